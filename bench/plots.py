"""Pictures of the benchmark: time against error on logarithmic axes, and growth of cost over a dial."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import LogFormatterSciNotation, NullFormatter

from bench.figures import DRAFT, FAST, OWN, Results, bias_floor, staircase

OWN_COLORS = ("#c8501e", "#e09b32", "#8c3b6d", "#3d8f6f", "#b5651d", "#7a7f2e", "#c06a8a")
STYLES = {
    "EEVEE": ("#3f6fb5", "s", True),
    "EEVEE, ray traced": ("#3f6fb5", "s", False),
    "Cycles": ("#8a8a8a", "o", True),
    "Cycles, denoised": ("#4b4b4b", "o", False),
    "Cycles, no bounces": ("#b9b9b9", "X", True),
}

SHOWN = (OWN, FAST, DRAFT, "Candela, raw")  # beside peers


def style(label: str, own: list[str]) -> dict:
    """Line and marker of a series; all of Candela's are warm diamonds."""
    if label in STYLES:
        color, marker, filled = STYLES[label]
    else:
        color, marker, filled = OWN_COLORS[own.index(label) % len(OWN_COLORS)], "D", label == "Candela"
    return {"color": color, "marker": marker, "markerfacecolor": color if filled else "white"}


def time_error(axes, results: Results, scene: str, labels: list[str], path: str = "combined") -> None:
    """One scene and light path: a marker per cell, the staircase of each series, noise as a band, bias as a line."""
    own = [label for label in results.labels(scene) if label.startswith("Candela")]
    floor = results.floor(scene, path)
    for label in labels:
        points = results.curve(scene, label, path)
        if not points:
            continue
        look, front = style(label, own), label in SHOWN
        steps = staircase(points)
        axes.step(
            [step.seconds for step in steps], [step.error for step in steps], where="post", color=look["color"],
            linewidth=1.6 if front else 0.9, alpha=0.9, zorder=3 if front else 2,
        )  # fmt: skip
        axes.plot(
            [point.seconds for point in points], [point.error for point in points], linestyle="none",
            markersize=5.5 if front else 4.5, markeredgewidth=1.0, label=label, zorder=4 if front else 3, **look,
        )  # fmt: skip
        bias = bias_floor(points, floor) if label.startswith("Candela") else None
        if bias:
            axes.axhline(bias, color=look["color"], linestyle=":", linewidth=1.0, zorder=1)
    axes.set_xscale("log")
    axes.set_yscale("log")
    if floor > 0:
        low = min(axes.get_ylim()[0], floor / 3)
        axes.axhspan(low, floor, color="#d8d4cb", alpha=0.7, linewidth=0, zorder=0)
        axes.set_ylim(bottom=low)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_formatter(LogFormatterSciNotation())
    axes.grid(which="major", color="#e4e4e4", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)


def overview(results: Results, path: Path) -> None:
    """All scenes, Combined: Candela as it comes and the peers."""
    labels = [*SHOWN, *(name for name in STYLES if name != "Cycles, no bounces")]
    columns = 4 if len(results.scenes) > 6 else 3
    rows = -(-len(results.scenes) // columns)
    figure, grid = plt.subplots(
        rows, columns, figsize=(3.3 * columns, 2.7 * rows + 0.6), layout="constrained", squeeze=False
    )
    for axes, scene in zip(grid.flat, results.scenes):
        time_error(axes, results, scene, labels)
        axes.set_title(scene.replace("_", " "), fontsize=10, loc="left")
    for axes in grid.flat[len(results.scenes) :]:
        axes.set_visible(False)
    for axes in grid[:, 0]:
        axes.set_ylabel("relMSE", fontsize=9)
    for axes in grid[-1]:
        axes.set_xlabel("seconds for a whole render", fontsize=9)
    handles: dict = {}
    for axes in grid.flat:
        for handle, label in zip(*axes.get_legend_handles_labels()):
            handles.setdefault(label, handle)
    figure.legend(handles.values(), handles.keys(), loc="outside upper center", ncols=5, frameon=False, fontsize=9)
    save(figure, path)


def scene_figure(results: Results, scene: str, path: Path) -> None:
    """One scene with every series, a panel per light path."""
    shown = results.paths(scene)
    figure, grid = plt.subplots(1, len(shown), figsize=(3.6 * len(shown), 3.6), layout="constrained", squeeze=False)
    for axes, name in zip(grid[0], shown):
        labels = [label for label in results.labels(scene) if path_fits(label, name)]
        time_error(axes, results, scene, labels, name)
        axes.set_title(name.replace("_", " "), fontsize=10, loc="left")
        axes.set_xlabel("seconds", fontsize=9)
    grid[0][0].set_ylabel("relMSE", fontsize=9)
    handles: dict = {}
    for axes in grid[0]:
        for handle, label in zip(*axes.get_legend_handles_labels()):
            handles.setdefault(label, handle)
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    save(figure, path)


def path_fits(label: str, path: str) -> bool:
    """Renders without bounces stand beside renders without bounces: in the direct paths."""
    return "direct" in path.replace("indirect", "") if "no bounces" in label else True


def growth(rows: list[dict], path: Path) -> None:
    """Cost over each dial, relative to its smallest value; the dashed line grows in proportion to the dial."""
    names = list(dict.fromkeys(row["dial"] for row in rows))
    columns = 4
    lines = -(-len(names) // columns)
    figure, grid = plt.subplots(
        lines, columns, figsize=(3.2 * columns, 2.7 * lines), layout="constrained", squeeze=False
    )
    for axes, name in zip(grid.flat, names):
        some = sorted((row for row in rows if row["dial"] == name), key=lambda row: row["value"])
        values = np.array([row["value"] for row in some], float)
        seconds = np.array([row["seconds"] for row in some])
        axes.plot(values, seconds, "D-", color=OWN_COLORS[0], markersize=4, linewidth=1.4, label="whole render")
        techniques = sorted({key for row in some for key in row["techniques"]})
        largest = sorted(techniques, key=lambda key: -some[-1]["techniques"].get(key, 0.0))[:3]
        for number, key in enumerate(largest):
            times = [row["techniques"].get(key, np.nan) / 1000 for row in some]
            axes.plot(values, times, "o-", color=OWN_COLORS[1 + number], markersize=3, linewidth=0.9, label=key)
        axes.plot(values, seconds[0] * values / values[0], "--", color="#b0b0b0", linewidth=0.9)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_ylim(bottom=max(min(seconds) / 30, 1e-4))
        axes.set_title(name, fontsize=10, loc="left")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(color="#e4e4e4", linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8)
        axes.legend(fontsize=7, frameon=False)
    for axes in grid.flat[len(names) :]:
        axes.set_visible(False)
    for axes in grid[:, 0]:
        axes.set_ylabel("seconds", fontsize=9)
    save(figure, path)


def save(figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130)
    plt.close(figure)
