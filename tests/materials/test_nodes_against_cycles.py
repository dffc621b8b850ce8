"""Every node beside Cycles, pixel by pixel; `make nodes` shows the same cases as a page."""

import pytest

from bench.node_cases import Case, compare
from bench.nodes import available, node_rows

# What artists' files use most; all other cases stand in the slow test.
QUICK = (
    *("Noise 3D fbm", "Noise 3D colour, distorted", "Noise 4D ridged_multifractal", "White Noise 3D color"),
    *("Voronoi 3D f1 distance", "Voronoi 2D f1 color", "Voronoi 3D distance_to_edge distance", "Wave bands sin"),
    *(
        "Checker color",
        "Brick color",
        "Magic depth 2",
        "Gradient spherical",
        "Image box",
        "Image sphere",
        "Image cubic",
    ),
    *("Texture Coordinate generated", "Texture Coordinate object", "Texture Coordinate window"),
    *("Texture Coordinate of another object: object", "Geometry position", "Object Info color", "Attribute Paint fac"),
    *("Layer Weight 0.2 facing", "Fresnel fac", "Tangent UV tangent", "Normal Map tangent", "Bump object sphere"),
    *("Bump uv", "Displacement sphere", "Mapping point", "Map Range smoothstep", "Vector Math snap", "RGB Curves"),
    *("Color Ramp b_spline", "Hue/Saturation", "Blackbody 4000 K", "Wavelength 551 nm"),
)


def apart(cases: list[Case], pixels: int) -> dict[str, tuple[float, float]]:
    """Largest difference and 99th percentile of the cases that are further apart than they may be."""
    return {d.case.name: (d.largest, d.percentile_99) for d in compare(cases, pixels) if not d.good}


@pytest.mark.slow
def test_common_nodes_give_cycles_pixels(registered):
    cases = [case for case in available() if case.name in QUICK]
    assert len(cases) == len(QUICK)
    assert apart(cases, 20) == {}


@pytest.mark.slow
def test_all_nodes_give_cycles_pixels(registered):
    assert apart(available(), 24) == {}


def test_every_node_of_blender_stands_in_the_table(empty_scene):
    rows = node_rows()
    assert len(rows) > 80
    assert all(text for _, state, text in rows if state != "supported")
    assert sum(state == "supported" for _, state, _ in rows) >= 55
