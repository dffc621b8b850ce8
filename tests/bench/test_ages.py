"""Generated pages say when they were made, and docs/versions.md says which are older than the code."""

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


def test_what_a_command_writes_is_stamped_with_this_commit(tmp_path):
    path = tmp_path / "page.md"
    path.write_text(f"{markdown.begin('command')}\nold\n{markdown.END}\n")
    markdown.put_between(path, "command", "new")
    (made,) = ages.of_text("page.md", path.read_text(encoding="utf-8"))
    assert made.since == 0 and not made.old


def test_an_unknown_commit_counts_as_old():
    (made,) = ages.of_text("page", ages.stamp("2026-01-01", "0123456789"))
    assert made.old and made.since is None
