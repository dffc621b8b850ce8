"""Runs in a second Blender without a window: draws what a viewport is about to draw, so that the driver has compiled it
(see ahead.py). Nothing that it draws is shown. It ends when the first process does, or has asked nothing for a while.

Standard input: numbers of 8 bytes, little endian: how many parts follow; then each part after its length. The first is
a pickle, the others its buffers. Standard output: a line of JSON for each thing that is told.
"""

import importlib
import io
import json
import os
import pickle
import queue
import sys
import threading
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

FIRST_SCALE = 8  # as of a viewport that has drawn nothing yet
FULL_SCALE = 2  # a picture in full resolution has the programs of one in coarser pixels that cost as much
SAMPLES = 2  # the second one has passes of its own
IDLE_S = 120.0


class Unpickler(pickle.Unpickler):
    """Finds the extension's classes, which stand below another package there."""

    def find_class(self, module: str, name: str):
        there = os.environ["CANDELA_AHEAD_OF"]
        if module == there or module.startswith(f"{there}."):
            module = f"addon{module.removeprefix(there)}"
        return super().find_class(module, name)


def own(name: str):
    """A module of the extension, which is no package of Blender's here."""
    return importlib.import_module(f"addon.{name}")


def part(source) -> bytes | None:
    """The next part; None at the end."""
    head = source.read(8)
    if len(head) < 8:
        return None
    return source.read(int.from_bytes(head, "little"))


def listen(source, orders: queue.Queue) -> None:
    """Put each order into the queue, and None at the end."""
    while True:
        head = source.read(8)
        parts = [part(source) for _ in range(int.from_bytes(head, "little"))] if len(head) == 8 else []
        if not parts or None in parts:
            os._exit(0)  # whoever asked is gone: what is being compiled is for nobody
        orders.put(parts)


def main() -> None:
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what Blender prints is no answer
    orders: queue.Queue = queue.Queue()
    threading.Thread(target=listen, args=(sys.stdin.buffer, orders), daemon=True).start()
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    import bpy  # noqa: F401 - as a module it has to be there before the extension's own

    run, library, first_look, techniques = map(own, ("frame.run", "gfx.library", "surfaces.first_look", "techniques"))
    renderer = run.Renderer(techniques.make_registry)
    renderer.publishes = False
    looks = first_look.FirstLook(), first_look.FirstLook()
    while True:
        try:
            parts = orders.get(timeout=IDLE_S)
        except queue.Empty:
            return
        order = Unpickler(io.BytesIO(parts[0]), buffers=parts[1:]).load()

        def tell(number=order["number"], **what) -> None:
            answers.write(json.dumps({"number": number, **what}) + "\n")
            answers.flush()

        before = library.compile_count
        for stage in ("draft", "full"):
            lasting = True
            try:
                with costs_of(stage):
                    for left, at in drawn(renderer, looks, order, stage, tell):
                        tell(left=left, at=at, compiled=library.compile_count - before)
                        if not orders.empty():
                            break
            except Exception as error:  # the picture itself will say so
                lasting = False
                print(f"Candela, compiling ahead: {error}", file=sys.stderr)
            if not orders.empty():
                break
            tell(done=stage, lasting=lasting)


def drawn(renderer, looks, order, stage: str, tell=lambda **_: None):
    """Draw an order's picture as a draft or in full; yields after each part how many programs are left, as far as
    known, and what technique they are for, where they are compiled as they are met. Of a picture that is foreseen the
    first look comes first, and what it needs is told."""
    images, library, begun = map(own, ("gfx.images", "gfx.library", "viewport.beginning"))
    ahead, display = map(own, ("viewport.ahead", "viewport.display"))
    coarser = begun.coarser
    whole, settings = order["snapshot"], order["settings"]
    draft = stage == "draft"
    scale = FIRST_SCALE if draft else FULL_SCALE
    snapshot = replace(whole, film=coarser(whole.film, scale))
    settings = replace(settings, samples=max(settings.samples, SAMPLES))
    looks = looks if draft and snapshot.camera.panorama is None else ()  # edges and shapes of drafts
    beginning = renderer.beginning(snapshot, begun.drawn_with(settings, scale if draft else 1, waits=not draft))
    placed = False
    while True:
        try:
            done, total = next(beginning)
        except StopIteration as end:
            frame = end.value
            break
        if not placed and order["foreseen"]:  # in full, too: the draft may have failed before
            look_at(renderer, looks, snapshot, coarser(whole.film, scale // 2))
            tell(needs=ahead.digests_of(renderer, whole, order["settings"]))
        placed = True
        yield max(total - done, 1), ""
    look_at(renderer, looks, snapshot, coarser(whole.film, scale // 2))
    for _ in range(1 if draft else SAMPLES):
        known = library.news()
        for _ in renderer.steps(frame):
            if library.news() != known:
                known = library.news()
                yield 1, frame.at
        shown = renderer.show(frame)
        for look in looks[1:] if shown is not None else ():
            look.refined(shown, snapshot.film.exposure, display.emitted_in(frame))
    images.finish()


@contextmanager
def costs_of(stage: str):
    """Choices by cost, as of maps and rays, are those of the picture that is drawn for, which has more pixels in full:
    of other methods it has other programs."""
    device = own("gfx.device")
    costs = device.current()
    if stage == "draft" or not device.known():  # drafts have no such choices
        yield
        return
    device.use(costs.of_dearer_pixels(FULL_SCALE**2))
    try:
        yield
    finally:
        device.use(costs)


def look_at(renderer, looks, snapshot, film) -> None:
    """Draw first looks at what is placed."""
    scene = snapshot, renderer.geometry, renderer.materials.compiled
    view = own("scene.view").View(snapshot.camera, film, renderer.geometry.origin)
    for k, look in enumerate(looks):
        look.draw(*scene, view, guides=k > 0)


if __name__ == "__main__":
    main()
    os._exit(0)  # Blender as a module may wait for ever in its exit handlers once a GPU was used
