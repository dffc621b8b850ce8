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

from . import gloss, nodes
from .attributes import surroundings_of
from .bounds import Bounds
from .compiled import CompiledMaterial
from .estimate import Estimate, Summary, constant
from .expressions import Expressions
from .graph import Graph, Input, Node
from .nodes.entry import Entry, Socket
from .nodes.shader import IMPLICIT_EMISSION, THIN, UNKNOWN_SHADER
from .values import glsl_number
from .volume import Medium, medium_of

BUMP_FILTER_WIDTH = 0.1  # pixels between the heights that a displacement's normal is made of, as in Cycles


def default_graph() -> Graph:
    """The material of an empty slot: diffuse, 0.8."""
    color = Input("COLOR", (0.8, 0.8, 0.8, 1.0))
    node = Node("Default", "Default", "ShaderNodeBsdfDiffuse", {"Color": color}, {"BSDF": "SHADER"})
    return Graph({"Default": node}, ("Default", "BSDF"))


def compile_material(
    name: str, graph: Graph, images: dict | None = None, notes: Sequence[tuple[str, str]] = (), lean: bool = False
) -> CompiledMaterial:
    """Compile `graph`. `images` (Image.key -> snapshot Image) tells how pixels are stored and what they are on average;
    without it every image counts as present, linear and opaque. `notes` are the reader's sentences, handed on. `lean`:
    layers of weight 0 are left out of the program, which is then another one when a slider leaves 0."""
    return _Compilation(name, graph, images, notes, lean).result()


class _Compilation:
    """One pass over a graph; nothing of it lives longer than the call."""

    def __init__(
        self, name: str, graph: Graph, images: dict | None, notes: Sequence[tuple[str, str]], lean: bool
    ) -> None:
        self.graph = graph
        self.code = Expressions(name, graph, images, lean)
        self.code.fallbacks.update(dict.fromkeys(tuple(note) for note in notes))
        self.bounds = Bounds(self.code)
        self._leaves: dict[tuple[str, str], Summary] = {}
        self._color, self._reflecting = np.zeros(3), 0.0  # of the leaves that reflect: colours by weight, weights

    def result(self) -> CompiledMaterial:
        self._displacement()
        summary = self._surface()
        self._aovs()
        medium = medium_of(self.graph)
        self._unused_slots(medium, summary.glass is not None)
        code, glsl, values = self.code, self.code.text(), self.code.values.array()
        kinds = ",".join(attribute.kind for attribute in code.attributes)
        identity = f"{glsl}\0{kinds}\0{len(code.image_keys)}\0{len(values)}"
        passes, emission = summary.transparency, summary.emission
        transparent = bool(np.any(passes.high > 1e-5))
        emissive = not np.all((emission.high <= 0.0) & (emission.low >= 0.0))  # not known: it may be
        shining = tuple(float(channel) for channel in emission.mean)
        opacity = float(np.clip(1.0 - passes.luminance().mean[0], 0.0, 1.0))
        return CompiledMaterial(
            name=code.name,
            program_key=hashlib.sha256(identity.encode()).hexdigest()[:32],
            glsl=glsl,
            attributes=tuple(code.attributes),
            images=tuple(code.image_keys),
            values=values,
            transparent=transparent,
            casts_stochastically=transparent and (self.graph.transparent_shadow or summary.glass is not None),
            emissive=emissive,
            emission=shining,
            emission_behind=shining,
            opacity=opacity,
            uneven=transparent and not passes.constant,
            uneven_emission=not emission.constant,
            reads=surroundings_of(self.graph),
            diffuse=summary.diffuse,
            glossy=summary.glossy,
            soft=summary.soft,
            tinted=summary.tinted,
            tint=_tint_of(passes.mean),
            glows=transparent and emissive,
            added=transparent and self._adds_lobes_to_transparency(),
            coated=gloss.coated(self.graph),
            glass=summary.glass,
            medium=medium,
            scatter=summary.scatter,
            fallbacks=tuple(code.fallbacks),
            aovs=tuple((name, kind) for name, kind, _ in self.graph.aovs),
            displaces=code.exists(self.graph.displacement),
            along_normal=self._lifts_along_normal(),
            averaging=frozenset(code.averaging),
            color=tuple(np.clip(np.nan_to_num(self._color / max(self._reflecting, 1e-6)), 0.0, 1.0).tolist()),
        )

    def _unused_slots(self, medium: Medium | None, glass: bool) -> None:
        if medium is not None and glass:
            node = self.graph.nodes[self.graph.volume[0]]
            text = "Of the volume of the material only what it absorbs is drawn, as if it were the same everywhere."
            absorbs_alone = medium.even and not (medium.scattering.any() or medium.emission.any() or medium.glow)
            if not absorbs_alone:
                self.code.note(node, text)

    def _displacement(self) -> None:
        """The surface keeps its place, but every shader sees the normal that the displaced surface would have."""
        link = self.graph.displacement
        if not self.code.exists(link):
            return
        self.code.includes.setdefault("material/bump.glsl")
        name = self.code.function(link, "VECTOR")
        width = glsl_number(BUMP_FILTER_WIDTH, "FLOAT")
        x = f"{name}(surface_point_moved(point, vec2({width}, 0.0)))"
        y = f"{name}(surface_point_moved(point, vec2(0.0, {width})))"
        self.code.lines.append("#if !defined(DISPLACED) && !defined(OWN_SURFACE)")
        self.code.lines.append(f"point.normal = displaced_normal(point, {width}, {name}(point), {x}, {y});")
        self.code.lines.append("closures.base_normal = point.normal;")
        self.code.lines.append("#elif defined(UNDISPLACED_PLACE)")
        self.code.lines.append("SurfacePoint before = point_before(point, UNDISPLACED_PLACE, UNDISPLACED_NORMAL);")
        x, y = x.replace("(point,", "(before,"), y.replace("(point,", "(before,")
        self.code.lines.append(f"point.normal = displaced_normal(before, {width}, {name}(before), {x}, {y});")
        self.code.lines.append("closures.base_normal = point.normal;")
        self.code.lines.append("#endif")
        self.code.call_it(name, "vec3 material_displacement")

    def _aovs(self) -> None:
        """A function of the surface point for each of the graph's AOVs, which only programs that draw them call."""
        for number, (name, kind, socket) in enumerate(self.graph.aovs):
            wanted = "FLOAT" if kind == "VALUE" else "COLOR"
            node = Node(f"AOV {name}", name, "ShaderNodeOutputAOV", {"Value": socket})
            if kind in ("HIT", "DISTANCE"):
                continue
            if kind == "VECTOR":
                value = f"{self.code.attribute(node, 'MOTION_BEFORE', '')}.xyz"
                after = f"{self.code.attribute(node, 'MOTION_AFTER', '')}.xyz"
                self.code.returns(after, f"vec3 material_aov{number}_after")
            elif kind == "UV":
                value = f"{self.code.attribute(node, 'UV_PASS', '')}.xyz"
            elif self.code.exists(socket.link):
                value = f"{self.code.function(socket.link, wanted)}(point)"
            else:
                value = self.code.socket(node, Socket("Value", wanted))
            self.code.returns(value, f"{'float' if wanted == 'FLOAT' else 'vec3'} material_aov{number}")

    def _lifts_along_normal(self) -> bool:
        link = self.graph.displacement
        node = self.graph.nodes[link[0]] if self.code.exists(link) else None
        if node is None or node.type != "ShaderNodeDisplacement":
            return False
        normal = node.inputs.get("Normal")
        return normal is None or not self.code.exists(normal.link)

    def _surface(self) -> Summary:
        """Emit the shaders, parents before children, so that a shared shader gets the sum of all weights at once."""
        total = Summary()
        if not self.code.exists(self.graph.surface):
            return total
        weights: dict[tuple[str, str], list[tuple[str, Estimate]]] = {self.graph.surface: [("1.0", constant(1.0))]}
        for count, link in enumerate(self._shader_order(self.graph.surface)):
            incoming = weights[link]
            estimate = incoming[0][1]
            for _, more in incoming[1:]:
                estimate = estimate + more
            weight = f"w{count}"
            self.code.lines.append(f"float {weight} = {' + '.join(expression for expression, _ in incoming)};")
            node = self.graph.nodes[link[0]]
            if node.outputs.get(link[1]) != "SHADER":
                total += self._implicit_emission(node, link, weight).weighted(estimate)
                continue
            entry = nodes.find(node.type, node.properties)
            if entry is None or not (entry.combine or entry.summary):
                self.code.note(node, f"'{node.label}' is not supported yet; it is drawn as a diffuse surface.")
                entry = UNKNOWN_SHADER
            if entry.combine:
                self._combine(node, entry, weight, estimate, weights)
            else:
                self._leaves[link] = self._leaf(node, entry, weight)
                self._add_color(node, entry, float(np.clip(estimate.mean.mean(), 0.0, 1.0)))
                total += self._leaves[link].weighted(estimate)
        return total

    def _adds_lobes_to_transparency(self) -> bool:
        """Whether an Add Shader has what lets light pass on one side and a lobe on the other."""
        if not self.code.exists(self.graph.surface):
            return False
        found: dict[tuple[str, str], tuple[bool, bool]] = {}  # whether there is either below a link
        for link in self._shader_order(self.graph.surface)[::-1]:
            below = [found[child] for child in self._shader_inputs(link)]
            if link in self._leaves:
                leaf = self._leaves[link]
                lobes = leaf.diffuse or leaf.glossy or leaf.soft
                below = [(bool(np.any(leaf.transparency.high > 0.0)), lobes)]
            passing, lobes = (any(one[k] for one in below) for k in (0, 1))
            node = self.graph.nodes[link[0]]
            entry = nodes.find(node.type, node.properties)
            if entry is not None and entry.combine == "ADD" and len(below) == 2:
                (passes_a, lobes_a), (passes_b, lobes_b) = below
                if (passes_a and lobes_b) or (passes_b and lobes_a):
                    return True
            found[link] = passing, lobes
        return False

    def _shader_inputs(self, link: tuple[str, str]) -> list[tuple[str, str]]:
        """Links of the SHADER sockets of a Mix or Add Shader."""
        node = self.graph.nodes[link[0]]
        entry = nodes.find(node.type, node.properties)
        if node.outputs.get(link[1]) != "SHADER" or entry is None or not entry.combine:
            return []
        sockets = (node.inputs.get(identifier) for identifier in ("Shader", "Shader_001"))
        return [socket.link for socket in sockets if socket is not None and self.code.exists(socket.link)]

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
            self.code.require(node, entry)
            self.code.lines.append(f"float {factor} = clamp({self.code.socket(node, socket)}, 0.0, 1.0);")
            share = self.bounds.socket(node, socket, 0).clipped()
            shares = [
                (f"{weight} * (1.0 - {factor})", estimate * share.complement()),
                (f"{weight} * {factor}", estimate * share),
            ]
        for identifier, share in zip(("Shader", "Shader_001"), shares):
            socket = node.inputs.get(identifier)
            if socket is not None and self.code.exists(socket.link):
                weights.setdefault(socket.link, []).append(share)

    def _leaf(self, node: Node, entry: Entry, weight: str) -> Summary:
        self.code.require(node, entry)
        self.code.include(entry)
        arguments = [self.code.argument(node, entry, argument) for argument in entry.arguments]
        call = ", ".join(["closures", "point", f"vec3({weight})", *arguments])
        self.code.lines.extend((f"if ({weight} > 0.0) {{", f"  {entry.function}({call});", "}"))
        self.code.describe(node, entry)
        return entry.summary(self.bounds.sockets(node, entry))

    def _add_color(self, node: Node, entry: Entry, weight: float) -> None:
        """Count the mean colour of a leaf of this mean weight, if it reflects."""
        if node.type == "ShaderNodeBsdfTransparent" or ("Bsdf" not in node.type and node.type not in REFLECTING):
            return
        named = {argument.identifier for argument in entry.arguments if isinstance(argument, Socket)}
        name = next((name for name in ("Base Color", "Color") if name in named), None)
        color = self.bounds.sockets(node, entry)[name].mean if name else np.full(3, 0.8)
        self._color += weight * color
        self._reflecting += weight

    def _implicit_emission(self, node: Node, link: tuple[str, str], weight: str) -> Summary:
        """A colour or number where a shader belongs."""
        emitter = Node(node.key, node.label, "", {"Color": Input("COLOR", 0.0, link)})
        return self._leaf(emitter, IMPLICIT_EMISSION, weight)


EMITTERS = {
    "ShaderNodeEmission": ("Strength", "Color"),
    "ShaderNodeBsdfPrincipled": ("Emission Strength", "Emission Color"),
}


def _tint_of(passing: np.ndarray) -> tuple[float, float, float]:
    """Mean colour of what passes, over the chance of a ray to pass; grey where nothing does."""
    chance = 1.0 - float(np.clip(1.0 - constant(passing).luminance().mean[0], 0.0, 1.0))
    if chance <= 1e-4 or not np.isfinite(passing).all():
        return 1.0, 1.0, 1.0
    return tuple(float(np.clip(channel / chance, 0.0, 10.0)) for channel in passing)


def may_emit(graph: Graph) -> bool:
    """Whether some node of the graph can emit: cheap, by its sockets alone. A black constant cannot."""
    for node in graph.nodes.values():
        if node.type in ("ShaderNodeBackground", "ShaderNodeEeveeSpecular"):
            return True
        if node.type in EMITTERS and all(_not_black(node.inputs.get(name)) for name in EMITTERS[node.type]):
            return True
    return False


def may_reflect(graph: Graph) -> bool:
    """Whether some node of the graph can scatter light that falls on it: cheap, by the nodes' types alone."""
    return any(
        ("Bsdf" in node.type and node.type != "ShaderNodeBsdfTransparent") or node.type in REFLECTING
        for node in graph.nodes.values()
    )


# Whose lobes are none of microfacets.
DULL = (
    "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTranslucent", "ShaderNodeBsdfTransparent", "ShaderNodeBsdfSheen",
    "ShaderNodeBsdfToon", "ShaderNodeBsdfHair", "ShaderNodeBsdfHairPrincipled", "ShaderNodeBsdfRayPortal",
)  # fmt: skip


def may_mirror(graph: Graph) -> bool:
    """Whether some node of the graph can have a lobe of microfacets: cheap, by the nodes' types alone."""
    return any(
        ("Bsdf" in node.type and node.type not in DULL) or node.type == "ShaderNodeEeveeSpecular"
        for node in graph.nodes.values()
    )


def may_tint(graph: Graph) -> bool:
    """Whether some node of the graph can colour what passes straight through: cheap, by its sockets alone."""
    return any(
        ((node.type == "ShaderNodeBsdfTransparent" or node.type in REFRACTING) and _not_grey(node.inputs.get("Color")))
        or (
            node.type == "ShaderNodeBsdfPrincipled"
            and _not_black(node.inputs.get("Transmission Weight"))
            and _not_grey(node.inputs.get("Base Color"))
        )
        for node in graph.nodes.values()
    )


# Whose lobes are none of microfacets, beside what is diffuse (shaders/lib/soft_lobe.glsl).
SOFT = (
    "ShaderNodeBsdfSheen", "ShaderNodeBsdfTranslucent", "ShaderNodeBsdfHairPrincipled", "ShaderNodeBsdfToon",
)  # fmt: skip


def may_be_soft(graph: Graph) -> bool:
    """Whether some node of the graph can have a lobe of soft_lobe.glsl: cheap, by its sockets alone."""
    return any(
        node.type in SOFT
        or (
            node.type == "ShaderNodeBsdfPrincipled"
            and (
                _not_black(node.inputs.get("Sheen Weight"))
                or (_may_be_thin(node.inputs.get("Thin Wall")) and _not_black(node.inputs.get("Subsurface Weight")))
            )
        )
        for node in graph.nodes.values()
    )


REFLECTING = ("ShaderNodeSubsurfaceScattering", "ShaderNodeEeveeSpecular")  # beside those named Bsdf
REFRACTING = ("ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction")


def may_refract(graph: Graph) -> bool:
    """Whether some node of the graph can bend light: cheap, by its sockets alone. Thin walls let it pass straight."""
    return any(
        node.type in REFRACTING
        or (
            node.type == "ShaderNodeBsdfPrincipled"
            and _not_black(node.inputs.get("Transmission Weight"))
            and not _is_thin(node.inputs.get("Thin Wall"))
        )
        for node in graph.nodes.values()
    )


def _is_thin(socket) -> bool:
    """Whether a Principled BSDF is a thin wall for certain, from where shader_principled takes it for one."""
    return socket is not None and socket.link is None and float(socket.value) > THIN


def _may_be_thin(socket) -> bool:
    return socket is not None and (socket.link is not None or float(socket.value) > THIN)


def least_roughness(graph: Graph) -> float:
    """Of the graph's lobes that mirror, at least: by sockets alone, 0 where one is linked or a node is not known here;
    infinite where no lobe mirrors."""
    found = [np.inf]
    for node in graph.nodes.values():
        if node.type in MATT or not ("Bsdf" in node.type or "Eevee" in node.type):
            continue
        found.append(_own_value(node.inputs.get("Roughness")))
        if node.type == "ShaderNodeBsdfPrincipled" and _not_black(node.inputs.get("Coat Weight")):
            found.append(_own_value(node.inputs.get("Coat Roughness")))
        if node.type == "ShaderNodeEeveeSpecular":
            found.append(0.0)  # its clear coat
    return min(found)


MATT = {"ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTransparent", "ShaderNodeBsdfTranslucent"}


def _own_value(socket) -> float:
    unknown = socket is None or socket.link is not None or not isinstance(socket.value, (int, float))
    return 0.0 if unknown else float(socket.value)


def may_scatter(graph: Graph) -> bool:
    """Whether some node of the graph can scatter light below the surface: cheap, by its sockets alone."""
    return any(
        node.type == "ShaderNodeSubsurfaceScattering"
        or (node.type == "ShaderNodeBsdfPrincipled" and _not_black(node.inputs.get("Subsurface Weight")))
        for node in graph.nodes.values()
    )


def may_walk(graph: Graph) -> bool:
    """Whether light may scatter below the surface by another method than Christensen-Burley: cheap, as the above."""
    methods = {"ShaderNodeSubsurfaceScattering": "falloff", "ShaderNodeBsdfPrincipled": "subsurface_method"}
    return may_scatter(graph) and any(
        node.properties.get(methods[node.type], "RANDOM_WALK") != "BURLEY"
        for node in graph.nodes.values()
        if node.type in methods
    )


def _not_grey(socket) -> bool:
    if socket is None or socket.link is not None:
        return socket is not None
    return isinstance(socket.value, tuple) and len(set(socket.value[:3])) > 1


def _not_black(socket) -> bool:
    if socket is None or socket.link is not None:
        return socket is not None
    value = socket.value
    return any(value[:3]) if isinstance(value, tuple) else bool(value)
