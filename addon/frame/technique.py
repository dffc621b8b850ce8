"""The contract of a technique: data about itself, and the stages in which it works on a picture.

Techniques are registered in techniques/__init__.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..gfx.library import Program
    from ..snapshot.scene import Snapshot
    from .picture import Frame
    from .settings import Settings


NEEDED = {bool: "on or off", int: "a whole number", float: "a number", str: "a word"}  # for messages, by type


SCENE, CAMERA, WORLD, LIGHT, MATERIAL, OBJECT = "SCENE", "CAMERA", "WORLD", "LIGHT", "MATERIAL", "OBJECT"
OF_A_PICTURE = (SCENE, CAMERA, WORLD)  # scopes of which a picture has one data-block: their values are its settings
POINT, DIRECTION = "POINT", "DIRECTION"


@dataclass(frozen=True)
class Param:
    """One parameter, declared once. Blender property, command-line override, benchmark axis and manual derive from it.

    `default` fixes the type: bool, int, float, str for a choice among `items` (identifier, label, number, description),
    or a tuple of three floats. `scope` is the kind of data-block that has it: the scene, the picture's camera or world,
    or each lamp, material or object (whose values come with the snapshot; see `own_value`).

    With `many` it is a list of groups of those parameters, a tuple of {name: value}. A vector with a `handle` (POINT or
    DIRECTION, in the object's space) can be dragged in the 3D viewport. `image`, `object`: the name of such a
    data-block; `file`: the path of a file.
    """

    name: str
    label: str
    default: bool | int | float | str | tuple
    description: str
    minimum: float | None = None
    maximum: float | None = None
    unit: str = ""  # Blender property unit: PIXEL, FACTOR, …
    items: tuple[tuple[str, str, int, str], ...] = ()
    scope: str = SCENE
    many: tuple[Param, ...] = ()
    handle: str = ""
    image: bool = False
    object: bool = False
    file: bool = False
    draft: bool | int | float | None = None  # upper bound in a draft: what a viewport shows while the view moves

    def check(self, value):
        """`value` in this parameter's type and range, or ValueError with a sentence."""
        kind = type(self.default)
        if kind is tuple:
            if isinstance(value, tuple):
                return value
            raise ValueError(f"'{self.name}' is set on data-blocks in Blender, not by a text.")
        try:
            value = _as_bool(value) if kind is bool else kind(value)
        except (TypeError, ValueError):
            raise ValueError(f"'{self.name}' needs {NEEDED[kind]}, not '{value}'.") from None
        if self.items and value not in [item[0] for item in self.items]:
            raise ValueError(f"'{self.name}' must be one of {', '.join(i[0] for i in self.items)}, not '{value}'.")
        if kind in (int, float):
            if value != value or (self.minimum is not None and value < self.minimum):
                raise ValueError(f"'{self.name}' must be at least {self.minimum}, not {value}.")
            if self.maximum is not None and value > self.maximum:
                raise ValueError(f"'{self.name}' must be at most {self.maximum}, not {value}.")
        return value


def own_value(own: tuple[tuple[str, object], ...], technique: Technique | type[Technique], name: str):
    """Value of a technique's parameter of a lamp, material or object, from what its data-block has set (`own` of the
    snapshot's Light, Material or Instance). KeyError if no such parameter is declared."""
    param = next((param for param in technique.params if param.name == name), None)
    if param is None:
        raise KeyError(f"Technique {technique.name} declares no parameter '{name}'.")
    value = dict(own).get(identifier(technique.name, name), param.default)
    return tuple(dict(entry) for entry in value) if param.many else value


def identifier(technique: str, param: str) -> str:
    """Name of the Blender property that holds a technique's parameter."""
    return f"{technique}_{param}"


def _as_bool(value) -> bool:
    if isinstance(value, str):
        words = {
            "1": True,
            "true": True,
            "on": True,
            "yes": True,
            "0": False,
            "false": False,
            "off": False,
            "no": False,
        }
        return words[value.lower()] if value.lower() in words else _refuse(value)
    return bool(value)


def _refuse(value):
    raise ValueError(value)


@dataclass(frozen=True)
class Write:
    """An image that a technique writes. `accumulates`: techniques blend into it additively; it is cleared before the
    first sample or, where a technique `finishes` it, by that one after each sample. `by_need`: this declaration alone
    does not allocate it; another technique of the plan has to write it, too."""

    name: str
    format: str
    description: str
    accumulates: bool = False
    by_need: bool = False
    ranked: bool = False  # pairs (id, weight) to which samples add by id (kernels/ranks.py): no sum, but cleared as one


class Service:
    """What one technique provides to others while a picture is made. Asked for by its class (Frame.service)."""

    name = ""  # of its socket in a pass tree


class Technique:
    """Base of all techniques. Instances live as long as a Renderer and may keep GPU resources of their own.

    A picture is made in stages: `begin` of all techniques in the plan's order, `sample` of all for each sample, `end`
    of all after the last sample, and `show` of all whenever the mean of the samples so far is shown. A stage that takes
    long is a generator: at each `yield` a viewport may pause to answer its user.
    """

    name = ""
    label = ""
    fills: tuple[str, ...] = ()  # slots: of the techniques that fill one, one runs
    params: tuple[Param, ...] = ()
    reads: tuple[str, ...] = ()
    writes: tuple[Write, ...] = ()
    finishes: tuple[str, ...] = ()  # taken over after each sample: it runs after all that only write them
    provides: tuple[type[Service], ...] = ()
    requests: tuple[type[Service], ...] = ()  # services whose providers run before it in each stage
    remembers: tuple[Write, ...] = ()  # of its writes: the next picture has them as frame.before (history.py)
    owns: tuple[str, ...] = ()  # kinds of transport that it takes over (light_paths.TRANSPORTS)

    @classmethod
    def params_of(cls, *scopes: str) -> tuple[Param, ...]:
        """The parameters of these scopes, in order."""
        return tuple(param for param in cls.params if param.scope in scopes)

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        """Why this scene does not need the technique, as "the world is black", without capital or full stop; None if it
        does. Must be cheap and must not use the GPU."""
        return None

    def claims(self, snapshot: Snapshot, settings: Settings) -> bool:
        """Whether Auto takes it for its slot in this scene, whatever the benchmark's means over scenes say."""
        return False

    def looks_at(self, settings: Settings) -> tuple[str, ...]:
        """Names of accumulated images (light paths, colours, normals) that it reads one by one. Those that nobody names
        may be merged into one sum (Held.is_apart)."""
        return ()

    def programs(self, snapshot: Snapshot, settings: Settings) -> tuple[Program, ...]:
        """Programs that the picture will need, to be compiled ahead; any that are missing compile when first used."""
        return ()

    def begin(self, frame: Frame) -> Iterator[None] | None:
        """Once for each picture, before its first sample."""

    def sample(self, frame: Frame) -> Iterator[None] | None:
        """The passes of sample number `frame.sample`."""

    def end(self, frame: Frame) -> Iterator[None] | None:
        """Once for each picture, after its last sample."""

    def show(self, frame: Frame) -> Iterator[None] | None:
        """Work on the mean of the samples so far, each time when it is shown."""

    @property
    def only_shows(self) -> bool:
        """Whether `show` is its only stage. Then no sample is drawn again when its parameters or the time change."""
        mine = type(self)
        stages = ("begin", "sample", "end")
        return mine.show is not Technique.show and all(getattr(mine, s) is getattr(Technique, s) for s in stages)

    def release(self) -> None:
        """Drop GPU resources."""
