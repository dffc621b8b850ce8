"""Rows of `python -m bench media`: pictures of fog beside Cycles and EEVEE, by error and processor seconds.

The truth of a scene is the mean of two renders by Cycles with the same bounces, whose noise is taken off the errors; it
is kept below out/media. Seconds are of all threads of the process, after a small picture with another seed, so that
nothing is compiled in them. What fog costs is the same without any of the scene's media. Results go to
bench/results/media.json as they come, one number after the other: another run goes on with what is missing.
"""

from __future__ import annotations

import json
import resource
from pathlib import Path

import numpy as np

from bench.cells import ROOT
from bench.markdown import table, write_whole

RESULTS, KEPT, SHEET = ROOT / "bench/results/media.json", ROOT / "out/media", ROOT / "docs/images/fog.png"
SEED, BOUNCES = 5, 4
CANDELA, CLEAR, CYCLES, DENOISED, EEVEE = "Candela", "Candela without fog", "Cycles", "Cycles denoised", "EEVEE"
ENTRANTS = (
    *((CANDELA, samples) for samples in (1, 4, 16)), (CLEAR, 1), (CLEAR, 16), (DENOISED, 4), (DENOISED, 16),
    (EEVEE, 16),
)  # fmt: skip
HEAD = ("scene", "engine", "samples", "seconds", "times without fog", "relMSE", "mean")
CROP = (192, 144)  # pixels of each picture on the sheet
SHOWN = ((CANDELA, 1), (CANDELA, 16), (DENOISED, 16))


def read() -> dict[str, dict]:
    """What is known, by scene."""
    return json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {}


def go_on(options) -> dict[str, dict]:
    """Measure what is missing of the scenes that are asked for; everything that is known then."""
    from bench import media_scenes

    rooms = media_scenes.ROOMS
    for name in options.scenes or rooms:
        if name not in rooms:
            raise SystemExit(f"There is no scene {name!r}; there are {', '.join(rooms)}.")
        build, volume_bounces = rooms[name]
        begun = False
        for engine, samples in ENTRANTS:
            if (engine == EEVEE and options.no_eevee) or (options.engines and engine not in options.engines):
                continue
            known = read().get(name, {})
            if f"{engine} {samples}" in known.get("rows", {}) and not options.again:
                continue
            if not begun:
                media_scenes.begin()
                build()
                begun = True
            row = Room(name, volume_bounces, options).measure(engine, samples)
            everything = read()  # another process may have written
            scene = everything.setdefault(name, {"rows": {}})
            scene |= {"size": list(options.size), "reference": options.reference, "volume bounces": volume_bounces}
            scene["rows"][f"{engine} {samples}"] = row
            write_whole(RESULTS, json.dumps(everything, indent=1))
            print(name, engine, samples, row, flush=True)
    return read()


class Room:
    """The open scene, to be drawn by every engine with the same bounces."""

    def __init__(self, name: str, volume_bounces: int, options):
        import bpy

        self.scene, self.name, self.options = bpy.context.scene, name, options
        self._volume_bounces = volume_bounces
        KEPT.mkdir(parents=True, exist_ok=True)

    def measure(self, engine: str, samples: int) -> dict[str, float]:
        """Processor seconds, and where a truth can be told relMSE and ratio of means."""
        if engine != CLEAR:
            truth, half = self._truth()
        if engine in (CANDELA, CLEAR, EEVEE):
            small = tuple(side // 4 for side in self.options.size)
            self._render(engine, 1 if engine == EEVEE else samples, SEED + 1, small)  # what compiles
        seen, seconds = self._render(engine, samples, SEED)
        if engine == CLEAR:
            return {"seconds": round(seconds, 2)}
        from addon.compare.metrics import compare_radiance

        np.save(_picture(self.name, engine, samples), seen.astype(np.float32))
        error = compare_radiance("combined", seen, truth, half)
        return {
            "seconds": round(seconds, 2), "relmse": round(max(error.relmse - error.floor, 0.0), 5),
            "mean": round(error.bias, 4), "floor": round(error.floor, 5),
        }  # fmt: skip

    def _file(self, end: str) -> Path:
        return KEPT / f"{self.name.replace(' ', '_')}_{end}"

    def _truth(self) -> tuple[np.ndarray, np.ndarray]:
        size = "{}x{}".format(*self.options.size)
        path = self._file(f"truth_{size}_{self.options.reference}_{self._volume_bounces}.npz")
        if not path.exists():
            first, second = (self._render(CYCLES, self.options.reference, seed)[0] for seed in (1, 2))
            np.savez_compressed(path, mean=(first + second) / 2, half=(first - second) / 2)
        found = np.load(path)
        return found["mean"], found["half"]

    def _render(
        self, engine: str, samples: int, seed: int, size: tuple[int, int] | None = None
    ) -> tuple[np.ndarray, float]:
        from addon.compare.reference import render_passes

        cycles = self.scene.cycles
        extra = [(cycles, "volume_bounces", self._volume_bounces), (cycles, "use_denoising", engine == DENOISED)]
        if engine == CLEAR:
            extra += [(one, "hide_render", True) for one in self.scene.objects if is_medium(one)]
            extra += [(self.scene, "world", None)] if holds_medium(self.scene.world) else []
        own = {CANDELA: "CANDELA", CLEAR: "CANDELA", EEVEE: "BLENDER_EEVEE"}.get(engine, "CYCLES")
        before = resource.getrusage(resource.RUSAGE_SELF)
        seen = render_passes(
            self.scene, own, samples, seed, size=size or self.options.size,
            bounces=None if engine == EEVEE else BOUNCES, extra=extra,
        ).images["combined"][..., :3]  # fmt: skip
        after = resource.getrusage(resource.RUSAGE_SELF)
        return seen, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def holds_medium(owner) -> bool:
    """Whether a material or world has a volume."""
    outputs = [node for node in owner.node_tree.nodes if node.type in ("OUTPUT_MATERIAL", "OUTPUT_WORLD")]
    return any(node.inputs["Volume"].is_linked for node in outputs)


def is_medium(thing) -> bool:
    """Whether an object is nothing but its medium."""
    if thing.type == "VOLUME":
        return True
    materials = [slot.material for slot in thing.material_slots if slot.material]
    outputs = [node for one in materials for node in one.node_tree.nodes if node.type == "OUTPUT_MATERIAL"]
    return any(node.inputs["Volume"].is_linked for node in outputs) and not any(
        node.inputs["Surface"].is_linked for node in outputs
    )


def page(known: dict[str, dict]) -> str:
    """The table, and what it is of."""
    rows = [HEAD]
    for name, scene in known.items():
        clear = {n: scene["rows"].get(f"{CLEAR} {n}", {}).get("seconds") for n in (1, 16)}
        said = f"{name} ({scene['volume bounces']} volume bounces, {scene['reference']})"
        for engine, samples in ENTRANTS:
            row = scene["rows"].get(f"{engine} {samples}")
            if row is None or engine == CLEAR:
                continue
            base = clear.get(samples) if engine == CANDELA else None
            times = f"{row['seconds'] / base:.2f}" if base else ""
            figures = f"{row['relmse']:.4f}", f"{row['mean']:.3f}"
            rows.append((said, engine, str(samples), f"{row['seconds']:.1f}", times, *figures))
            said = ""
    width, height = next(iter(known.values()))["size"]
    return f"""{width} x {height} pixels, {BOUNCES} bounces between surfaces, and of volumes what stands behind a
scene's name, in all engines but EEVEE, against the mean of two renders by Cycles with as many samples each as stand
there, too, whose noise is taken off the errors. Seconds are processor seconds of all threads; Candela and EEVEE draw
on a software GPU. EEVEE has bounces of its own, and its bias is partly that.

{table(rows)}"""


def sheet(known: dict[str, dict]) -> None:
    """Picture of the scenes, one below the other: 1 sample, 16 samples, Cycles with 16 denoised; the middle of each."""
    from addon.compare.metrics import display
    from addon.compare.png import png

    kept = {name: [_picture(name, *shown) for shown in SHOWN] for name in known}
    missing = [name for name, files in kept.items() if not all(file.exists() for file in files)]
    if missing:
        print(f"{SHEET.name} stays as it is: out/media holds no pictures of {', '.join(missing)}; measure --again.")
        return
    rows = []
    for files in kept.values():
        pictures = [np.load(file) for file in files]
        exposure = float(-np.log2(max(np.percentile(pictures[-1], 98), 1e-6)))
        rows.append(np.concatenate([_middle(display(one, exposure)[::-1]) for one in pictures], axis=1))
    SHEET.write_bytes(png((np.concatenate(rows) * 255 + 0.5).astype(np.uint8)))


def _picture(name: str, engine: str, samples: int) -> Path:
    return KEPT / f"{name.replace(' ', '_')}_{engine}_{samples}.npy"


def _middle(picture: np.ndarray) -> np.ndarray:
    height, width = picture.shape[:2]
    x, y = (max(have - want, 0) // 2 for have, want in zip((width, height), CROP))
    return picture[y : y + CROP[1], x : x + CROP[0]]
