"""The report page: complete, self-contained, written in one step or not at all."""

import base64
import html.parser
import re

import bpy
import numpy as np
import pytest

from addon.compare.comparison import Comparison, LedgerRow, Picture
from addon.compare.first_row import Shown
from addon.compare.metrics import compare_depth, compare_normal, compare_radiance
from addon.compare.passes import ROWS, Row
from addon.compare.png import png
from addon.compare.report import MADE_BY, ReportError, difference_palette, page, shrink, signed_difference, write_report


def comparison(**more):
    generator = np.random.default_rng(2)
    pictures = []
    for row in ROWS:
        if not row.always:
            continue
        r = generator.random((6, 8, 1 if row.name == "depth" else 3), np.float32)
        x = r * np.float32(1.1)
        compare = {"depth": compare_depth, "normal": compare_normal}.get(row.name, compare_radiance)
        pictures.append(Picture(row, x, r, compare(row.label, x, r)))
    named = {
        "scene": "Garden <b>&</b>",
        "pictures": tuple(pictures),
        "size": (8, 6),
        "samples": 16,
        "reference_samples": 64,
        "seconds": 0.25,
        "reference_seconds": 12.0,
        "versions": {"Blender": "5.2.3"},
        "device": "a device",
        "ledger": (
            LedgerRow("Surfaces", "ran", "", 1.25),
            LedgerRow("Caustics", "skipped", "no material is a mirror or glass"),
        ),
        "times": {"sync": 0.012, "total": 0.25},
        "notes": ("Material 'Glass': nothing refracts yet.",),
    }
    return Comparison(**{**named, **more})


class Tags(html.parser.HTMLParser):
    """Which tags are open, and every address that an element refers to."""

    VOID = ("meta", "img", "input")

    def __init__(self):
        super().__init__()
        self.open, self.addresses, self.text = [], [], []

    def handle_starttag(self, tag, attributes):
        if tag not in self.VOID:
            self.open.append(tag)
        self.addresses += [v for k, v in attributes if k in ("src", "href", "data-large")]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def parsed(text):
    tags = Tags()
    tags.feed(text)
    assert tags.open == []
    return tags


def decoded(tmp_path, file):
    """Pixels of a PNG as Blender reads them, (H, W, 3) uint8, top row first."""
    path = tmp_path / "picture.png"
    path.write_bytes(file)
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return np.round(pixels.reshape(height, width, 4)[::-1, :, :3] * 255).astype(np.uint8)


def test_the_page_needs_nothing_from_elsewhere():
    text = page(comparison())
    addresses = parsed(text).addresses
    for address in addresses:
        text = text.replace(address, "")
    assert not re.search(r"https?:|//[a-z]|@import|url\(", text)
    assert len(addresses) > 30
    assert all(address.startswith("data:image/png;base64,") for address in addresses)


def test_the_page_says_what_was_compared():
    words = " ".join(parsed(page(comparison())).text)
    for said in (
        "Garden <b>&</b>",
        "8 × 6",
        "5.2.3",
        "a device",
        "Diffuse direct",
        "no material is a mirror or glass",
        "1.2 ms",
        "Material 'Glass': nothing refracts yet.",
        "exposure 0",
        "1.1000",
    ):
        assert said in words, said


def test_a_picture_that_is_missing_or_of_another_size_leaves_a_gap_and_no_error():
    present = np.ones((6, 8, 3), np.float32)
    other = np.ones((3, 4, 3), np.float32)
    rows = [
        Picture(Row("Combined", "image", "combined"), x, r, compare_radiance("Combined", x, r))
        for x, r in ((None, present), (present, None), (other, present))
    ]
    words = " ".join(parsed(page(comparison(pictures=tuple(rows)))).text)
    assert "missing in this picture" in words and "sizes differ: 4x3 against 8x6" in words
    parsed(page(comparison(pictures=(), ledger=(), times={}, notes=())))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, -1.0, 1e30])
def test_a_bad_pixel_does_not_spoil_the_page(bad):
    r = np.ones((6, 8, 3), np.float32)
    x = r.copy()
    x[1, 2] = bad
    depth = np.full((6, 8, 1), bad, np.float32)
    rows = (
        Picture(Row("Combined", "image", "combined"), x, r, compare_radiance("Combined", x, r)),
        Picture(Row("Normal", "image", "normal"), x, r, compare_normal("Normal", x, r)),
        Picture(Row("Depth", "image", "depth"), depth, depth, compare_depth("Depth", depth, depth)),
    )
    parsed(page(comparison(pictures=rows)))


@pytest.mark.parametrize("size", [(1, 1), (1, 700), (700, 1), (2000, 3)])
def test_pictures_of_any_shape_fit(size):
    width, height = size
    x = np.ones((height, width, 3), np.float32)
    row = Picture(Row("Combined", "image", "combined"), x, x, compare_radiance("Combined", x, x))
    parsed(page(comparison(pictures=(row,), size=size)))


def test_a_page_bears_each_mark_by_which_its_folder_is_known():
    assert all(part in page(comparison()) for mark in MADE_BY for part in mark)


def test_a_report_is_written_in_one_step(tmp_path):
    path = write_report(tmp_path / "new" / "report.html", comparison())
    assert path.read_text(encoding="utf-8").startswith("<!doctype html>")
    assert [p.name for p in path.parent.iterdir()] == ["report.html"]
    write_report(path, comparison(scene="Another"))
    assert "Another" in path.read_text(encoding="utf-8")


def test_a_protected_target_is_refused_in_one_sentence(tmp_path):
    path = tmp_path / "report.html"
    path.write_text("old")
    path.chmod(0o444)
    with pytest.raises(
        ReportError, match=rf"^The report could not be written to {re.escape(str(path))}: .*protected\.$"
    ):
        write_report(path, comparison())
    assert path.read_text() == "old"


def test_targets_that_cannot_be_files_are_refused_and_nothing_is_left(tmp_path):
    with pytest.raises(ReportError, match="it is a folder"):
        write_report(tmp_path, comparison())
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(ReportError, match=r"The report could not be written to .*report\.html: "):
        write_report(tmp_path / "file" / "report.html", comparison())
    locked = tmp_path / "locked"
    locked.mkdir()
    locked.chmod(0o555)
    with pytest.raises(ReportError, match="write-protected"):
        write_report(locked / "report.html", comparison())
    locked.chmod(0o755)
    assert list(locked.iterdir()) == []


def test_png_files_hold_the_pixels(tmp_path, empty_scene):
    pixels = np.random.default_rng(4).integers(0, 256, (13, 7, 3)).astype(np.uint8)
    np.testing.assert_array_equal(decoded(tmp_path, png(pixels)), pixels)
    index = np.arange(256, dtype=np.uint8).reshape(16, 16)
    np.testing.assert_array_equal(decoded(tmp_path, png(index, difference_palette())), difference_palette()[index])


def test_pictures_stand_upright_on_the_page(tmp_path, empty_scene):
    r = np.zeros((6, 8, 3), np.float32)
    r[0] = 1  # lowest row
    row = Picture(Row("Combined", "image", "combined"), r, r, compare_radiance("Combined", r, r))
    address = parsed(page(comparison(pictures=(row,)))).addresses[0]
    shown = decoded(tmp_path, base64.b64decode(address.split(",")[1]))
    assert (shown[-1] == 255).all() and (shown[:-1] == 0).all()


def test_difference_is_signed_and_takes_the_channel_that_differs_most():
    r = np.full((1, 2, 3), 0.5, np.float32)
    x = r.copy()
    x[0, 0] = (0.5, 0.6, 0.5)
    x[0, 1] = (0.51, 0.5, 0.3)
    difference = signed_difference("combined", x, r)[0]
    assert difference[0] > 0 > difference[1]


def test_no_difference_is_the_dark_middle_of_the_palette():
    palette = difference_palette().astype(int)
    assert palette[128].max() < 30
    assert palette[255, 0] > palette[255, 2] and palette[1, 2] > palette[1, 0]  # orange is brighter, blue is darker


def test_shrinking_averages_whole_blocks():
    image = np.arange(24, dtype=np.float64).reshape(4, 6)
    np.testing.assert_array_equal(shrink(image, 3), [[3.5, 5.5, 7.5], [15.5, 17.5, 19.5]])
    assert shrink(image, 6) is image


def test_the_first_row_opens_the_page_with_time_and_error_of_each():
    pixels = np.ones((6, 8, 4), np.float32)
    row = (Shown("1 sample", pixels, 0.25, 3e-2), Shown("Cycles, denoised", pixels, 1.5, 4e-3))
    text = page(comparison(opening=row))
    opening = text[text.index('class="opening"') : text.index('class="cards"')]
    assert opening.count("<figure>") == 2
    assert "<b>1 sample</b><span>0.25 s</span>" in opening and "<span>1.50 s</span>" in opening
    assert '<section class="opening"' not in page(comparison())


def test_the_page_opens_with_what_the_figures_come_to_and_then_the_picture():
    pixels = np.ones((6, 8, 4), np.float32)
    row = (
        Shown("16 samples", pixels, 2.5, 2e-3, 2e-4),
        Shown("Cycles, denoised", pixels, 2.4, 5e-3, 1e-4, peer=True),
        Shown("EEVEE, 16 samples", pixels, 1.25, 1e-3, 1e-4, peer=True),
    )
    text = page(comparison(opening=row))
    told = text[text.index('class="conclusion"') : text.index('class="viewer"')]
    assert "picture of 16 samples took 2.5 s. At a glance nobody can tell it from Cycles&#x27; picture" in told
    assert "Cycles, denoised took 2.4 s and has 2.5 times the error." in told
    assert "EEVEE, 16 samples took 1.2 s and has 50 % of the error." in told
    assert text.index('class="viewer"') < text.index('class="opening"')
    assert "error 2.0·10⁻³ ± 2·10⁻⁴" in text[text.index('class="opening"') :]


def test_what_the_noise_of_the_truth_hides_is_called_equal():
    pixels = np.ones((6, 8, 4), np.float32)
    row = (
        Shown("16 samples", pixels, 2.5, 2e-3, 1e-3),
        Shown("Cycles, denoised", pixels, 2.4, 3e-3, 1e-3, peer=True),
    )
    assert "has about the same error" in page(comparison(opening=row))
