"""What a picture lacks by design, in words for its ledger: for the scene's size, or where systems meet."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from ..materials import gloss
from ..materials.compiled import CompiledMaterial
from ..materials.nodes.inputs import ROUND
from ..scene import acceleration
from ..snapshot.panorama import bends_lines
from ..snapshot.scene import Note, Snapshot
from .plan import Plan
from .settings import Settings

# By slot, or by name of a technique without one: what is missing where nobody brings it.
BRINGS = {
    "indirect": "bounced light",
    "reflection": "what gloss shows of lights and of the world",
    "shaded_reflections": "what mirrors and glass show of the scene",
    "transmission": "how glass bends light",
    "volume": "light in volumes",
    "caustics": "light of caustics",
    "volume_caustics": "light of caustics in volumes",
    "subsurface": "light below surfaces",
    "reflection_editing": "what edits of reflections change",
    "temporal_glare": "the glare of the eye",
}

COLOURED = ("instant_radiosity", "multires_radiosity", "clustered_visibility")  # whose rays take colours of layers
EVEN = ("implicit_visibility", "ssdo")  # for which gloss sends light on as dull surfaces do
DIRECTED = "micro_rendering"  # sends what gloss throws of lamps by its direction
GEM = 2.0  # index of refraction, from which on most directions are mirrored totally
GEM_INTERFACES = 24  # crossings that such glass needs
WIDE = 0.45  # roughness from which a lobe is about as wide as those of paths (shaders/indirect/albedo.glsl)
NO_GRASS = ("no material", "it is not in the pass tree")  # how reasons begin that nobody need hear


def notes_of(
    plan: Plan, snapshot: Snapshot, settings: Settings, materials: Sequence[CompiledMaterial]
) -> tuple[Note, ...]:
    """None for most scenes. `materials`: the snapshot's, compiled."""
    tinted = (one for k, one in enumerate(materials) if one.tinted and k in snapshot.used_materials)
    used = (one for k, one in enumerate(materials) if k in snapshot.used_materials)
    return (
        *_for_size(plan, snapshot), *_where_systems_meet(plan, settings), *_bounces_past(plan, tinted),
        *_kept_inside(plan, settings, used), *_thrown_wide(plan, snapshot, settings, materials),
        *_flat_fibres(plan, snapshot),
    )  # fmt: skip


def _kept_inside(plan: Plan, settings: Settings, used: Iterable[CompiledMaterial]) -> Iterator[Note]:
    """Gems, out of which much light comes after more total reflections than are followed."""
    rays = next((technique for technique in plan.techniques if technique.name == "traced_refraction"), None)
    if rays is None or (followed := settings.get(rays, "interfaces")) >= GEM_INTERFACES:
        return
    for one in used:
        if one.glass is not None and one.glass.share > 0.0 and one.glass.ior >= GEM:
            inside = f"with an index of refraction of {one.glass.ior:.2f} it reflects light inside more often than"
            text = f"{inside} {rays.label} follows ({followed} Interfaces), so it looks too dark: set Interfaces to 32."
            yield Note(f"Material '{one.name}'", text, one.name)


def _thrown_wide(
    plan: Plan, snapshot: Snapshot, settings: Settings, materials: Sequence[CompiledMaterial]
) -> Iterator[Note]:
    """Gloss that is narrower than the lobes of paths and no caustic: what it throws onto surfaces is blurred."""
    if plan.filled.get("indirect") in (None, DIRECTED) or settings.bounces <= 0:
        return
    least = gloss.THROWS if "caustics" in plan.filled else 0.0
    names = []
    for number in sorted(snapshot.used_materials):
        graph = snapshot.materials[number].graph
        narrow = [rough for rough in gloss.mirrors(graph) if least < rough] + list(gloss.polish(graph))
        if min(narrow, default=1.0) < WIDE:
            names.append(f"'{materials[number].name}'")
    if names:
        told = _together(names if len(names) < 4 else [*names[:2], f"{len(names) - 2} other materials"])
        evenly = plan.filled["indirect"] in EVEN
        spread = "evenly, as by dull surfaces" if evenly else "as by a roughness of 0.5"
        text = f"light that other surfaces get from the gloss of {told} is spread {spread}: lamps' reflections there"
        thrown = f" Metals of roughness {gloss.THROWS:g} or less throw caustics." if least else ""
        yield Note("Gloss", f"{text} are softer.{thrown}")


def _flat_fibres(plan: Plan, snapshot: Snapshot) -> Iterator[Note]:
    """Principled Hair on meshes in the world's light: its narrow lobes meet directions that all pixels share by chance.
    Strands show all angles in a few pixels, so that what one gets too much another lacks."""
    if not plan.runs("environment_light"):
        return
    edges = {key: mesh.colors[ROUND] for key, mesh in snapshot.meshes.items() if ROUND in mesh.colors}
    flat = {key for key, edge in edges.items() if not edge[:, 3].any()}  # strands have a number of sides there
    shown = {slot for one in snapshot.instances if one.mesh in flat for slot in one.materials}
    for material in (snapshot.materials[slot] for slot in sorted(shown)):
        for node in material.graph.nodes.values():
            if node.type == "ShaderNodeBsdfHairPrincipled":
                text = (
                    "where Principled Hair on a mesh is flat, the world's light on it is up to 40 % too bright or too "
                    "dark, also in many samples. Use hair curves, or lamps."
                )
                yield Note(f"Material '{material.name}'", text, material.name, node.label)


def _bounces_past(plan: Plan, tinted: Iterable[CompiledMaterial]) -> Iterator[Note]:
    """Where nothing counts the colours that rays of bounced light pass."""
    for one in tinted if "indirect" in plan.filled else ():
        if one.emissive or plan.filled["indirect"] not in COLOURED:  # rays know one colour of a surface
            text = (
                "its coloured transparency colours light that comes straight; bounced light passes it as through grey."
            )
            yield Note(f"Material '{one.name}'", text, one.name)


def _for_size(plan: Plan, snapshot: Snapshot) -> Iterator[Note]:
    """What the scene has too many triangles for, and what a panorama lacks."""
    bent = bends_lines(snapshot)
    if missing := _missing(plan, bent):
        yield Note("Camera", f"{bent}: {missing} missing from the picture.")
    too_many = acceleration.too_many(snapshot)
    for reason in (too_many, acceleration.too_many_copies(snapshot)):
        if missing := _missing(plan, reason):
            text = f"{reason}: {missing} missing from the picture. "
            yield Note("Scene", text + "Give meshes fewer faces, or use copies of one mesh in place of many.")
        names = {row.name for row in plan.skipped if row.reason == reason}
        if too_many is not None and "instant_radiosity" in names and "indirect" in plan.filled:
            yield Note("Scene", f"{reason}: bounced light is missing where it comes from what the camera does not see.")


def _missing(plan: Plan, reason: str | None) -> str:
    """What nobody brings since its techniques were skipped for this reason, with its verb; empty for nothing."""
    rows = [row for row in plan.skipped if reason is not None and row.reason == reason and row.slot not in plan.filled]
    names = list(dict.fromkeys(BRINGS[row.slot or row.name] for row in rows if (row.slot or row.name) in BRINGS))
    return f"{_together(names)} {'are' if len(names) > 1 else 'is'}" if names else ""


def _where_systems_meet(plan: Plan, settings: Settings) -> Iterator[Note]:
    row = next((row for row in plan.skipped if row.name == "grass" and not row.reason.startswith(NO_GRASS)), None)
    if row is not None:
        yield Note("Grass", f"it is missing: {row.reason}.")
    if not plan.runs("shaded_reflections"):
        return
    if plan.runs("airlight") and settings.bounces > 0:
        text = "surfaces that mirrors and glass show lack the light that volumes scatter onto them."
        yield Note("Volumes", text)
    if plan.runs("volume_caustics"):
        yield Note("Volumes", "mirrors and glass do not show the beams that glass and mirrors throw into volumes.")
    if plan.runs("grass"):
        yield Note("Grass", "mirrors, glass and bounced light meet the ground; the blades are missing there.")


def _together(words: list[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
