"""Settings that files of many authors contain and sample scenes do not, each against Cycles' picture."""

import pytest

SIZE = (16, 16)


def means(images, names):
    return {name: images[name].reshape(-1, images[name].shape[-1])[:, :3].mean(axis=0) for name in names}


def agree(stage, names, bounces=0, samples=64, rel=0.01):
    ours = means(stage.render(samples, SIZE, bounces=bounces), names)
    theirs = means(stage.render(4 * samples, SIZE, engine="CYCLES", bounces=bounces), names)
    for name in names:
        assert ours[name] == pytest.approx(theirs[name], rel=rel, abs=1e-6), name


def test_a_surface_without_material_is_cycles_default(stage):
    stage.rectangle((-9, -9), (9, 9))
    stage.light("POINT", (1, 1, 3))
    stage.camera_above()
    agree(stage, ("combined", "diffuse_color", "glossy_color", "diffuse_direct"))


def test_a_volume_alone_has_no_surface(stage):
    stage.floor(material=stage.diffuse(0.5))
    fog = stage.material("ShaderNodeVolumeScatter", Density=0.0)
    tree = fog.node_tree
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    scatter = next(node for node in tree.nodes if node.type == "VOLUME_SCATTER")
    tree.links.remove(tree.links[0])
    tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    stage.rectangle((-9, -9), (9, 9), 1.0, material=fog)
    stage.light("POINT", (0, 0, 3))
    stage.camera_above()
    agree(stage, ("combined", "diffuse_direct"))


@pytest.mark.slow
@pytest.mark.parametrize("limit", [0, 1024])
def test_a_light_may_be_kept_from_bouncing(stage, limit):
    stage.floor(material=stage.diffuse(0.8))
    stage.rectangle((-2, -2), (2, 2), 0.0, location=(-1.5, 0, 2), turn=(0, 1.5708, 0), material=stage.diffuse(0.8))
    stage.light("POINT", (0.5, 0, 2)).data.cycles.max_bounces = limit
    stage.camera_above()
    agree(stage, ("diffuse_direct", "combined"), bounces=4, rel=0.03)
