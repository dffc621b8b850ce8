"""What a device does, in one command of at most four minutes: `python -m bench gpu`, which writes docs/gpu.md.

On four scenes at 1920x1080 with one sample: the first picture (which compiles), a picture after the camera has moved
and one of an unchanged scene, both without Blender's own part, and a whole final render with it, beside EEVEE's; which
programs took the driver longest to compile; how fast fragment and compute programs run (gpu_speed.py); the time of each
technique when it is waited for; and, counted at 16x12 pixels, where nothing but the floor is left: readbacks, waits,
draws, dispatches, uploads, framebuffers and Python's own time. Then each technique that these pictures do not use, on
the first scene on which it can run. What does not fit into the time is named. `--small` is the same for a software
driver: one scene less, few pixels, no technique by hand.

Figures are written to out/gpu.json after each part, so that a run that is cut off leaves what it has.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path

from bench import gpu_speed, markdown
from bench.cells import ROOT, SCENES
from bench.counted import counted

PAGE, RESULTS = ROOT / "docs" / "gpu.md", ROOT / "out" / "gpu.json"
COMMAND = "python -m bench gpu"
WHOLE = ("cornell_box", "colonnade_hall", "soft_shadow_garden", "instances")
SMALL = ("cornell_box", "instances")
# Where techniques that Auto does not take are looked for, in this order.
OTHERS = ("caustics_table", "hdri_product", "alpha_foliage", "emissive_lamp", "window_interior", "sky_courtyard")
SIZE, SMALL_SIZE, COUNTED_SIZE = (1920, 1080), (64, 36), (16, 12)
MOVES, STEP = 5, 1e-3  # m
STEPPED = 16  # samples of the picture that tells what one more sample costs
SLOWEST = 5  # programs that are named


def add_options(parser: argparse.ArgumentParser) -> None:
    from bench.run import size_of

    parser.add_argument("--small", action="store_true", help="two scenes, 64x36 pixels: for software drivers")
    parser.add_argument("--minutes", type=float, default=4.0, help="begin nothing more after so many (default 4)")
    parser.add_argument("--size", type=size_of, metavar="WxH", help="default 1920x1080")
    parser.add_argument("--results", default=RESULTS, type=Path, metavar="PATH", help="JSON; default out/gpu.json")
    parser.add_argument("--page", default=PAGE, type=Path, metavar="PATH", help="default docs/gpu.md")


class View:
    """The open scene, drawn by a renderer of its own, as a viewport that is at rest draws it."""

    def __init__(self, name: str, size: tuple[int, int]):
        import bpy

        from addon.compare import reference
        from addon.frame.run import Renderer
        from addon.snapshot import SnapshotCache
        from addon.techniques import make_registry

        bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{name}.blend"))
        self.scene, self.layer = bpy.context.scene, reference.active_view_layer(bpy.context.scene)
        self.scene.render.engine = "CANDELA"
        self.size = size
        self.renderer, self.cache = Renderer(make_registry), SnapshotCache()
        self.renderer.publishes = False

    def move(self) -> None:
        self.scene.camera.location.x += STEP

    def snapshot(self):
        import bpy

        from addon.snapshot import take

        graph = bpy.context.evaluated_depsgraph_get()
        graph.update()
        return take(graph, self.cache, *self.size)

    def settings(self, samples: int, **changes):
        from addon.final import images_of
        from addon.ui.passes import wanted_passes
        from addon.ui.properties import settings_of

        shows = frozenset(images_of(wanted_passes(self.layer, self.scene)))  # as a final render asks for
        settings = settings_of(self.scene, viewport=False, layer=self.layer)
        return replace(settings, samples=samples, shows=shows, **changes)

    def draw(self, settings) -> dict[str, float]:
        """Milliseconds of a picture by its stages, the GPU waited for at the end."""
        from addon.gfx import images

        started = time.perf_counter()
        snapshot = self.snapshot()
        synced = time.perf_counter()
        frame = self.renderer.begin(snapshot, settings)
        begun = time.perf_counter()
        while frame.samples_done < settings.samples_to_draw:
            self.renderer.advance(frame)
        self.renderer.show(frame)
        asked = time.perf_counter()
        images.finish()
        ended = time.perf_counter()
        parts = {"sync": synced - started, "begin": begun - synced, "asking": asked - begun, "waiting": ended - asked}
        found = {name: 1000 * seconds for name, seconds in parts.items()}
        return {"total": 1000 * (ended - started), **found, "compile": 1000 * frame.ledger.times.get("compile", 0.0)}

    def techniques(self, settings) -> dict[str, float]:
        """Milliseconds of each technique in a picture after a move, each waited for."""
        self.move()
        settings = replace(settings, profile=True)
        self.draw(settings)
        frame = self.renderer.frame
        self.renderer.finish(frame, ())
        return {row.name: row.milliseconds for row in frame.ledger.rows if row.state == "ran"}

    def final(self, samples: int = 1, eevee: bool = False) -> float:
        """Milliseconds of a whole final render after a move, with all that Blender does."""
        import bpy

        self.move()
        with self.rendering(self.size, samples, eevee):
            started = time.perf_counter()
            bpy.ops.render.render(scene=self.scene.name, layer=self.layer.name)
            return 1000 * (time.perf_counter() - started)

    def counts(self) -> dict:
        """What a final render after a move asks of the GPU when it has 16x12 pixels."""
        import bpy

        with self.rendering(COUNTED_SIZE):
            for _ in range(2):
                self.move()
                bpy.ops.render.render(scene=self.scene.name, layer=self.layer.name)
            self.move()
            return asdict(counted(lambda: bpy.ops.render.render(scene=self.scene.name, layer=self.layer.name)))

    @contextmanager
    def rendering(self, size: tuple[int, int], samples: int = 1, eevee: bool = False) -> Iterator[None]:
        import bpy

        from addon.compare.reference import overridden

        render, own = self.scene.render, self.scene.candela
        changed = [(render, "resolution_x", size[0]), (render, "resolution_y", size[1])]
        changed += [(render, "resolution_percentage", 100), (own, "samples", samples)]
        if eevee:
            engine = "BLENDER_EEVEE" if bpy.app.version >= (5, 0) else "BLENDER_EEVEE_NEXT"
            changed += [(render, "engine", engine), (self.scene.eevee, "taa_render_samples", samples)]
        with overridden(changed):
            yield

    def close(self) -> None:
        self.renderer.release()


@contextmanager
def compiling() -> Iterator[dict[str, float]]:
    """Seconds that programs compiled meanwhile took, by name."""
    from addon.gfx import library

    took: dict[str, float] = {}
    original = library._compile

    def timed(program):
        started = time.perf_counter()
        handle = original(program)
        took[program.name] = took.get(program.name, 0.0) + time.perf_counter() - started
        return handle

    library._compile = timed
    try:
        yield took
    finally:
        library._compile = original


def median(values: list[dict[str, float]]) -> dict[str, float]:
    """Of the run with the median total."""
    return sorted(values, key=lambda one: one["total"])[len(values) // 2]


def of_scene(view: View, name: str, left: Callable[[], bool], eevee: bool) -> dict:
    """Figures of one scene; those that there is no time for are missing."""
    found: dict = {"scene": name, "triangles": 0}
    one = view.settings(1)
    with compiling() as took:
        found["first"] = view.draw(one)
    found["compiled"] = sorted(([1000 * s, program] for program, s in took.items()), reverse=True)[:SLOWEST]
    found["triangles"] = int(view.renderer.geometry.triangles)
    moved = []
    for _ in range(MOVES):
        if moved and not left():
            break
        view.move()
        moved.append(view.draw(one))
    found["moved"] = median(moved)
    found["rest"] = median([view.draw(one) for _ in range(3)])
    if left():
        found["techniques"] = view.techniques(one)
    if left():
        found["counts"] = view.counts()
    if left():
        view.final()
        found["final"] = view.final()
    if left():
        view.final(STEPPED)
        found["final_many"] = view.final(STEPPED)
    if eevee and left():
        view.final(STEPPED, eevee=True)
        found["eevee_many"] = view.final(STEPPED, eevee=True)
    if left():
        many = view.settings(STEPPED)
        view.draw(many)  # what only pictures of several samples compile
        view.move()
        found["sample"] = view.draw(many)["total"] / STEPPED
    return found


def by_hand(view: View, name: str, wanted: set[str], left: Callable[[], bool]) -> list[dict]:
    """Techniques of `wanted` that can run on the open scene, each chosen for its slots: milliseconds of one sample, and
    of the whole picture."""
    from addon.frame.plan import PlanError, make_plan

    found = []
    snapshot = view.snapshot()
    for technique in view.renderer.techniques:
        if technique.name not in wanted or technique.skip(snapshot, view.settings(1)):
            continue
        settings = view.settings(1)
        settings = replace(settings, slots={**settings.slots, **dict.fromkeys(technique.fills, technique.name)})
        try:
            if not make_plan(view.renderer.techniques, snapshot, settings).runs(technique.name):
                continue
        except PlanError:
            continue
        if not left():
            break
        row = {"technique": technique.name, "label": technique.label, "scene": name}
        try:
            view.draw(settings)
            row["ms"] = view.techniques(settings).get(technique.name)
            view.move()
            row["picture"] = view.draw(settings)["total"]
        except (ValueError, RuntimeError) as error:  # one that fails on this device is what the page is to tell
            row["failed"] = str(error).splitlines()[0]
        wanted.discard(technique.name)
        found.append(row)
    return found


def measure(names, size, minutes: float, others, note: Callable[[dict], None], say: Callable[[str], None]) -> dict:
    """All figures; `note` is called with them after each part, `say` with what comes next."""
    from addon.techniques import REGISTRY
    from bench import worker

    end = time.monotonic() + 60 * minutes
    left = lambda: time.monotonic() < end  # noqa: E731
    began = time.monotonic()
    found: dict = {"about": worker.about() | {"size": list(size), "load": load()}, "scenes": [], "by_hand": []}
    found["left_out"] = []
    say("speed of programs")
    found["speeds"] = gpu_speed.speeds()
    note(found)
    for name in names:
        if not left():
            found["left_out"].append(f"scene {name}")
            continue
        say(name)
        view = View(name, size)
        found["scenes"].append(of_scene(view, name, left, eevee=bool(others)))
        view.close()
        note(found)
    ran = {technique for row in found["scenes"] for technique in row.get("techniques", ())}
    wanted = {technique.name for technique in REGISTRY} - ran
    for name in others:
        if wanted and left():
            say(f"{len(wanted)} techniques by hand on {name}")
            view = View(name, size)
            found["by_hand"] += by_hand(view, name, wanted, left)
            view.close()
            note(found)
    if others:
        found["left_out"] += [f"technique {name}" for name in sorted(wanted)]
    found["about"]["seconds"] = time.monotonic() - began
    note(found)
    return found


def load() -> float:
    from bench.run import load

    return load() or 0.0


# ---------------------------------------------------------------------------------------------------------------- page


PICTURES = (
    "Milliseconds. The first compiles; *moved* is the median of five pictures after a move of the camera, from reading"
    " the scene to the last texel, *of it asking* what Python and the driver took to ask for it, *at rest* a picture of"
    " an unchanged scene, *final* a final render with all that Blender does, *one more sample* the time of a sample of"
    f" {STEPPED}. Final renders are timed the second time, when everything is compiled, EEVEE's too."
)
COUNTED = (
    "A final render of 16x12 pixels and one sample after a move of the camera, under Python's profiler: the same on"
    " every device but for waits, which software drivers need between draws and dispatches, and for what the device's"
    " measured costs decide."
)
TIMED = (
    "Milliseconds of one sample, each technique waited for; what is skipped on a scene has no figure. Shadows are drawn"
    " in the time of the light that asks for them."
)
SPEEDS = (
    "Picoseconds of one step of one thread in a fragment and in a compute program, all threads together: where the two"
    " differ by much, the card has few units that draw, and most of Candela's passes run on those."
)
COMPILED = "Seconds that the driver took to compile for the first picture, and the programs that took longest of it:"
BY_HAND = "Chosen by hand, on the first scene that can use it:"


def page(found: dict) -> str:
    """The tables of docs/gpu.md."""
    about = found["about"]
    size = "x".join(map(str, about["size"]))
    device = f"{about['device']}; {about['cpu']}; Blender {about['blender']}, Python {about['python']}"
    took = f"{about.get('seconds', 0.0):.0f} s in all, load {about['load']:.1f}"
    parts = [f"{device}; {size} pixels, one sample; {took}."]
    parts.append(f"## Whole pictures\n\n{PICTURES}\n\n{markdown.table(pictures(found))}")
    if found.get("speeds"):
        parts.append(f"{SPEEDS}\n\n{markdown.table(speeds(found))}")
    if any("compiled" in row for row in found["scenes"]):
        parts.append(f"{COMPILED}\n\n{markdown.table(compiled(found))}")
    parts.append(f"## What a picture asks for\n\n{COUNTED}\n\n{markdown.table(counts(found))}")
    parts.append(f"## Each technique\n\n{TIMED}\n\n{markdown.table(techniques(found))}")
    if found["by_hand"]:
        parts.append(f"{BY_HAND}\n\n{markdown.table(hand(found))}")
    if found["left_out"]:
        parts.append("Not measured: " + ", ".join(found["left_out"]) + ".")
    return "\n\n".join(parts)


def pictures(found: dict) -> list[tuple[str, ...]]:
    rows = [("scene", "triangles", "first", "of it compiling", "moved", "of it asking", "at rest", "final",
             "one more sample", f"final, {STEPPED} samples", f"EEVEE, {STEPPED} samples")]  # fmt: skip
    for row in found["scenes"]:
        moved = row["moved"]
        asking = sum(moved[part] for part in ("sync", "begin", "asking"))
        rows.append((
            row["scene"].replace("_", " "), f"{row['triangles']:,}", number(row["first"]["total"]),
            number(row["first"]["compile"]), number(moved["total"]), number(asking), number(row["rest"]["total"]),
            number(row.get("final")), number(row.get("sample")), number(row.get("final_many")),
            number(row.get("eevee_many")),
        ))  # fmt: skip
    return rows


def speeds(found: dict) -> list[tuple[str, ...]]:
    rows = [("steps", "fragment, ps", "compute, ps", "ratio")]
    for row in found["speeds"]:
        ratio = row["fragment"] / row["compute"]
        rows.append((row["steps"], number(row["fragment"]), number(row["compute"]), f"{ratio:.1f}"))
    return rows


def compiled(found: dict) -> list[tuple[str, ...]]:
    rows = [("scene", "all", "programs")]
    for row in found["scenes"]:
        named = ", ".join(f"{name} {ms / 1000:.2f}" for ms, name in row.get("compiled", ()))
        rows.append((row["scene"].replace("_", " "), f"{row['first']['compile'] / 1000:.2f}", named or "–"))
    return rows


def counts(found: dict) -> list[tuple[str, ...]]:
    names = ("readbacks", "waits", "draws", "dispatches", "uploads", "framebuffers")
    rows = [("scene", *names, "Python's own ms")]
    for row in found["scenes"]:
        if "counts" in row:
            values = row["counts"]
            counted = (str(values[name]) for name in names)
            rows.append((row["scene"].replace("_", " "), *counted, number(values["own_ms"])))
    return rows


def techniques(found: dict) -> list[tuple[str, ...]]:
    scenes = [row for row in found["scenes"] if "techniques" in row]
    names = list(dict.fromkeys(name for row in scenes for name in row["techniques"]))
    rows = [("technique", *(row["scene"].replace("_", " ") for row in scenes))]
    return rows + [(name.replace("_", " "), *(number(row["techniques"].get(name)) for row in scenes)) for name in names]


def hand(found: dict) -> list[tuple[str, ...]]:
    rows = [("technique", "scene", "ms", "whole picture, ms")]
    for row in found["by_hand"]:
        figures = (row["failed"], "–") if "failed" in row else (number(row["ms"]), number(row["picture"]))
        rows.append((row["label"], row["scene"].replace("_", " "), *figures))
    return rows


def number(milliseconds: float | None) -> str:
    if milliseconds is None:
        return "–"
    return f"{milliseconds:.2f}" if milliseconds < 10 else f"{milliseconds:.0f}"


HEAD = f"""# What a device does

Written by `{COMMAND}`, which takes at most four minutes on a machine with a GPU (`--small` on one without: fewer pixels
and scenes; its times are a software driver's). Everything is in out/gpu.json, too.

{markdown.begin(COMMAND)}
{markdown.END}
"""


def command(options: argparse.Namespace) -> int:
    import addon
    from addon.cli.terminal import quiet
    from bench.run import rounded

    names, size, others = (SMALL, SMALL_SIZE, ()) if options.small else (WHOLE, SIZE, (*WHOLE, *OTHERS))
    addon.register()
    options.results.parent.mkdir(parents=True, exist_ok=True)

    def note(found: dict) -> None:
        text = json.dumps(rounded(found), indent=1, ensure_ascii=False)
        markdown.write_whole(options.results, text + "\n")

    with quiet() as terminal:
        started = time.monotonic()

        def say(what: str) -> None:
            print(f"{time.monotonic() - started:5.0f} s  {what}", file=terminal, flush=True)

        found = measure(names, options.size or size, options.minutes, others, note, say)
    if not options.page.is_file():
        options.page.write_text(HEAD, encoding="utf-8")
    text = page(found)
    markdown.put_between(options.page, COMMAND, text)
    print(text)
    print(options.results, options.page, file=sys.stderr)
    return 0
