"""What the benchmark measures: scenes × series × samples, as plain data, and the file that keeps every measured cell.

A cell is one engine with one set of settings at one number of samples on one scene. Its key is a hash of all that its
figures depend on: the scene's file (or the source of its family), the settings, the size, Blender's version and device,
and, for Candela, every source file of the add-on and what Auto chooses by. A run that is interrupted, or started again
after a change, measures only the cells whose keys it does not find.
"""

from __future__ import annotations

import ast
import hashlib
import json
import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SCENES = ROOT / "sample_blends"

SWEEP = (1, 2, 4, 8, 16, 32, 64)  # of Candela
CYCLES_SWEEP = (1, 2, 4, 8, 16, 32, 64, 128, 256)
EEVEE_SWEEP = (16, 4, 1, 64)  # the first is the one that claims are made about
# What a page needs at least, and what tells most beyond that: kept the longest when time is short.
NEEDED, MAIN, EXTRA = range(3)
NEEDED_SAMPLES = {"CANDELA": (1, 4, 16), "BLENDER_EEVEE": (16, 4, 1), "CYCLES": (1, 4, 16, 64)}
MAIN_SAMPLES = {"CANDELA": (2, 64), "BLENDER_EEVEE": (), "CYCLES": (256,)}


@dataclass(frozen=True)
class Series:
    """An engine with settings; its samples are swept. `label` names it in tables and plots."""

    label: str
    engine: str
    samples: tuple[int, ...]
    main: bool = False  # the engine as it comes, without any setting chosen by hand
    bounces: int | None = None  # None: all that the engine renders by itself
    denoised: bool = False
    ray_traced: bool = False  # EEVEE's own ray tracing
    slots: tuple[tuple[str, str], ...] = ()  # Candela's technique by slot, where not Auto
    values: tuple[tuple[str, float], ...] = ()  # Candela's parameters by property, where not the default

    @property
    def own(self) -> bool:
        return self.engine == "CANDELA"

    @property
    def paths(self) -> bool:
        """Whether its light paths can be compared one by one: EEVEE splits light otherwise, denoising knows only
        Combined."""
        return self.engine != "BLENDER_EEVEE" and not self.denoised


def preset(name: str) -> tuple[tuple[str, float], ...]:
    """What a quality preset of Candela sets by property; samples are swept and left out."""
    text = (ROOT / "addon" / "ui" / "presets" / "candela" / "quality" / f"{name}.py").read_text(encoding="utf-8")
    found = re.findall(r"^candela\.(\w+) = (\S+)$", text, re.MULTILINE)
    return tuple((key, ast.literal_eval(value)) for key, value in found if not key.endswith("samples"))


OWN = Series("Candela", "CANDELA", SWEEP, main=True)
FAST = Series("Candela, Fast preset", "CANDELA", (4, 1, 16), main=True, values=preset("Fast"))
DRAFT = Series("Candela, Draft preset", "CANDELA", (1, 4), main=True, values=preset("Draft"))
RAW = Series("Candela, raw", "CANDELA", (16, 4, 8, 32, 64), main=True, values=(("denoise_strength", 0.0),))
PEERS = (
    Series("EEVEE", "BLENDER_EEVEE", EEVEE_SWEEP),
    Series("EEVEE, ray traced", "BLENDER_EEVEE", EEVEE_SWEEP, main=True, ray_traced=True),
    Series("Cycles", "CYCLES", CYCLES_SWEEP, main=True),
    Series("Cycles, denoised", "CYCLES", CYCLES_SWEEP, main=True, denoised=True),
    Series("Cycles, no bounces", "CYCLES", (1, 4, 16, 64), bounces=0),
)


FIRST = "Candela, first techniques"


def choices(registry: Iterable) -> dict[str, list]:
    """Techniques by slot, in the registry's order, of slots that have several."""
    found: dict[str, list] = {}
    for technique in registry:
        for slot in technique.fills:
            found.setdefault(slot, []).append(technique)
    return {slot: techniques for slot, techniques in found.items() if len(techniques) > 1}


def own_series(registry: Iterable) -> tuple[Series, ...]:
    """Candela as it comes, by its fast presets, raw, without bounces, with the first technique of every slot, and with
    each other instead.

    What is set by hand is set in every slot that has a choice, so that those series do not depend on what Auto knows.
    """
    found = [OWN, FAST, DRAFT, Series("Candela, no bounces", "CANDELA", SWEEP, bounces=0)]
    if any(technique.name == "denoise" for technique in registry):
        found.append(RAW)
    slots = choices(registry)
    first = {slot: techniques[0].name for slot, techniques in slots.items()}
    if first:
        found.append(Series(FIRST, "CANDELA", SWEEP, slots=tuple(first.items())))
    for slot, techniques in slots.items():
        for one in techniques[1:]:
            chosen = tuple({**first, slot: one.name}.items())
            found.append(Series(f"Candela, {one.label.lower()}", "CANDELA", SWEEP, slots=chosen))
    return tuple(found)


@dataclass(frozen=True)
class Scene:
    """A sample file, or a member of a procedural family: family and value of its dial."""

    name: str
    family: str = ""
    dial: float = 0.0

    @property
    def file(self) -> Path | None:
        return None if self.family else SCENES / f"{self.name}.blend"

    def content(self) -> str:
        """Hash of what defines the scene."""
        source = self.file or Path(__file__).with_name("families.py")
        return hashlib.blake2b(source.read_bytes() + f"{self.family} {self.dial}".encode(), digest_size=12).hexdigest()


# Of these Cycles gives no truth: paths rarely find a small lamp behind glass, and a patch of grass is Candela's own.
# They have pages of their own, with other references.
NO_TRUTH = {
    "caustics_pool": "docs/caustics.md", "caustics_rings": "docs/caustics.md", "caustics_table": "docs/caustics.md",
    "meadow": "docs/grass.md",
}  # fmt: skip


def sample_scenes() -> tuple[Scene, ...]:
    """Those that Cycles gives a truth of."""
    return tuple(one for one in _all_scenes() if one.name not in NO_TRUTH)


def _all_scenes() -> tuple[Scene, ...]:
    return tuple(Scene(path.stem) for path in sorted(SCENES.glob("*.blend")))


def named_scenes(names: list[str] | None) -> tuple[Scene, ...]:
    """Sample scenes of these names, without any those of `sample_scenes`; ValueError where one is unknown."""
    scenes = _all_scenes() if names else sample_scenes()
    unknown = set(names or ()) - {scene.name for scene in scenes}
    if unknown:
        known = ", ".join(scene.name for scene in scenes)
        raise ValueError(f"There is no scene {', '.join(sorted(unknown))}; there is {known}.")
    return tuple(scene for scene in scenes if not names or scene.name in names)


@dataclass(frozen=True)
class Cell:
    """One point of a plot. `size` is (width, height) in pixels."""

    scene: Scene
    series: Series
    samples: int
    size: tuple[int, int]
    reference_samples: int

    @property
    def rank(self) -> int:
        """NEEDED, MAIN or EXTRA."""
        if self.series.main and self.samples in NEEDED_SAMPLES[self.series.engine]:
            return NEEDED
        return MAIN if self.series.main and self.samples in MAIN_SAMPLES[self.series.engine] else EXTRA

    def key(self, machine: str) -> str:
        """Name of the cell in the store; `machine` is Blender's version and the device."""
        settings = {name: value for name, value in asdict(self.series).items() if name not in ("samples", "main")}
        about = {
            "scene": self.scene.content(),
            "settings": settings,
            "samples": self.samples,
            "size": self.size,
            "reference": self.reference_samples,
            "machine": machine,
            "sources": sources() if self.series.own else "",
        }
        return hashlib.blake2b(json.dumps(about, sort_keys=True).encode(), digest_size=16).hexdigest()


@cache
def sources() -> str:
    """Hash of everything that Candela is made of."""
    digest = hashlib.blake2b(digest_size=12)
    for folder in ("addon", "shaders"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".glsl", ".npz"):
                digest.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()


def in_turns(cells: Iterable[Cell]) -> list[Cell]:
    """The cells of each scene by rank, in alternating order of their series, from few samples to many."""
    cells = list(cells)
    places: dict[tuple[Scene, Series], int] = {}
    order = {}
    for cell in cells:
        place = places.setdefault((cell.scene, cell.series), 0)
        places[cell.scene, cell.series] = place + 1
        order[cell] = place
    scenes = list(dict.fromkeys(cell.scene for cell in cells))
    return sorted(cells, key=lambda cell: (scenes.index(cell.scene), cell.rank, order[cell]))


@dataclass
class Store:
    """Measured cells by key, in a file of one JSON object per line, to which each cell is added at once."""

    path: Path
    found: dict[str, dict] = field(default_factory=dict)

    def __post_init__(self):
        if self.path.exists():
            for line in self.path.read_text(encoding="utf-8").splitlines():
                try:
                    row = json.loads(line)
                except ValueError:
                    continue  # the line that was being written when the machine went down
                self.found[row["key"]] = row

    def remember(self, rows: Iterable[dict]) -> None:
        """Take rows of a results file for those that are not in the store, as on a machine that lost its own."""
        for row in rows:
            self.found.setdefault(row["key"], row)

    def add(self, key: str, figures: dict) -> dict:
        """Keep the figures of a cell; returns the row as it was written."""
        row = {"key": key, **figures}
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row, ensure_ascii=False) + "\n")
        self.found[key] = row
        return row
