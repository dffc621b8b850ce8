#!/usr/bin/env bash
# What only a machine with a graphics card can tell, in one run of at most eight minutes:
# tools/on_a_card.sh OUT [PYTHON]
#
# OUT is a folder for logs, figures and docs/gpu.md's tables; PYTHON one with Blender as a module (default .venv's).
# Each part has a limit of its own and leaves what it has; one that fails does not stop the next. In order of worth:
#
#   device    what Blender finds, in a line: a run on a software driver is stopped here unless SMALL=1
#   gpu       bench gpu: four scenes at 1920x1080, each technique alone, fragment against compute, EEVEE beside
#   compiling bench compiling of a Cornell box and a window: programs that the driver compiles longest
#   tests     those that a card decides: precision of pow and of matrices, sums in another order, formats, devices
#
# Where a card is at hand for minutes: make the environment beforehand (`make environment`), carry the tree and the
# environment there, and run this once. `tools/on_a_card.sh pack FILE.tar.xz` packs the tree without what
# the run does not need. SMALL=1 tries the script on a software driver with few pixels.
set -uo pipefail
cd "$(dirname "$0")/.."

if [ "${1:-}" = pack ]; then
    git archive HEAD | tar --delete --wildcards 'docs/images/*' 'docs/log/*' | xz -T0 >"${2:?a file to pack into}"
    ls -l "$2"
    exit
fi

out=${1:?a folder for what is measured}
python=${2:-.venv/bin/python}
small=${SMALL:-}
mkdir -p "$out"
ended=$((SECONDS + 480))

part() { # NAME LIMIT COMMAND…: within its limit and the run's
    local name=$1 limit=$2 left=$((ended - SECONDS))
    shift 2
    [ "$left" -ge 10 ] || { echo "$name: NOT RUN, no time is left"; return; }
    local began=$SECONDS
    timeout -k 5 "$((limit < left ? limit : left))" "$@" >"$out/$name.log" 2>&1
    local code=$?
    echo "$name: $((SECONDS - began)) s, $([ $code = 0 ] && echo done || echo "exit $code; see $name.log")"
    [ $code = 0 ] || tail -n 5 "$out/$name.log"
}

part device 60 "$python" -c "
import addon
from addon.gfx import context
addon.register()
import bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
context.ensure()
print(context.describe(), flush=True)
import os; os._exit(0)"
cat "$out/device.log"
if grep -qi "llvmpipe\|softpipe\|swrast" "$out/device.log" && [ -z "$small" ]; then
    echo "This is a software driver: SMALL=1 tries the script here; nothing that it measures tells of a card."
    exit 1
fi

cp docs/gpu.md "$out/gpu.md"
part gpu 250 "$python" -m bench gpu ${small:+--small --minutes 0.5} --results "$out/gpu.json" --page "$out/gpu.md"
scenes=(cornell_box window_interior)
[ -z "$small" ] || scenes=(cornell_box)
part compiling 60 "$python" -m bench compiling --only "${scenes[@]}" ${small:+--size 32x24}
part tests 120 "$python" -m pytest -q -x --no-header -p no:cacheprovider -m "not slow and not window and not timing" \
    tests/kernels tests/gfx tests/frame/test_device.py tests/techniques/test_reflection_editing.py \
    tests/techniques/test_imperfect_shadow_maps.py tests/techniques/test_media.py ${small:+-k ranks}
ls -l "$out"
