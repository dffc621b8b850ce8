"""The texts: module docstrings stay short, and what pages and docstrings point to exists."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
MOST_LINES = 30  # of a module's docstring: method, source, cost, bias, failure; experiments go to docs/log
PAGES = (ROOT / "README.md", *sorted(ROOT.glob("docs/**/*.md")))
MODULES = sorted(ROOT.glob("addon/**/*.py"))


def module_text(path: Path) -> str:
    return ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""


def test_module_docstrings_have_at_most_thirty_lines():
    lines = {path.relative_to(ROOT).as_posix(): len(module_text(path).splitlines()) for path in MODULES}
    assert not {path: count for path, count in lines.items() if count > MOST_LINES}


def test_docstrings_name_pages_that_exist():
    named = {name for path in MODULES for name in re.findall(r"\bdocs/[\w/-]+\.md", module_text(path))}
    assert named
    assert not sorted(name for name in named if not (ROOT / name).exists())


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_of_pages_lead_somewhere(page):
    targets = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    files = [target for target in targets if "://" not in target]
    assert not [target for target in files if not (page.parent / target).exists()]


def test_the_readme_is_short_and_its_commands_exist():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 120
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    assert set(re.findall(r"`?\bmake ([a-z-]+)", text)) <= targets


def test_every_page_stands_once_in_the_menu_of_the_site():
    listed = re.findall(r": (\S+\.md)$", (ROOT / "tools" / "site.yml").read_text(encoding="utf-8"), re.MULTILINE)
    pages = [path.relative_to(ROOT / "docs").as_posix() for path in ROOT.glob("docs/**/*.md")]
    assert sorted(listed) == sorted(page for page in pages if not page.startswith("log/") or page == "log/README.md")
