"""Measured costs of the device, by which methods are chosen; its name decides nothing.

The figures are measured once (frame/device_probe.py) and kept by driver and version in the user's folder for caches,
so that a picture is drawn alike each time. They are rounded, for the same reason. Tests, and whoever wants the choices
of another machine, set CANDELA_DEVICE to one of MADE_UP or to a JSON file with the fields of `Device`: then nothing is
measured or kept, and pictures depend on no clock.
"""

from __future__ import annotations

import contextlib
import json
import os
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

from . import user_folder

VERSION = 3  # of the kernels: figures of others are measured anew
MOST_KEPT = 16  # drivers
FILE = "candela_devices.json"
LOAD_GAIN = 0.7  # of a fetch's time, below which loads are worth the bindings that they take
COMPUTE_GAIN = 0.5  # of a fragment's time, below which compute programs are worth what they wait for
VARIABLE = "CANDELA_DEVICE"
OF_PIXELS = ("ray_level", "texel", "fetch", "load", "edge", "fragment", "compute")  # costs that come with each pixel


@dataclass(frozen=True)
class Device:
    """Nanoseconds of one of each."""

    ray_level: float  # of a shadow ray, for each doubling of the triangles that it may meet
    triangle: float  # of a depth map, small
    texel: float  # of a depth map, cleared and drawn
    view: float  # of a depth map: what Python and the driver take to begin it
    render_pass: float  # over a single pixel, waited for
    python: float  # of a pass, until it is asked for
    fetch: float  # of a texel far from that before, from a texture
    load: float  # the same from an image
    edge: float  # of a shadow, asked by a pixel for 64 points of a light
    fragment: float  # of 64 steps of arithmetic of a pixel that is drawn
    compute: float  # the same of a thread of a compute program

    def of_dearer_pixels(self, times: float) -> Device:
        """The same where each pixel takes so many times as long: a picture of as many times fewer pixels is then drawn
        in the same ways as one of all."""
        return replace(self, **{name: times * getattr(self, name) for name in OF_PIXELS})

    def lines(self) -> list[str]:
        """For the panel and the terminal."""
        drawn = f"triangle {_time(self.triangle)}, depth texel {_time(self.texel)}, view {_time(self.view)}"
        asked = f"pass {_time(self.render_pass)}, of it Python and driver {_time(self.python)}"
        read = f"texel fetched {_time(self.fetch)}, loaded {_time(self.load)}; edge of a shadow {_time(self.edge)}"
        steps = f"64 steps of arithmetic drawn {_time(self.fragment)}, computed {_time(self.compute)}"
        return [f"ray {_time(20 * self.ray_level)} (a million triangles), {drawn}", f"{asked}; {read}", steps]


# Made up for tests, near to what two threads of llvmpipe and a fast card do: whole renders of 16 samples of direct
# light, by maps and by rays; of cards only what others publish.
MADE_UP = {
    "software": Device(8.0, 130.0, 20.0, 8e5, 5e5, 3e5, 8.0, 2.5, 20.0, 80.0, 80.0),
    "card": Device(0.15, 0.3, 0.02, 5e3, 3e4, 2.5e4, 0.01, 0.012, 0.05, 0.01, 0.01),
}

_current: Device | None = None
measured_s = 0.0  # that the measurement took in this process; 0: it was known


def current() -> Device:
    """The figures that choices ask. Before they are known, those of a card: a choice that is made then is not kept."""
    return _current or given() or MADE_UP["card"]


def loads_beat_fetches() -> bool:
    """Whether shaders read texels faster from images than from textures: with Mesa's software rasteriser in down to a
    quarter of the time, where neighbours ask for texels far apart."""
    return current().load < LOAD_GAIN * current().fetch


def computes_beat_fragments() -> bool:
    """Whether compute programs run faster than full-screen passes, by more than a dispatch costs: on cards for
    computing, of which few units draw, in a twentieth of the time."""
    return current().compute < COMPUTE_GAIN * current().fragment


def known() -> bool:
    return _current is not None


def use(device: Device | None) -> None:
    """Let these figures decide from now on; None: measure or read them again."""
    global _current
    _current = device


def given() -> Device | None:
    """What CANDELA_DEVICE names. ValueError with a sentence where it is neither made up nor a file of figures."""
    name = os.environ.get(VARIABLE, "")
    if not name:
        return None
    if name in MADE_UP:
        return MADE_UP[name]
    try:
        with Path(name).open(encoding="utf-8") as file:
            return _of(json.loads(file.read(user_folder.MOST_BYTES)))
    except (OSError, ValueError, TypeError, OverflowError, RecursionError) as error:
        names = ", ".join(MADE_UP)
        raise ValueError(f"{VARIABLE} is '{name}': neither one of {names} nor a file of figures ({error}).") from None


def _of(values: dict) -> Device:
    missing = [field.name for field in fields(Device) if field.name not in values]
    if missing:
        raise ValueError(f"figures of {', '.join(missing)} are missing: measure again with this version")
    device = Device(**{field.name: float(values[field.name]) for field in fields(Device)})
    if not all(0.0 < value < 1e12 for value in asdict(device).values()):
        raise ValueError("figures must be nanoseconds above 0")
    return device


def key() -> str:
    """What the figures hold for."""
    from .context import describe

    return f"{describe()}, probe {VERSION}"


def read(folder: Path) -> Device | None:
    """The figures of this driver that were kept; None where there are none that can be read."""
    try:
        return _of(user_folder.kept(folder / FILE)[key()])
    except (KeyError, TypeError, ValueError, OverflowError):
        return None


def write(folder: Path, device: Device) -> None:
    """Keep the figures of this driver. A folder that cannot be written only means to measure again next time."""
    others = {name: one for name, one in user_folder.kept(folder / FILE).items() if name != key()}
    user_folder.keep(folder / FILE, dict([*others.items()][1 - MOST_KEPT :]) | {key(): asdict(device)})


def forget(folder: Path) -> None:
    """Measure anew when figures are next asked for: after a change of clocks, say."""
    use(None)
    with contextlib.suppress(OSError):
        (folder / FILE).unlink(missing_ok=True)


def _time(nanoseconds: float) -> str:
    for unit, size in (("ms", 1e6), ("µs", 1e3)):
        if nanoseconds >= size:
            return f"{nanoseconds / size:.3g} {unit}"
    return f"{nanoseconds:.3g} ns"


def milliseconds(nanoseconds: float) -> str:
    """For sentences about choices: `1.3 ms`."""
    return f"{nanoseconds / 1e6:.2g} ms" if nanoseconds < 99.5e6 else f"{nanoseconds / 1e6:.0f} ms"
