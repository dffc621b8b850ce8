"""Which backend draws, and who is called when GPU resources are freed."""

import gc
import os
import weakref

import pytest

from addon.gfx import context


class Holder:
    """Registers its method, as a renderer does."""

    def __init__(self, freed):
        self.freed = freed
        context.on_release(self.free)

    def free(self):
        self.freed.append(self)


def test_what_is_registered_is_called_on_release(gpu_context):
    freed = []
    holder = Holder(freed)
    context.release_all()
    assert freed == [holder]


def test_registration_keeps_no_object_alive(gpu_context):
    holder = Holder([])
    kept = weakref.ref(holder)
    del holder
    gc.collect()
    assert kept() is None
    context.release_all()


def test_the_backend_is_the_one_that_was_asked_for(gpu_context):
    """Blender takes OpenGL where Vulkan fails: `make test-vulkan` must not pass by that."""
    asked = os.environ.get("CANDELA_BACKEND")
    if not asked:
        pytest.skip("no backend was asked for in CANDELA_BACKEND")
    assert context.describe().rpartition(", ")[2] == asked
