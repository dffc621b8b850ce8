"""Generated pages say when they were made, and docs/versions.md says which are older than the code."""

import re
from pathlib import Path

import pytest

from bench import ages, markdown


@pytest.mark.parametrize("page", ages.PAGES)
def test_every_generated_page_says_at_which_commit_it_was_made(page):
    """And where a command writes parts of it, each of them does."""
    text = (ages.ROOT / page).read_text(encoding="utf-8")
    assert len(ages.of_text(page, text)) == max(text.count("<!-- written by"), 1)


@pytest.mark.parametrize("page", ages.PAGES)
def test_the_table_names_pages_that_are_older_than_the_code(page):
    if ages.git("rev-parse", "HEAD") is None or ages.git("rev-parse", "--is-shallow-repository") == "true":
        pytest.skip("there is no history here")
    made = ages.oldest(page)
    lines = ages.TABLE.read_text(encoding="utf-8").splitlines()
    (row,) = [line for line in lines if f"({Path(page).name}) | `{ages.PAGES[page]}`" in line]
    assert made.since is not None, f"{made.commit} of {page} is no commit of this history"
    assert made.commit in row, f"run `{ages.COMMAND}`"
    assert ("older" in row) or not made.old, (
        f"{page} is {made.since} commits behind: make it anew, or run `{ages.COMMAND}`"
    )


HASH = re.compile(r"(?<![\w./-])(?=[0-9a-f]*[a-f])(?=[0-9a-f]*\d)[0-9a-f]{7,40}(?!\w)")
GONE = {  # commits of clones that were lost before their work was brought here in others; figures were made at them
    "117eca0020", "2394c7a371", "295c894c45", "4815c6e9", "4c30c144", "6e066c3494", "7549dbf7",
    "7551a35b14", "8092ad67df", "81a71b2c47", "995aff3965", "9e8d8e54", "a80f75d896", "ae5ab17ed7",
    "c29f607710", "c679aac8", "cae8dc567a", "e13f09becf", "ff373119f5",
}  # fmt: skip


def test_commits_that_pages_name_are_of_this_history():
    history = ages.git("log", "--format=%H")
    if history is None or ages.git("rev-parse", "--is-shallow-repository") == "true":
        pytest.skip("there is no history here")
    known = {commit[:length] for commit in history.split() for length in range(7, 41)}
    pages = (ages.ROOT / "README.md", *ages.ROOT.glob("docs/**/*.md"))
    named = {(page.name, one) for page in pages for one in HASH.findall(page.read_text(encoding="utf-8"))}
    assert named
    assert not sorted((page, one) for page, one in named if one not in known | GONE)


def test_what_a_command_writes_is_stamped_with_this_commit(tmp_path):
    path = tmp_path / "page.md"
    path.write_text(f"{markdown.begin('command')}\nold\n{markdown.END}\n")
    markdown.put_between(path, "command", "new")
    made = ages.of_text("page.md", path.read_text(encoding="utf-8"))
    if not ages.commit():
        assert not made  # outside of a clone there is none to name
        return
    assert [one.since for one in made] == [0] and not made[0].old


def test_an_unknown_commit_counts_as_old():
    (made,) = ages.of_text("page", ages.stamp("2026-01-01", "0123456789"))
    assert made.old and made.since is None
