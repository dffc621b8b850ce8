"""Programs compiled ahead of a viewport's picture, by a second Blender without a window.

Blender's `gpu` module compiles where it is asked, and all of Blender waits; its own compile workers are not offered to
Python. Drivers keep what they have compiled on disk, for all processes. So before a view's first picture, if nobody is
known to have compiled its programs, the viewport waits, and shows what it has, while another process draws the same
snapshot (`ahead_worker.py`): first as a draft, then in full. What is begun then finds its programs in the driver's
cache, and takes a few hundredths of a second for each.

Already when this engine is chosen for a scene (chosen.py) the process begins with it, and with the first look. That
picture is remembered by the content of the scene, since nothing is there yet that tells which programs it needs.

Which pictures are known is remembered from session to session by digests of what decides about programs: node trees,
kinds of lamps, features. Where the process cannot be started, ends, or says nothing for long, programs are compiled
here, one for each redraw, as without it.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import pickle
import queue
import subprocess
import sys
import threading
import time
import tomllib
from collections import deque
from dataclasses import dataclass, field, replace
from pathlib import Path

import bpy
import gpu

from ..frame import device_probe
from ..frame.run import Renderer
from ..frame.settings import Settings
from ..gfx import device, user_folder
from ..gfx.context import to_hold
from ..gfx.library import Program
from ..materials.graph import Graph
from ..scene.media import has_media
from ..snapshot.scene import NO_LINKS, Snapshot

VARIABLE = "CANDELA_AHEAD"  # 0: never by a second process
BACKENDS = ("OPENGL", "VULKAN")  # whose drivers keep programs for other processes
SILENT_S = 90.0  # after which the process is given up: the largest programs take a third of it on slow machines
TURN_S = 5.0  # for which a viewport that has not asked again keeps its turn
MOST_BYTES = 512 << 20  # of a scene that is handed over
MOST_KNOWN = 4096
WORKER = Path(__file__).with_name("ahead_worker.py")
ADDON = __package__.rpartition(".")[0]  # this extension's modules; in the other process they stand below `addon`
DRAFT, FULL = "draft", "full"
NOBODY = 0  # in place of who asks for a picture


@dataclass
class Job:
    """What the other process draws."""

    number: int
    needs: frozenset[str]  # of a picture that is foreseen empty, until the other process has found them
    asker: int  # whose picture it is
    foreseen: str = ""  # the digest by which a picture that nobody has asked for yet is remembered
    left: int = 1  # programs that it still has to compile, as far as known
    at: str = ""  # the technique whose programs it compiles, where it meets them while it draws
    compiled: int = 0
    told_at: float = field(default_factory=time.monotonic)
    asked_at: float = field(default_factory=time.monotonic)
    done: set[str] = field(default_factory=set)  # of DRAFT, FULL

    def is_anothers(self, asker: int, now: float) -> bool:
        """Whether another viewport waits for it, whose turn it is."""
        waits = self.asker not in (NOBODY, asker) and FULL not in self.done
        return waits and now - self.asked_at < TURN_S


class Ahead:
    """The second process, which all viewports share."""

    def __init__(self):
        self.failed = False
        self._process: subprocess.Popen | None = None
        self._lines: deque[str] = deque()
        self._orders: queue.SimpleQueue = queue.SimpleQueue()
        self._job: Job | None = None
        self._jobs = 0
        self._came = False
        self._known: set[str] | None = None

    def left(
        self, renderer: Renderer, whole: Snapshot, settings: Settings, draft: bool, edit: bool = False
    ) -> int | None:
        """How many programs the other process has to compile before this picture is begun, at least 1; None: begin.
        `whole`: the scene on a film in full resolution; `settings`: those of the picture in full. Of an `edit` the
        programs of single materials do not count: they are few and small, and edits of node trees are many."""
        if self.failed or gpu.platform.backend_type_get() not in BACKENDS:
            return None
        stage = DRAFT if draft else FULL
        digests = digests_of(renderer, whole, settings)
        needs, asked = frozenset(digests), digests[-1:] if edit else digests
        self._hear()
        if {f"{one} {stage}" for one in asked} <= self._remembered():
            return None
        job, now = self._job, time.monotonic()
        if job is not None and job.foreseen and not job.needs and FULL in job.done:
            job.needs = needs  # it was too large or failed before that was found: likely this one, not to be sent again
        if job is not None and job.foreseen and not job.needs:  # it may be this one
            job.asked_at = now
        elif job is not None and job.needs == needs:
            job.asked_at, job.asker = now, id(renderer)
            if stage in job.done:
                return None
        elif job is not None and job.is_anothers(id(renderer), now):
            return 1
        else:
            self._begin(needs, id(renderer), whole, settings)
        if self._job is not None and time.monotonic() - self._job.told_at > SILENT_S:
            self._give_up()
        return None if self.failed else max(self._job.left, 1)

    def foresee(self, whole: Snapshot, settings: Settings) -> None:
        """Let the other process begin with a picture that will be asked for, unless it is busy or knows it."""
        if self.failed or gpu.platform.backend_type_get() not in BACKENDS:
            return
        foreseen = _foreseen(whole, settings)
        self._hear()
        if f"{foreseen} {FULL}" not in self._remembered() and (self._job is None or FULL in self._job.done):
            self._begin(frozenset(), NOBODY, whole, settings, foreseen)

    def came(self) -> bool:
        """Whether a stage has been drawn, or the other process has ended, since this was asked last."""
        self._hear()
        came, self._came = self._came or self.failed, False
        return came

    @property
    def doing(self) -> str:
        """What the other process does, for the text in a region's corner."""
        job = self._job
        if job is None or not job.compiled:
            return "Compiling shaders"
        if job.at:
            return f"Compiling shaders for {job.at} ({job.compiled} so far)"
        return f"Compiling shaders ({job.left} remaining)"

    def _begin(
        self, needs: frozenset[str], asker: int, whole: Snapshot, settings: Settings, foreseen: str = ""
    ) -> None:
        self._jobs += 1
        self._job = Job(self._jobs, needs, asker, foreseen)
        order = {"number": self._jobs, "snapshot": whole, "settings": settings, "foreseen": bool(foreseen)}
        buffers: list[pickle.PickleBuffer] = []
        try:
            texts = pickle.dumps(order, 5, buffer_callback=buffers.append)
            views = [buffer.raw() for buffer in buffers]
            if sum(view.nbytes for view in views) > MOST_BYTES:
                self._job.done |= {DRAFT, FULL}
                return
            if self._process is None or self._process.poll() is not None:
                self._start()
        except (OSError, ValueError, TypeError, AttributeError, pickle.PicklingError) as error:
            print(f"Candela compiles shaders in its own process: {error}", file=sys.stderr)
            self._give_up()
            return
        self._orders.put([memoryview(texts), *views])

    def _start(self) -> None:
        """A Blender of the same kind, with the same backend."""
        backend = gpu.platform.backend_type_get().lower()
        if bpy.app.binary_path:
            options = ("--background", "--factory-startup", "--disable-autoexec", "--gpu-backend", backend)
            command = [bpy.app.binary_path, *options, "--python", str(WORKER)]
        else:  # Blender as a module of Python; -P: imports nothing from beside the worker
            command = [sys.executable, "-P", str(WORKER)]
        # It measures this device for us where nobody has, and keeps the figures where they are looked for.
        environment = {**os.environ, "CANDELA_CACHE": str(device_probe.folder()), "CANDELA_AHEAD_OF": ADDON}
        self._orders.put(None)  # ends the thread of a process before, which may have ended by itself
        self._lines, self._orders = deque(), queue.SimpleQueue()  # what is left of one before is not this one's
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
        )
        threading.Thread(target=_send, args=(self._process, self._orders), daemon=True).start()
        threading.Thread(target=_receive, args=(self._process, self._lines), daemon=True).start()

    def _hear(self) -> None:
        """Take note of what has come from the other process."""
        while self._lines:
            line, job = self._lines.popleft(), self._job
            if line == "":
                self._came = True
                if job is not None and FULL not in job.done:
                    self._give_up()
                return
            try:
                told = json.loads(line)
            except ValueError:
                continue
            if job is None or not isinstance(told, dict) or told.get("number") != job.number:
                continue
            job.told_at, job.left = time.monotonic(), int(told.get("left", job.left))
            job.at, job.compiled = str(told.get("at", job.at)), int(told.get("compiled", job.compiled))
            job.needs = job.needs or frozenset(map(str, told.get("needs", ())))
            if told.get("done"):
                self._came = True
                job.done.add(told["done"])
            if told.get("lasting"):
                self._remember({f"{one} {told['done']}" for one in (*job.needs, job.foreseen) if one})

    def _give_up(self) -> None:
        self.failed = True
        self.close()

    def close(self) -> None:
        """End the other process."""
        process, self._process, self._job = self._process, None, None
        self._orders.put(None)
        if process is not None and process.poll() is None:
            process.kill()

    # ------------------------------------------------------------------------------------- from session to session

    def _remembered(self) -> set[str]:
        if self._known is None:
            known = user_folder.kept(_file()).get(_driver())
            self._known = {one for one in known if isinstance(one, str)} if isinstance(known, list) else set()
        return self._known

    def _remember(self, more: set[str]) -> None:
        known = self._remembered()
        known |= more
        user_folder.keep(_file(), {_driver(): sorted(known)[:MOST_KNOWN]})


def _file() -> Path:
    return user_folder.user_folder("programs") / "candela_programs.json"


def _driver() -> str:
    """What compiled programs hold for: this version of the extension, Blender, and the driver."""
    manifest = WORKER.parents[2] / "blender_manifest.toml"
    version = tomllib.loads(manifest.read_text(encoding="utf-8"))["version"]
    return f"{version}, {manifest.stat().st_mtime_ns}, {bpy.app.version_string}, {device.key()}"


def _digest(one: object) -> str:
    return hashlib.sha1(repr(one).encode(), usedforsecurity=False).hexdigest()[:16]


def _foreseen(whole: Snapshot, settings: Settings) -> str:
    """Of what decides about programs before any of them is compiled, by content: names of data-blocks and images hold
    numbers that change when a file is opened again."""

    def by_content(graph: Graph) -> str:
        return repr(
            replace(graph, nodes={key: replace(one, image=kind(one.image)) for key, one in graph.nodes.items()})
        )

    def kind(key: str) -> str:
        one = whole.images.get(key)
        return repr(one and (one.encoding, one.alpha_mode, one.missing, len(one.tiles), one.bits))

    materials = {
        (by_content(one.graph), one.own, tuple((name, kind(key)) for name, key in one.own_images))
        for one in whole.materials
    }
    graphs = [one.graph for one in (whole.world, *whole.lights) if one.graph is not None]
    features = sorted(map(repr, materials)), sorted(map(by_content, graphs)), _lamps_of(whole), _of_all(whole, settings)
    return _digest(features)


def digests_of(renderer: Renderer, snapshot: Snapshot, settings: Settings) -> list[str]:
    """Of `needs_of`."""
    return [_digest(one) for one in needs_of(renderer, snapshot, settings)]


def _send(process: subprocess.Popen, orders: queue.SimpleQueue) -> None:
    """Write orders one after the other, each part after its length, until None comes; what reads is there or ends,
    which `_receive` notices."""
    with contextlib.suppress(OSError, ValueError):
        while (parts := orders.get()) is not None:
            process.stdin.write(len(parts).to_bytes(8, "little"))
            for part in parts:
                process.stdin.write(memoryview(part).nbytes.to_bytes(8, "little"))
                process.stdin.write(part)
            process.stdin.flush()


def _receive(process: subprocess.Popen, lines: deque[str]) -> None:
    for line in process.stdout:
        lines.append(line.decode("utf-8", "replace").strip() or "{}")
    lines.append("")  # it has ended


def needs_of(renderer: Renderer, snapshot: Snapshot, settings: Settings) -> list[tuple]:
    """What decides which programs a picture uses, but for whether it is a draft: its materials, one by one, and all
    else together, last. Kinds of lamps do where programs hold only those of the scene."""
    compiled = renderer.materials.compiled
    shown = {draw.material for draw in renderer.geometry.draws if not compiled[draw.material].bounds_alone}
    materials = [_text_of(renderer.materials.surface_program(k)) for k in shown]
    flags = ("transparent", "tinted", "colors_behind", "glows", "uneven", "uneven_emission", "casts_stochastically")
    of_materials = {(*(bool(getattr(c, name)) for name in flags), c.scatter > 0.0, c.glass is None) for c in compiled}
    shines = any(max(one.emission) > 0.0 for one in compiled)
    of_lamps = to_hold(_lamps_of(snapshot), bool(snapshot.lights))
    trees = sorted(_types_in(one.graph) for one in (snapshot.world, *snapshot.lights) if one.graph is not None)
    features = sorted(map(repr, of_materials)), shines, of_lamps, trees, *_of_all(snapshot, settings)
    return [*materials, features]


def _lamps_of(snapshot: Snapshot) -> list[str]:
    """Kinds of lamps."""
    lamps = {
        (
            one.kind,
            one.shape,
            one.radius > 0.0,
            one.graph is None,
            one.cast_shadow,
            one.spread < 3.14,
            one.links == NO_LINKS,
        )
        for one in snapshot.lights
    }
    return sorted(map(repr, lamps))


def _of_all(snapshot: Snapshot, settings: Settings) -> tuple:
    """What decides about programs beside materials and lamps."""
    world, camera, film = snapshot.world, snapshot.camera, snapshot.film
    return (
        world.image is None, any(world.color), has_media(snapshot), camera.panorama is None, camera.aperture is None,
        camera.kind, film.transparent, any(one.links != NO_LINKS for one in snapshot.instances),
        any(one.caustics_caster for one in snapshot.instances),
        min(settings.bounces, 2), settings.passes, sorted(settings.slots.items()), settings.samples > 1,
        sorted(settings.shows or ()),
    )  # fmt: skip


def _types_in(graph: Graph) -> tuple[str, ...]:
    return tuple(sorted(node.type for node in graph.nodes.values()))


def _text_of(program: Program) -> tuple:
    return program.name, program.vertex, program.fragment, program.defines, program.snippets
