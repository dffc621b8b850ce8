"""Image lookups against Cycles: extension, interpolation, alpha and colour space, on a small picture seen far beyond
its borders."""

import itertools

import bpy
import numpy as np
import pytest

from addon.materials.compiler import compile_material
from addon.materials.reader import read_graph
from addon.snapshot.scene import Image
from tests.materials.cycles import new_material, render_patches
from tests.materials.graphs import emission, graph
from tests.materials.graphs import image as node_of_image
from tests.materials.probe import points

RESOLUTION = 12
TOLERANCE = 6e-3  # Cycles multiplies by alpha in 8 bits: half a step there is up to 2.3 / 510 after the sRGB decode
UV = (-0.83, 1.79)  # no pixel centre falls on the border of a texel
EXTENSIONS = ("REPEAT", "EXTEND", "CLIP", "MIRROR")


def new_image(name, colorspace="sRGB", alpha_mode="STRAIGHT"):
    """3 x 2 pixels of 8 bits, with some that are half or fully transparent, and the same for the shader."""
    made = bpy.data.images.new(name, 3, 2, alpha=True)
    made.colorspace_settings.name = colorspace
    made.alpha_mode = alpha_mode
    random = np.random.default_rng(7)
    pixels = np.round(random.random((2, 3, 4)) * 255.0) / 255.0
    pixels[0, 0, 3], pixels[1, 2, 3] = 0.0, 1.0
    made.pixels.foreach_set(pixels.astype(np.float32).ravel())
    made.update()
    # Data is not colour: alpha does not cover it.
    mode = "CHANNEL_PACKED" if colorspace == "Non-Color" and alpha_mode == "STRAIGHT" else alpha_mode
    encoding = "SRGB" if colorspace == "sRGB" else "LINEAR"
    stored = np.empty(24, np.float32)
    made.pixels.foreach_get(stored)
    return made, Image(name, 1, stored.reshape(2, 3, 4), encoding, mode)


def image_material(image, interpolation="Linear", extension="REPEAT", with_alpha=False):
    """Emission of the image's colour, with its alpha as strength if that is to be used too."""
    material = new_material()
    tree = material.node_tree
    texture, shown, output = (
        tree.nodes.new(name) for name in ("ShaderNodeTexImage", "ShaderNodeEmission", "ShaderNodeOutputMaterial")
    )
    texture.image, texture.interpolation, texture.extension = image, interpolation, extension
    tree.links.new(texture.outputs["Color"], shown.inputs["Color"])
    if with_alpha:
        tree.links.new(texture.outputs["Alpha"], shown.inputs["Strength"])
    tree.links.new(shown.outputs[0], output.inputs["Surface"])
    return material


def patch_points():
    """The centres of a patch's pixels, bottom row first."""
    centers = UV[0] + (UV[1] - UV[0]) * (np.arange(RESOLUTION) + 0.5) / RESOLUTION
    v, u = np.meshgrid(centers, centers, indexing="ij")
    uv = np.zeros((RESOLUTION**2, 4), np.float32)
    uv[:, 0], uv[:, 1] = u.ravel(), v.ravel()
    return points(RESOLUTION**2, attributes=[uv])


def differences(evaluate, materials, images):
    """Largest difference to Cycles per material, in units of radiance."""
    passes, _ = render_patches(materials, resolution=RESOLUTION, uv=UV)
    reference = passes["emission"][..., :3].reshape(len(materials), -1, 3)
    for material, expected in zip(materials, reference):
        compiled = compile_material("Test", read_graph(material, lambda image, user: image.name)[0], images)
        measured = evaluate(compiled, patch_points(), images)["emission"]
        yield float(np.abs(measured - expected).max())


@pytest.mark.slow
def test_extension_interpolation_and_alpha_match_cycles(evaluate, empty_scene):
    image, pixels = new_image("Straight")
    cases = list(itertools.product(EXTENSIONS, ("Linear", "Closest"), (False, True)))
    materials = [image_material(image, i, e, a) for e, i, a in cases]
    found = dict(zip(cases, differences(evaluate, materials, {"Straight": pixels})))
    assert max(found.values()) < TOLERANCE, found


def test_color_spaces_and_alpha_modes_match_cycles(evaluate, empty_scene):
    cases, materials, images = [], [], {}
    for colorspace, mode in itertools.product(("sRGB", "Non-Color"), ("STRAIGHT", "CHANNEL_PACKED", "NONE")):
        image, pixels = new_image(f"{colorspace} {mode}", colorspace, mode)
        images[image.name] = pixels
        for with_alpha in (False, True):
            cases.append((colorspace, mode, with_alpha))
            materials.append(image_material(image, with_alpha=with_alpha))
    found = dict(zip(cases, differences(evaluate, materials, images)))
    assert max(found.values()) < TOLERANCE, found


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_wild_coordinates_stay_finite(evaluate, empty_scene, extension):
    image, pixels = new_image("Straight")
    material = image_material(image, extension=extension)
    compiled = compile_material("Test", read_graph(material, lambda image, user: image.name)[0], {"Straight": pixels})
    wild = np.array([[1e9, -1e9, 0, 1], [-1e30, 1e30, 0, 1], [1e-30, -1e-30, 0, 1], [16777217.0, 0.5, 0, 1]])
    assert np.isfinite(evaluate(compiled, points(4, attributes=[wild]), {"Straight": pixels})["emission"]).all()


@pytest.mark.parametrize("extension", ["REPEAT", "CLIP"])
def test_what_cannot_be_read_is_magenta_everywhere(evaluate, extension):
    """As in Cycles, also where an image that is there would end."""
    lost = Image("lost", 1, np.array([[(1.0, 0.0, 1.0, 1.0)]], np.float32), missing=True)
    tree = graph(node_of_image("Image", "lost", extension=extension), emission(Color=("Image", "Color")),
                 surface=("Emission", "Emission"))  # fmt: skip
    material = compile_material("Test", tree, {"lost": lost})
    found = evaluate(material, points(3, attributes=[[(-1.0, 0.5, 0, 1), (0.01, 0.5, 0, 1), (0.5, 0.5, 0, 1)]]))
    np.testing.assert_allclose(found["emission"], [(1.0, 0.0, 1.0)] * 3)
    assert not material.images and not material.fallbacks
