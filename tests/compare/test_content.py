"""The hash of a .blend file's content."""

import struct

import bpy
import pytest

from addon.compare.content import Dna, blend_hash, read_blocks
from bench import reflection_scenes


def written(scene, path):
    bpy.data.libraries.write(str(path), {scene}, path_remap="NONE", compress=False)
    return path.read_bytes()


def test_struct_sizes_add_up_to_what_the_file_states(room, tmp_path):
    data = written(room, tmp_path / "a.blend")
    block = next(block for block in read_blocks(data) if block.code == b"DNA1")
    dna = Dna(data[block.start : block.start + block.length])
    for name, size in dna.structs[1:]:  # the first stands for blocks without fields
        _, _, offset, last = dna.layout(name)[-1]
        assert offset + last == size, name


def test_blocks_hold_the_scene(room, tmp_path):
    codes = {block.code for block in read_blocks(written(room, tmp_path / "a.blend"))}
    assert {b"SC", b"OB", b"ME", b"MA", b"LA", b"CA", b"WO", b"DATA", b"DNA1"} <= codes


def test_the_same_scene_written_twice_has_one_hash(room, tmp_path):
    bpy.context.view_layer.update()
    assert blend_hash(written(room, tmp_path / "a.blend")) == blend_hash(written(room, tmp_path / "b.blend"))


def test_another_order_of_memory_has_the_same_hash(room, tmp_path):
    bpy.context.view_layer.update()
    before = blend_hash(written(room, tmp_path / "a.blend"))
    for number in range(50):
        bpy.data.objects.remove(bpy.data.objects.new(f"Gone {number}", None))
    assert blend_hash(written(room, tmp_path / "b.blend")) == before


def parts_of_meshes(data):
    """The blocks of data of each mesh, in the file's order, with the bytes from the first to behind the last."""
    meshes, last = [], b""
    for block in read_blocks(data):
        last = block.code if block.code != b"DATA" else last
        if block.code == b"ME":
            meshes.append([])
        elif last == b"ME":
            meshes[-1].append(block)
    return meshes


def moved(data, block, group, address):
    """The file if `block` had stood at `address`; `group`: all blocks that may point to it."""
    data, old = bytearray(data), struct.pack("<Q", block.address)
    for start, end in [(one.start, one.start + one.length) for one in group]:
        data[start:end] = bytes(data[start:end]).replace(old, struct.pack("<Q", address))
    place = data.rindex(old, 0, block.start)
    data[place : place + 8] = struct.pack("<Q", address)
    return bytes(data)


def test_parts_of_two_meshes_may_have_stood_at_one_address(room, tmp_path):
    data = written(room, tmp_path / "a.blend")
    first, second = parts_of_meshes(data)
    pairs = [(a, b) for a in first for b in second if a.struct == b.struct and a.length == b.length]
    whole = [block for block in read_blocks(data) if block.code == b"ME"]
    for address in (pairs[0][0].address, 0x123456789ABCDEF0):
        changed = moved(data, pairs[0][1], [whole[1], *second], address)
        assert changed != data or address == pairs[0][1].address
        assert blend_hash(changed) == blend_hash(data)


def test_selection_does_not_matter_and_visibility_does(room, tmp_path):
    bpy.context.view_layer.update()
    before = blend_hash(written(room, tmp_path / "a.blend"))
    bpy.data.objects["Wall"].select_set(True)
    bpy.context.view_layer.update()
    assert blend_hash(written(room, tmp_path / "b.blend")) == before
    bpy.data.objects["Wall"].hide_render = True
    assert blend_hash(written(room, tmp_path / "c.blend")) != before


def test_own_settings_are_left_out_and_others_are_not(registered, room, tmp_path):
    room["zebra"] = 1
    before = blend_hash(written(room, tmp_path / "a.blend"))
    room.candela.samples = 3
    room.candela.seed = 4
    assert blend_hash(written(room, tmp_path / "b.blend")) == before
    room["zebra"] = 2
    assert blend_hash(written(room, tmp_path / "c.blend")) != before


def test_a_scene_built_anew_has_the_same_hash(registered, tmp_path):
    def built(name):
        reflection_scenes.make("glass ball")
        bpy.context.view_layer.update()
        return blend_hash(written(bpy.context.scene, tmp_path / name))

    assert built("a.blend") == built("b.blend")


def test_what_is_no_blend_file_is_refused():
    with pytest.raises(ValueError, match="not an uncompressed"):
        blend_hash(b"\x28\xb5\x2f\xfd" + bytes(100))
    with pytest.raises(ValueError, match="does not describe"):
        blend_hash(b"BLENDER17-01v0502" + bytes(10))
