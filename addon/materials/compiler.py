"""Compiles a node graph to GLSL: one function that turns a surface point into closures.

The shader part of the tree is walked from the surface downwards with a weight: Mix Shader splits it, Add Shader hands
it on twice, a leaf adds its closure with the sum of all weights that reach it. What the sockets need is computed by
value nodes, each once, in order of dependence. Unlinked sockets become entries of the block `material_values`, in an
order that follows from topology alone, so that materials which differ in values share a program.

Kinds are converted as Blender does: colour to number by luminance, vector to number by average, number to all three
channels; a colour where a shader belongs is an emission. What the node table does not know falls back to the socket's
own constant, an unknown shader to diffuse, each with a sentence.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from . import nodes
from .compiled import Attribute, CompiledMaterial
from .estimate import Estimate, Summary, constant, image_estimate, unknown
from .graph import Graph, Input, Node
from .nodes import entry as words
from .nodes.entry import Entry
from .nodes.shader import IMPLICIT_EMISSION, UNKNOWN_SHADER
from .values import ValueBlock, glsl_number, to_kind

MAX_ATTRIBUTES = 8  # SurfacePoint.attributes in lib/closure.glsl
MAX_IMAGES = 12  # of 16 samplers that every backend has; the rest is for the programs that include the material
ESTIMATE_DEPTH = 48  # links followed to learn about a value; deeper trees are taken as unknown

IMAGE_FLAGS = {"STRAIGHT": 2, "PREMUL": 8, "CHANNEL_PACKED": 0, "NONE": 4}  # IMAGE_* in material/image.glsl
MISSING_COLOR = (1.0, 0.0, 1.0)

IMAGE_FUNCTIONS = """\
vec4 material_image{k}_texel(ivec2 size, ivec2 texel, int extension, int flags)
{{
  ivec2 at = ivec2(image_wrap(texel.x, size.x, extension), image_wrap(texel.y, size.y, extension));
  if (at.x < 0 || at.y < 0) {{
    return vec4(0.0);
  }}
  return image_associate(texelFetch(material_image{k}, at, 0), flags);
}}

void material_image{k}_sample(vec3 coordinate, int interpolation, int extension, float storage, bool alpha_used,
                           out vec3 color, out float alpha)
{{
  int flags = int(storage + 0.5);
  ivec2 size = textureSize(material_image{k}, 0);
  vec2 position = image_position(coordinate, size, extension);
  vec4 filtered;
  if (interpolation == 1) {{
    filtered = material_image{k}_texel(size, ivec2(floor(position)), extension, flags);
  }}
  else {{
    position -= vec2(0.5);
    vec2 lower = floor(position);
    vec2 share = position - lower;
    ivec2 texel = ivec2(lower);
    vec4 low = mix(material_image{k}_texel(size, texel, extension, flags),
                   material_image{k}_texel(size, texel + ivec2(1, 0), extension, flags), share.x);
    vec4 high = mix(material_image{k}_texel(size, texel + ivec2(0, 1), extension, flags),
                    material_image{k}_texel(size, texel + ivec2(1, 1), extension, flags), share.x);
    filtered = mix(low, high, share.y);
  }}
  filtered = image_finish(filtered, flags, alpha_used);
  color = filtered.rgb;
  alpha = filtered.a;
}}
"""

GLSL_TYPES = {"FLOAT": "float", "VECTOR": "vec3", "COLOR": "vec3", "INT": "float", "BOOLEAN": "float"}


def default_graph() -> Graph:
    """The material of an empty slot: diffuse, 0.8."""
    color = Input("COLOR", (0.8, 0.8, 0.8, 1.0))
    node = Node("Default", "Default", "ShaderNodeBsdfDiffuse", {"Color": color}, {"BSDF": "SHADER"})
    return Graph({"Default": node}, ("Default", "BSDF"))


def compile_material(
    name: str, graph: Graph, images: dict | None = None, notes: Sequence[tuple[str, str]] = ()
) -> CompiledMaterial:
    """Compile `graph`. `images` (Image.key -> snapshot Image) tells how pixels are stored and what they are on average;
    without it every image counts as present, linear and opaque. `notes` are the reader's sentences, handed on."""
    return _Compilation(name, graph, images, notes).result()


class _Compilation:
    """One pass over a graph; nothing of it lives longer than the call."""

    def __init__(self, name, graph: Graph, images: dict | None, notes) -> None:
        self.name, self.graph, self.images = name, graph, images
        self.fallbacks: dict[tuple[str, str], None] = dict.fromkeys(tuple(note) for note in notes)
        self.values = ValueBlock()
        self.attributes: list[Attribute] = []
        self.image_keys: list[str] = []
        self.includes: dict[str, None] = {"lib/closure.glsl": None, "lib/color.glsl": None}
        self.lines: list[str] = []
        self.outputs: dict[tuple[str, str], tuple[str, str]] = {}  # link -> GLSL variable, kind
        self.done: set[str] = set()
        self.read_outputs = {
            input.link for node in graph.nodes.values() for input in node.inputs.values() if input.link is not None
        }
        self.known_estimates: dict[tuple[str, str], Estimate] = {}

    def result(self) -> CompiledMaterial:
        summary = self._surface()
        self._unused_slots()
        glsl = self._text()
        values = self.values.array()
        kinds = ",".join(attribute.kind for attribute in self.attributes)
        identity = f"{glsl}\0{kinds}\0{len(self.image_keys)}\0{len(values)}"
        passes, emission = summary.transparency, summary.emission
        return CompiledMaterial(
            name=self.name,
            program_key=hashlib.sha256(identity.encode()).hexdigest()[:32],
            glsl=glsl,
            attributes=tuple(self.attributes),
            images=tuple(self.image_keys),
            values=values,
            transparent=bool(np.any(passes.high > 1e-5)),
            emissive=bool(np.any(emission.high > 0.0) or np.any(emission.low < 0.0)),
            emission=tuple(float(channel) for channel in emission.mean),
            opacity=float(np.clip(1.0 - passes.luminance().mean[0], 0.0, 1.0)),
            diffuse=summary.diffuse,
            glossy=summary.glossy,
            fallbacks=tuple(self.fallbacks),
        )

    def _text(self) -> str:
        includes = "".join(f'#include "{path}"\n' for path in self.includes)
        functions = "".join("\n" + IMAGE_FUNCTIONS.format(k=k) for k in range(len(self.image_keys)))
        body = "".join(f"  {line}\n" for line in self.lines)
        head = "void evaluate_material(in SurfacePoint point, inout Closures closures)"
        return f"{includes}{functions}\n{head}\n{{\n{body}}}\n"

    def _note(self, node: Node, sentence: str) -> None:
        self.fallbacks.setdefault((node.label, sentence))

    def _unused_slots(self) -> None:
        for what, link in (("Volume", self.graph.volume), ("Displacement", self.graph.displacement)):
            if link is not None and link[0] in self.graph.nodes:
                self._note(self.graph.nodes[link[0]], f"{what} of the material is not drawn.")
        if self.values.overflow:
            self.fallbacks.setdefault(
                (self.name, "The material has more sliders than fit a uniform block; the last ones recompile it.")
            )

    # Shaders: weights from the surface down.

    def _surface(self) -> Summary:
        """Emit the shader part of the tree; parents before children, so that a shared shader gets one sum of weights."""
        total = Summary()
        if not self._exists(self.graph.surface):
            return total
        weights: dict[tuple[str, str], list[tuple[str, Estimate]]] = {self.graph.surface: [("1.0", constant(1.0))]}
        for count, link in enumerate(self._shader_order(self.graph.surface)):
            incoming = weights[link]
            estimate = incoming[0][1]
            for _, more in incoming[1:]:
                estimate = estimate + more
            weight = f"w{count}"
            self.lines.append(f"float {weight} = {' + '.join(expression for expression, _ in incoming)};")
            node = self.graph.nodes[link[0]]
            if node.outputs.get(link[1]) != "SHADER":
                total += self._implicit_emission(node, link, weight).weighted(estimate)
                continue
            entry = nodes.find(node.type, node.properties)
            if entry is None or not (entry.combine or entry.summary):
                self._note(node, f"'{node.label}' is not supported yet; it is drawn as a diffuse surface.")
                entry = UNKNOWN_SHADER
            if entry.combine:
                self._combine(node, entry, weight, estimate, weights)
            else:
                total += self._leaf(node, entry, weight).weighted(estimate)
        return total

    def _exists(self, link: tuple[str, str] | None) -> bool:
        return link is not None and link[0] in self.graph.nodes

    def _shader_inputs(self, link: tuple[str, str]) -> list[tuple[str, str]]:
        """Links of the SHADER sockets of a Mix or Add Shader."""
        node = self.graph.nodes[link[0]]
        entry = nodes.find(node.type, node.properties)
        if node.outputs.get(link[1]) != "SHADER" or entry is None or not entry.combine:
            return []
        sockets = (node.inputs.get(identifier) for identifier in ("Shader", "Shader_001"))
        return [socket.link for socket in sockets if socket is not None and self._exists(socket.link)]

    def _shader_order(self, root: tuple[str, str]) -> list[tuple[str, str]]:
        """Reverse post-order of the links to shaders: every shader after all that mix it in."""
        order: list[tuple[str, str]] = []
        seen = {root}
        stack = [(root, iter(self._shader_inputs(root)))]
        while stack:
            link, children = stack[-1]
            for child in children:
                if child not in seen:
                    seen.add(child)
                    stack.append((child, iter(self._shader_inputs(child))))
                    break
            else:
                order.append(link)
                stack.pop()
        return order[::-1]

    def _combine(self, node: Node, entry: Entry, weight: str, estimate: Estimate, weights: dict) -> None:
        shares = [(weight, estimate), (weight, estimate)]
        if entry.combine == "MIX":
            socket = entry.arguments[0]
            factor = f"f{weight[1:]}"
            self._require(node, entry)
            self.lines.append(f"float {factor} = clamp({self._socket(node, socket)}, 0.0, 1.0);")
            share = self._estimate_socket(node, socket, 0).clipped()
            shares = [
                (f"{weight} * (1.0 - {factor})", estimate * share.complement()),
                (f"{weight} * {factor}", estimate * share),
            ]
        for identifier, share in zip(("Shader", "Shader_001"), shares):
            socket = node.inputs.get(identifier)
            if socket is not None and self._exists(socket.link):
                weights.setdefault(socket.link, []).append(share)

    def _leaf(self, node: Node, entry: Entry, weight: str) -> Summary:
        self._require(node, entry)
        self._include(entry)
        arguments = [self._argument(node, entry, argument) for argument in entry.arguments]
        call = ", ".join(["closures", "point", f"vec3({weight})", *arguments])
        self.lines += [f"if ({weight} > 0.0) {{", f"  {entry.function}({call});", "}"]
        self._describe(node, entry)
        return entry.summary(_SocketEstimates(self, node, entry, 0))

    def _implicit_emission(self, node: Node, link: tuple[str, str], weight: str) -> Summary:
        """A colour or number where a shader belongs."""
        emitter = Node(node.key, node.label, "", {"Color": Input("COLOR", 0.0, link)})
        return self._leaf(emitter, IMPLICIT_EMISSION, weight)

    def _describe(self, node: Node, entry: Entry) -> None:
        """The sentences of a node that is drawn otherwise than Cycles would."""
        if entry.note:
            self._note(node, entry.note)
        for approximation in entry.approximations:
            socket = node.inputs.get(approximation.socket)
            settled = node.inputs.get(approximation.unless_linked)
            if socket is None or (settled is not None and self._exists(settled.link)):
                continue
            if self._exists(socket.link) or to_kind(socket.value, socket.kind, "FLOAT") != approximation.harmless:
                self._note(node, approximation.sentence)
        for name, values, sentence in entry.setting_approximations:
            if node.properties.get(name) in values:
                self._note(node, sentence)

    # Values: what sockets are linked to, each node once.

    def _require(self, node: Node, entry: Entry) -> None:
        """Emit all value nodes that this node's sockets read, deepest first; a loop, because trees can be deep."""
        stack = self._sources(node, entry)[::-1]
        while stack:
            key = stack[-1]
            if key in self.done:
                stack.pop()
                continue
            source = self.graph.nodes[key]
            found = nodes.find(source.type, source.properties)
            missing = [] if found is None else [k for k in self._sources(source, found) if k not in self.done]
            # A node that stands on the stack already waits for this one: the reader cuts cycles, hand-made graphs may not.
            missing = [k for k in missing if k not in stack]
            if missing:
                stack += missing[::-1]
                continue
            stack.pop()
            self.done.add(key)
            self._value_node(source, found)

    def _sources(self, node: Node, entry: Entry) -> list[str]:
        keys = []
        for argument in entry.arguments:
            if isinstance(argument, words.Socket):
                socket = node.inputs.get(argument.identifier)
                if socket is not None and self._exists(socket.link):
                    keys.append(socket.link[0])
        return keys

    def _value_node(self, node: Node, entry: Entry | None) -> None:
        if entry is None or entry.combine or entry.summary or not self._settings_known(node, entry):
            if "SHADER" not in node.outputs.values():
                self._note(node, f"'{node.label}' is not supported yet; what it feeds keeps the value set there.")
            return
        number = len(self.done)
        names = {identifier: f"n{number}_{i}" for i, (identifier, _) in enumerate(entry.outputs)}
        if entry.image and not self._image_index(node):
            for identifier, kind in entry.outputs:
                value = MISSING_COLOR if kind == "COLOR" else 1.0
                self.lines.append(f"{GLSL_TYPES[kind]} {names[identifier]} = {glsl_number(value, kind)};")
                self.outputs[node.key, identifier] = names[identifier], kind
            return
        self._include(entry)
        arguments = [self._argument(node, entry, argument) for argument in entry.arguments]
        for identifier, kind in entry.outputs:
            self.lines.append(f"{GLSL_TYPES[kind]} {names[identifier]};")
            self.outputs[node.key, identifier] = names[identifier], kind
        self.lines.append(f"{self._function(node, entry)}({', '.join([*arguments, *names.values()])});")
        if node.properties.get(entry.clamp_result):
            for identifier, kind in entry.outputs:
                zero, one = glsl_number(0.0, kind), glsl_number(1.0, kind)
                self.lines.append(f"{names[identifier]} = clamp({names[identifier]}, {zero}, {one});")
        self._describe(node, entry)

    def _settings_known(self, node: Node, entry: Entry) -> bool:
        return all(node.properties.get(name, allowed[0]) in allowed for name, allowed in entry.choices.items())

    def _function(self, node: Node, entry: Entry) -> str:
        settings = {name: str(node.properties.get(name, items[0])).lower() for name, items in entry.choices.items()}
        if entry.image:
            settings["image"] = str(self.image_keys.index(node.image))
        return entry.function.format(**settings)

    def _image_index(self, node: Node) -> bool:
        """Give the node's image a sampler; False, with a sentence, where that is impossible."""
        if node.image == "" or (self.images is not None and node.image not in self.images):
            self._note(node, f"The image of '{node.label}' is missing; it is drawn pink.")
            return False
        if node.image not in self.image_keys:
            if len(self.image_keys) >= MAX_IMAGES:
                self._note(node, f"The material reads more than {MAX_IMAGES} images; '{node.label}' is drawn pink.")
                return False
            self.image_keys.append(node.image)
        return True

    def _include(self, entry: Entry) -> None:
        if entry.include:
            self.includes.setdefault(entry.include)

    # Arguments.

    def _argument(self, node: Node, entry: Entry, argument: words.Argument) -> str:
        if isinstance(argument, words.Socket):
            return self._socket(node, argument)
        if isinstance(argument, words.Expression):
            return argument.glsl
        if isinstance(argument, words.Choice):
            return str(argument.items.get(node.properties.get(argument.property), argument.missing))
        if isinstance(argument, words.Setting):
            value = node.properties.get(argument.property, argument.default)
            return self.values.add(to_kind(value, "FLOAT", "FLOAT"), "FLOAT")
        if isinstance(argument, words.Attribute):
            return self._attribute(node, argument.kind, str(node.properties.get(argument.property, "")))
        if isinstance(argument, words.Used):
            return "true" if (node.key, argument.output) in self.read_outputs else "false"
        return self.values.add(float(self._image_flags(node.image)), "FLOAT")

    def _socket(self, node: Node, socket: words.Socket) -> str:
        expression = self._socket_value(node, socket)
        if socket.clamp and (socket.clamp == "*" or node.properties.get(socket.clamp, True)):
            zero, one = glsl_number(0.0, socket.kind), glsl_number(1.0, socket.kind)
            return f"clamp({expression}, {zero}, {one})"
        return expression

    def _socket_value(self, node: Node, socket: words.Socket) -> str:
        input = node.inputs.get(socket.identifier)
        if input is not None and self._exists(input.link):
            if input.link in self.outputs:
                return convert(*self.outputs[input.link], socket.kind)
            source = self.graph.nodes[input.link[0]]
            entry = nodes.find(source.type, source.properties)
            if entry is not None and input.link[1] not in dict(entry.outputs):
                self._note(
                    source,
                    f"The output '{input.link[1]}' of '{source.label}' is not supported yet; what it feeds keeps the "
                    "value set there.",
                )
        if socket.implicit == "@UV":
            return f"vec3({self._attribute(node, 'UV', '')}.xy, 0.0)"
        if socket.implicit:
            return socket.implicit
        value, kind = (socket.default, socket.kind) if input is None else (input.value, input.kind)
        return self.values.add(to_kind(socket.default if value is None else value, kind, socket.kind), socket.kind)

    def _attribute(self, node: Node, kind: str, name: str) -> str:
        attribute = Attribute(kind, name)
        if attribute not in self.attributes:
            if len(self.attributes) >= MAX_ATTRIBUTES:
                self._note(
                    node, f"The material reads more than {MAX_ATTRIBUTES} attributes; '{node.label}' reads zeros."
                )
                return "vec4(0.0)"
            self.attributes.append(attribute)
        return f"point.attributes[{self.attributes.index(attribute)}]"

    def _image_flags(self, key: str) -> int:
        image = (self.images or {}).get(key)
        if image is None:
            return IMAGE_FLAGS["NONE"]
        return IMAGE_FLAGS.get(image.alpha_mode, 0) + (1 if image.encoding == "SRGB" else 0)

    # Estimates.

    def _estimate_socket(self, node: Node, socket: words.Socket, depth: int) -> Estimate:
        """What is known about a socket's value without running the tree."""
        input = node.inputs.get(socket.identifier)
        if input is not None and self._exists(input.link):
            if input.link in self.outputs:
                estimate = self._estimate_output(input.link, depth)
                kind = self.outputs[input.link][1]
                if socket.kind == "FLOAT" and kind != "FLOAT":
                    return estimate.luminance() if kind == "COLOR" else estimate.average()
                return estimate
            if socket.implicit:
                return unknown()
        value, kind = (socket.default, socket.kind) if input is None else (input.value, input.kind)
        return constant(to_kind(socket.default if value is None else value, kind, socket.kind))

    def _estimate_output(self, link: tuple[str, str], depth: int) -> Estimate:
        if link not in self.known_estimates:
            self.known_estimates[link] = self._new_estimate(link, depth)
        return self.known_estimates[link]

    def _new_estimate(self, link: tuple[str, str], depth: int) -> Estimate:
        node = self.graph.nodes[link[0]]
        entry = nodes.find(node.type, node.properties)
        if depth > ESTIMATE_DEPTH:
            return unknown()
        if entry.image:
            image = (self.images or {}).get(node.image)
            if image is None or image.pixels.size == 0:
                return unknown()
            return image_estimate(image, node.properties.get("extension") == "CLIP", link[1])
        if entry.estimate is None:
            return unknown()
        outputs = entry.estimate(_SocketEstimates(self, node, entry, depth + 1))
        estimate = outputs[link[1]] if link[1] in outputs else outputs["*"]
        return estimate.clipped() if node.properties.get(entry.clamp_result) else estimate


class _SocketEstimates:
    """Estimates of a node's sockets by identifier, made when asked for: images are only looked at where it matters."""

    def __init__(self, compilation: _Compilation, node: Node, entry: Entry, depth: int) -> None:
        self._compilation, self._node, self._depth = compilation, node, depth
        self._sockets = {a.identifier: a for a in entry.arguments if isinstance(a, words.Socket)}

    def __getitem__(self, identifier: str) -> Estimate:
        return self._compilation._estimate_socket(self._node, self._sockets[identifier], self._depth)


def convert(expression: str, kind: str, wanted: str) -> str:
    """GLSL that turns a value of one kind into another, as Blender does between sockets."""
    if kind == wanted or {kind, wanted} == {"VECTOR", "COLOR"}:
        return expression
    if wanted == "FLOAT":
        return f"color_luminance({expression})" if kind == "COLOR" else f"vector_average({expression})"
    return f"vec3({expression})"
