"""How many programs a scene's materials make on the GPU, and how long a large tree takes."""

import time
from dataclasses import replace

import numpy as np
import pytest

from addon.materials.compiler import compile_material
from addon.snapshot.scene import Camera, Film, Material, Snapshot, World
from tests.materials.graphs import diffuse, emission, graph, math, node, principled

NOISE = {"Fac": "FLOAT", "Color": "COLOR"}


def noise(key, **inputs):
    return node(key, "ShaderNodeTexNoise", NOISE, properties={"noise_dimensions": "3D"}, **inputs)


def chain(length, value):
    """A tree of `length` sums below a diffuse surface."""
    sums = [math(f"M{k}", "ADD", (f"M{k - 1}", "Value") if k else value, value) for k in range(length)]
    return graph(*sums, diffuse(Color=(f"M{length - 1}", "Value")), surface=("Diffuse", "BSDF"))


def snapshot(materials):
    camera = Camera(np.eye(4), "PERSPECTIVE", (-0.5, 0.5, -0.5, 0.5), 0.1, 100.0)
    film = Film(8, 8, (0, 0, 8, 8))
    return Snapshot({}, (), tuple(materials), {}, (), World(np.zeros(3)), camera, film)


@pytest.mark.slow
def test_200_materials_of_10_topologies_make_10_programs(gpu_context):
    from addon.gfx import library
    from addon.scene.materials import MaterialSet

    materials = [Material(f"{k}", f"Material {k}", chain(1 + k % 10, 0.001 * k)) for k in range(200)]
    shown = MaterialSet()
    shown.update(snapshot(materials))
    before = library.compile_count
    for index in range(200):
        library.get(shown.surface_program(index))
    assert library.compile_count - before == 10
    # Other values of the same sliders compile nothing.
    shown.update(snapshot([Material(m.key, m.name, chain(1 + k % 10, 0.5)) for k, m in enumerate(materials)]))
    for index in range(200):
        library.get(shown.surface_program(index))
    assert library.compile_count - before == 10
    shown.release()


def large_tree(value):
    """300 nodes: 20 noises, blended and bent by 279 sums and products, under a Principled surface."""
    textures = [noise(f"N{k}", Scale=value + k) for k in range(20)]
    steps = []
    for k in range(279):
        before = (f"M{k - 1}", "Value") if k else value
        steps.append(math(f"M{k}", "MULTIPLY" if k % 2 else "ADD", before, (f"N{k % 20}", "Fac")))
    return graph(*textures, *steps, principled(Base_Color=("M278", "Value")), surface=("Principled", "BSDF"))


@pytest.mark.slow
@pytest.mark.timing
def test_a_tree_of_300_nodes_compiles_in_two_seconds_and_its_sliders_in_none(gpu_context):
    from addon.gfx import library
    from tests.materials.probe import material_program

    fresh = noise("Fresh", Scale=1.0)
    tree = large_tree(1.5)
    tree.nodes["Fresh"] = fresh
    seconds = []
    while not seconds or (min(seconds) >= 2.0 and len(seconds) < 3):  # other work on the machine slows single tries
        start = time.process_time()
        material = compile_material("Large", tree)
        # The driver keeps programs on disk from run to run: a number of its own in the text makes this one new.
        program, _ = material_program(material, name=f"large tree {time.time()}")
        library.get(replace(program, defines=(*program.defines, ("FRESH", str(time.time_ns())))))
        seconds.append(time.process_time() - start)
    assert min(seconds) < 2.0
    assert compile_material("Large", large_tree(2.5)).program_key == material.program_key


def test_bump_evaluates_its_height_three_times_and_shares_the_first():
    """Noise that is shown and lifts the surface: once for both at the point, once in the function for neighbours."""
    bump = node("Bump", "ShaderNodeBump", {"Normal": "VECTOR"}, properties={"invert": False}, Height=("Noise", "Fac"))
    tree = graph(noise("Noise"), bump, diffuse(Color=("Noise", "Fac"), Normal=("Bump", "Normal")),
                 surface=("Diffuse", "BSDF"))  # fmt: skip
    glsl = compile_material("Test", tree).glsl
    assert glsl.count("noise_texture(") == 2
    assert glsl.count("tree0(surface_point_moved(point") == 2
    body = glsl[glsl.index("void evaluate_material") :]
    assert body.count("noise_texture(") == 1


def test_constants_of_a_height_are_uploaded_once():
    def values(height):
        bump = node("Bump", "ShaderNodeBump", {"Normal": "VECTOR"}, Height=height)
        tree = graph(noise("Noise", Scale=7.25), bump, diffuse(Normal=("Bump", "Normal")), surface=("Diffuse", "BSDF"))
        return compile_material("Test", tree).values

    assert (values(("Noise", "Fac")) == 7.25).sum() == 1


def test_bump_within_heights_ends():
    """Each level of bump within a height is evaluated three times: from the fourth on it is left out, and said."""
    parts, below = [], 0.5
    for k in range(8):
        parts += [
            node(f"Bump{k}", "ShaderNodeBump", {"Normal": "VECTOR"}, Height=below),
            node(f"Facing{k}", "ShaderNodeLayerWeight", {"Facing": "FLOAT"}, Normal=(f"Bump{k}", "Normal")),
        ]
        below = (f"Facing{k}", "Facing")
    material = compile_material("Test", graph(*parts, emission(Color=below), surface=("Emission", "Emission")))
    assert len(material.glsl) < 100_000
    assert any("fourth level" in sentence for _, sentence in material.fallbacks)
