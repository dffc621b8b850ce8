"""Comparing one scene: Candela's render against Cycles' reference, gathered as plain data for a table or a page."""

from __future__ import annotations

import platform
import time
from dataclasses import dataclass, field

import numpy as np

from . import metrics
from .cache import Reference
from .first_row import Shown, few_samples, first_row
from .metrics import PathError
from .passes import ROWS, Passes, Row, light_paths


@dataclass(frozen=True)
class Picture:
    """One row of the comparison: both pictures, (H, W, C) float32 linear, bottom row first, and the error."""

    row: Row
    x: np.ndarray | None  # the engine under test
    reference: np.ndarray | None
    error: PathError


@dataclass(frozen=True)
class LedgerRow:
    """What one technique did in the frame."""

    name: str
    state: str  # ran, reused, skipped
    reason: str = ""
    milliseconds: float = 0.0


@dataclass(frozen=True)
class Comparison:
    """Everything that a table or a report page says about one scene by two engines."""

    scene: str
    pictures: tuple[Picture, ...]
    size: tuple[int, int]
    samples: int
    reference_samples: int  # of each of the reference's two renders
    seconds: float = 0.0  # wall time of Candela's whole render
    reference_seconds: float = 0.0  # wall time of Cycles' two renders, when they were made
    reference_cached: bool = False
    file: str = ""
    frame: int = 1
    engine: str = "Candela"
    reference_engine: str = "Cycles"
    direct_only: bool = False  # Combined of the reference shows direct light, emission and world only
    versions: dict[str, str] = field(default_factory=dict)  # "Blender" -> "5.2.3 LTS"
    device: str = ""
    ledger: tuple[LedgerRow, ...] = ()
    times: dict[str, float] = field(default_factory=dict)  # stage of Candela's render -> seconds
    notes: tuple[str, ...] = ()
    date: str = ""
    opening: tuple[Shown, ...] = ()  # the page's first row

    @property
    def errors(self) -> tuple[PathError, ...]:
        return tuple(picture.error for picture in self.pictures)

    def error(self, label: str) -> PathError:
        """The error of the row with this label; `KeyError` when there is none."""
        for picture in self.pictures:
            if picture.row.label == label:
                return picture.error
        raise KeyError(f"The comparison has no row '{label}'.")


def compare_passes(passes: Passes, reference: Reference, with_flip: bool = True) -> tuple[Picture, ...]:
    """All rows that are worth showing, in the order of `ROWS`, each with its error."""
    paths = light_paths(passes.images, passes.film_transparent)
    reference_paths, half_paths = reference.paths()
    pictures = []
    for row in ROWS:
        mine, theirs, half = (
            (paths, reference_paths, half_paths)
            if row.source == "path"
            else (passes.images, reference.images, reference.half)
        )
        x, r = mine.get(row.name), theirs.get(row.name)
        if not row.always and (r is None or x is None or not (np.any(r) or np.any(x))):
            continue
        if row.name == "depth":
            error = metrics.compare_depth(row.label, x, r)
        elif row.name == "normal":
            error = metrics.compare_normal(row.label, x, r)
        else:
            error = metrics.compare_radiance(row.label, x, r, half.get(row.name))
        pictures.append(Picture(row, x, r, error))
    if with_flip:
        errors = metrics.with_flip([p.error for p in pictures], [(p.x, p.reference) for p in pictures])
        pictures = [Picture(p.row, p.x, p.reference, error) for p, error in zip(pictures, errors, strict=True)]
    return tuple(pictures)


def compare_scene(
    scene,
    samples: int,
    reference_samples: int,
    size: tuple[int, int] | None = None,
    direct_only: bool = False,
    engine: str = "CANDELA",
    ledger=None,
    with_flip: bool = True,
    use_cache: bool = True,
    view_layer=None,
    seed: int = 1,
    folder=None,
    with_first_row: bool = False,
) -> Comparison:
    """Render `scene` (a bpy Scene) by `engine` and by Cycles, and compare them.

    `ledger` is what the engine wrote about its frame (`rows`, `times`, `notes`); without one, the engine's latest is
    asked for. The other arguments are those of `reference.render_passes`. Raises `reference.RenderFailed`.
    """
    from . import reference as rendering  # bpy is needed from here on only

    view_layer = view_layer or rendering.active_view_layer(scene)
    few = few_samples(scene, seed, direct_only, size, view_layer) if with_first_row else []
    passes = rendering.render_passes(scene, engine, samples, seed, direct_only, size, view_layer)
    if ledger is None and engine == "CANDELA":
        ledger = _latest_ledger()
    truth = rendering.reference(scene, reference_samples, direct_only, size, view_layer, use_cache, folder)
    opening = ()
    if with_first_row:
        opening = first_row(few, passes, truth, scene, seed, direct_only, size, view_layer)
    about = rendering.describe(scene)
    return Comparison(
        scene=scene.name,
        pictures=compare_passes(passes, truth, with_flip),
        size=passes.size,
        samples=samples,
        reference_samples=reference_samples,
        seconds=passes.seconds,
        reference_seconds=truth.seconds,
        reference_cached=truth.cached,
        file=about["file"],
        frame=about["frame"],
        engine={"CANDELA": "Candela", "CYCLES": "Cycles"}.get(engine, engine),
        direct_only=direct_only,
        versions={"Blender": about["blender"], "Python": platform.python_version(), "numpy": np.__version__},
        device=about["device"],
        ledger=ledger_rows(ledger),
        times=dict(getattr(ledger, "times", None) or {}),
        notes=tuple(str(note) for note in getattr(ledger, "notes", None) or ())
        + passes.notes
        + missing_paths(passes, truth),
        date=time.strftime("%Y-%m-%d %H:%M"),
        opening=opening,
    )


def missing_paths(passes: Passes, reference: Reference) -> tuple[str, ...]:
    """A sentence about the light paths that carry light in the reference and are not rendered by the engine at all."""
    wanted = [row for row in ROWS if row.source == "path" and not row.always]
    rendered, (there, _) = light_paths(passes.images, passes.film_transparent), reference.paths()
    names = [row.label.lower() for row in wanted if row.name not in rendered and np.any(there.get(row.name, 0))]
    if not names:
        return ()
    return (f"The reference has light in paths that {passes.engine.title()} does not render: {', '.join(names)}.",)


def ledger_rows(ledger) -> tuple[LedgerRow, ...]:
    """Plain rows of a ledger object (or of none)."""
    return tuple(
        LedgerRow(getattr(row, "label", "") or row.name, row.state, row.reason or _counted(row), row.milliseconds)
        for row in getattr(ledger, "rows", None) or ()
    )


def _counted(row) -> str:
    """What a technique counted in the frame ("4 passes, 12 views"), in place of a reason."""
    return ", ".join(f"{value} {name}" for name, value in (getattr(row, "counters", None) or {}).items())


def _latest_ledger():
    from ..frame import ledger

    return ledger.latest()
