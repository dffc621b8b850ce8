"""Everything in the code base that declares a Struct or a Program, found by looking at all modules under addon/."""

import importlib
import pkgutil
from dataclasses import replace

import numpy as np

import addon
from addon.gfx import passes
from addon.gfx.interface import answered, asked_by
from addon.gfx.library import Program
from addon.gfx.struct import Struct
from addon.lighting.grass import GRASS
from addon.lighting.leaving_light import LEAVES
from addon.lighting.linked import LINKS
from addon.lighting.loop import lighting
from addon.lighting.visibility import HARD
from addon.materials import nodes
from addon.materials.compiled import Attribute
from addon.materials.compiler import compile_material, default_graph
from addon.materials.graph import Graph, Input, Node
from addon.materials.volume_program import CompiledVolume, compile_volume
from addon.scene import displacement, materials, media
from addon.scene.lamp_trees import bake_program as lamp_program
from addon.scene.world_tree import background_program, bake_program
from addon.surfaces.hits import hit_program
from addon.techniques.grass import grass_program


def _found(kind: type) -> list:
    """Values of `kind` at the top of any module, alone or in tuples, each once."""
    values = {}
    for module in pkgutil.walk_packages(addon.__path__, "addon."):
        if not module.name.endswith("__main__"):
            for declared in vars(importlib.import_module(module.name)).values():
                for value in declared if isinstance(declared, tuple) else (declared,):
                    if isinstance(value, kind):
                        values[id(value)] = value
    return list(values.values())


def fog() -> CompiledVolume:
    """A Principled Volume whose density is an attribute."""
    inputs = {
        "Color": Input("COLOR", (0.5, 0.5, 0.5, 1.0)), "Density": Input("FLOAT", 1.0),
        "Density Attribute": Input("STRING", "density"),
    }  # fmt: skip
    node = Node("Fog", "Fog", "ShaderNodeVolumePrincipled", inputs, {"Volume": "SHADER"})
    return compile_volume("fog", Graph({"Fog": node}, volume=("Fog", "Volume")))


def relief_programs() -> list[Program]:
    """Those of a material that is displaced, asked for its displacement and drawn in a shell."""
    nodes = default_graph().nodes | {
        "Noise": Node("Noise", "Noise", "ShaderNodeTexNoise", {}, {"Fac": "FLOAT"}, {}),
        "Lift": Node(
            "Lift", "Lift", "ShaderNodeDisplacement", {"Height": Input("FLOAT", 0.0, ("Noise", "Fac"))},
            {"Displacement": "VECTOR"}, {"space": "OBJECT"},
        ),
    }  # fmt: skip
    lifted = compile_material("lifted", Graph(nodes, ("Default", "BSDF"), displacement=("Lift", "Displacement")))
    shell = replace(lifted, own_surface=displacement.relief_surface(lifted), program_key=f"r{lifted.program_key}")
    drawn = (materials._surface_program, materials._caster_program, materials._tint_program, materials._lobe_program)
    drawn = (*drawn, materials._scatter_program, materials._glow_program, materials._emission_program)
    drawn = (*drawn, materials._layer_program)
    return [displacement.displacement_program(lifted), *(program(shell) for program in drawn)]


def structs() -> list[Struct]:
    """Every struct that a shader reads; of the materials' blocks, two lengths."""
    used = {id(struct): struct for program in programs() for struct, _ in program.blocks}
    return sorted(used.values(), key=lambda struct: (struct.name, struct.dtype.itemsize))


def programs() -> list[Program]:
    """Programs of passes and techniques, and of one material for each file that the node table includes."""
    plain = compile_material("plain", default_graph())
    files = sorted({entry.include for entry in nodes.REGISTRY if entry.include})
    made = [*_found(Program), materials._tint_program(plain), bake_program(plain), background_program(plain)]
    made += [materials._scatter_program(plain), materials._glow_program(plain), materials._emission_map_program(plain)]
    made += [materials._layer_program(plain)]
    made += [materials._lobe_program(plain), hit_program(plain), media.bake_program(fog(), ("density",))]
    made += [hit_program(replace(plain, attributes=(Attribute("COLOR", "Color"),), program_key="with attributes"))]
    made += [grass_program(materials._surface_program(plain)), answered(lighting(HARD, False), (GRASS,))]
    made += [answered(lighting(HARD, False), (LINKS,))]
    made += [answered(next(one for one in made if LEAVES.asked in asked_by(one)), (LEAVES,))]
    made += relief_programs()
    hair = replace(plain, strands=True, program_key=f"s{plain.program_key}")
    made += [materials._surface_program(hair), materials._scatter_program(hair), materials._caster_program(hair)]
    layouts = ((("UV", "VECTOR"),), (("", "COLOR"), ("", "VALUE")))
    made += [
        lamp_program(plain),
        materials._aov_program(hair, layouts[:1]),
        *(materials._aov_program(plain, (held,)) for held in layouts),
    ]
    for length, file in enumerate(files, len(plain.values)):  # blocks of several lengths among the structs
        values = np.zeros((length, 4), np.float32)
        with_file = replace(plain, glsl=f'#include "{file}"\n{plain.glsl}', values=values)
        made += [materials._surface_program(with_file), materials._caster_program(with_file)]
        made += [materials._emission_program(with_file), materials._opacity_program(with_file)]
    of_pixels = [one for one in made if one.fragment.startswith(passes.OF_PIXELS)]
    made += [passes.computed(one, ("RGBA32F",) * len(one.outputs), adds) for one in of_pixels for adds in (False, True)]
    return sorted(dict.fromkeys(made), key=lambda program: (program.name, program.fragment, program.compute))
