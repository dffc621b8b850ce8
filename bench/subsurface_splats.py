"""Dipole splats beside closed forms, for `python -m bench subsurface_costs --parts splats`.

Planes of the media that the author of the method uses, lit whole and by half, and what his grids cost here.
"""

from __future__ import annotations

import time

import numpy as np

from . import markdown, subsurface

# Per mm; the specification's test material and those of Jensen et al. 2001 that the author uses: absorption, reduced
# scattering, index.
MEDIA = {
    "sigma_a .1, sigma_s 2": ((0.1,) * 3, (2.0,) * 3, 1.2),
    "marble": ((0.0021, 0.0041, 0.0071), (2.19, 2.62, 3.0), 1.5),
    "skin1": ((0.032, 0.17, 0.48), (0.74, 0.88, 1.01), 1.3),
}
GRIDS = ((32, "24 to 31"), (71, "27"), (114, "24"), (300, "23"))  # the author's, with his frames a second


def edge(medium, x: float) -> float:
    """Of a half-plane that is lit evenly, the share of the light of a whole one at distance x, m, from its edge; by the
    dipole, numerically."""
    from addon.kernels import diffusion

    far = 12.0 / medium.transport
    t = (np.arange(200) + 0.5) / 200 * abs(x)
    y = np.sinh(np.linspace(0.0, np.arcsinh(far / medium.depths[0]), 1201)) * medium.depths[0]
    middle, width = (y[1:] + y[:-1]) / 2, np.diff(y)
    across = 2.0 * (diffusion.dipole(medium, np.hypot(t[:, None], middle)) * width).sum(axis=1)
    part = float(across.mean()) * abs(x) / diffusion.dipole_total(medium)
    return 0.5 + np.sign(x) * part


def _splatted_plane(media, ior: float, grid: int, x: float, half_lit: bool) -> np.ndarray:
    """Colour at x, m, from the edge of a plane that the sun lights, by splats."""
    import bpy

    from addon.compare.reference import render_passes
    from addon.kernels import diffusion

    subsurface.clear()
    totals = [diffusion.dipole_total(medium) for medium in media]
    made = subsurface.material("RANDOM_WALK", totals, [medium.depths[0] for medium in media], 1.0)
    node = subsurface.node_of(made, "BSDF_PRINCIPLED")
    for name, value in {"Subsurface Scale": 1.0, "Roughness": 0.0, "IOR": ior, "Specular IOR Level": 0.5}.items():
        node.inputs[name].default_value = value
    side = 2.2 * max(diffusion.dipole_range(medium) for medium in media)
    cube = bpy.ops.mesh.primitive_cube_add
    subsurface._shape(cube, made, False, size=1, location=(0, 0, -side / 2), scale=(side, side, side))
    subsurface.light("SUN", turn=(0, 0, 0), energy=np.pi, angle=0.0)
    subsurface.camera((x, 0, 2 * side), (0, 0, 0), span=0.02 * side)
    if half_lit:
        bpy.ops.mesh.primitive_plane_add(size=1, location=(-side, 0, side))
        bpy.context.object.scale = (2 * side, 4 * side, 1)
        bpy.context.object.visible_camera = False
    scene = bpy.context.scene
    scene.candela.image_space_subsurface_form, scene.candela.image_space_subsurface_grid = "SPLATS", grid
    images = render_passes(scene, "CANDELA", 8, 1, size=(8, 8), bounces=0).images
    return images["combined"][..., :3].astype(np.float64).mean(axis=(0, 1))


def splats(grid: int = 192) -> str:
    """Dipole splats: light beside the edge of a half-lit plane, and what the author's grids cost."""
    import bpy

    from addon.compare.reference import render_passes
    from addon.kernels import diffusion

    rows = [["material", "distance to the edge", "dipole", "splats"]]
    for name, (absorption, scattering, ior) in MEDIA.items():
        media = [diffusion.Medium(a, s, 0.0, ior) for a, s in zip(absorption, scattering)]
        free = media[1].depths[0]
        whole = _splatted_plane(media, ior, grid, 0.0, False)
        passes = 1.0 - ((ior - 1.0) / (ior + 1.0)) ** 2  # each way, and of what is diffuse as much is left by speculars
        right = [passes**3 * diffusion.dipole_total(medium) for medium in media]
        rows.append(
            [name, "lit whole", " ".join(f"{one:.4f}" for one in right), " ".join(f"{one:.4f}" for one in whole)]
        )
        for paths in (-2, -1, 1, 2, 4):
            found = _splatted_plane(media, ior, grid, paths * free, True) / whole
            right = [edge(medium, paths * free) for medium in media]
            rows.append([
                name, f"{paths} free paths", " ".join(f"{one:.4f}" for one in right),
                " ".join(f"{one:.4f}" for one in found),
            ])  # fmt: skip
            print(rows[-1], flush=True)
    scene, costs = bpy.context.scene, [["grid", "processor s a sample, 200 x 150", "the author's frames a second"]]
    subsurface.clear()
    subsurface.ears("RANDOM_WALK")
    scene.candela.image_space_subsurface_form = "SPLATS"
    for side, author in GRIDS:
        scene.candela.image_space_subsurface_grid = side
        for _ in range(2):
            start = time.process_time()
            render_passes(scene, "CANDELA", 1, 1, size=(200, 150), bounces=0)
        costs.append([f"{side} x {side}", f"{time.process_time() - start:.2f}", author])
        print(costs[-1], flush=True)
    for name in ("form", "grid"):
        scene.candela.property_unset(f"image_space_subsurface_{name}")
    return f"{markdown.table(rows)}\n\n{markdown.table(costs)}"
