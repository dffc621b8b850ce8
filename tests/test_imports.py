"""Who may import whom. The table is the law; the tests read every import under addon/ and compare."""

import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ADDON = Path(__file__).resolve().parent.parent / "addon"


@dataclass(frozen=True)
class Room:
    """What a part of addon/ may import beside itself and the standard library."""

    rooms: tuple[str, ...] = ()  # other parts of addon/
    modules: tuple[str, ...] = ()  # packages that every Blender has
    optional: tuple[str, ...] = ()  # packages that Blender lacks: only inside a function


DATA = ("materials", "snapshot.scene", "snapshot.panorama")
BELOW_FRAME = ("gfx", "sampling", "kernels", "scene", "sources", *DATA)
ON_A_FRAME = ("surfaces", "film", "lighting")  # pieces that techniques share, each on those before it
BELOW_TECHNIQUES = (*BELOW_FRAME, "eye", "frame", "grass", *ON_A_FRAME)
BELOW_COMPARE = (*BELOW_TECHNIQUES, "materials", "snapshot", "techniques", "whole_files")
BLENDER = ("bpy", "bpy_extras", "imbuf", "mathutils", "bl_math", "idprop", "numpy")

# The longest name that fits is the one that counts: gfx.context has its own line, the rest of gfx another.
ROOMS = {
    "whole_files": Room(),
    "gfx": Room(modules=("gpu", "gpu_extras", "numpy")),
    "gfx.context": Room(modules=("bpy", "gpu")),
    "gfx.user_folder": Room(rooms=("whole_files",), modules=("bpy",)),
    "materials": Room(modules=("numpy",)),
    "materials.reader": Room(modules=BLENDER),
    "snapshot": Room(rooms=("materials",), modules=BLENDER, optional=("openvdb",)),
    "snapshot.scene": Room(rooms=("materials",), modules=("numpy",)),
    "snapshot.panorama": Room(modules=("numpy",)),
    "sampling": Room(rooms=DATA, modules=("numpy",)),
    "kernels": Room(rooms=("gfx",), modules=("numpy",)),
    "eye": Room(modules=("numpy",)),
    "eye.point_spread": Room(rooms=("gfx", "kernels"), modules=("numpy",)),
    "eye.scatter": Room(rooms=("gfx", "kernels"), modules=("numpy",)),
    "grass": Room(rooms=("whole_files",), modules=("numpy",)),
    "grass.generate": Room(rooms=("snapshot",), modules=BLENDER),
    "scene": Room(rooms=("gfx", "sampling", "kernels", *DATA), modules=("numpy",)),
    "sources": Room(rooms=("gfx", "sampling", "kernels", "scene", *DATA), modules=("numpy",)),
    "frame": Room(rooms=BELOW_FRAME, modules=("numpy",)),
    "surfaces": Room(rooms=(*BELOW_FRAME, "frame"), modules=("numpy",)),
    "film": Room(rooms=(*BELOW_FRAME, "frame", "surfaces"), modules=("numpy",)),
    "film.takes": Room(
        rooms=("frame", "film", "snapshot.scene", "snapshot.light_groups", "snapshot.shutter"), modules=("numpy",)
    ),
    "lighting": Room(rooms=(*BELOW_FRAME, "frame", "surfaces", "film"), modules=("numpy",)),
    "techniques": Room(rooms=BELOW_TECHNIQUES, modules=("numpy",)),
    "compare": Room(rooms=BELOW_COMPARE, modules=("numpy",), optional=("flip_evaluator", "matplotlib")),
    "compare.reference": Room(rooms=BELOW_COMPARE, modules=BLENDER),
    "compare.beside": Room(rooms=BELOW_COMPARE, modules=BLENDER),
    "ui": Room(rooms=(*BELOW_COMPARE, "compare"), modules=(*BLENDER, "gpu")),
    "ui.quality": Room(rooms=BELOW_COMPARE, modules=(*BLENDER, "bl_operators", "bl_ui")),
    "ui.pass_panels": Room(modules=(*BLENDER, "bl_ui")),
    "viewport": Room(rooms=(*BELOW_COMPARE, "ui"), modules=(*BLENDER, "gpu", "gpu_extras")),
    "final": Room(rooms=(*BELOW_COMPARE, "ui"), modules=("numpy",)),
    "bake": Room(rooms=(*BELOW_COMPARE, "ui", "final"), modules=("numpy",)),
    "main_loop": Room(rooms=("gfx",), modules=BLENDER),
    "engine": Room(rooms=(*BELOW_COMPARE, "ui", "viewport", "bake", "final", "main_loop"), modules=(*BLENDER, "gpu")),
    "cli": Room(rooms=(*BELOW_COMPARE, "compare", "ui", "engine"), modules=BLENDER),
    "__main__": Room(rooms=("cli", "engine", "ui", "gfx"), modules=("bpy",)),
    "": Room(rooms=("cli", "engine", "ui", "gfx"), modules=("bpy",)),
}


@dataclass(frozen=True)
class Import:
    """One imported module: `room` is its dotted name below addon/, or None when it comes from outside."""

    line: int
    name: str
    room: str | None
    inside_function: bool


def module_name(path: Path) -> str:
    """addon/gfx/context.py -> gfx.context, addon/gfx/__init__.py -> gfx, addon/__init__.py -> ''."""
    parts = path.relative_to(ADDON).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def is_module(name: str) -> bool:
    path = ADDON.joinpath(*name.split("."))
    return path.is_dir() or path.with_suffix(".py").is_file()


def imports_of(path: Path, source: str) -> Iterator[Import]:
    """Every import in a module of addon/, also those inside functions and for type checkers."""
    package = list(path.relative_to(ADDON).parent.parts)

    def walk(node: ast.AST, inside_function: bool) -> Iterator[Import]:
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield Import(node.lineno, alias.name, None, inside_function)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield Import(node.lineno, node.module, None, inside_function)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - (node.level - 1)]
            base = ".".join([*above, *(node.module.split(".") if node.module else [])])
            for alias in node.names:
                name = f"{base}.{alias.name}".lstrip(".")
                # `from .a import b` may name a module or a value; `from . import b` takes a module.
                room = name if node.module is None or is_module(name) else base
                yield Import(node.lineno, "." * node.level + (node.module or alias.name), room, inside_function)
        inside = inside_function or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        for child in ast.iter_child_nodes(node):
            yield from walk(child, inside)

    yield from walk(ast.parse(source), False)


def stands_in(name: str, room: str) -> bool:
    """Whether the module `name` is `room` or lies below it."""
    return name == room or name.startswith(f"{room}.")


def room_of(name: str) -> str | None:
    fitting = [room for room in ROOMS if stands_in(name, room)]
    return max(fitting, key=len, default=None)


def breaches(path: Path, source: str) -> list[str]:
    """One sentence for each import that the table does not allow."""
    name = module_name(path)
    room = room_of(name)
    if room is None:
        return [f"addon/{path.relative_to(ADDON)} stands in no room: give it a line in ROOMS."]
    allowed, part = ROOMS[room], name.split(".")[0]
    found = []
    for entry in imports_of(path, source):
        top = entry.name.split(".")[0]
        if entry.room is not None:
            fine = entry.room.split(".")[0] == part or any(stands_in(entry.room, other) for other in allowed.rooms)
        elif top in sys.stdlib_module_names or top in allowed.modules:
            fine = True
        else:
            fine = top in allowed.optional and entry.inside_function
        if not fine:
            where = f"addon/{path.relative_to(ADDON)}:{entry.line}"
            found.append(f"{where} imports {entry.name}, which {room or 'addon/__init__.py'} may not.")
    return found


MODULES = sorted(ADDON.rglob("*.py"))


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(ADDON).as_posix())
def test_module_imports_only_what_its_room_may(path):
    assert not breaches(path, path.read_text(encoding="utf-8"))


def test_rooms_stand_in_the_architecture_in_the_order_of_imports():
    page = (ADDON.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    order = re.findall(r"^    addon/(\w+)/ ", page, re.MULTILINE)
    found = set()
    for path in (path for room in order for path in (ADDON / room).rglob("*.py")):
        own = path.relative_to(ADDON).parts[0]
        above = {one.room.split(".")[0] for one in imports_of(path, path.read_text(encoding="utf-8")) if one.room}
        found |= {(own, room) for room in above & set(order) if order.index(room) > order.index(own)}
    assert len(order) > 12 and not found


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("gfx/images.py", "import bpy"),
        ("gfx/images.py", "from ..frame import plan"),
        ("materials/compiler.py", "from ..gfx.library import get"),
        ("snapshot/meshes.py", "from ..gfx import images"),
        ("snapshot/scene.py", "import bpy"),
        ("frame/plan.py", "from ..techniques import TECHNIQUES"),
        ("frame/plan.py", "from ..snapshot import scene, meshes"),
        ("techniques/surfaces.py", "import bpy"),
        ("techniques/surfaces.py", "def run():\n    from ..compare import metrics"),
        ("techniques/surfaces.py", "from .. import engine"),
        ("compare/metrics.py", "import flip_evaluator"),
        ("engine.py", "from .compare import report"),
        ("engine.py", "from addon.gfx import images"),
        ("scraps.py", "import math"),
    ],
)
def test_breach_is_found(module, source):
    assert breaches(ADDON / module, source)


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("gfx/context.py", "import bpy\nimport gpu"),
        ("snapshot/meshes.py", "from . import scene\nfrom ..materials import reader"),
        ("techniques/surfaces.py", "from ..gfx.images import Image\nfrom ..snapshot.scene import Snapshot"),
        ("compare/metrics.py", "def flip():\n    import flip_evaluator"),
        ("cli.py", "from .compare import report\nfrom . import engine"),
    ],
)
def test_allowed_import_passes(module, source):
    assert not breaches(ADDON / module, source)


def test_scene_asks_a_frame_for_its_scene_alone():
    """What has a parameter `frame` says that it is a SceneOnGpu, and reads nothing that this does not declare."""
    declared = ast.parse((ADDON / "scene" / "on_gpu.py").read_text(encoding="utf-8")).body
    (protocol,) = (one for one in declared if isinstance(one, ast.ClassDef) and one.name == "SceneOnGpu")
    known = {getattr(one, "name", None) or one.target.id for one in protocol.body[1:]}
    for path in sorted((ADDON / "scene").glob("*.py")):
        for made in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(made, ast.FunctionDef):
                continue
            frames = [argument for argument in made.args.args if argument.arg == "frame"]
            assert all(ast.unparse(one.annotation or ast.Constant(None)) == "SceneOnGpu" for one in frames), path.name
            if frames:
                read = {one.attr for one in ast.walk(made) if isinstance(one, ast.Attribute)
                        and isinstance(one.value, ast.Name) and one.value.id == "frame"}  # fmt: skip
                assert read <= known, f"{path.name}: {made.name} reads {read - known} of a frame"


def test_what_is_asked_of_a_frame_is_there():
    """Everywhere, of what is called `frame` or `….frame`, and of its parts that hold images and tell of techniques."""
    parts = {"": "picture.Frame", "held": "held.Held", "account": "account.Account", "settings": "settings.Settings",
             "settings.schedule": "schedule.Schedule"}  # fmt: skip
    known = {part: _members(*name.split(".")) for part, name in parts.items()}
    asked = re.compile(r"(?:\bself\.|(?<![.\w]))frame\.(?:(held|account|settings\.schedule|settings)\.)?([a-z_]+)\b")
    for path in sorted(ADDON.rglob("*.py")):
        if path.parts[-2] not in ("ui", "grass", "cli", "snapshot"):  # where frames are Blender's
            text = re.sub(r"addon\.frame\.|\"frame\.", "", path.read_text(encoding="utf-8"))
            lost = {found[0] for found in asked.finditer(text) if found[2] not in known[found[1] or ""]}
            assert not lost, f"{path.relative_to(ADDON)} asks a frame for {lost}"


def _members(module: str, name: str) -> set[str]:
    """Names that a class of frame/ declares, or sets on itself."""
    tree = ast.parse((ADDON / "frame" / f"{module}.py").read_text(encoding="utf-8"))
    (made,) = (one for one in tree.body if isinstance(one, ast.ClassDef) and one.name == name)
    declared = {getattr(one, "name", None) or getattr(getattr(one, "target", None), "id", "") for one in made.body}
    return declared | set(re.findall(r"\bself\.(\w+)", ast.unparse(made)))
