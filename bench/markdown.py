"""Tables and parts of documents that commands write."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from addon.whole_files import replacing

END = "<!-- end of what is written -->"


def write_whole(path: Path, text: str) -> None:
    """Replace the file at once: whoever reads or interrupts finds the old text or the new one."""
    with replacing(path.resolve()) as file:
        file.write(text.encode())


def begin(command: str) -> str:
    """The mark before what `command` writes."""
    return f"<!-- written by `{command}` -->"


def table(rows: Sequence[Sequence[str]]) -> str:
    """The first row is the head."""
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join([lines[0], "|---" * len(rows[0]) + "|", *lines[1:]])


def put_between(path: Path, command: str, part: str, stamped: bool = True, made: str = "") -> None:
    """Replace what stands between the mark of `command` and the next end. ValueError when the file has none.

    Unless it is not to be `stamped`, the part says when and at which commit it was `made` (bench/ages.py); now, if that
    is empty.
    """
    mark = begin(command)
    before, found, rest = path.read_text(encoding="utf-8").partition(mark)
    _, end, after = rest.partition(END)
    if not (found and end):
        raise ValueError(f"{path.name} lacks the marks '{mark}' and '{END}'.")
    from bench import ages

    said = f"{made or ages.now()}\n\n" if stamped else ""
    write_whole(path, f"{before}{mark}\n\n{said}{part}\n\n{END}{after}")


def rows_of(page: str, command: str, head: Sequence[str]) -> list[list[str]]:
    """Rows, without their heads, of the tables with that head that a command wrote on a page."""
    rows, ours = [], False
    for line in page.partition(begin(command))[2].partition(END)[0].splitlines():
        cells = [cell.strip() for cell in line[1:-1].split("|")] if line.startswith("| ") else []
        ours = bool(cells or line.startswith("|-")) and (ours or cells == list(head))
        if ours and cells and cells != list(head):
            rows.append(cells)
    return rows
