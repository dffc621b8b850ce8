"""Short ways to write node graphs by hand."""

from addon.materials.graph import Graph, Input, Node

KIND_OF_LENGTH = {1: "FLOAT", 3: "VECTOR", 4: "COLOR"}


def node(key, node_type, outputs, image="", properties=None, **inputs):
    """A node; inputs are given as numbers, tuples (3: vector, 4: colour) or ("key", "output") links.

    Underscores in input names stand for spaces.
    """
    sockets = {}
    for name, value in inputs.items():
        name = name.replace("_", " ") if not name[-3:].isdigit() else name
        if isinstance(value, tuple) and isinstance(value[0], str):
            sockets[name] = Input("SHADER" if name.startswith("Shader") else "COLOR", None, value)
        elif isinstance(value, tuple):
            sockets[name] = Input(KIND_OF_LENGTH[len(value)], value)
        else:
            sockets[name] = Input("FLOAT", float(value))
    return Node(key, key, node_type, sockets, outputs, properties or {}, image)


def graph(*nodes, surface):
    return Graph({n.key: n for n in nodes}, surface)


def emission(key="Emission", **inputs):
    return node(key, "ShaderNodeEmission", {"Emission": "SHADER"}, **inputs)


def diffuse(key="Diffuse", **inputs):
    return node(key, "ShaderNodeBsdfDiffuse", {"BSDF": "SHADER"}, **inputs)


def transparent(key="Transparent", **inputs):
    return node(key, "ShaderNodeBsdfTransparent", {"BSDF": "SHADER"}, **inputs)


def principled(key="Principled", **inputs):
    return node(key, "ShaderNodeBsdfPrincipled", {"BSDF": "SHADER"}, **inputs)


def mix(key, fac, first, second):
    return node(key, "ShaderNodeMixShader", {"Shader": "SHADER"}, Fac=fac, Shader=first, Shader_001=second)


def image(key, name, **properties):
    return node(key, "ShaderNodeTexImage", {"Color": "COLOR", "Alpha": "FLOAT"}, name, properties)


def math(key, operation, first, second=0.5, **properties):
    return node(
        key, "ShaderNodeMath", {"Value": "FLOAT"}, properties={"operation": operation, **properties},
        Value=first, Value_001=second,
    )  # fmt: skip
