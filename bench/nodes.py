"""`make nodes`: every shader node by Candela and by Cycles → docs/nodes.md and docs/images/nodes.png.

The table of nodes is written from the node table itself, the differences are measured. Takes about two minutes.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import sys
from pathlib import Path

import bpy
import numpy as np

import addon
from addon.materials import nodes
from addon.materials.nodes.entry import Entry
from addon.materials.reader import DISSOLVED
from bench import ages
from bench.markdown import write_whole

from .node_cases import Case, Difference, compare, new_material
from .node_list import CASES

ROOT = Path(__file__).resolve().parents[1]
COLUMNS = 10  # pairs of tiles side by side on the contact sheet

# No nodes of a surface: outputs, groups, and what only other engines or objects have.
LEFT_OUT = ("ShaderNodeOutput", "ShaderNodeGroup", "ShaderNodeTree", "ShaderNodeCustomGroup", "ShaderNodeUVAlongStroke")

HEAD = """\
# Shader nodes

Written by `make nodes` with Blender {version}; do not edit. {made}

{supported} node types are drawn in full, {limited} with a stated limit, {stand_in} by a stated stand-in, {missing} not
at all. {beside} of all types have cases beside Cycles, below. Of those drawn in full these have none: {without}.

A node that is not known keeps the value that is set in the socket it feeds. Everything but the first kind is named in
the render properties, with material and node.

## What is drawn

| node | state | what differs |
|---|---|---|
"""

COMPARISON = """
## Compared with Cycles

One output of a node as the radiance of an emission, one sample at each pixel's centre, {count} cases of {pixels} x
{pixels} pixels. Differences are in steps of 8 bits after the standard view transform: the largest, and the one that
99 % of the pixels stay below. Patterns that jump, images and noise are held to 2 steps on 99 % of the pixels,
everything else to 1 step on all. {good} of {count} keep that.

![Pairs of tiles: Candela left, Cycles right](images/nodes.png)

| case | largest | 99 % | |
|---|---|---|---|
"""


def available(cases: tuple[Case, ...] = CASES) -> list[Case]:
    """The cases that this Blender has."""
    return [case for case in cases if case.since <= bpy.app.version[:2]]


# The table of nodes -----------------------------------------------------------------------------------------------


def node_rows() -> list[tuple[str, str, str]]:
    """(name, state, sentences) of every shader node of this Blender, by name. Reads the node table."""
    tree = new_material("Table").node_tree
    rows = []
    for name in sorted(dir(bpy.types)):
        if not name.startswith("ShaderNode") or name.startswith(LEFT_OUT) or name == "ShaderNode":
            continue
        try:
            made = tree.nodes.new(name)
        except RuntimeError:
            continue
        rows.append((made.bl_label, *_state(made, [entry for entry in nodes.REGISTRY if entry.type == name])))
    for name in sorted(DISSOLVED):  # by Blender, before anything reads the tree
        with contextlib.suppress(RuntimeError):
            rows.append((tree.nodes.new(name).bl_label, "supported", ""))
    return sorted(rows)


def _state(made, entries: list[Entry]) -> tuple[str, str]:
    if not entries:
        closure = any(socket.type == "SHADER" for socket in made.outputs)
        return "missing", "Drawn as a diffuse surface." if closure else "What it feeds keeps the value set there."
    sentences = [entry.note for entry in entries if entry.note]
    if len(sentences) == len(entries):
        return "stand-in", " ".join(dict.fromkeys(sentences))
    for entry in entries:
        sentences += [approximation.sentence for approximation in entry.approximations]
        sentences += [sentence for _, _, sentence in entry.setting_approximations]
        sentences += [sentence for _, sentence in entry.output_approximations]
    known = {output for entry in entries for output, _ in entry.outputs}
    shown = {socket.identifier: socket.name for socket in made.outputs if socket.type != "SHADER"}
    unknown = sorted(shown[one] for one in shown if one not in known and not one.startswith(("__", "Result_Rot")))
    if unknown:
        sentences.append(f"Without the output{'s' if len(unknown) > 1 else ''} {', '.join(unknown)}.")
    return ("limited" if sentences else "supported"), " ".join(dict.fromkeys(sentences))


# The page ---------------------------------------------------------------------------------------------------------


def page(found: list[Difference], pixels: int) -> str:
    rows = node_rows()
    counts = {state: sum(row[1] == state for row in rows) for state in ("supported", "limited", "stand-in", "missing")}
    counts["stand_in"] = counts.pop("stand-in")
    beside = {difference.case.node for difference in found} | {d.case.through for d in found if d.case.through}
    labels = {getattr(bpy.types, f"ShaderNode{name}").bl_rna.name for name in beside if name}
    without = ", ".join(name for name, state, _ in rows if state == "supported" and name not in labels) or "none"
    about = {"version": bpy.app.version_string, "made": ages.now(), "beside": len(labels), "without": without}
    lines = [HEAD.format(**about, **counts)]
    lines += [f"| {name} | {state} | {text} |\n" for name, state, text in rows]
    good = sum(difference.good for difference in found)
    lines.append(COMPARISON.format(count=len(found), pixels=pixels, good=good))
    lines += [
        f"| {d.case.name} | {d.largest:.2f} | {d.percentile_99:.2f} | {'' if d.good else 'apart'} |\n" for d in found
    ]
    return "".join(lines)


def renewed(text: str) -> str:
    """The page with the table of nodes as it is now; the comparison stays, and so does its stamp."""
    rows = node_rows()
    counts = {state: sum(row[1] == state for row in rows) for state in ("supported", "limited", "stand-in", "missing")}
    numbers = iter(counts.values())
    head, _, rest = text.partition("## What is drawn\n")
    sentence = head.index(" node types are drawn in full")
    start = head.rindex("\n", 0, sentence) + 1
    end = head.index("at all.", start)
    counted = re.sub(r"\d+", lambda _: str(next(numbers)), head[start:end])
    made = "".join(f"| {name} | {state} | {said} |\n" for name, state, said in rows)
    columns = "| node | state | what differs |\n|---|---|---|\n"
    compared = rest.partition("## Compared")[2]
    return f"{head[:start]}{counted}{head[end:]}## What is drawn\n\n{columns}{made}\n## Compared{compared}"


def contact_sheet(found: list[Difference], path: Path) -> None:
    """All pairs in rows, the first at the top left, a dark line between neighbours."""
    height, width = found[0].ours.shape[:2]
    rows = -(-len(found) // COLUMNS)
    sheet = np.full((rows * (height + 2), COLUMNS * (2 * width + 4), 4), (0.05, 0.05, 0.05, 1.0), np.float32)
    for number, difference in enumerate(found):
        row, column = divmod(number, COLUMNS)
        y, x = (rows - 1 - row) * (height + 2), column * (2 * width + 4)
        sheet[y : y + height, x : x + width, :3] = difference.ours
        sheet[y : y + height, x + width : x + 2 * width, :3] = difference.theirs
    image = bpy.data.images.new("Nodes", sheet.shape[1], sheet.shape[0])
    image.pixels.foreach_set(sheet.ravel())
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pixels", type=int, default=32, help="width of a tile")
    parser.add_argument("--only", default="", help="cases whose name contains this; prints them and writes no page")
    parser.add_argument("--output", type=Path, default=ROOT / "docs")
    parser.add_argument("--table", action="store_true", help="the table of nodes alone; the comparison stays as it is")
    arguments = parser.parse_args()
    addon.register()
    if arguments.table:
        known = arguments.output / "nodes.md"
        write_whole(known, renewed(known.read_text(encoding="utf-8")))
        sys.stdout.flush()
        os._exit(0)
    cases = [case for case in available() if arguments.only.lower() in case.name.lower()]
    found = compare(cases, arguments.pixels)
    if arguments.only:
        for difference in found:
            state = "ok" if difference.good else "apart"
            print(f"{difference.largest:7.2f} {difference.percentile_99:7.2f}  {state:5}  {difference.case.name}")
    else:
        contact_sheet(found, arguments.output / "images" / "nodes.png")
        write_whole(arguments.output / "nodes.md", page(found, arguments.pixels))
        print(f"{sum(difference.good for difference in found)} of {len(found)} cases agree; see docs/nodes.md")
    # As in the tests: Blender 4.5 as a module does not come back from its exit handlers once a GPU was used.
    sys.stdout.flush()
    os._exit(0 if all(difference.good for difference in found) else 1)


if __name__ == "__main__":
    main()
