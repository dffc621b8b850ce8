"""The gallery of the README: scenes by Candela, Cycles and EEVEE with their times: `python -m bench gallery`.

Each strip shows one scene three times: by Candela with 16 samples, by Cycles with 64 and its denoiser, by EEVEE with 16
and ray tracing. Seconds are what the process computed, all cores together, for a picture after another of the same
scene, so that compiling shaders counts for nobody. `--page` writes the table into README.md.
"""

from __future__ import annotations

import argparse
import json
import resource
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bench.cells import ROOT
from bench.markdown import put_between, write_whole
from bench.strips import GAP, sample_file, write_picture

COMMAND = "python -m bench gallery"
RESULTS, FOLDER, PAGE = ROOT / "out" / "gallery.json", ROOT / "docs" / "images" / "gallery", ROOT / "README.md"
SIZE = (240, 135)
ENTRANTS = (("Candela", "CANDELA", 16), ("Cycles", "CYCLES", 64), ("EEVEE", "BLENDER_EEVEE", 16))


@dataclass(frozen=True)
class Shown:
    title: str
    text: str
    page: str  # under docs/
    make: Callable[[], None]  # leaves the scene open


def _street() -> None:
    from bench import glare_scenes

    glare_scenes.street().camera.data.candela.glare_mode = "CONVOLUTION"


def _moved_reflection() -> None:
    import bpy
    import mathutils

    from bench import reflection_scenes

    reflection_scenes.make("corridor")
    mirror = next(thing for thing in bpy.data.objects if "Mirror" in getattr(thing.data, "materials", ()))
    settings = mirror.candela
    edit, region = (getattr(settings, f"reflection_editing_{name}").add() for name in ("constraints", "regions"))
    into = mirror.matrix_world.inverted()
    edit.point, edit.viewer, edit.target = (
        into @ mathutils.Vector(place) for place in ((0.5, 3.0, 1.3), (0.4, -1.5, 1.4), (-0.8, -3.5, 0.6))
    )
    region.centre, region.radius, region.border = edit.point, 3.0, 0.5


def _medium(name: str) -> Callable[[], None]:
    def made() -> None:
        from bench import media_scenes

        media_scenes.begin()
        (media_scenes.MEDIA | media_scenes.CAUSTICS)[name]()

    return made


def _scattering(name: str) -> Callable[[], None]:
    def made() -> None:
        from bench import subsurface

        subsurface.clear()
        (subsurface.SCENES | subsurface.THROUGH)[name]("RANDOM_WALK")

    return made


def _veins() -> None:
    from bench import subsurface_costs as painted

    painted.with_maps("veins")


def _stones() -> None:
    from bench import strips

    strips.over_relief("1")


def _grass() -> None:
    from bench import strips

    strips.over_grass("2 varied")


def _edges() -> None:
    from bench import edge_scenes

    edge_scenes.build("picket fence")
    _candela(slot_shadow="penumbra_wedges")


def _sample(name: str, **settings) -> Callable[[], None]:
    def made() -> None:
        sample_file(name)
        _candela(**settings)

    return made


def _fisheye() -> None:
    import bpy

    sample_file("colonnade_hall")
    camera = bpy.context.scene.camera.data
    camera.type, camera.panorama_type = "PANO", "FISHEYE_EQUIDISTANT"


def _candela(**settings) -> None:
    import bpy

    for name, value in settings.items():
        setattr(bpy.context.scene.candela, name, value)


GALLERY = {
    "glare": Shown("Glare of the human eye", "needles, halo and veil from a model of pupil, lens and vitreous",
                   "glare.md", _street),
    "reflection": Shown("Reflections you can move", "the yellow ball was dragged into the middle of the mirror",
                        "reflections.md", _moved_reflection),
    "caustics": Shown("Caustics", "of lamps through glass and off metal, from one sample on", "caustics.md",
                      _sample("caustics_table")),
    "volume_caustics": Shown("Light focused in fog", "beams behind a glass ball", "media.md", _medium("W1 glass ball")),
    "fog": Shown("Fog and haze", "shafts of the sun through a window", "media.md", _medium("window in haze")),
    "subsurface": Shown("Light below surfaces", "random walks where a body is thin, maps to paint how deep light goes",
                        "subsurface.md", _scattering("ears")),
    "painted": Shown("Translucency painted on a surface", "veins below the skin, as maps of tint",
                     "subsurface.md", _veins),
    "grass": Shown("Grass from one rendered patch", "any number of blades at the cost of their pixels",
                   "grass.md", _grass),
    "relief": Shown("Displacement without subdivision", "a plane of two triangles, with its own outlines and shadows",
                    "relief.md", _stones),
    "edges": Shown("Soft shadows from silhouette edges", "exact penumbrae, free of noise in one sample",
                   "edge_shadows.md", _edges),
    "indirect": Shown("Bounced light", "a room lit through its window, by virtual lights with soft visibility",
                      "indirect_light.md", _sample("window_interior")),
    "panorama": Shown("Panoramic cameras", "fisheye, mirror ball, spherical stereo: every technique sees through them",
                      "panoramas.md", _fisheye),
}  # fmt: skip


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"of {', '.join(GALLERY)}; default those without times"
    )
    parser.add_argument("--page", action="store_true", help=f"write the table into {PAGE.name}")


def command(options: argparse.Namespace) -> int:
    import addon

    addon.register()
    if unknown := [name for name in options.names if name not in GALLERY]:
        print(f"The gallery has no {', '.join(unknown)}: it has {', '.join(GALLERY)}.")
        return 2
    known = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    for name in options.names or [name for name in GALLERY if name not in known]:
        known[name] = strip(name)
        RESULTS.parent.mkdir(exist_ok=True)
        write_whole(RESULTS, json.dumps(known, indent=0))
        print(f"{name:16} {times(known[name])}", flush=True)
    if options.page:
        put_between(PAGE, COMMAND, rows(known))
    return 0


def strip(name: str) -> list[float]:
    """Write the strip's picture; returns the engines' seconds."""
    import bpy

    from addon.compare.metrics import display
    from addon.compare.reference import render_passes

    GALLERY[name].make()
    scene, pictures, seconds = bpy.context.scene, [], []
    for _, engine, samples in ENTRANTS:
        extra = [(scene.cycles, "use_denoising", engine == "CYCLES")]
        if engine == "BLENDER_EEVEE" and hasattr(scene.eevee, "use_raytracing"):
            extra.append((scene.eevee, "use_raytracing", True))
        for seed in (2, 1):
            before = _spent()
            found = render_passes(scene, engine, samples, seed, size=SIZE, extra=extra)
            spent = _spent() - before
        pictures.append(found.images.get("glare", found.images["combined"])[..., :3])
        seconds.append(spent)
    exposure = float(-np.log2(max(np.percentile(pictures[1], 97), 1e-6)))
    gap = np.ones((SIZE[1], GAP, 3))
    shown = [part for one in pictures for part in (display(one, exposure)[::-1], gap)]
    write_picture(FOLDER / f"{name}.png", np.concatenate(shown, axis=1))
    return seconds


def _spent() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def times(seconds: list[float]) -> str:
    return " · ".join(f"{label} {spent:.1f} s" for (label, _, _), spent in zip(ENTRANTS, seconds, strict=True))


def rows(known: dict[str, list[float]]) -> str:
    """The gallery as a table, a row for each strip that has been made."""
    lines = ["| Candela, Cycles, EEVEE | |", "|---|---|"]
    for name, one in GALLERY.items():
        if name in known:
            picture = f"[![{one.title} by three engines](docs/images/gallery/{name}.png)](docs/{one.page})"
            lines.append(f"| {picture} | **{one.title}**: {one.text}. {times(known[name])} |")
    return "\n".join(lines)
