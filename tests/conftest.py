"""What every test may ask for, which slow tests are chosen, and how the test process ends."""

import hashlib
import os
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

# Choices between methods do not depend on the clock of the machine that tests.
os.environ.setdefault("CANDELA_DEVICE", "software")


# Of PARTS into which slow tests fall by their names and a seed, those that each choice takes.
PARTS = 12
CHOICES = {"all": range(PARTS), "sample": range(1), "more": range(1, 4), "rest": range(1, PARTS)}


def pytest_addoption(parser):
    parser.addoption(
        "--slow", choices=CHOICES, default="all",
        help="of the slow tests all, a sample (a twelfth, by the seed CANDELA_SAMPLE), a quarter more, or all the rest",
    )  # fmt: skip


# What tests the repository and its tools, whatever Blender draws: with the default one alone.
DEFAULT_BLENDER = "5.2"
OF_THE_REPOSITORY = (
    "tests/bench/",
    "tests/gfx/test_portable.py",
    "tests/test_docs.py",
    "tests/test_environment.py",
    "tests/test_imports.py",
)


def pytest_collection_modifyitems(config, items):
    wanted, default = CHOICES[config.getoption("--slow")], version("bpy").startswith(DEFAULT_BLENDER)
    kept, left_out = [], []
    for item in items:
        is_slow = item.get_closest_marker("slow") is not None
        elsewhere = not default and item.nodeid.startswith(OF_THE_REPOSITORY)
        (kept if not elsewhere and (not is_slow or part_of(item.nodeid) in wanted) else left_out).append(item)
    if not left_out:
        return
    config.hook.pytest_deselected(items=left_out)
    items[:] = kept


def part_of(name: str) -> int:
    """Of the slow tests, the part that holds the one of this name: the same on every machine."""
    seed = os.environ.get("CANDELA_SAMPLE", "0")
    digest = hashlib.blake2b(f"{seed} {name}".encode(), digest_size=4).digest()
    return int.from_bytes(digest, "big") % PARTS


@pytest.fixture(scope="session")
def gpu_context():
    """A GPU context for code that draws outside a render; made once, since a process has only one."""
    from addon.gfx import context

    context.ensure()


@pytest.fixture(scope="session")
def registered():
    """The extension's classes registered in this process, as Blender does on enabling it."""
    import addon

    addon.register()
    yield
    addon.unregister()


@pytest.fixture
def empty_scene():
    """A scene without objects under factory settings."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy.context.scene


@pytest.fixture(autouse=True)
def few_programs():
    """Programs that tests compile, or draw outside of final renders, would stay until a picture begins there: 4 MB
    each, and a process of them grew to 4 GB. Those of final renders alone are left to them; see gfx/library.py."""
    yield
    library = sys.modules.get("addon.gfx.library")
    if library is not None:
        library.free_lasting(library.most_programs())


@pytest.fixture(autouse=True)
def undefined_content(monkeypatch):
    """With CANDELA_UNDEFINED=1 what images hold before they are drawn is not a number, as it may be on any GPU: a test
    that then fails looks at what nobody has drawn."""
    if not os.environ.get("CANDELA_UNDEFINED"):
        return
    from addon.gfx import images

    def spoilt(made):
        def make(*arguments):
            image = made(*arguments)
            if "F" in image.format and "DEPTH" not in image.format:
                image.texture.clear(format="FLOAT", value=(float("nan"),) * 4)
            return image

        return make

    monkeypatch.setattr(images.Pool, "take", spoilt(images.Pool.take))
    monkeypatch.setattr(images, "create", spoilt(images.create))


@pytest.fixture(scope="module", autouse=True)
def memory_of_the_file(request):
    """With CANDELA_MEMORY=FILE: a line for each file of tests, of what this process holds after it."""
    yield
    place = os.environ.get("CANDELA_MEMORY")
    library, images = (sys.modules.get(f"addon.gfx.{name}") for name in ("library", "images"))
    if not place or library is None or images is None:
        return
    resident = int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") // 2**20
    with Path(place).open("a") as file:
        file.write(
            f"{os.getpid()} {resident:5d} MiB, {images.pool.allocated_bytes >> 20:4d} MiB of images, "
            f"{library.kept():4d} programs, {len(library._dropped):4d} to be freed, {library.compile_count:5d} compiled"
            f"  {request.node.name}\n"
        )


session_key = pytest.StashKey[pytest.Session]()


def pytest_sessionstart(session):
    session.config.stash[session_key] = session


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config):
    """End the process here: Blender 4.5 as a module waits forever in its exit handlers once a GPU was used.

    The summary is printed by now and the exit status final.
    """
    session = config.stash.get(session_key, None)
    if session is None or "bpy" not in sys.modules:
        return
    config.get_terminal_writer().flush()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(int(session.exitstatus))
