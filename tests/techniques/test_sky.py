"""The Sky Texture against Cycles: what the camera sees, and the light of sky and sun on surfaces."""

import bpy
import pytest

SIZE = (48, 36)
SLOW = pytest.mark.slow
NEW = bpy.app.version >= (5, 0)
SINGLE = "SINGLE_SCATTERING" if NEW else "NISHITA"
DISC = {"sun_elevation": 0.5, "sun_rotation": 0.7}
COMMON = ("single", "multiple")
CASES = {
    "single": {"sky_type": SINGLE, **DISC},
    "large low sun": {"sky_type": SINGLE, "sun_elevation": 0.05, "sun_rotation": -0.3, "sun_size": 0.2},
    "high up": {"sky_type": SINGLE, **DISC, "altitude": 3000.0, "air_density": 2.0, "ozone_density": 3.0},
    "Preetham": {"sky_type": "PREETHAM", "sun_direction": (0.3, 0.5, 0.7), "turbidity": 3.0},
    "Hosek": {"sky_type": "HOSEK_WILKIE", "sun_direction": (0.3, 0.5, 0.7), "turbidity": 3.0, "ground_albedo": 0.7},
    "Hosek, dusk": {"sky_type": "HOSEK_WILKIE", "sun_direction": (0.3, 0.9, -0.1), "turbidity": 6.6},
}
if NEW:
    CASES["multiple"] = {"sky_type": "MULTIPLE_SCATTERING", **DISC}
    CASES["haze"] = {"sky_type": "MULTIPLE_SCATTERING", **DISC, "aerosol_density": 4.0, "sun_disc": False}


def below_a_sky(stage, **settings):
    """A floor and a metal plate; the camera sees the sky above them, and the sun."""
    tree = stage.world().node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    for name, value in settings.items():
        setattr(sky, name, value)
    tree.links.new(sky.outputs[0], next(node for node in tree.nodes if node.type == "BACKGROUND").inputs["Color"])
    stage.floor(half=30)
    metal = stage.principled(Roughness=0.3, Metallic=1.0)
    stage.rectangle((-0.5, -0.5), (0.5, 0.5), z=1.0, material=metal, location=(1, 3, 0))
    stage.camera((0, 0, 1.5), (1.5, 0, -0.5), 1.9)
    return sky


@pytest.mark.parametrize("name", [n if n in COMMON else pytest.param(n, marks=SLOW) for n in CASES])
def test_a_sky_shows_and_lights_as_in_cycles(stage, name):
    """Within 2 %. A narrow sun moves the edge of the plate's shadow by parts of a pixel: squares count more there.
    A sun that is not a lamp takes more directions."""
    below_a_sky(stage, **CASES[name])
    ours, cycles = stage.render(64 if "sun_size" in CASES[name] else 16, SIZE), stage.render(256, SIZE, engine="CYCLES")
    for image, error in (("environment", 2e-4), ("diffuse_direct", 0.015), ("glossy_direct", 2e-3)):
        a, b = (images[image][..., :3].astype(float) for images in (ours, cycles))
        assert a.mean(axis=(0, 1)) == pytest.approx(b.mean(axis=(0, 1)), rel=0.02), image
        assert ((a - b) ** 2).sum() < error * (b**2).sum(), image


def test_the_sun_of_a_sky_is_a_lamp_that_the_camera_sees_once(stage):
    below_a_sky(stage, sky_type=SINGLE, **DISC)
    images = stage.render(2, SIZE)
    lights = stage.renderer.frame.snapshot.lights
    assert [(light.kind, light.visibility.camera) for light in lights] == [("SUN", False)]
    assert images["emission"].max() == 0.0
    assert stage.renderer.frame.environment.pixels.max() < 1e3  # the map of light holds no disc
