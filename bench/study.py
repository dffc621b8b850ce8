"""A study: what a file of bench/ measures, part by part, its options, and the page that its tables go into.

A part takes the options and gives rows of a table, or Markdown; one that yields gives all that is known so far each
time, so that what is measured stays when the run is ended. With `--page` it replaces what stands in docs/ between the
marks of `Study.mark`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from bench import markdown

ROOT = Path(__file__).resolve().parents[1]

Text = str | list  # Markdown, or rows of a table, the first of which is the head


def size_of(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdigit() and height.isdigit() and int(width) and int(height)):
        raise argparse.ArgumentTypeError(f"'{text}' is not a size such as 256x192")
    return int(width), int(height)


# What options are, as argparse takes them.
PICTURES = {"type": Path, "metavar": "FOLDER", "help": "write what is shown as PNG"}


def size(default: str) -> dict:
    return {"type": size_of, "default": size_of(default), "metavar": "WxH", "help": f"default {default}"}


def number(default: int, what: str) -> dict:
    return {"type": int, "default": default, "metavar": "N", "help": f"{what} (default {default})"}


def some_of(names: Iterable) -> dict:
    names = list(names)
    return {"nargs": "*", "choices": names, "default": names, "metavar": "NAME", "help": ", ".join(map(str, names))}


@dataclass(frozen=True)
class Study:
    """`name`: of the verb and, unless said otherwise, of the page. `flag`: the option that chooses parts."""

    name: str
    parts: Mapping[str, Callable[[argparse.Namespace], Text | Iterator[Text]]]
    options: Mapping[str, dict] = field(default_factory=dict)
    titles: Mapping[str, str] = field(default_factory=dict)  # of parts
    page: str = ""
    flag: str = "--page --parts"

    @property
    def path(self) -> Path:
        return ROOT / "docs" / f"{self.page or self.name}.md"

    def mark(self, part: str) -> str:
        """The command that writes a part, which stands in the page before it."""
        return f"python -m bench {self.name} {self.flag} {part}"

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        parser.add_argument(self.flag.split()[-1], **some_of(self.parts), dest="parts")
        for name, said in self.options.items():
            parser.add_argument(name, **said)
        parser.add_argument("--page", action="store_true", help=f"write the tables into docs/{self.path.name}")

    def command(self, options: argparse.Namespace) -> int:
        import addon
        from addon.cli.terminal import quiet
        from addon.gfx import context

        addon.register()
        with quiet():
            context.ensure()
        for part in options.parts:
            made = self.parts[part](options)
            for known in (made,) if isinstance(made, (str, list)) else made:
                text = known if isinstance(known, str) else markdown.table(known)
                text = f"**{self.titles[part]}**\n\n{text}" if part in self.titles else text
                print(f"\n{text}", flush=True)
                if options.page:
                    markdown.put_between(self.path, self.mark(part), text)
        return 0


def opened(name: str):
    """The scene of a sample file."""
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(ROOT / "sample_blends" / f"{name}.blend"))
    return bpy.context.scene
