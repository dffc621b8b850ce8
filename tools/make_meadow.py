"""Renders the patch of grass that comes with Candela: `python tools/make_meadow.py [--output FILE]`, some minutes.

Interrupted, the same command goes on. Blender as a Python module is needed, as for `python -m addon`.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=ROOT / "addon" / "grass" / "meadow.grass")
    options = parser.parse_args()
    import bpy  # noqa: F401

    from addon.grass.blades import Recipe
    from addon.grass.directions import LIGHTS, Rings
    from addon.grass.generate import Order, generate

    views = Rings((0.0, 20.0, 40.0, 60.0, 75.0, 85.0), (1, 6, 10, 12, 14, 14))
    order = Order(Recipe(0.4, 0.1, 1300, 3), 64, views, LIGHTS, samples=24, luma=4, chroma=1)
    for done, whole in generate(order, options.output):
        print(f"{done} of {whole} views", flush=True)
    print(options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
