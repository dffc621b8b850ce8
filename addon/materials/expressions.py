"""GLSL for the value part of a tree: what the sockets of shaders read, each node computed once.

Holds everything that a program collects on the way: constants, attributes, images, includes, lines of code, sentences.

Bump mapping needs heights at neighbouring points. What feeds a height is written once more as a function of the point
and called for both neighbours; at the point itself the height is an ordinary value, shared with the rest of the tree.
"""

from __future__ import annotations

import math

from . import nodes
from .atlas import PREFIX, atlas_key, keys_of, texture_layout
from .attributes import asked_for
from .averages import EXACT, averaged_lookups
from .compiled import Attribute
from .estimate import image_estimate
from .graph import Graph, Node
from .nodes import entry as words
from .nodes.entry import Entry
from .nodes.image import FUNCTIONS, MISSING_COLOR, image_functions, tiled_functions
from .nodes.image import SOURCE as IMAGE_SOURCE
from .values import ValueBlock, glsl_number, to_kind
from .working_space import current

MAX_ATTRIBUTES = 8  # SurfacePoint.attributes in lib/closure.glsl
DEEPEST_BUMP = 3  # bump nodes within the heights of bump nodes: each level is evaluated three times
MAX_IMAGES = 12  # of 16 samplers that every backend has; the rest is for the programs that include the material

# The Texture Mapping panel of a node as the reader hands it on, where nobody has touched it.
PLAIN_MAPPING = ("POINT", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
IMAGE_FLAGS = {"STRAIGHT": 2, "PREMUL": 8, "CHANNEL_PACKED": 0, "NONE": 4}  # IMAGE_* in texture/levels.glsl
LEVELS = 16

SURFACE_HEAD = "void evaluate_material(SurfacePoint point, inout Closures closures)"
GLSL_TYPES = {"FLOAT": "float", "VECTOR": "vec3", "COLOR": "vec3"}


def convert(expression: str, kind: str, wanted: str) -> str:
    """GLSL that turns a value of one kind into another, as Blender does between sockets."""
    if kind == wanted or {kind, wanted} == {"VECTOR", "COLOR"}:
        return expression
    if wanted == "FLOAT":
        return f"color_luminance({expression})" if kind == "COLOR" else f"vector_average({expression})"
    return f"vec3({expression})"


def _working_luminance() -> str:
    """What tells the luminance of colours in the generated text, where they are no Rec. 709."""
    space = current()
    if space.usual:
        return ""
    weights = glsl_number(tuple(space.luminance), "COLOR")
    return (
        f"float working_luminance(vec3 color)\n{{\n  return dot(color, {weights});\n}}\n"
        "#define color_luminance(color) working_luminance(color)\n"
        "#define rgb_to_bw(color, result) result = working_luminance(color)\n"
    )


class _Scope:
    """One GLSL function while it grows: its lines, and what is computed in it."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.outputs: dict[tuple[str, str], tuple[str, str]] = {}  # link -> GLSL variable, kind
        self.done: set[str] = set()
        self.depth = 0  # how many functions stand in each other at the deepest of its calls


class Expressions:
    """The program text of one material while it grows."""

    def __init__(self, name: str, graph: Graph, images: dict | None, lean: bool = False) -> None:
        self.name, self.graph, self.images, self.lean = name, graph, images, lean
        self.fallbacks: dict[tuple[str, str], None] = {}
        self.values = ValueBlock()
        self.attributes: list[Attribute] = []
        # In sampler order, with the files that their functions call: of one, unless nodes of two kinds read an image.
        self.image_keys: dict[str, dict[str, None]] = {}
        self.averaging: set[str] = set()  # those of which some lookup averages
        self._sizes: dict[str, str] = {}  # GLSL that reads width and height, of those that are one image
        self.includes: dict[str, None] = {
            "material/values.glsl": None,
            "lib/closure.glsl": None,
            "lib/color.glsl": None,
        }
        self._atlas = self._shared_sampler()
        self._scopes = [_Scope()]
        self._functions: list[str] = []
        self._function_names: dict[tuple[tuple[str, str], str], str] = {}
        self._function_depths: dict[str, int] = {}
        self._constants: dict[tuple[str, words.Argument], str] = {}
        self._read_outputs = graph.read
        self._averaged = averaged_lookups(graph, self._is_opaque) if images is not None else {}

    @property
    def lines(self) -> list[str]:
        return self._scopes[-1].lines

    @property
    def outputs(self) -> dict[tuple[str, str], tuple[str, str]]:
        """What the function that grows has computed: link -> GLSL variable, kind."""
        return self._scopes[-1].outputs

    def text(self, head: str = SURFACE_HEAD) -> str:
        """The whole source: includes, the images' functions, and the function of that head."""
        if self.values.overflow:
            sentence = (
                "Not all sliders and tables of its nodes fit a uniform block; changing the last ones recompiles it."
            )
            self.fallbacks.setdefault((self.name, sentence))
        includes = self.values.text()
        includes += "".join(f'#include "{path}"\n' for path in self.includes)
        wanted = [(k, source) for k, sources in enumerate(self.image_keys.values()) for source in sources]
        keys = list(self.image_keys)
        includes += _working_luminance()
        functions = "".join("\n" + self._image_functions(keys[k], k, source) for k, source in wanted)
        functions += "".join(self._functions)
        body = "".join(f"  {line}\n" for line in self.lines)
        return f"{includes}{functions}\n{head}\n{{\n{body}}}\n"

    def _image_functions(self, key: str, k: int, source: str) -> str:
        """The lookups of sampler `k`: of an image, of each image of an atlas, or of a UDIM image's tiles."""
        if source != IMAGE_SOURCE:
            return FUNCTIONS[source].format(k=k)
        averages = key in self.averaging
        if key.startswith(PREFIX):
            sizes = [self._size(one) for one in keys_of(key)]
            return "\n".join(
                image_functions(f"{k}_{n}", f"ivec2({size[0]}, {size[1]})", corner, averages)
                for n, (corner, size) in enumerate(zip(texture_layout(sizes)[0], sizes))
            )
        tiles = self.images[key].tiles if self.images and key in self.images else ()
        if tiles:
            sizes = [tile[3:] for tile in tiles]
            places = [(*corner, *size) for corner, size in zip(texture_layout(sizes)[0], sizes)]
            return tiled_functions(k, [tile[0] for tile in tiles], places, averages)
        size = f"ivec2({self._sizes[key]} + vec2(0.5))" if key in self._sizes else f"material_image{k}_size()"
        return image_functions(k, size, None, averages)

    def _size(self, key: str) -> tuple[int, int]:
        return self.images[key].size

    def _shared_sampler(self) -> dict[str, str]:
        """The atlas for each image of those that share a sampler, the smallest ones: none where there are enough."""
        read = dict.fromkeys(
            node.image for node in self.graph.nodes.values()
            if node.type in ("ShaderNodeTexImage", "ShaderNodeTexEnvironment", "ShaderNodeTexSky") and node.image
        )  # fmt: skip
        there = [key for key in read if self.images is not None and key in self.images and not self.images[key].missing]
        if len(there) <= MAX_IMAGES:
            return {}
        skies = {node.image for node in self.graph.nodes.values() if node.type == "ShaderNodeTexSky"}
        shared = [key for key in there if not self.images[key].tiles and key not in skies]
        shared.sort(key=lambda key: (math.prod(self._size(key)), there.index(key)))
        shared = shared[: len(there) - MAX_IMAGES + 1]
        return dict.fromkeys(shared, atlas_key(shared))

    def note(self, node: Node, sentence: str) -> None:
        self.fallbacks.setdefault((node.label, sentence))

    def exists(self, link: tuple[str, str] | None) -> bool:
        return link is not None and link[0] in self.graph.nodes

    def describe(self, node: Node, entry: Entry) -> None:
        """The sentences of a node that is drawn otherwise than Cycles would."""
        if entry.note:
            self.note(node, entry.note)
        for approximation in entry.approximations:
            socket = node.inputs.get(approximation.socket)
            settled = node.inputs.get(approximation.unless_linked)
            if socket is None or (settled is not None and self.exists(settled.link)):
                continue
            value = to_kind(socket.value, socket.kind, "FLOAT")
            harmless = round(value) if approximation.harmless == "whole" else approximation.harmless
            if self.exists(socket.link) or value != harmless:
                self.note(node, approximation.sentence)
        if node.properties.get("texture_mapping", PLAIN_MAPPING) != PLAIN_MAPPING:
            self.note(node, "The node's own Texture Mapping panel is not read; use a Mapping node.")
        for output, sentence in entry.output_approximations:
            if (node.key, output) in self._read_outputs:
                self.note(node, sentence)
        for name, values, sentence in entry.setting_approximations:
            if node.properties.get(name) in values:
                self.note(node, sentence)

    def require(self, node: Node, entry: Entry) -> None:
        """Emit all value nodes that this node's sockets read."""
        self._emit(self._sources(node, entry)[::-1])

    def _emit(self, stack: list[str]) -> None:
        """Emit nodes and what they read, deepest first; a loop, because trees can be deep."""
        waiting: set[str] = set()  # for what they read
        while stack:
            key = stack[-1]
            if key in self._scopes[-1].done:
                stack.pop()
                continue
            source = self.graph.nodes[key]
            found = nodes.find(source.type, source.properties)
            missing = (
                [] if found is None else [k for k in self._sources(source, found) if k not in self._scopes[-1].done]
            )
            # A node that waits is read by itself: the reader cuts cycles, hand-made graphs may not.
            missing = [k for k in missing if k not in waiting and k != key]
            if missing:
                waiting.add(key)
                stack += missing[::-1]
                continue
            stack.pop()
            waiting.discard(key)
            self._scopes[-1].done.add(key)
            self._value_node(source, found)

    def _sources(self, node: Node, entry: Entry) -> list[str]:
        keys = []
        for argument in entry.arguments:
            if isinstance(argument, (words.Socket, words.Heights)):
                socket = node.inputs.get(argument.identifier)
                if socket is not None and self.exists(socket.link):
                    keys.append(socket.link[0])
        return keys

    def _value_node(self, node: Node, entry: Entry | None) -> None:
        if entry is None or entry.combine or entry.summary:
            if "SHADER" not in node.outputs.values():
                self.note(node, f"'{node.label}' is not supported yet; what it feeds keeps the value set there.")
            return
        number = len(self._scopes[-1].done)
        names = {identifier: f"n{number}_{i}" for i, (identifier, _) in enumerate(entry.outputs)}
        if entry.image and not self._image_index(node, entry):
            for identifier, kind in entry.outputs:
                value = MISSING_COLOR if kind == "COLOR" else 1.0
                self.lines.append(f"{GLSL_TYPES[kind]} {names[identifier]} = {glsl_number(value, kind)};")
                self.outputs[node.key, identifier] = names[identifier], kind
            return
        self.include(entry)
        arguments = [self.argument(node, entry, argument) for argument in entry.arguments]
        for identifier, kind in entry.outputs:
            self.lines.append(f"{GLSL_TYPES[kind]} {names[identifier]};")
            self.outputs[node.key, identifier] = names[identifier], kind
        call = f"{self._function(node, entry)}({', '.join([*arguments, *names.values()])});"
        self.lines.extend(self._averaging(node, entry, arguments, list(names.values())) or [call])
        if node.properties.get(entry.clamp_result):
            for identifier, kind in entry.outputs:
                zero, one = glsl_number(0.0, kind), glsl_number(1.0, kind)
                self.lines.append(f"{names[identifier]} = clamp({names[identifier]}, {zero}, {one});")
        self.describe(node, entry)

    def _function(self, node: Node, entry: Entry) -> str:
        settings = {name: str(node.properties.get(name, items[0])).lower() for name, items in entry.choices.items()}
        if entry.image:
            shared = self._atlas.get(node.image)
            settings["image"] = str(list(self.image_keys).index(shared or node.image))
            if shared:
                settings["image"] += f"_{keys_of(shared).index(node.image)}"
        return entry.function.format(**settings)

    def _image_index(self, node: Node, entry: Entry) -> bool:
        """Give the node's image a sampler; False, with a sentence, where that is impossible."""
        if node.image == "" or (self.images is not None and node.image not in self.images):
            self.note(node, f"The image of '{node.label}' is missing; it is drawn pink.")
            return False
        if self.images is not None and self.images[node.image].missing:
            return False  # whoever read the scene has said so
        key = self._atlas.get(node.image, node.image)
        if key not in self.image_keys:
            if len(self.image_keys) >= MAX_IMAGES:
                self.note(node, f"The material reads more than {MAX_IMAGES} images; '{node.label}' is drawn pink.")
                return False
            self.image_keys[key] = {}
            if self.images is not None and entry.include == IMAGE_SOURCE and not key.startswith(PREFIX):
                self._sizes[key] = f"{self.values.add((*self._size(key), 0.0), 'VECTOR')}.xy"
        self.image_keys[key].setdefault(entry.include)
        return True

    def include(self, entry: Entry) -> None:
        if entry.include:
            self.includes.setdefault(entry.include)

    def argument(self, node: Node, entry: Entry, argument: words.Argument) -> str:
        if isinstance(argument, words.Socket):
            return self.socket(node, argument)
        if isinstance(argument, words.Heights):
            return self._heights(node, argument)
        if isinstance(argument, words.Expression):
            return argument.glsl
        if isinstance(argument, words.Choice):
            return str(argument.items.get(node.properties.get(argument.property), argument.missing))
        if isinstance(argument, words.Setting):
            value = node.properties.get(argument.property, argument.default)
            return self._constant(node, argument, to_kind(value, "FLOAT", "FLOAT"), "FLOAT")
        if isinstance(argument, words.Attribute):
            if argument.output and (node.key, argument.output) not in self._read_outputs:
                return "vec4(0.0)"
            name = argument.name or str(node.properties.get(argument.property, ""))
            read = self.attribute(node, argument.kind, name)
            if not argument.slopes:
                return read
            along = (read.replace(".attributes[", f".attributes_{axis}[") for axis in ("dx", "dy"))
            return ", ".join((read, *along))
        if isinstance(argument, words.Used):
            return "true" if (node.key, argument.output) in self._read_outputs else "false"
        if isinstance(argument, words.Rows):
            if (node.key, argument) not in self._constants:
                rows = argument.rows(node.properties.get(argument.property))
                self._constants[node.key, argument] = f"{self.values.add_rows(rows)}, {len(rows)}"
            return self._constants[node.key, argument]
        return self._constant(node, argument, float(self._image_flags(node.image)), "FLOAT")

    def _constant(self, node: Node, argument: words.Argument, value, kind: str) -> str:
        """The node's constant in the block, the same one wherever the node is written."""
        if (node.key, argument) not in self._constants:
            self._constants[node.key, argument] = self.values.add(value, kind)
        return self._constants[node.key, argument]

    def _heights(self, node: Node, heights: words.Heights) -> str:
        given = node.inputs.get(heights.identifier)
        here = self.socket(node, words.Socket(heights.identifier, "FLOAT"))
        if given is None or given.link not in self.outputs:
            return f"{here}, {here}, {here}"
        name = self.function(given.link, "FLOAT")
        depth = self._function_depths[name]
        if depth > DEEPEST_BUMP:
            self.note(node, "Bump within the heights of bump is left out from the fourth level on.")
            return f"{here}, {here}, {here}"
        self._scopes[-1].depth = max(self._scopes[-1].depth, depth)
        width = self.socket(node, heights.width)
        x = f"{name}(surface_point_moved(point, vec2({width}, 0.0)))"
        y = f"{name}(surface_point_moved(point, vec2(0.0, {width})))"
        return f"{here}, {x}, {y}"

    def function(self, link: tuple[str, str], kind: str) -> str:
        """The name of a GLSL function of the surface point that computes what `link` leads to."""
        if (link, kind) not in self._function_names:
            self._scopes.append(_Scope())
            self._emit([link[0]])
            value = convert(*self.outputs[link], kind) if link in self.outputs else glsl_number(0.0, kind)
            name = f"tree{len(self._functions)}"
            body = "".join(f"  {line}\n" for line in (*self.lines, f"return {value};"))
            self._function_depths[name] = self._scopes.pop().depth + 1
            self._functions.append(f"\n{GLSL_TYPES[kind]} {name}(SurfacePoint point)\n{{\n{body}}}\n")
            self._function_names[link, kind] = name
        return self._function_names[link, kind]

    def call_it(self, function: str, head: str) -> None:
        """Give one of the functions of `function` a name that does not depend on the tree."""
        self.returns(f"{function}(point)", head)

    def returns(self, value: str, head: str) -> None:
        """A function of the surface point of that name whose value is an expression."""
        self._functions.append(f"\n{head}(SurfacePoint point)\n{{\n  return {value};\n}}\n")

    def socket(self, node: Node, socket: words.Socket) -> str:
        expression = self._socket_value(node, socket)
        if socket.clamp and (socket.clamp == "*" or node.properties.get(socket.clamp, True)):
            zero, one = glsl_number(0.0, socket.kind), glsl_number(1.0, socket.kind)
            return f"clamp({expression}, {zero}, {one})"
        return expression

    def _socket_value(self, node: Node, socket: words.Socket) -> str:
        given = node.inputs.get(socket.identifier)
        if given is not None and self.exists(given.link):
            if given.link in self.outputs:
                return convert(*self.outputs[given.link], socket.kind)
            source = self.graph.nodes[given.link[0]]
            entry = nodes.find(source.type, source.properties)
            if entry is not None and given.link[1] not in dict(entry.outputs):
                self.note(
                    source,
                    f"The output '{given.link[1]}' of '{source.label}' is not supported yet; what it feeds keeps the "
                    "value set there.",
                )
        if not asked_for(node, socket):
            return glsl_number(0.0, socket.kind)
        implicit = "" if given is not None and given.given else socket.implicit
        if implicit == "@RADIAL":
            self.includes["material/input.glsl"] = None
            generated = self.attribute(node, "GENERATED", "")
            return f"surface_tangent(point, vec3(0.5 - {generated}.y, {generated}.x - 0.5, 0.0))"
        if implicit == "@UV":
            return f"vec3({self.attribute(node, 'UV', '')}.xy, 0.0)"
        if implicit == "@GENERATED":
            return f"{self.attribute(node, 'GENERATED', '')}.xyz"
        if implicit:
            return implicit
        value, kind = (socket.default, socket.kind) if given is None else (given.value, given.kind)
        constant = to_kind(socket.default if value is None else value, kind, socket.kind)
        if self.lean and socket.layer and constant == 0.0:
            return glsl_number(0.0, socket.kind)
        return self._constant(node, socket, constant, socket.kind)

    def attribute(self, node: Node, kind: str, name: str) -> str:
        attribute = Attribute(kind, name)
        if attribute not in self.attributes:
            if len(self.attributes) >= MAX_ATTRIBUTES:
                self.note(
                    node, f"The material reads more than {MAX_ATTRIBUTES} attributes; '{node.label}' reads zeros."
                )
                return "vec4(0.0)"
            self.attributes.append(attribute)
        return f"point.attributes[{self.attributes.index(attribute)}]"

    def _averaging(self, node: Node, entry: Entry, arguments: list[str], outputs: list[str]) -> list[str]:
        """The call of a lookup that averages where a program knows what its pixels see. Functions of heights do not."""
        if node.key not in self._averaged or len(self._scopes) > 1:
            return []
        own = self._atlas.get(node.image, node.image)
        self.averaging.add(own)
        given = node.inputs.get("Vector")
        if given is not None and self.exists(given.link):
            name = self.function(given.link, "VECTOR")
            steps = [
                f"{name}(surface_point_moved(point, vec2({step}))) - {arguments[0]}"
                for step in ("1.0, 0.0", "0.0, 1.0")
            ]
        else:
            uv = self.attribute(node, "UV", "")
            steps = [uv.replace("attributes", f"attributes_{way}") for way in ("dx", "dy")]
        how = self._averaged[node.key]
        pixels = "FOOTPRINT_OF_EXACT" if how.kind == EXACT else "FOOTPRINT_OF_FIRST"
        along_x, along_y = (f"({step}).xy" for step in steps)
        footprint = f"image_footprint(point, {along_x}, {along_y}, {pixels})"
        function, at_point = self._function(node, entry), ", ".join([*arguments, *outputs])
        mean = [f"{function}_mean({', '.join([*arguments, footprint, *outputs])});"]
        if not how.alpha:
            alpha = outputs[1]
            mean = [f"{function}({at_point});", f"float {alpha}_here = {alpha};", *mean, f"{alpha} = {alpha}_here;"]
        return [f"#ifdef {pixels}", *mean, "#else", f"{function}({at_point});", "#endif"]

    def _is_opaque(self, node: Node) -> bool:
        image = self.images.get(node.image)
        if image is None or image.alpha_mode in ("NONE", "CHANNEL_PACKED") or image.encoding != "SRGB":
            return True
        return bool(image_estimate(image, False, "Alpha").low[0] >= 1.0)

    def _image_flags(self, key: str) -> int:
        image = (self.images or {}).get(key)
        return IMAGE_FLAGS["NONE"] if image is None else image_flags(image) + LEVELS * self._has_levels(key)

    def _has_levels(self, key: str) -> bool:
        """Whether an image, or the atlas that holds it, leaves room for levels in its texture."""
        sizes: list[tuple[int, int]] = []
        for one in keys_of(self._atlas.get(key, key)):
            tiles = self.images[one].tiles
            sizes += [tile[3:] for tile in tiles] if tiles else [self._size(one)]
        return texture_layout(sizes)[2]


def image_flags(image) -> int:
    """How an image's pixels are stored, see IMAGE_* in shaders/texture/levels.glsl."""
    return IMAGE_FLAGS.get(image.alpha_mode, 0) + (1 if image.encoding == "SRGB" else 0)
