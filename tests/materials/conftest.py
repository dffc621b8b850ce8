"""Fixtures of the material tests: evaluation on the GPU."""

import numpy as np
import pytest

from addon.materials.energy import energy_texture
from addon.materials.reader import FINE_LAYERS


@pytest.fixture(scope="session")
def evaluate(gpu_context):
    """`evaluate(material, points, images)` -> dict of closure fields, (N, 3) or (N,) float32."""
    from addon.gfx import images as gpu_images
    from addon.gfx import passes
    from addon.gfx.struct import Block
    from addon.scene.materials import MATERIAL_SCENE
    from tests.materials.probe import FIELDS, material_program, points

    scene = Block(
        MATERIAL_SCENE,
        origin=np.zeros(4),
        camera_position=(0.0, 0.0, 5.0, 0.0),
        camera_right=(1.0, 0.0, 0.0, 0.01),
        camera_up=(0.0, 1.0, 0.0, 0.0),
        camera_backward=(0.0, 0.0, 1.0, 0.0),
        window=(-0.5, -0.5, 1.0, 1.0),
    )
    table = gpu_images.upload(energy_texture(FINE_LAYERS))

    def run(material, at=None, images=None):
        at = points() if at is None else at
        program, struct = material_program(material)
        count = len(at.normal)
        data = np.zeros((count, 12, 4), np.float32)
        data[:, 0, :3], data[:, 1, :3], data[:, 2, :3] = at.normal, at.geometric_normal, at.incoming
        data[:, 3, 0], data[:, 3, 1] = at.backfacing, at.random
        data[:, 4:] = at.attributes
        result = gpu_images.create(len(FIELDS), count, "RGBA32F")
        textures = {"points": gpu_images.upload(data), "energy_table": table}
        for k, key in enumerate(material.images):
            textures[f"material_image{k}"] = gpu_images.upload(images[key].pixels)
        block = Block(struct, value=material.values)
        passes.compute(
            program,
            (1, count),
            textures=textures,
            images={"result": result},
            blocks={"material_values": block, "material_scene": scene},
        )
        texels = gpu_images.read(result)
        return {f: texels[:, i, :n] if n > 1 else texels[:, i, 0] for i, (f, n) in enumerate(FIELDS)}

    return run
