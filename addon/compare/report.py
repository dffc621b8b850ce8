"""The comparison as one HTML page that needs nothing else: pictures inside, no script or style from elsewhere.

`page.html` is the page; this module makes its pieces and puts them in by name. A name that one of the two does not
know is an error, not a gap.
"""

from __future__ import annotations

import html
import math
from pathlib import Path
from string import Template

import numpy as np

from ..whole_files import replacing
from .comparison import Comparison, Picture
from .first_row import Shown
from .metrics import EMPTY_DEPTH, PathError, display, figures, is_surface
from .png import data_url, png

# What only pages of Candela have: the mark in page.html; and together a title and a line of the style, as those of
# versions before the mark have them.
MADE_BY = (
    ('<meta name="generator" content="Candela">',),
    (": Candela against Cycles</title>", "--page: #f6f5f2; --card: #ffffff; --ink: #1d1c1a; --dim: #6b675f;"),
)
LARGE_WIDTH = 1920  # pixels; wider pictures are averaged down by a whole factor
SMALL_WIDTH = 640  # of all rows but the first
GAINS = {"four": 4.0, "sixteen": 16.0}
SCALE = (1e-6, 1e1)  # ends of the logarithmic relMSE strip
GOOD, FAIR = 3e-3, 3e-2  # relMSE: not told apart at a glance; visible side by side
GOOD_BIAS, FAIR_BIAS = 0.01, 0.05
# Difference colours: share of full scale -> RGB. Dark in the middle on both page backgrounds, pale at the ends.
DARKER = ((0.0, (20, 20, 22)), (0.55, (44, 110, 220)), (1.0, (205, 228, 255)))
BRIGHTER = ((0.0, (20, 20, 22)), (0.55, (224, 104, 24)), (1.0, (255, 232, 200)))


class ReportError(OSError):
    """The page could not be written; the message is a sentence that names the path."""


def write_report(path: str | Path, data: Comparison) -> Path:
    """Write the page to `path` (its folder is made) in one step: a reader sees the old page or the new one.

    Raises `ReportError`.
    """
    path = Path(path)
    text = page(data)
    try:
        _refuse_protected(path)
        with replacing(path, ".html") as file:
            file.write(text.encode())
    except ReportError:
        raise
    except OSError as error:
        raise ReportError(f"The report could not be written to {path}: {error.strerror or error}.") from error
    return path


def _refuse_protected(path: Path) -> None:
    """A file or folder without any write permission is meant to stay, also when the user is root."""
    if path.is_dir():
        raise ReportError(f"The report could not be written to {path}: it is a folder.")
    for place in (path, path.parent):
        if place.exists() and not place.stat().st_mode & 0o222:
            raise ReportError(f"The report could not be written to {path}: {place} is write-protected.")


def page(data: Comparison) -> str:
    """The whole page as text."""
    template = Template((Path(__file__).parent / "page.html").read_text(encoding="utf-8"))
    width, height = data.size
    shown = [picture for picture in data.pictures if picture.x is not None and picture.reference is not None]
    first = shown[0] if shown else None
    rows = [_row(picture, data, large=picture is first) for picture in data.pictures if not is_surface(picture.error)]
    surface = [_surface_row(picture) for picture in data.pictures if is_surface(picture.error)]
    empty = data_url(png(np.zeros((1, 1, 3), np.uint8)))
    return template.substitute(
        title=_text(f"{data.scene}: {data.engine} against {data.reference_engine}"),
        heading=_text(f"{data.engine} against {data.reference_engine}"),
        facts=_facts(data),
        conclusion=_conclusion(data),
        opening=_opening(data),
        cards=_cards(data),
        stage_width=max(width, 860) if width < 1140 else 1140,
        aspect=f"{width} / {height}",
        rendering="pixelated" if width <= 400 else "auto",
        ramp=_ramp(),
        engine=_text(data.engine),
        reference_engine=_text(data.reference_engine),
        first_label=_text(first.row.label) if first else "",
        first_x=_image(first, first.x, LARGE_WIDTH) if first else empty,
        first_reference=_image(first, first.reference, LARGE_WIDTH) if first else empty,
        rows="".join(rows),
        surface=_surface(surface, data),
        ledger=_ledger(data),
        times=_times(data),
        notes=_notes(data),
        reference_note=_reference_note(data),
    )


def _conclusion(data: Comparison) -> str:
    """What the figures of the first row come to, in sentences; nothing without a first row."""
    own = [one for one in data.opening if not one.peer]
    if not own:
        return ""
    whole = own[-1]
    said = [
        f"{data.engine}'s picture of {whole.label} took {_time(whole.seconds)}. {_seen(whole, data.reference_engine)}",
        *(_beside(one, whole) for one in data.opening if one.peer),
    ]
    return f'<p class="conclusion">{_text(" ".join(said))}</p>'


def _seen(one: Shown, reference: str) -> str:
    error = one.relmse - one.floor  # the reference's noise is part of the difference
    if error <= GOOD:
        return f"At a glance nobody can tell it from {reference}' picture with many samples."
    if error <= FAIR:
        return f"Beside {reference}' picture with many samples small differences can be seen."
    return f"It differs visibly from {reference}' picture with many samples."


def _beside(peer: Shown, whole: Shown) -> str:
    """One sentence about another engine; errors that the noise of the truth hides are called equal."""
    low, high = sorted((peer.relmse, whole.relmse))
    if high - low <= peer.floor + whole.floor or high <= 1.1 * low:
        error = "about the same error"
    elif low == peer.relmse:
        error = f"{100 * low / high:.0f} % of the error"
    else:
        error = f"{high / max(low, 1e-12):.{1 if high < 10 * low else 0}f} times the error"
    return f"{peer.label} took {_time(peer.seconds)} and has {error}."


def _opening(data: Comparison) -> str:
    """The first row: what few samples look like, Cycles in the time of the last, EEVEE."""
    if not data.opening:
        return ""
    figures = []
    for one in data.opening:
        error = _scientific(f"{one.relmse:.1e}")
        noise = f" ± {_scientific(f'{one.floor:.0e}')}" if one.floor > 0.05 * one.relmse else ""
        told = f'<span>{one.seconds:.2f} s</span><span title="relMSE">error {error}{noise}</span>'
        caption = f"<figcaption><b>{_text(one.label)}</b>{told}</figcaption>"
        figures.append(f'<figure><img alt="{_text(one.label)}" src="{_plain(one.pixels)}">{caption}</figure>')
    about = (
        f"Time is that of a whole render with everything compiled. The error is the mean squared difference from "
        f"{data.reference_engine}' picture, relative to its brightness (relMSE): up to {GOOD} two pictures are not "
        f"told apart at a glance, from {FAIR} on the difference is plain. ± is the noise that the reference has left."
    )
    return (
        f'<h2>Few samples, and other engines</h2><p class="dim">{_text(about)}</p>'
        f'<section class="opening" aria-label="First row">{"".join(figures)}</section>'
    )


def _plain(image: np.ndarray) -> str:
    return data_url(png(np.round(shrink(display(image), SMALL_WIDTH)[::-1] * 255).astype(np.uint8)))


# Pictures ------------------------------------------------------------------------------------------------------------


def shown_pixels(name: str, image: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """(H, W, 3) float in [0, 1] as the page shows it. Depth is scaled by the reference's range, near is bright."""
    if name == "normal":
        return np.clip(np.nan_to_num(image[..., :3]) * 0.5 + 0.5, 0, 1)
    if name == "depth":
        hit = np.isfinite(image[..., 0]) & (image[..., 0] < EMPTY_DEPTH)
        known = reference[..., 0][np.isfinite(reference[..., 0]) & (reference[..., 0] < EMPTY_DEPTH)]
        near, far = (float(v) for v in np.percentile(known, (1, 99))) if known.size else (0.0, 1.0)
        value = 1 - 0.85 * np.clip((np.where(hit, image[..., 0], far) - near) / max(far - near, 1e-9), 0, 1)
        return np.repeat(np.where(hit, value, 0)[..., None], 3, axis=-1)
    return display(image)


def signed_difference(name: str, x: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """(H, W) in display units: the channel that differs most, signed; relative for depth, a length for normals."""
    if name == "depth":
        x, r = x[..., 0].astype(np.float64), reference[..., 0].astype(np.float64)
        both = (np.abs(x) < EMPTY_DEPTH) & (np.abs(r) < EMPTY_DEPTH)
        relative = np.zeros(x.shape)
        relative[both] = (x[both] - r[both]) / np.maximum(np.abs(r[both]), 1e-12)
        return relative
    if name == "normal":
        x, r = (np.clip(np.nan_to_num(n[..., :3].astype(np.float64)), -2, 2) for n in (x, reference))
        return np.linalg.norm(x - r, axis=-1)
    difference = display(x) - display(reference)
    most = np.abs(difference).argmax(axis=-1)[..., None]
    return np.take_along_axis(difference, most, axis=-1)[..., 0]


def difference_palette() -> np.ndarray:
    """(256, 3) uint8: index 128 is no difference, 1 is as dark and 255 as bright as full scale."""
    share = np.clip((np.arange(256) - 128) / 127.0, -1, 1)
    colors = np.empty((256, 3))
    for stops, side in ((DARKER, share <= 0), (BRIGHTER, share > 0)):
        at = [stop for stop, _ in stops]
        for channel in range(3):
            values = [color[channel] for _, color in stops]
            colors[side, channel] = np.interp(np.abs(share[side]), at, values)
    return np.round(colors).astype(np.uint8)


def shrink(image: np.ndarray, width: int) -> np.ndarray:
    """Averaged down by a whole factor so that it is at most `width` wide; (H, W) or (H, W, C)."""
    factor = -(-image.shape[1] // width)
    if factor == 1:
        return image
    height, columns = image.shape[0] // factor * factor, image.shape[1] // factor * factor
    if height == 0:
        return image[:1, ::factor]
    blocks = image[:height, :columns].reshape(height // factor, factor, columns // factor, factor, *image.shape[2:])
    return blocks.mean(axis=(1, 3))


def _image(picture: Picture, image: np.ndarray, width: int) -> str:
    reference = picture.reference if picture.reference is not None else image
    shown = shrink(shown_pixels(picture.row.name, image, reference), width)
    return data_url(png(np.round(shown[::-1] * 255).astype(np.uint8)))


def _difference(picture: Picture, gain: float, width: int) -> str:
    difference = shrink(signed_difference(picture.row.name, picture.x, picture.reference), width)[::-1]
    index = np.round(np.clip(difference * gain, -1, 1) * 127 + 128).astype(np.uint8)
    return data_url(png(index, difference_palette()))


def _ramp() -> str:
    """CSS colour stops of the legend, from darker to brighter."""
    stops = [(0.5 - share / 2, color) for share, color in reversed(DARKER)]
    stops += [(0.5 + share / 2, color) for share, color in BRIGHTER[1:]]
    return ", ".join(f"rgb({r} {g} {b}) {100 * at:.1f}%" for at, (r, g, b) in stops)


# Tables --------------------------------------------------------------------------------------------------------------


def _row(picture: Picture, data: Comparison, large: bool) -> str:
    error, row = picture.error, picture.row
    relmse, trimmed, floor, bias, flip = figures(error)
    remark = "; ".join(filter(None, (row.what, error.remark)))
    cells = [
        f'<td class="name">{_text(row.label)}<small>{_text(remark)}</small></td>',
        *_pictures(picture, data, large),
        f'<td class="n"><span class="{_grade(error)}">{_scientific(relmse)}</span>{_strip(error)}</td>',
        f'<td class="n">{_scientific(trimmed)}</td>',
        f'<td class="n {_bias_grade(error)}">{_text(bias)}</td>',
        f'<td class="n">{_text(flip)}</td>',
        f'<td class="n dim">{_scientific(floor)}</td>',
    ]
    return _table_row(picture, cells)


def _surface_row(picture: Picture) -> str:
    error = picture.error
    unit = "relative" if picture.row.name == "depth" else "|x − r|"
    cells = [
        f'<td class="name">{_text(picture.row.label)}<small>{_text(error.remark)}</small></td>',
        *_pictures(picture, None, False),
        f'<td class="n">{_scientific(_percentile(error.median))}<small> {unit}</small></td>',
        f'<td class="n">{_scientific(_percentile(error.percentile_95))}<small> {unit}</small></td>',
    ]
    return _table_row(picture, cells)


def _table_row(picture: Picture, cells: list[str]) -> str:
    if picture.x is None or picture.reference is None or picture.x.shape[:2] != picture.reference.shape[:2]:
        return f"<tr>{''.join(cells)}</tr>"
    return f'<tr class="pick" tabindex="0" data-label="{_text(picture.row.label)}">{"".join(cells)}</tr>'


def _pictures(picture: Picture, data: Comparison | None, large: bool) -> list[str]:
    """Three cells: Candela, Cycles, difference. The second difference travels along for the large view."""
    cells = []
    for kind, image in (("x", picture.x), ("r", picture.reference)):
        if image is None:
            cells.append('<td class="pic"><div class="none">none</div></td>')
            continue
        extra = f' data-large="{_image(picture, image, LARGE_WIDTH)}"' if large and data.size[0] > SMALL_WIDTH else ""
        source = _image(picture, image, SMALL_WIDTH)
        cells.append(f'<td class="pic"><img data-kind="{kind}" alt="" src="{source}"{extra}></td>')
    both = (
        picture.x is not None and picture.reference is not None and picture.x.shape[:2] == picture.reference.shape[:2]
    )
    if both:
        width = LARGE_WIDTH if large else SMALL_WIDTH
        four, sixteen = (_difference(picture, gain, width) for gain in GAINS.values())
        hidden = f'<span hidden><img data-kind="sixteen" alt="" src="{sixteen}"></span>'
        cells.append(f'<td class="pic"><img data-kind="four" alt="" src="{four}">{hidden}</td>')
    else:
        cells.append('<td class="pic"><div class="none">none</div></td>')
    return cells


def _surface(rows: list[str], data: Comparison) -> str:
    if not rows:
        return ""
    head = (
        f"<th>Surface</th><th>{_text(data.engine)}</th><th>{_text(data.reference_engine)}</th><th>Difference ×4</th>"
        '<th class="n">Median error</th><th class="n">95 %</th>'
    )
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    return f'<h2>Surface data</h2><div class="scroll">{table}</div>'


def _strip(error: PathError) -> str:
    """relMSE on a logarithmic strip, with the reference's noise as a band from the left."""
    if math.isnan(error.relmse):
        return ""
    return (
        f'<div class="scale {_grade(error)}"><i style="width:{100 * _place(error.floor):.1f}%"></i>'
        f'<b style="left:{100 * _place(error.relmse):.1f}%"></b></div>'
    )


def _place(value: float) -> float:
    low, high = (math.log10(end) for end in SCALE)
    if value <= 0:
        return 0.0
    return min(1.0, max(0.0, (math.log10(value) - low) / (high - low))) if math.isfinite(value) else 1.0


def _grade(error: PathError) -> str:
    if math.isnan(error.relmse):
        return "dim"
    if error.below_floor or error.relmse <= GOOD:
        return "good"
    return "fair" if error.relmse <= FAIR else "bad"


def _bias_grade(error: PathError) -> str:
    away = abs(error.bias - 1) - error.bias_floor
    if math.isnan(away):
        return "dim"
    return "good" if away <= GOOD_BIAS else "fair" if away <= FAIR_BIAS else "bad"


def _cards(data: Comparison) -> str:
    cards = []
    for label in ("Combined", "Direct light"):
        error = next((e for e in data.errors if e.name == label), None)
        if error is None:
            continue
        relmse, _, floor, bias, flip = figures(error)
        below = f"bias {bias}, FLIP {flip}, floor {floor}" if error.floor else f"bias {bias}, FLIP {flip}"
        if math.isnan(error.relmse):
            below = error.remark
        cards.append((f"{label}, relMSE", _scientific(relmse), _grade(error), _scientific(below)))
    cards.append((f"{data.engine}, {_count(data.samples)}", _text(_time(data.seconds)), "", "whole render, wall time"))
    kept = " (from the cache)" if data.reference_cached else ""
    each = f"2 × {_count(data.reference_samples)}{kept}"
    cards.append((f"{data.reference_engine} reference", _text(_time(data.reference_seconds)), "", each))
    return "".join(
        f'<div class="card"><span>{_text(top)}</span><strong class="{grade}">{figure}</strong>'
        f"<span>{below}</span></div>"
        for top, figure, grade, below in cards
    )


def _facts(data: Comparison) -> str:
    width, height = data.size
    facts = [("Scene", data.scene), ("File", data.file or "not saved"), ("Frame", str(data.frame))]
    facts += [("Size", f"{width} × {height}"), ("Samples", str(data.samples))]
    facts += [("Reference", f"2 × {data.reference_samples} samples" + (", no bounces" if data.direct_only else ""))]
    facts += [*data.versions.items(), ("Device", data.device), ("Made", data.date)]
    return "".join(f"<li>{_text(name)} <b>{_text(value)}</b></li>" for name, value in facts if value)


def _ledger(data: Comparison) -> str:
    if not data.ledger:
        return '<p class="dim">The engine wrote no ledger.</p>'
    rows = "".join(
        f'<tr><td>{_text(row.name)}</td><td><span class="state {_text(row.state)}">{_text(row.state)}</span></td>'
        f'<td class="dim">{_text(row.reason)}</td>'
        f'<td class="n">{f"{row.milliseconds:.1f} ms" if row.state == "ran" else ""}</td></tr>'
        for row in data.ledger
    )
    head = '<th>Technique</th><th>State</th><th>Because</th><th class="n">Time</th>'
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'


def _times(data: Comparison) -> str:
    rows = [(f"{data.engine}: {name}", seconds) for name, seconds in data.times.items() if name != "total"]
    rows.append((f"{data.engine}: whole render, {_count(data.samples)}", data.seconds))
    each = data.reference_seconds / 2
    rows.append((f"{data.reference_engine}: one reference, {_count(data.reference_samples)}", each))
    cells = "".join(
        f'<tr><td>{_text(name)}</td><td class="n">{_text(_time(seconds))}</td></tr>' for name, seconds in rows
    )
    return f'<div class="scroll"><table><tbody>{cells}</tbody></table></div>'


def _notes(data: Comparison) -> str:
    if not data.notes:
        return '<p class="dim">Nothing in this scene is drawn otherwise than meant.</p>'
    return '<ul class="notes">' + "".join(f"<li>{_text(note)}</li>" for note in data.notes) + "</ul>"


def _reference_note(data: Comparison) -> str:
    text = (
        f"The reference is the mean of two renders by {data.reference_engine}, {data.reference_samples} samples each, "
        "with different seeds, no clamping, denoising or adaptive sampling, caustics as the scene says; half their "
        "difference is the noise floor."
    )
    if data.direct_only:
        text += " It was rendered without bounces: Combined shows direct light, emission and world."
    return _text(text)


# Text ----------------------------------------------------------------------------------------------------------------


def _text(value: str) -> str:
    return html.escape(str(value), quote=True)


def _scientific(text: str) -> str:
    """Escaped, with 1.20e-03 set as 1.20·10⁻³."""
    raised = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    words = []
    for word in text.split(" "):
        mantissa, mark, exponent = word.partition("e")
        if mark and exponent.lstrip("+-").isdigit():
            power = f"·10{str(int(exponent)).translate(raised)}" if int(exponent) else ""
            word = mantissa + power if float(mantissa) else "0"
        words.append(word)
    return _text(" ".join(words)).replace("≤ ", "≤\u202f")


def _percentile(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.1e}"


def _count(samples: int) -> str:
    return f"{samples} sample" if samples == 1 else f"{samples} samples"


def _time(seconds: float) -> str:
    if seconds < 1:
        return f"{seconds * 1000:.1f} ms" if seconds < 0.1 else f"{seconds * 1000:.0f} ms"
    return f"{seconds:.1f} s" if seconds < 120 else f"{seconds / 60:.1f} min"
