"""The panels: made from the declarations, shown among Blender's own, and gone without a trace."""

import contextlib
from types import SimpleNamespace

import bpy
import pytest

from addon import engine
from addon.frame import ledger
from addon.frame.technique import SCENE, identifier
from addon.snapshot.scene import Note
from addon.techniques import REGISTRY
from addon.techniques.denoise import Denoise
from addon.ui import ENGINE, blender_panels, notes, panels, scoped_panels, technique_groups
from addon.ui.pass_tree import TREE
from addon.ui.passes import PASSES, render_metadata, wanted_passes
from addon.ui.properties import _SMALL as SMALL
from addon.ui.properties import GROUPS, precision_of, settings_of, slots, titled


class Layout:
    """Stands in for a UILayout: takes every call and lists what is shown."""

    def __init__(self, shown=None):
        self.shown = [] if shown is None else shown

    def prop(self, data, name, **_):
        assert name in data.bl_rna.properties, f"{data.bl_rna.identifier} has no property {name}"
        self.shown.append(name)

    def label(self, text="", **_):
        self.shown.append(text)

    def operator(self, name, **_):
        self.shown.append(name)
        return SimpleNamespace()

    def separator(self, **_):
        pass

    def row(self, **_):
        return Layout(self.shown)

    column = row


class Context:
    """What the panels ask of a context."""

    def __init__(self, **more):
        self.scene = bpy.context.scene
        self.view_layer = bpy.context.view_layer
        self.engine = ENGINE
        self.preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))  # 0 in background mode
        self.region = SimpleNamespace(width=400)
        for name, value in more.items():
            setattr(self, name, value)


def drawn(panel, **more):
    """Everything that a panel shows."""
    layout = Layout()
    panel.draw(SimpleNamespace(layout=layout), Context(**more))
    return layout.shown


@pytest.fixture
def scene(registered, empty_scene):
    empty_scene.render.engine = ENGINE
    return empty_scene


@pytest.fixture
def published():
    """Sets the last frame's ledger, and takes it back."""
    before = ledger.latest()
    yield ledger.publish
    ledger.publish(before)


def test_every_slot_and_parameter_has_a_place(scene):
    shown = drawn(panels.CANDELA_RENDER_PT_techniques)
    for group in technique_groups.GROUPS:
        shown += drawn(getattr(bpy.types, f"CANDELA_RENDER_PT_group_{group.name}"))
    for technique in REGISTRY:
        if technique.params_of(SCENE):
            shown += drawn(getattr(bpy.types, f"CANDELA_RENDER_PT_{technique.name}"))
    others = scene.render, getattr(scene, "cycles", None)  # settings of Blender's, in the panel of the film
    shown = [name for name in shown if not any(hasattr(other, name) for other in others)]
    assert sorted(shown) == sorted(
        ["pass_tree", "use_denoise", "use_viewport_denoise"]
        + [f"slot_{slot}" for slot in slots()]
        + [identifier(t.name, p.name) for t in REGISTRY for p in t.params_of(SCENE)]
    )


def of_an_artist(shows_expert=False):
    """A context whose preferences show settings for experts, or not."""
    own = SimpleNamespace(preferences=SimpleNamespace(show_expert=shows_expert))
    return {"preferences": SimpleNamespace(system=SimpleNamespace(ui_scale=1.0), addons={"addon": own})}


def test_half_of_the_parameters_are_for_experts(scene):
    made = {t: getattr(bpy.types, f"CANDELA_RENDER_PT_{t.name}") for t in REGISTRY if t.params_of(SCENE)}
    everything = [name for panel in made.values() for name in drawn(panel, **of_an_artist(True))]
    few = [name for panel in made.values() for name in drawn(panel, **of_an_artist())]
    assert set(few) < set(everything) and 0.4 < len(few) / len(everything) < 0.65
    assert not made[next(t for t in made if t.name == "accumulated_maps")].poll(Context(**of_an_artist()))


def test_what_the_last_picture_did_without_says_why(scene, published):
    published(ledger.Ledger([ledger.Row("vssm", "Variance", ledger.SKIPPED, "no light has a size")]))
    assert any("no light has a size" in text for text in drawn(bpy.types.CANDELA_RENDER_PT_vssm))


def test_groups_stand_in_the_order_of_an_artists_work(scene):
    order = [panel.bl_label for panel in panels._CLASSES if getattr(panel, "bl_parent_id", "") == ""]
    labels = [group.label for group in technique_groups.GROUPS]
    assert [label for label in order if label in labels] == labels
    assert order.index("Sampling") < order.index(labels[0]) < order.index("Film") < order.index("Performance")


def test_parameters_are_those_of_the_techniques_in_question(scene):
    """With Auto, of all; with a technique in the slot, of none of its rivals."""

    def shown():
        made = {t: getattr(bpy.types, f"CANDELA_RENDER_PT_{t.name}") for t in REGISTRY if t.params_of(SCENE)}
        return {technique for technique, panel in made.items() if panel.poll(Context())}

    assert shown() == {technique for technique in REGISTRY if technique.params_of(SCENE)}
    scene.candela.slot_shadow = "vssm"
    assert all(technique.name == "vssm" for technique in shown() if "shadow" in technique.fills)
    assert {
        technique for technique in REGISTRY if technique.params_of(SCENE) and "shadow" not in technique.fills
    } <= shown()


def test_all_passes_can_be_chosen_and_are_wanted_then(scene):
    layer = bpy.context.view_layer
    assert drawn(panels.CANDELA_VIEWLAYER_PT_passes) == [render_pass.switch.split(".")[-1] for render_pass in PASSES]
    for render_pass in PASSES:
        owner, _, switch = render_pass.switch.rpartition(".")
        setattr(getattr(layer, owner) if owner else layer, switch, True)
    assert wanted_passes(layer) == list(PASSES)


def test_frame_panel_shows_states_times_and_reasons(scene, published):
    rows = [
        ledger.Row("surfaces", "Surfaces", ledger.RAN, milliseconds=12.34),
        ledger.Row("direct", "Direct light", ledger.RAN, milliseconds=2500.0),
        ledger.Row("glossy", "Traced glossy", ledger.SKIPPED, "no material is glossy"),
    ]
    published(ledger.Ledger(rows, {"sync": 0.02, "passes": 2.6}, samples=16))
    text = " ".join(drawn(panels.CANDELA_RENDER_PT_frame))
    for part in ("16 samples", "sync 20.0 ms", "12.3 ms", "2.5 s"):
        assert part in text
    assert "no material is glossy" not in text  # folded away, so that nothing is buried under it
    assert panels.CANDELA_RENDER_PT_frame_skipped.poll(Context())
    assert "DEFAULT_CLOSED" in panels.CANDELA_RENDER_PT_frame_skipped.bl_options
    text = " ".join(drawn(panels.CANDELA_RENDER_PT_frame_skipped))
    assert "skipped" in text and "no material is glossy" in text


def test_warnings_come_first_and_by_weight(scene, published):
    """Before all other panels, with their number in the header; what is missing before what differs a little."""
    slight, missing = Note("Material 'A'", "The thin film is approximated."), Note("Object 'B'", "smoke is not drawn.")
    published(ledger.Ledger(notes=(slight, missing)))
    shown = [text for text in drawn(panels.CANDELA_RENDER_PT_frame_notes) if "'" in text]
    assert "smoke" in shown[0] and "thin film" in shown[1]
    layout = Layout()
    panels.CANDELA_RENDER_PT_frame_notes.draw_header(SimpleNamespace(layout=layout), Context())
    assert layout.shown == ["2"]
    own = [panel for panel in panels._CLASSES if issubclass(panel, bpy.types.Panel) and panel.bl_context == "render"]
    assert own[0] is panels.CANDELA_RENDER_PT_frame_notes


def test_icons_of_materials_leave_the_last_picture_alone(scene, published):
    from addon import engine

    assert not engine.session(scene, "preview").renderer.publishes
    assert engine.session(scene, "final").renderer.publishes


def test_unregistering_leaves_the_extensions_own_panels_their_engine(registered):
    """They are registered again with the same classes when the extension is enabled once more."""
    blender_panels.withdraw(ENGINE)
    try:
        assert panels.CANDELA_RENDER_PT_sampling.poll(Context())
        assert all(ENGINE in made.COMPAT_ENGINES for made in panels._CLASSES if hasattr(made, "COMPAT_ENGINES"))
    finally:
        blender_panels.show(ENGINE)


# Settings that the snapshot reads (addon/snapshot), by the context of the panels that must hold them.
READ = {
    "data": (
        *("use_dof", "focus_distance", "focus_object", "aperture_fstop", "aperture_blades", "aperture_rotation"),
        *("aperture_ratio", "lens", "ortho_scale", "shift_x", "shift_y", "sensor_fit", "sensor_width", "clip_start"),
        *("clip_end", "energy", "exposure", "use_temperature", "normalize", "use_soft_falloff", "shadow_soft_size"),
        *("spot_size", "spot_blend", "shape", "size_y", "spread", "angle", "use_shadow"),
    ),
    "world": ("lightgroup", "mist_settings", "Surface", "Volume", "cycles_visibility"),
    "material": ("pass_index", "Volume", "Displacement", "Surface", "use_transparent_shadow"),
    "object": (
        *("pass_index", "color", "is_holdout", "shadow_terminator_geometry_offset", "visible_transmission"),
        *("visible_volume_scatter", "visible_camera", "receiver_collection", "blocker_collection", "lightgroup"),
        "is_shadow_catcher",
    ),
    "render": (
        *("filter_size", "film_transparent", "film_transparent_glass", "film_transparent_roughness", "film_exposure"),
        *("use_simplify", "use_motion_blur", "motion_blur_position", "motion_blur_shutter"),
        *("motion_blur_shutter_curve", "use_persistent_data", "preview_pixel_size"),
    ),
    "output": ("resolution_x", "use_border", "pixel_aspect_x"),
    "view_layer": (
        *("material_override", "use_solid", "use_strand", "use_pass_mist", "samples", "aovs", "pass_alpha_threshold"),
        *("use_pass_cryptomatte_object", "pass_cryptomatte_depth", "lightgroups", "use_pass_uv"),
        "denoising_store_passes",
    ),
    "particle": ("root_radius", "tip_radius", "radius_scale", "use_close_tip"),
}  # fmt: skip


@pytest.mark.parametrize("context", READ)
def test_every_setting_that_is_read_stands_in_some_panel(registered, context):
    import inspect

    text = ""
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", None)
        where = getattr(panel, "bl_context", "")
        if where != context or (engines is not None and ENGINE not in engines):
            continue
        for part in panel.__mro__:
            if part.__module__ != "bpy_types" and part is not object:
                with contextlib.suppress(OSError, TypeError):
                    text += inspect.getsource(part)
    text += " ".join(switch.switch for switch in PASSES) if context == "view_layer" else ""
    missing = [name for name in READ[context] if name not in text]
    assert not missing


def test_frame_panel_before_the_first_render(scene, published):
    published(None)
    assert drawn(panels.CANDELA_RENDER_PT_frame) == ["Nothing was rendered yet."]
    assert not panels.CANDELA_RENDER_PT_frame_notes.poll(Context())


def test_warnings_stand_with_a_button_for_what_can_be_selected(scene, published):
    about_material = Note("Material 'Glass'", "node 'Glass BSDF' is not supported.", "Glass", "Glass BSDF")
    about_scene = Note("Image 'gone.png'", "its file is missing.")
    published(ledger.Ledger(bad_pixels=3, notes=(about_material, about_scene)))
    assert panels.CANDELA_RENDER_PT_frame_notes.poll(Context())
    shown = drawn(panels.CANDELA_RENDER_PT_frame_notes)
    assert shown.count("candela.select_culprit") == 1
    assert "3 values were not finite" in " ".join(shown)


def test_many_warnings_are_counted(scene, published):
    published(ledger.Ledger(notes=tuple(Note(f"Object '{k}'", "is strange.") for k in range(30))))
    shown = drawn(panels.CANDELA_RENDER_PT_frame_notes)
    assert shown.count("candela.select_culprit") == panels.MOST_NOTES
    assert shown[-1] == f"and {30 - panels.MOST_NOTES} more"


@pytest.mark.parametrize(
    ("note", "target"),
    [
        (Note("Material 'A'", "…", material="A"), ("MATERIAL", "A")),
        (Note("Object 'it's'", "…"), ("OBJECT", "it's")),
        (Note("Light 'Key'", "…"), ("OBJECT", "Key")),
        (Note("Camera 'Camera'", "…"), ("OBJECT", "Camera")),
        (Note("World 'Sky'", "…"), ("WORLD", "Sky")),
        (Note("Image 'a.png'", "…"), ("", "")),
    ],
)
def test_note_says_what_it_is_about(note, target):
    assert notes.target(note) == target


def test_culprit_is_selected(scene):
    mesh = bpy.data.meshes.new("mesh")
    first, second = (bpy.data.objects.new(name, mesh if name == "second" else None) for name in ("first", "second"))
    for made in (first, second):
        scene.collection.objects.link(made)
    for name in ("Plain", "Glass"):
        mesh.materials.append(bpy.data.materials.new(name))
    assert bpy.ops.candela.select_culprit(kind="OBJECT", name="first") == {"FINISHED"}
    assert bpy.context.view_layer.objects.active == first
    assert bpy.ops.candela.select_culprit(kind="MATERIAL", name="Glass") == {"FINISHED"}
    assert bpy.context.view_layer.objects.active == second
    assert second.select_get() and not first.select_get()
    assert second.active_material.name == "Glass"
    assert bpy.ops.candela.select_culprit(kind="OBJECT", name="nobody") == {"CANCELLED"}


def test_light_panels_show_what_the_snapshot_reads(scene):
    area, point = bpy.data.lights.new("area", "AREA"), bpy.data.lights.new("point", "POINT")
    assert panels.CANDELA_LIGHT_PT_beam_shape.poll(Context(light=area))
    assert not panels.CANDELA_LIGHT_PT_beam_shape.poll(Context(light=point))
    assert drawn(panels.CANDELA_LIGHT_PT_beam_shape, light=area) == ["spread"]
    assert drawn(panels.CANDELA_LIGHT_PT_shadow, light=point) == ["use_shadow"]


def test_panels_are_for_candela_only(scene):
    assert panels.CANDELA_RENDER_PT_sampling.poll(Context())
    assert not panels.CANDELA_RENDER_PT_sampling.poll(Context(engine="CYCLES"))


def compatible():
    return {
        panel.__name__: frozenset(panel.COMPAT_ENGINES)
        for panel in bpy.types.Panel.__subclasses__()
        if hasattr(panel, "COMPAT_ENGINES") and not panel.__name__.startswith("CANDELA_")
    }


def test_blenders_panels_are_shown_and_left_as_they_were(registered):
    shown = compatible()
    with_candela = {name for name, engines in shown.items() if ENGINE in engines}
    assert {
        "RENDER_PT_color_management", "RENDER_PT_format", "DATA_PT_lens", "EEVEE_MATERIAL_PT_surface",
        "EEVEE_WORLD_PT_surface", "DATA_PT_EEVEE_light", "MATERIAL_PT_preview",
    } <= with_candela  # fmt: skip
    assert not {name for name in with_candela if "lightprobe" in name or name == "DATA_PT_light"}
    assert {name for name in shown if "freestyle" in name and shown[name]} <= with_candela  # Blender itself draws lines
    blender_panels.withdraw(ENGINE)
    try:
        assert compatible() == {name: engines - {ENGINE} for name, engines in shown.items()}
    finally:
        blender_panels.show(ENGINE)
    assert compatible() == shown


def test_every_setting_has_a_tooltip_and_can_be_keyframed(scene):
    for declared in scene.candela.bl_rna.properties:
        if declared.identifier in ("rna_type", "name"):
            continue
        assert declared.description, declared.identifier
        if declared.type != "POINTER":
            assert declared.is_animatable, declared.identifier
    scene.candela.keyframe_insert("samples", frame=1)
    scene.candela.samples = 7
    scene.candela.keyframe_insert("samples", frame=9)
    scene.frame_set(9)
    assert scene.candela.samples == 7


def test_labels_are_in_title_case_and_items_say_what_they_are(scene):
    groups = [scene.candela.bl_rna, *(group.bl_rna for _, group in GROUPS.values())]
    for declared in (one for group in groups for one in group.properties if one.identifier != "rna_type"):
        words = declared.name.split(" ")
        assert all(word[:1].isupper() or not word[:1].isalpha() or word in SMALL for word in words), declared.name
        if declared.type == "ENUM":
            for item in declared.enum_items:
                assert item.description, (declared.identifier, item.identifier)
        if declared.type == "FLOAT" and not declared.is_array and declared.default:
            assert round(declared.default, declared.precision) > 0.0, declared.identifier  # not shown as zero


def test_a_label_is_titled_as_blenders_own():
    assert titled("Lights per sample") == "Lights per Sample"
    assert titled("of what is seen") == "Of What Is Seen"
    assert [precision_of(value) for value in (0.0, 1.0, 0.02, 0.001)] == [3, 3, 3, 5]


def test_every_slot_can_be_switched_off(scene):
    for slot in slots():
        assert "OFF" in [item.identifier for item in scene.candela.bl_rna.properties[f"slot_{slot}"].enum_items]


def test_denoising_is_switched_apart_for_renders_and_the_viewport(scene):
    strength = lambda viewport: settings_of(scene, viewport).get(Denoise(), "strength")  # noqa: E731
    assert strength(False) == strength(True) == 1.0
    scene.candela.use_denoise = False
    assert (strength(False), strength(True)) == (0.0, 1.0)
    scene.candela.use_denoise, scene.candela.use_viewport_denoise = True, False
    assert (strength(False), strength(True)) == (1.0, 0.0)


def test_bounces_are_limited_by_kind_in_one_panel_and_simplify_stands_below(scene):
    assert drawn(panels.CANDELA_RENDER_PT_light_paths)[0] == "bounces"
    assert len(drawn(panels.CANDELA_RENDER_PT_light_paths)) >= 4
    order = [panel.__name__ for panel in panels._CLASSES]
    assert order.index("CANDELA_RENDER_PT_sampling") < order.index("CANDELA_RENDER_PT_simplify")
    assert ENGINE not in bpy.types.RENDER_PT_simplify.COMPAT_ENGINES
    shown = drawn(panels.CANDELA_RENDER_PT_simplify)
    assert {"simplify_subdivision", "simplify_subdivision_render"} <= set(shown)


def test_a_setting_that_a_script_changes_is_a_change_of_the_scene(scene):
    """So that the viewport draws it; a button's change is one anyway."""
    tree = bpy.data.node_groups.new("Passes", TREE)
    settings, told = scene.candela, []

    def note(scene, depsgraph):
        told.extend(update.id.original for update in depsgraph.updates)

    bpy.app.handlers.depsgraph_update_post.append(note)
    try:
        for declared in settings.bl_rna.properties:
            if declared.identifier in ("rna_type", "name"):
                continue
            bpy.context.view_layer.update()
            told.clear()
            value = tree if declared.type == "POINTER" else getattr(settings, declared.identifier)
            setattr(settings, declared.identifier, value)
            bpy.context.view_layer.update()
            assert scene in told, declared.identifier
        told.clear()
        tree.nodes.new("CandelaPass_film")
        bpy.context.view_layer.update()
        assert tree in told
    finally:
        bpy.app.handlers.depsgraph_update_post.remove(note)


def test_last_picture_begins_with_what_costs_most_and_the_setting_that_bounds_it(scene, published):
    rows = [
        ledger.Row("surfaces", "Surfaces", ledger.RAN, milliseconds=12.0),
        ledger.Row("instant_radiosity", "Instant radiosity", ledger.RAN, milliseconds=900.0),
        ledger.Row("film", "Film", ledger.REUSED),
    ]
    published(ledger.Ledger(rows, {}, samples=4))
    text = drawn(panels.CANDELA_RENDER_PT_frame)
    assert text.index("Instant radiosity") < text.index("instant_radiosity_virtual_lights") < text.index("Surfaces")
    assert text.index("Surfaces") < text.index("Film")
    for technique in REGISTRY:
        assert hasattr(scene.candela, panels.bound_of(technique.name))
    assert panels.bound_of("direct_light") == "samples"


def test_another_file_clears_the_last_picture(scene, published):
    published(ledger.Ledger([], {}, samples=4))
    engine._another_file()
    assert ledger.latest() is None


def test_what_is_off_leaves_its_other_fields_grey_and_displacement_has_its_method(scene):
    material, camera = bpy.data.materials.new("Grass"), bpy.data.cameras.new("Eye")
    by_name = {technique.name: technique for technique in REGISTRY}

    def is_off(block, name):
        scope = "MATERIAL" if block is material else "CAMERA"
        technique = by_name[name]
        return scoped_panels.is_off(block, technique, scoped_panels.scoped(technique)[scope][0])

    assert is_off(material, "grass") and is_off(camera, "eye") and is_off(material, "relief")
    material.candela.grass_patch, material.displacement_method = "MEADOW", "BOTH"
    camera.candela.glare_mode = "CONVOLUTION"
    assert not (is_off(material, "grass") or is_off(camera, "eye") or is_off(material, "relief"))
    assert "displacement_method" in drawn(bpy.types.CANDELA_MATERIAL_PT_relief, material=material)


def test_metadata_are_named_and_written_as_cycles_writes_its_own():
    told = render_metadata("Layer", ledger.Ledger(times={"sync": 61.5}, samples=7), 3600 + 2.25)
    assert told == {
        "candela.Layer.samples": "7", "candela.Layer.render_time": "01:00:02.25",
        "candela.Layer.synchronization_time": "01:01.50", "candela.Layer.total_time": "01:01:03.75",
    }  # fmt: skip
