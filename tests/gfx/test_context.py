"""Who is called when GPU resources are freed."""

import gc
import weakref

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
