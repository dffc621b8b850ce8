"""Trees of passes as data: sockets from declarations, running order, and sentences about what is wrong."""

from dataclasses import replace

import pytest

from addon.frame.pass_graph import FAMILY, RESULT, SUM, Link, PassGraph, PassNode, check, depths, from_plan, sockets
from addon.frame.plan import Plan, make_plan
from addon.frame.settings import Settings
from addon.frame.technique import Service, Technique, Write
from addon.techniques import REGISTRY, make_registry


class Surface(Technique):
    name, label = "surface", "Surface"
    writes = (Write("surface.position", "RGBA32F", ""), Write("surface.normal", "RGBA32F", ""))


class Shadow(Service):
    name = "shadow"


class Maps(Technique):
    name, label, fills, provides = "maps", "Maps", ("shadow",), (Shadow,)


class Volumes(Maps):
    name, label = "volumes", "Volumes"


class Lamp(Technique):
    name, label = "lamp", "Lamp"
    reads, requests = ("surface.position", "surface.normal"), (Shadow,)
    writes = (Write("radiance.diffuse", "RGBA32F", "", True),)


class Sky(Technique):
    name, label = "sky", "Sky"
    reads = ("surface.normal",)
    writes = (Write("radiance.diffuse", "RGBA32F", "", True),)


class Picture(Technique):
    name, label = "picture", "Picture"
    writes = (Write("radiance.diffuse", "RGBA32F", "", True), Write("film.combined", "RGBA32F", ""))


SMALL = (Surface, Maps, Volumes, Lamp, Sky, Picture)
SHOWN = PassNode("Output")


def planned(*techniques):
    return from_plan(Plan(tuple(technique() for technique in techniques), ()))


def shown(*techniques):
    """The tree of these techniques with its picture shown."""
    graph = planned(*techniques)
    return PassGraph((*graph.nodes, SHOWN), (*graph.links, Link("Picture", "film.combined", "Output", "Image")))


def without(graph, target, socket):
    return replace(graph, links=tuple(li for li in graph.links if (li.target, li.input) != (target, socket)))


def test_images_that_passes_hand_on_go_by_family_and_sums_run_through():
    inputs, outputs = sockets(Lamp, SMALL)
    assert [(s.name, s.kind, s.required) for s in inputs] == [
        ("shadow", "service", False), ("surface", FAMILY, True), ("radiance.diffuse", SUM, False),
    ]  # fmt: skip
    assert [(s.name, s.kind) for s in outputs] == [("radiance.diffuse", SUM)]
    (surface,) = sockets(Surface, SMALL)[1]
    assert surface.images == ("surface.position", "surface.normal")
    assert [s.kind for s in sockets(Picture, SMALL)[1]] == [SUM, RESULT]


def test_tree_of_a_plan_gives_the_plans_order_and_is_fine():
    checked = check(shown(Surface, Maps, Lamp, Sky, Picture), SMALL)
    assert checked.fine
    assert checked.order == ("surface", "maps", "lamp", "sky", "picture")


def test_sum_runs_through_all_that_add_to_it():
    links = planned(Surface, Lamp, Sky, Picture).links
    chain = [(link.source, link.target) for link in links if link.input == "radiance.diffuse"]
    assert chain == [("Lamp", "Sky"), ("Sky", "Picture")]


def test_only_what_feeds_the_output_runs():
    graph = without(shown(Surface, Lamp, Sky, Picture), "Sky", "radiance.diffuse")
    assert check(graph, SMALL).order == ("surface", "sky", "picture")
    assert check(shown(Surface, Maps, Lamp, Sky, Picture), SMALL, root="Lamp").order == ("surface", "maps", "lamp")


def test_who_reads_the_light_of_one_sample_brings_who_takes_it_up():
    class Bounce(Technique):
        name, label, reads = "bounce", "Bounce", ("radiance.diffuse",)
        writes = (Write("radiance.diffuse", "RGBA32F", "", True),)

    class Film(Picture):
        finishes = ("radiance.diffuse",)

    graph = planned(Surface, Lamp, Bounce, Film)
    registry = (Surface, Lamp, Bounce, Film)
    assert check(graph, registry, root="Lamp").order == ("surface", "lamp")
    assert check(graph, registry, root="Bounce").order == ("surface", "lamp", "bounce", "picture")


def test_muted_pass_is_left_out_and_lets_sums_through():
    graph = shown(Surface, Lamp, Sky, Picture)
    graph = replace(graph, nodes=tuple(replace(n, muted=n.name == "Sky") for n in graph.nodes))
    checked = check(graph, SMALL)
    assert checked.fine and checked.order == ("surface", "lamp", "picture")


def test_missing_input_is_a_sentence_with_the_remedy():
    checked = check(without(shown(Surface, Lamp, Picture), "Lamp", "surface"), SMALL)
    assert checked.sentences == {"Lamp": ("'Surface' has no link: it comes from Surface.",)}


def test_wrong_link_is_marked_and_not_followed():
    graph = without(shown(Surface, Maps, Lamp, Picture), "Lamp", "surface")
    wrong = Link("Maps", "shadow", "Lamp", "surface")
    checked = check(replace(graph, links=(*graph.links, wrong)), SMALL)
    assert checked.wrong_links == {wrong}
    assert "takes surface, but the link brings shadow" in checked.sentences["Lamp"][0]
    assert "has no link" in checked.sentences["Lamp"][1]


def test_circle_is_a_sentence_and_leaves_the_rest():
    graph = shown(Surface, Lamp, Sky, Picture)
    back = Link("Sky", "radiance.diffuse", "Lamp", "radiance.diffuse")
    checked = check(replace(graph, links=(*graph.links, back)), SMALL)
    assert "wait for each other: Lamp, Sky" in checked.sentences["Lamp"][0]
    assert back in checked.wrong_links
    assert checked.order[0] == "surface" and checked.order[-1] == "picture"


def test_second_technique_of_a_slot_twins_and_strangers_are_told():
    graph = shown(Surface, Maps, Volumes, Lamp, Picture)
    nodes = (*graph.nodes, PassNode("Lamp.001", "lamp"), PassNode("Old", "radiosity_1984"))
    said = check(replace(graph, nodes=nodes), SMALL).sentences
    assert said["Volumes"] == ("The shadow slot is filled by Maps; mute one of the two.",)
    assert "stands in the tree already as 'Lamp'" in said["Lamp.001"][0]
    assert "no technique 'radiosity_1984'" in said["Old"][0]


def test_links_into_nowhere_are_told():
    graph = PassGraph((PassNode("Lamp", "lamp"),), (Link("Gone", "x", "Lamp", "surface"),))
    assert "leads nowhere" in check(graph, SMALL).sentences["Lamp"][0]


def test_empty_tree_runs_nothing():
    assert check(PassGraph(), SMALL).order == ()


def test_columns_grow_along_the_links():
    column = depths(planned(Surface, Maps, Lamp, Sky, Picture))
    assert column["Surface"] == column["Maps"] == 0
    assert column["Lamp"] < column["Sky"] < column["Picture"]


@pytest.mark.parametrize("technique", REGISTRY, ids=lambda technique: technique.name)
def test_every_technique_of_candela_can_stand_in_a_tree(technique):
    inputs, outputs = sockets(technique, REGISTRY)
    for socket in (*inputs, *outputs):
        assert socket.label and socket.description
    assert outputs, "nothing could ask for it"


def test_tree_of_all_techniques_names_each_once():
    graph = planned(*REGISTRY)
    checked = check(graph, REGISTRY, root=graph.nodes[-1].name)
    assert set(checked.order) <= {technique.name for technique in make_registry()}
    assert len(checked.order) == len(set(checked.order))


def test_plan_by_tree_runs_its_techniques_only():
    registry = [technique() for technique in SMALL]
    for made in registry:
        made.skip = lambda snapshot, settings: None
    plan = make_plan(registry, None, Settings(passes=("surface", "sky", "picture"), slots={"shadow": "maps"}))
    assert [t.name for t in plan.techniques] == ["surface", "sky", "picture"]
    assert {row.reason for row in plan.skipped} == {"it is not in the pass tree"}


def test_plan_waits_for_what_is_offered():
    plan = make_plan([Lamp(), Surface(), Maps()], None, Settings())
    assert [t.name for t in plan.techniques] == ["surface", "maps", "lamp"]
