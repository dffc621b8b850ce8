"""The manual's pictures, cut from what the windowed tests left: `make screenshots`.

    python tools/screenshots.py [SCRIPT ...]     only those of some scripts in tests/window/

The window is 1280 x 800; regions are where the scripts in tests/window/ put them, or as they say in their result.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
BACKEND = "opengl"
LEFT = (0, 26, 1058, 694)  # the large area of the Layout workspace
HALF = (0, 26, 636, 694)
POPOVER = (0, 0, 800, 560)
RIGHT = (636, 26, 422, 694)
DIALOG = (430, 240, 628, 340)  # around the middle of the properties
# Picture in docs/images, script, picture of the window, what is cut out: a box or a name in the script's result.
PICTURES = (
    ("viewport_rest", "tour", "tour_engine", HALF),
    ("viewport_passes", "tour", "tour_passes", POPOVER),
    ("panel_presets", "tour", "tour_presets", RIGHT),
    ("viewport_moving", "drive", "viewport_moving", LEFT),
    ("panel_render", "drive", "panel_render", "properties"),
    ("panel_frame", "drive", "panel_frame", "properties"),
    ("panel_film", "features", "film_panel", "properties"),
    ("panel_tune", "tune", "tune_found", "properties"),
    ("panel_tune_apply", "tune", "tune_apply", DIALOG),
    ("panel_view_layer", "drive", "panel_view_layer", "properties"),
    ("panel_world", "drive", "panel_world", "properties"),
    ("panel_light", "drive", "panel_data", "properties"),
    ("panel_object", "drive", "panel_object", "properties"),
    ("panel_material", "drive", "panel_material", "properties"),
    ("pass_tree_run", "passes", "passes_run", LEFT),
    ("pass_tree", "passes", "passes_compared", LEFT),
    ("pass_tree_nodes", "passes", "passes_nodes", LEFT),
    ("pass_tree_wrong_link", "passes", "passes_wrong_link", LEFT),
    ("compare", "tour", "tour_compared", LEFT),
    ("compare_error", "tour", "tour_error", LEFT),
    ("render_growing", "growing", "growing_1", LEFT),
    ("glare_window", "features", "glare_on", LEFT),
    ("glare_panel", "features", "glare_panel", "properties"),
    ("subsurface_maps", "features", "painting_maps", LEFT),
    ("subsurface_painted", "features", "painting_painted", LEFT),
    ("reflections_picked", "features", "reflections_picked", LEFT),
    ("reflections_turned", "features", "reflections_turned", LEFT),
    ("reflections_heat", "features", "reflections_heat", LEFT),
)


def main() -> int:
    """Write the pictures; 1 if the tests left none."""
    wanted = sys.argv[1:]
    for name, script, picture, box in PICTURES:
        if wanted and script not in wanted:
            continue
        folder = ROOT / "build" / "window" / f"{script}-{BACKEND}"
        source = folder / f"{picture}.png"
        if not source.exists():
            print(f"There is no {source.relative_to(ROOT)}: run make test-window first.", file=sys.stderr)
            return 1
        if isinstance(box, str):
            box = json.loads((folder / "result.json").read_text())[box]
        x, y, width, height = box
        image = Image.open(source).convert("RGB").crop((x, y, x + width, y + height))
        image.save(ROOT / "docs" / "images" / f"{name}.png", optimize=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
