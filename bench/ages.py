"""How old the generated pages are: `python -m bench ages`, which writes the table on docs/versions.md.

Each page, or the part of one that a command writes, carries the commit and the date at which its figures were made.
Here the commits to `addon` and `shaders` since then are counted. A page that more than OLD of them have passed may say
what is not true any more; the table names it, and a test fails while it does not.
"""

from __future__ import annotations

import argparse
import datetime as dt
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

from bench import markdown
from bench.cells import ROOT

OLD = 30  # commits to the code
CODE = ("addon", "shaders")
TABLE = ROOT / "docs" / "versions.md"
COMMAND = "python -m bench ages"
STAMP = re.compile(r"Made on (\d{4}-\d\d-\d\d) at commit ([0-9a-f]{7,40})\b")
PAGES = {  # and the commands that write them
    "docs/direct_light.md": "python -m bench direct --page docs/direct_light.md",
    "docs/gpu.md": "python -m bench gpu",
    "docs/indirect_light.md": "python -m bench indirect --page docs/indirect_light.md",
    "docs/nodes.md": "make nodes",
    "docs/other_files.md": "python -m bench others --page",
    "docs/performance.md": "make bench",
    "docs/soft_shadows.md": (
        "python -m bench.soft --page, python -m bench.soft_lights --page, python -m bench soft_sources --page"
    ),
    "docs/viewport.md": "make bench-viewport",
}


@dataclass(frozen=True)
class Made:
    """When the oldest part of a page was made."""

    page: str
    date: str
    commit: str
    since: int | None  # commits to the code since then; None where this clone does not know the commit

    @property
    def old(self) -> bool:
        return self.since is None or self.since > OLD


def git(*arguments: str) -> str | None:
    """What git says, or None where it knows nothing of that."""
    try:
        done = subprocess.run(["git", *arguments], cwd=ROOT, check=False, capture_output=True, text=True)
    except OSError:
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def commit() -> str:
    """Of the working tree, as rows of tables name it; empty outside of a clone."""
    return git("rev-parse", "--short=10", "HEAD") or ""


def now() -> str:
    """The sentence that a page carries which is made now; empty outside of a clone."""
    return stamp(dt.datetime.now(dt.UTC).strftime("%Y-%m-%d"), commit())


def stamp(date: str, commit: str) -> str:
    return f"Made on {date} at commit {commit}." if commit else ""


def of_text(page: str, text: str) -> list[Made]:
    """All stamps of a page."""
    return [Made(page, date, commit, _since(commit)) for date, commit in STAMP.findall(text)]


def _since(commit: str) -> int | None:
    count = git("rev-list", "--count", f"{commit}..HEAD", "--", *CODE)
    return None if count is None else int(count)


def oldest(page: str) -> Made:
    """ValueError where a page has no stamp."""
    found = of_text(page, (ROOT / page).read_text(encoding="utf-8"))
    if not found:
        raise ValueError(f"{page} does not say at which commit it was made.")
    return max(found, key=lambda made: float("inf") if made.since is None else made.since)


def table() -> str:
    rows = [("page", "made by", "on", "at commit", "")]
    for page, command in PAGES.items():
        made = oldest(page)
        name, link = Path(page).stem.replace("_", " "), Path(page).relative_to("docs")
        old = "older than the code that it describes" if made.old else ""
        rows.append((f"[{name}]({link})", f"`{command}`", made.date, made.commit, old))
    return markdown.table(rows)


# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--print", action="store_true", dest="only_print", help="print the table and leave the page")


def command(options: argparse.Namespace) -> int:
    if options.only_print:
        print(table())
    else:
        markdown.put_between(TABLE, COMMAND, table(), stamped=False)
        print(TABLE)
    return 0
