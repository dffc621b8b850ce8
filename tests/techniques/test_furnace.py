"""The white furnace: under a world of radiance 1 every surface shows its albedo, and a white one vanishes."""

import numpy as np
import pytest

WHITE = (1.0, 1.0, 1.0, 1.0)
PIXELS = 3  # columns per material
ROWS = 24


def materials(stage):
    """Name -> (material, what it shows by theory; None where Cycles must tell)."""

    def glossy(roughness, color=WHITE):
        return stage.material("ShaderNodeBsdfGlossy", Color=color, Roughness=roughness)

    def principled(**inputs):
        return stage.principled(**{"Base_Color": WHITE, **inputs})

    return {
        "diffuse 1": (stage.diffuse(1.0), 1.0),
        "diffuse 0.5": (stage.diffuse(0.5), 0.5),
        "diffuse 0": (stage.diffuse(0.0), 0.0),
        "Oren-Nayar white": (stage.diffuse(1.0, roughness=1.0), 1.0),
        "Oren-Nayar grey": (stage.diffuse(0.5, roughness=1.0), None),
        "glossy 0": (glossy(0.0), 1.0),
        "glossy 0.2": (glossy(0.2), 1.0),
        "glossy 0.6": (glossy(0.6), 1.0),
        "glossy 1": (glossy(1.0), 1.0),
        "gold": (glossy(0.5, (1.0, 0.7, 0.3, 1.0)), None),
        "metal 0": (principled(Metallic=1.0, Roughness=0.0), 1.0),
        "metal 0.3": (principled(Metallic=1.0, Roughness=0.3), 1.0),
        "metal 1": (principled(Metallic=1.0, Roughness=1.0), 1.0),
        "half metal": (principled(Metallic=0.5), None),
        "plastic 0": (principled(Roughness=0.0), None),
        "plastic 0.2": (principled(Roughness=0.2), None),
        "plastic 0.5": (principled(Roughness=0.5), None),
        "plastic 1": (principled(Roughness=1.0), None),
        "grey plastic": (principled(Base_Color=(0.5, 0.5, 0.5, 1.0)), None),
        "no specular": (principled(Specular_IOR_Level=0.0), 1.0),
        "strong specular": (principled(Specular_IOR_Level=1.0), None),
        "ior 1": (principled(IOR=1.0), 1.0),
        "ior 2.5": (principled(IOR=2.5), None),
        "coat": (principled(Coat_Weight=1.0, Coat_Roughness=0.1), None),
        "half alpha": (principled(Alpha=0.5), None),
    }


NAMES = [
    "diffuse 1", "diffuse 0.5", "diffuse 0", "Oren-Nayar white", "Oren-Nayar grey", "glossy 0", "glossy 0.2",
    "glossy 0.6", "glossy 1", "gold", "metal 0", "metal 0.3", "metal 1", "half metal", "plastic 0", "plastic 0.2",
    "plastic 0.5", "plastic 1", "grey plastic", "no specular", "strong specular", "ior 1", "ior 2.5", "coat",
    "half alpha",
]  # fmt: skip


SLOW = pytest.mark.slow


@pytest.fixture(
    scope="module", params=[pytest.param(0, marks=SLOW), pytest.param(60, marks=SLOW), 80], ids="{}_degrees".format
)
def pictures(request, kept_stage):
    """Strips of all materials in one plane, seen under one angle from the normal: by Candela and by Cycles."""
    stage = kept_stage
    stage.clear()
    wanted = materials(stage)
    assert list(wanted) == NAMES
    width = 4.0 / len(wanted)
    for k, (material, _) in enumerate(wanted.values()):
        stage.rectangle((-2 + k * width, -99), (-2 + (k + 1) * width, 99), material=material)
    stage.world()
    tilt = np.radians(request.param)
    camera = stage.camera_above(4.0)
    camera.location, camera.rotation_euler = (0, -20 * np.sin(tilt), 20 * np.cos(tilt)), (tilt, 0, 0)
    camera.data.clip_end = 1000
    size = (PIXELS * len(wanted), ROWS)
    theory = [expected for _, expected in wanted.values()]
    return stage.render(64, size), stage.render(512, size, engine="CYCLES"), theory


def mean(images, name, k):
    return images[name][:, PIXELS * k : PIXELS * (k + 1), :3].astype(float).mean(axis=(0, 1))


@pytest.mark.parametrize("name", NAMES)
def test_a_surface_in_a_white_furnace_shows_its_albedo(pictures, name):
    candela, cycles, theory = pictures
    k = NAMES.index(name)
    expected = mean(cycles, "combined", k) if theory[k] is None else np.full(3, theory[k])
    np.testing.assert_allclose(mean(candela, "combined", k), expected, rtol=0.02, atol=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_colour_passes_are_cycles_albedos(pictures, name):
    candela, cycles, _ = pictures
    k = NAMES.index(name)
    for color in ("diffuse_color", "glossy_color"):
        np.testing.assert_allclose(
            mean(candela, color, k), mean(cycles, color, k), atol=0.03 if name == "half alpha" else 2e-3
        )


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("half alpha", "diffuse 0")])
def test_no_surface_gives_back_more_than_it_gets(pictures, name):
    assert mean(pictures[0], "combined", NAMES.index(name)).max() < 1.02


def test_samples_added_to_a_picture_give_what_all_at_once_give(stage):
    from addon import engine

    stage.floor()
    stage.blocker((-0.5, -0.5), (0.5, 0.5), 0.5)
    stage.world()
    stage.camera_above(4.0)
    at_once = stage.render(8)["combined"]
    engine.free_sessions()
    stage.render(2)
    np.testing.assert_array_equal(stage.render(8)["combined"], at_once)


def test_a_white_sphere_vanishes_in_a_white_world(stage):
    import bmesh
    import bpy

    data, shape = bpy.data.meshes.new("Sphere"), bmesh.new()
    bmesh.ops.create_icosphere(shape, subdivisions=4, radius=1.5)
    for face in shape.faces:
        face.smooth = True
    shape.to_mesh(data)
    shape.free()
    data.materials.append(stage.diffuse())
    stage.link("Sphere", data)
    stage.camera_above(4.0)
    stage.world()
    found = stage.render(64)["combined"][..., :3]
    assert found.mean() == pytest.approx(1.0, abs=0.01)
    assert np.abs(found - 1.0).max() < 0.1  # at the rim, facets and smooth normals disagree
