"""Error and time of soft shadow techniques on six families of blockers: `python -m bench.soft`.

The error is the root mean square of the visibility against the mean of 1,024 accumulated maps (4 texels per pixel),
over all pixels; those that get less than a twentieth of the most light count as right, because they hardly show whether
they are in shadow. A technique's visibility is its direct light with shadows over the same without, so that only
blocking is compared. The time is the processor time of a whole render on a software GPU, the least of some that take
turns, less that of the same picture without shadows, as a ratio to that of one accumulated map.

With `--cycles N` relMSE and FLIP of the direct diffuse light against Cycles with twice N samples follow, and what of
both is the reference's own noise. With `--page` the tables become a part of docs/soft_shadows.md.

References are kept in the cache folder of the comparison with Cycles, one small file per family and size.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from . import markdown, soft_scenes
from .quick import size_of, table

REFERENCE_MAPS, REFERENCE_TEXELS = 1024, 4.0
PAGE = Path(__file__).resolve().parent.parent / "docs" / "soft_shadows.md"
COMMAND = "python -m bench.soft --page"
LEAST_LIGHT = 0.05  # of the brightest pixel


@dataclass(frozen=True)
class Entrant:
    """A technique of the shadow slot with its parameters."""

    label: str
    technique: str
    values: tuple[tuple[str, object], ...] = ()
    samples: int = 1
    shared: float = 0.0  # maps per sample that the light probes share out; 0: one for every light


VSSM, CSSM, POINTS = "vssm", "cssm", "accumulated_maps"
BY_MAPS, BY_RAYS = (("by", "MAPS"),), (("by", "RAYS"),)  # what tells whether a point of a light is seen
ENTRANTS = (
    Entrant("Auto, 1 sample", "AUTO", shared=6.0),
    Entrant("maps, 1 sample, 6 shared", POINTS, BY_MAPS, shared=6.0),
    Entrant("VSSM", VSSM),
    Entrant("VSSM, rule of the source", VSSM, (("rule", "MEAN"),)),
    Entrant("VSSM, 5 cells", VSSM, (("cells", 5),)),
    Entrant("VSSM, 8 cells", VSSM, (("cells", 8),)),
    Entrant("VSSM, 1 texel per pixel", VSSM, (("texels_per_pixel", 1.0),)),
    Entrant("VSSM, 4 texels per pixel", VSSM, (("texels_per_pixel", 4.0),)),
    Entrant("VSSM, 4 samples", VSSM, samples=4),
    Entrant("VSSM, 16 samples", VSSM, samples=16),
    Entrant("CSSM", CSSM),
    Entrant("CSSM, table", CSSM, (("prefilter", "TABLE"),)),
    Entrant("CSSM, order 4", CSSM, (("order", "4"),)),
    Entrant("CSSM, order 16", CSSM, (("order", "16"),)),
    Entrant("CSSM, order 16, table", CSSM, (("order", "16"), ("prefilter", "TABLE"))),
    Entrant("CSSM, 1 cell", CSSM, (("cells", 1),)),
    Entrant("CSSM, 5 cells", CSSM, (("cells", 5),)),
    Entrant("CSSM, 16 samples", CSSM, samples=16),
    Entrant("maps, 1 sample", POINTS, BY_MAPS),
    Entrant("maps, 4 samples", POINTS, BY_MAPS, samples=4),
    Entrant("maps, 16 samples", POINTS, BY_MAPS, samples=16),
    Entrant("maps, 64 samples", POINTS, BY_MAPS, samples=64),
    Entrant("rays, 1 sample", POINTS, BY_RAYS),
    Entrant("rays, 16 samples", POINTS, BY_RAYS, samples=16),
)


@dataclass
class Result:
    """One entrant on one family."""

    error: float
    shadowed: list[float] = field(default_factory=list)  # processor seconds of each run
    free: list[float] = field(default_factory=list)
    relmse: float = float("nan")  # against Cycles
    flip: float | None = None

    @property
    def seconds(self) -> float:
        """Of the shadows; the least of the runs, since whatever else the machine does adds."""
        return max(min(self.shadowed, default=np.nan) - min(self.free, default=np.nan), 0.0)


def configure(scene, entrant: Entrant) -> None:
    """Set the scene to the entrant's technique; nothing is denoised."""
    settings = scene.candela
    for prop in settings.bl_rna.properties:
        if prop.identifier not in ("rna_type", "name"):
            settings.property_unset(prop.identifier)
    settings.slot_shadow = entrant.technique
    settings.light_probes_maps = entrant.shared
    settings.denoise_strength = 0.0
    for name, value in entrant.values:
        setattr(settings, f"{entrant.technique}_{name}", value)


def direct(scene, entrant: Entrant, size: tuple[int, int], seed: int = 1, shadows: bool = True):
    """Direct diffuse light, (H, W), and the processor seconds of the render, of all threads."""
    from addon.compare.reference import render_passes

    configure(scene, entrant)
    for thing in scene.objects:  # without shadows the speck still casts one: a light without any has no technique
        thing.visible_shadow = shadows or thing.name == "Speck"
    start = time.process_time()
    images = render_passes(scene, "CANDELA", entrant.samples, seed, direct_only=True, size=size).images
    return light(images), time.process_time() - start


def light(images: dict[str, np.ndarray]) -> np.ndarray:
    """Direct diffuse light that reaches the camera, (H, W). Blender's pass alone is light by colour: a pixel of which a
    hundredth shows a surface, and the rest nothing, has as much as a pixel full of it."""
    return images["diffuse_direct"][..., 0].astype(np.float64) * images["diffuse_color"][..., 0]


def visibility(scene, entrant: Entrant, size: tuple[int, int], seed: int = 1) -> np.ndarray:
    """Of the light at every pixel, (H, W); 1 where it hardly reaches."""
    blocked, _ = direct(scene, entrant, size, seed)
    free, _ = direct(scene, entrant, size, seed, shadows=False)
    return np.divide(blocked, free, out=np.ones_like(free), where=lit(free))


def lit(free: np.ndarray) -> np.ndarray:
    """Pixels that get enough light to show whether they are in shadow."""
    return free > LEAST_LIGHT * free.max()


def truth(family: str, scene, size: tuple[int, int], maps: int = REFERENCE_MAPS) -> np.ndarray:
    """Visibility by the mean of `maps` accumulated maps, from the cache where it was made before."""
    from addon.compare.reference import cache_folder

    # What needs no hierarchy to be right.
    values = (*BY_MAPS, ("texels_per_pixel", REFERENCE_TEXELS), ("edge_rays", False))
    entrant = Entrant("truth", POINTS, values, maps)
    made_of = Path(soft_scenes.__file__).read_bytes() + repr((family, size, entrant, LEAST_LIGHT)).encode()
    path = cache_folder() / f"soft_{hashlib.sha256(made_of).hexdigest()[:16]}.npy"
    if path.exists():
        return np.load(path)
    found = visibility(scene, entrant, size)
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, found)
    return found


def rms(found: np.ndarray, expected: np.ndarray) -> float:
    """Root mean square over all pixels."""
    return float(np.sqrt(((found - expected) ** 2).mean()))


def measure(family: str, entrants, size: tuple[int, int], runs: int, maps: int, pictures: Path | None) -> list[Result]:
    """All entrants on one family; with `pictures`, truth, each visibility and its error become PNG files there."""
    scene = soft_scenes.build(family)
    expected = truth(family, scene, size, maps)
    results = []
    for entrant in entrants:
        found = visibility(scene, entrant, size)
        results.append(Result(rms(found, expected)))
        if pictures is not None:
            save(pictures / f"{family}, {entrant.label}.png".replace(" ", "_"), found, expected)
    for seed in range(2, 2 + runs):
        for entrant, result in zip(entrants, results):
            result.shadowed.append(direct(scene, entrant, size, seed)[1])
            result.free.append(direct(scene, entrant, size, seed, shadows=False)[1])
    return results


def save(path: Path, found: np.ndarray, expected: np.ndarray) -> None:
    """Found, expected, and their difference around grey (black: too dark by 0.25), each pixel as 3x3."""
    from addon.compare.png import png

    picture = np.concatenate([found, expected, 0.5 + 2.0 * (found - expected)], axis=1)[::-1]
    picture = np.repeat(np.repeat(picture, 3, axis=0), 3, axis=1)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(png((np.clip(picture, 0, 1)[..., None].repeat(3, axis=-1) * 255 + 0.5).astype(np.uint8)))


def against_cycles(scene, entrants, results: list[Result], size: tuple[int, int], samples: int) -> Result:
    """Fill in relMSE and FLIP of each result; returns those of one seed of Cycles, which are noise."""
    from addon.compare.metrics import compare_radiance, flips
    from addon.compare.reference import reference

    made = reference(scene, samples, True, size)
    one_seed = {name: made.images[name] + made.half[name] for name in ("diffuse_direct", "diffuse_color")}
    shown = [light(made.images), *(direct(scene, entrant, size)[0] for entrant in entrants), light(one_seed)]
    expected, *pictures = (np.repeat(one[..., None], 3, axis=-1) for one in shown)
    floor = Result(0.0)
    for result, picture, flip in zip([*results, floor], pictures, flips([(one, expected) for one in pictures])):
        result.relmse, result.flip = compare_radiance("direct", picture, expected).relmse, flip
    return floor


def rows_against_cycles(found: dict[str, list[Result]], labels: list[str], figure: str) -> list[tuple[str, ...]]:
    """A row per label: `figure` (relmse, flip) on each family."""
    families = list(found)
    rows = [(figure, *families)]
    for k, label in enumerate(labels):
        values = [getattr(found[family][k], figure) for family in families]
        rows.append((label, *("–" if value is None else f"{value:.4f}" for value in values)))
    return rows


def rows_of(found: dict[str, list[Result]], entrants) -> list[tuple[str, ...]]:
    """A row per entrant: RMS error on each family, and its time over all families by that of one map."""
    families = list(found)
    base = next((k for k, entrant in enumerate(entrants) if entrant.technique == POINTS and entrant.samples == 1), 0)
    rows = [("technique", *families, "mean", "time / one map")]
    for k, entrant in enumerate(entrants):
        errors = [found[family][k].error for family in families]
        ratio = sum(found[family][k].seconds for family in families) / sum(
            found[family][base].seconds for family in families
        )
        shown = f"{ratio:.1f}" if np.isfinite(ratio) else "–"
        rows.append((entrant.label, *(f"{error:.4f}" for error in errors), f"{np.mean(errors):.4f}", shown))
    return rows


def written(options: argparse.Namespace, rms_rows, cycles_rows: list) -> str:
    """The tables as a part of the page."""
    width, height = options.size
    parts = [
        f"{width}x{height} pixels.",
        f"### RMS of the visibility against {options.maps:,} accumulated maps",
        markdown.table(rms_rows),
    ]
    for rows, aim in zip(cycles_rows, (0.02, 0.05)):
        auto = [float(value) for value in rows[1][1:]]
        held = sum(value <= aim for value in auto)
        parts += [
            f"### {rows[0][0]} of one-sample direct diffuse light against Cycles (2 x {options.cycles} samples)",
            f"The aim is {aim}: Auto holds it in {held} of {len(auto)} families; its worst is {max(auto):.4f}.",
            markdown.table(rows),
        ]
    return "\n\n".join(parts)


def parse(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m bench.soft", description=__doc__.splitlines()[0])
    families = list(soft_scenes.FAMILIES)
    parser.add_argument("--families", nargs="+", choices=families, default=families, metavar="NAME")
    parser.add_argument("--only", default="", metavar="TEXT", help="entrants whose name holds this text")
    parser.add_argument("--size", default="128x96", type=size_of, metavar="WxH")
    parser.add_argument("--runs", default=3, type=int, metavar="N", help="for the times (default 3)")
    parser.add_argument("--maps", default=REFERENCE_MAPS, type=int, metavar="N", help="of the reference")
    parser.add_argument("--cycles", default=0, type=int, metavar="N", help="samples of each seed of Cycles' reference")
    parser.add_argument("--page", action="store_true", help="write the tables into docs/soft_shadows.md")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="write visibilities and errors there")
    return parser.parse_args(arguments)


def main(arguments: list[str]) -> int:
    options = parse(arguments)
    import addon
    from addon.cli.terminal import quiet
    from addon.gfx import context

    addon.register()
    entrants = [entrant for entrant in ENTRANTS if options.only in entrant.label]
    found, cycles = {}, {}
    for family in options.families:
        with quiet():
            context.ensure()
            found[family] = measure(family, entrants, options.size, options.runs, options.maps, options.pictures)
            if options.cycles:
                scene = soft_scenes.build(family)
                floor = against_cycles(scene, entrants, found[family], options.size, options.cycles)
                cycles[family] = [*found[family], floor]
        print(f"{family} done", flush=True)
    labels = [*(entrant.label for entrant in entrants), "noise of the reference"]
    of_cycles = [rows_against_cycles(cycles, labels, figure) for figure in ("relmse", "flip") if cycles]
    for rows in (rows_of(found, entrants), *of_cycles):
        print(table(rows))
    if options.page:
        markdown.put_between(PAGE, COMMAND, written(options, rows_of(found, entrants), of_cycles))
    return 0


if __name__ == "__main__":
    code = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # Blender 4.5 as a module waits forever in its exit handlers once a GPU was used
