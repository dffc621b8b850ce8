"""A tree of passes as data: which techniques an artist has wired up, checked, and put in running order.

The sockets of a pass are not written down anywhere: they follow from what the techniques declare.

- What a technique reads comes in, and what others read of it goes out, by family ("surface"): one link carries all
  images of a family, since passes hand them on together.
- A sum that several techniques add to (Write.accumulates) runs through all of them: each has it coming in, optional,
  and going out. The last one in the row holds the whole sum.
- What one technique offers to others while it runs (Technique.provides and requests) goes by a link of its own.
- What nobody reads is a result, with one socket for each image; so are pictures (film.…), which later passes may take.

A tree may be wrong in any way: circles, missing links, links between things that do not fit. Nothing here raises;
`check` says in sentences what is wrong with which pass, and orders what is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from .plan import Plan
from .technique import Technique

SUM, FAMILY, SERVICE, RESULT = "sum", "family", "service", "result"
PICTURES = "film"  # the family whose images are results each, also where a later pass takes one up


def in_words(name: str) -> str:
    """An image, family or service in words: "Diffuse direct" of radiance.diffuse_direct, "Color diffuse" of
    color.diffuse."""
    family, _, rest = name.partition(".")
    words = rest if family in ("radiance", "film") and rest else f"{family} {rest}"
    return words.replace("_", " ").strip().capitalize()


@dataclass(frozen=True)
class Socket:
    """One thing that a pass takes or gives. Links connect sockets of the same name."""

    name: str  # image, family of images, or service
    kind: str  # SUM, FAMILY, SERVICE or RESULT
    images: tuple[str, ...] = ()  # of the frame, that go through it
    required: bool = False
    description: str = ""

    @property
    def label(self) -> str:
        """In words."""
        return in_words(self.name)


@dataclass(frozen=True)
class PassNode:
    """A node of the tree; without a technique it only shows pictures, and takes any image."""

    name: str  # unique in the tree
    technique: str = ""
    muted: bool = False  # left out; sums go through it unchanged


@dataclass(frozen=True)
class Link:
    """From an output of one node to an input of another."""

    source: str
    output: str
    target: str
    input: str


@dataclass(frozen=True)
class PassGraph:
    """Nodes in the order in which they were added, and links."""

    nodes: tuple[PassNode, ...] = ()
    links: tuple[Link, ...] = ()

    def node(self, name: str) -> PassNode | None:
        return next((node for node in self.nodes if node.name == name), None)


@dataclass(frozen=True)
class Checked:
    """What `check` found: techniques in running order, sentences by node, and the links that do not fit."""

    order: tuple[str, ...]
    sentences: dict[str, tuple[str, ...]]
    wrong_links: frozenset[Link]

    @property
    def fine(self) -> bool:
        return not self.sentences and not self.wrong_links


@cache
def sockets(technique: type[Technique], registry: tuple[type[Technique], ...]):
    """(inputs, outputs) of a technique's node, as tuples of Socket."""
    others = [other for other in registry if other is not technique]
    read = {name for other in others for name in other.reads}
    added = {write.name for other in others for write in other.writes if write.accumulates}
    inputs: dict[str, Socket] = {}
    outputs: dict[str, Socket] = {}
    for name in (service.name for service in technique.requests):
        inputs[name] = Socket(name, SERVICE, description=f"What a technique that provides '{name}' brings; optional")
    for name in technique.reads:
        family = name.partition(".")[0]
        if family == PICTURES:
            inputs[name] = Socket(name, RESULT, (name,), True, "The picture that the pass works on")
            continue
        known = inputs[family].images if family in inputs else ()
        inputs[family] = Socket(family, FAMILY, (*known, name), True, f"Images that the pass reads: {family}.…")
    for name in (service.name for service in technique.provides):
        outputs[name] = Socket(name, SERVICE, description="What other techniques may ask for while they run")
    for write in technique.writes:
        family = write.name.partition(".")[0]
        if write.accumulates and write.name in added:
            inputs[write.name] = Socket(write.name, SUM, (write.name,), False, "The sum so far; optional")
            outputs[write.name] = Socket(write.name, SUM, (write.name,), False, write.description)
        elif write.name in read and family != PICTURES:
            known = outputs[family].images if family in outputs else ()
            outputs[family] = Socket(family, FAMILY, (*known, write.name), False, f"Images of the family {family}")
        else:
            outputs[write.name] = Socket(write.name, RESULT, (write.name,), False, write.description)
    return tuple(inputs.values()), tuple(outputs.values())


def check(graph: PassGraph, registry: Sequence[type[Technique]], root: str = "") -> Checked:
    """What feeds the node `root` (by default: everything that is shown), in running order, and what is wrong with it.

    Passes that have no output at all count always, and passes in a circle never.
    """
    registry = tuple(registry)
    by_name = {technique.name: technique for technique in registry}
    wrong, sentences = set(), {}

    def say(node: str, sentence: str) -> None:
        sentences[node] = (*sentences.get(node, ()), sentence)

    good: list[Link] = []
    for link in graph.links:
        sentence = _misfit(graph, link, by_name, registry)
        if sentence:
            wrong.add(link)
            say(link.target, sentence)
        else:
            good.append(link)
    for circle in _circles(graph, good):
        said = ", ".join(circle)
        for name in circle:
            say(name, f"These passes wait for each other: {said}. Cut one of their links.")
        inside = {link for link in good if link.source in circle and link.target in circle}
        wrong |= inside
        good = [link for link in good if link not in inside]

    seen: dict[str, str] = {}
    for node in graph.nodes:
        technique = by_name.get(node.technique)
        if node.technique and technique is None:
            say(node.name, f"Candela has no technique '{node.technique}'; this pass is left out.")
        if technique is None or node.muted:
            continue
        if technique.name in seen:
            say(node.name, f"{technique.label} stands in the tree already as '{seen[technique.name]}'; it runs once.")
        seen.setdefault(technique.name, node.name)
        for slot in technique.fills:
            rival = next((other for other in seen if other != technique.name and slot in by_name[other].fills), None)
            if rival:
                say(node.name, f"The {slot} slot is filled by {by_name[rival].label}; mute one of the two.")
        for socket in sockets(technique, registry)[0]:
            if socket.required and not any(link.target == node.name and link.input == socket.name for link in good):
                say(node.name, f"'{socket.label}' has no link: it comes from {_writers(socket, registry)}.")
    names = _upstream(graph, good, [root] if root else [node.name for node in graph.nodes if not node.technique])
    names |= {
        node.name
        for node in graph.nodes
        if node.technique in by_name and not sockets(by_name[node.technique], registry)[1]
    }
    # Who reads the light of one sample needs who takes it up after each.
    read = {image for node in graph.nodes if node.name in names and node.technique in by_name
            for image in by_name[node.technique].reads}  # fmt: skip
    names |= {
        node.name for node in graph.nodes if node.technique in by_name and read & {*by_name[node.technique].finishes}
    }
    ordered = [graph.node(name) for name in _sorted(graph, good) if name in names]
    running = [node.technique for node in ordered if node.technique in by_name and not node.muted]
    return Checked(tuple(dict.fromkeys(running)), sentences, frozenset(wrong))


def from_plan(plan: Plan) -> PassGraph:
    """The tree of what was planned: each input is linked to the last pass before it that has such an output."""
    registry = tuple(type(technique) for technique in plan.techniques)
    nodes, links, latest = [], [], {}
    for technique in registry:
        nodes.append(PassNode(technique.label, technique.name))
        inputs, outputs = sockets(technique, registry)
        for socket in inputs:
            if socket.name in latest:
                links.append(Link(latest[socket.name], socket.name, technique.label, socket.name))
        for socket in outputs:
            latest[socket.name] = technique.label
    return PassGraph(tuple(nodes), tuple(links))


def depths(graph: PassGraph) -> dict[str, int]:
    """How many links lie at most before each node: its column in a drawing of the tree."""
    depth = {node.name: 0 for node in graph.nodes}
    for name in _sorted(graph, graph.links):
        for link in graph.links:
            if link.target == name:
                depth[name] = max(depth[name], depth[link.source] + 1)
    return depth


def _misfit(graph: PassGraph, link: Link, by_name: dict, registry) -> str:
    """Why a link cannot be followed; empty if it can."""
    source, target = graph.node(link.source), graph.node(link.target)
    if target is None or source is None:
        return "A link of this pass leads nowhere."
    giver, taker = by_name.get(source.technique), by_name.get(target.technique)
    if giver is None or taker is None:
        return ""  # what shows pictures takes any; an unknown technique is told of by itself
    output = next((s for s in sockets(giver, registry)[1] if s.name == link.output), None)
    wanted = next((s for s in sockets(taker, registry)[0] if s.name == link.input), None)
    if output is None or wanted is None:
        return "A link of this pass ends at a socket that the technique no longer has."
    if output.name != wanted.name:
        return f"'{wanted.label}' takes {wanted.label.lower()}, but the link brings {output.label.lower()}."
    return ""


def _writers(socket: Socket, registry) -> str:
    found = [t.label for t in registry if any(write.name in socket.images for write in t.writes)]
    return " or ".join(dict.fromkeys(found)) or "a technique that is not installed"


def _upstream(graph: PassGraph, links: list[Link], roots: list[str]) -> set[str]:
    found, left = set(), list(roots)
    while left:
        name = left.pop()
        if name not in found:
            found.add(name)
            left += [link.source for link in links if link.target == name]
    return found


def _sorted(graph: PassGraph, links: Sequence[Link]) -> list[str]:
    """Names of all nodes that are in no circle, sources first, else in the tree's own order."""
    left, done = [node.name for node in graph.nodes], []
    while left:
        ready = next(
            (
                name
                for name in left
                if all(link.source in done or link.source not in left for link in links if link.target == name)
            ),
            None,
        )
        if ready is None:
            return done
        left.remove(ready)
        done.append(ready)
    return done


def _circles(graph: PassGraph, links: list[Link]) -> list[tuple[str, ...]]:
    """Groups of nodes that reach each other."""
    reach = {
        node.name: _upstream(graph, links, [link.source for link in links if link.target == node.name])
        for node in graph.nodes
    }
    circles = []
    for node in graph.nodes:
        name = node.name
        if name in reach[name] and not any(name in circle for circle in circles):
            circles.append(tuple(o.name for o in graph.nodes if o.name in reach[name] and name in reach[o.name]))
    return circles
