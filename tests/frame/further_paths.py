"""A process whose table of light paths has three more rows: prints, as JSON, by how much pictures with their light are
brighter than without, for the test of the contract."""

import json
import os
from importlib.machinery import SourceFileLoader

import bpy  # noqa: F401 (brings the module gpu)
import numpy as np

ROWS = """
    LightPath("below_direct", "Below Direct", "BelowDir", "use_pass_below", SURFACE, DIRECT, "diffuse", by_need=True),
    LightPath("sheen_direct", "Sheen Direct", "SheenDir", "use_pass_sheen", SURFACE, DIRECT, "sheen", by_need=True),
    LightPath("glow", "Glow", "Glow", "use_pass_glow", MEDIUM, by_need=True),
"""
BRINGS = {"below_direct": 1.0, "sheen_direct": 2.0, "glow": 4.0}
BEHIND = '    LightPath("emission"'
TABLE = "addon.frame.light_paths"
own_code = SourceFileLoader.get_code


def with_rows(loader, fullname):
    if fullname != TABLE:
        return own_code(loader, fullname)
    text = loader.get_data(loader.path).decode()
    assert text.count(BEHIND) == 1
    return compile(text.replace(BEHIND, ROWS.lstrip("\n") + BEHIND), loader.path, "exec")


def main() -> None:
    SourceFileLoader.get_code = with_rows
    from addon.compare.passes import ROWS as COMPARED
    from addon.film.clamping import CLAMP_DIRECT
    from addon.frame.run import Renderer
    from addon.frame.settings import Settings
    from addon.frame.technique import Technique, Write
    from addon.gfx import context
    from addon.snapshot.scene import Instance
    from addon.techniques import make_registry
    from addon.ui.passes import PASSES
    from tests.frame.test_plan import room

    class Brings(Technique):
        name, label = "brings", "Light of the new paths"
        reads = ("surface.position",)
        writes = tuple(Write(f"radiance.{path}", "RGBA32F", "Even light", True) for path in BRINGS)

        def sample(self, frame):
            for path, amount in BRINGS.items():
                frame.target(f"radiance.{path}").clear((amount, amount, amount, 1.0))

    place = np.diag([20.0, 20.0, 1.0, 1.0])
    place[:3, 3] = -7.0, -7.0, -3.0  # fills the picture
    scene = room(instances=(Instance("Triangle", "mesh", place, (0,)),))

    def combined(registry, settings):
        renderer = Renderer(lambda: registry)
        frame = renderer.begin(scene, settings)
        renderer.advance(frame)
        renderer.show(frame)
        pixels = renderer.finish(frame, ["film.combined"])["film.combined"][..., :3]
        renderer.release()
        return pixels

    context.ensure()
    found = {}
    for title, settings in {
        "apart": Settings(samples=1, bounces=0),
        "together": Settings(samples=1, bounces=0, shows=frozenset({"film.combined"})),
        "clamped": Settings(samples=1, bounces=0, values={("film", CLAMP_DIRECT.name): 1e6}),
        "repeated": Settings(samples=4, bounces=0),
    }.items():
        more = combined((*make_registry(), Brings()), settings) - combined(make_registry(), settings)
        found[title] = [float(more.min()), float(more.max())]
    found["passes"] = [one.source for one in PASSES if one.source.partition(" ")[0].split(".")[-1] in BRINGS]
    found["compared"] = [row.name for row in COMPARED if row.name in BRINGS]
    print(json.dumps(found), flush=True)


if __name__ == "__main__":
    main()
    os._exit(0)  # Blender as a module may hang or crash on its way out
