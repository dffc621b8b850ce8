"""Everything in the code base that declares a Struct or a Program, found by looking at all modules under addon/."""

import importlib
import pkgutil
from dataclasses import replace

import numpy as np

import addon
from addon.gfx.library import Program
from addon.gfx.struct import Struct
from addon.materials import nodes
from addon.materials.compiler import compile_material, default_graph
from addon.scene import materials
from addon.scene.world_tree import background_program, bake_program


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


def structs() -> list[Struct]:
    """Every struct that a shader reads; of the materials' blocks, two lengths."""
    used = {id(struct): struct for program in programs() for struct, _ in program.blocks}
    return sorted(used.values(), key=lambda struct: (struct.name, struct.dtype.itemsize))


def programs() -> list[Program]:
    """Programs of passes and techniques, and of one material for each file that the node table includes."""
    plain = compile_material("plain", default_graph())
    files = sorted({entry.include for entry in nodes.REGISTRY if entry.include})
    made = [*_found(Program), materials._tint_program(plain), bake_program(plain), background_program(plain)]
    for length, file in enumerate(files, len(plain.values)):  # blocks of several lengths among the structs
        values = np.zeros((length, 4), np.float32)
        with_file = replace(plain, glsl=f'#include "{file}"\n{plain.glsl}', values=values)
        made += [materials._surface_program(with_file), materials._caster_program(with_file)]
        made += [materials._emission_program(with_file), materials._opacity_program(with_file)]
    return sorted(dict.fromkeys(made), key=lambda program: (program.name, program.fragment, program.compute))
