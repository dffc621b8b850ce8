"""Features that meet, beside Cycles: `python -m bench pairs`.

Every pair of the features of bench/pair_features.py and bench/pair_settings.py is drawn in one small room by Candela,
with 1 and with 16 samples and all bounces, and by Cycles, whose pictures are kept by content. Judged are the ratio of
means and relMSE of means over 4x4 pixels, which noise of single pixels hardly moves. With 1 sample all light passes are
drawn apart and must add up to the picture where Cycles' do; with 16 the picture is drawn alone.

    green   within the bounds of its number of samples; the noise of a reference of 64 samples or more is added
    amber   beyond them, and a sentence said that something is drawn otherwise
    red     beyond them without a word, or no picture, or values that are not finite, or passes that do not add up

Results go to out/pairs.json as they come; another run goes on with what is missing. `--triples N` draws N triples at
random instead. `--page` writes docs/pairs.md and its picture.

What Cycles cannot find is judged by light tracing where that is known (pair_truth.py; `--only A B --truth PYTHON` makes
it), in the blocks that show no glass.
"""

from __future__ import annotations

import argparse
import itertools
import json
import random
import resource
import traceback
from pathlib import Path

import numpy as np

from bench import ages, pair_features, pair_settings, pair_truth  # noqa: F401  (they name the features)
from bench.cells import ROOT
from bench.markdown import begin, put_between, table, write_whole
from bench.pair_room import FEATURES, Room

COMMAND = "python -m bench pairs"
RESULTS, PAGE, PICTURE = ROOT / "out" / "pairs.json", ROOT / "docs" / "pairs.md", ROOT / "docs" / "images" / "pairs.png"
SIZE, BLOCK = (48, 36), 4
REFERENCE_SAMPLES = (16, 64, 1024)  # of each of two renders: the next where a picture is not within bounds
BOUNDS = {1: (0.10, 0.10), 16: (0.03, 0.02)}  # by samples: how far the ratio of means is from 1, relMSE of blocks
GREEN, AMBER, RED = "green", "amber", "red"
APART = 0.01  # of the mean: how far the sum of passes may be from the picture beyond what it is for Cycles
DEAR = dict.fromkeys(("fog in a box", "smoke", "fog of the world", "absorbing box", "fire"), 6)  # as if met that often
BLACK = 1e-6  # two pictures whose means are below it are alike: a sun that fog without end lets not through, say
DARK = 0.1  # of the mean luminance: below it, errors count as absolute


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--only", metavar="FEATURE", nargs="+", help="pairs of these with any; two of them: that pair")
    parser.add_argument("--alone", action="store_true", help="each feature by itself, first of all")
    parser.add_argument("--triples", metavar="N", type=int, default=0, help="so many triples at random")
    parser.add_argument("--seed", type=int, default=1, help="of the triples and of --sample")
    parser.add_argument("--sample", metavar="N", type=int, default=0, help="only so many of the pairs, at random")
    parser.add_argument("--part", metavar="K/N", default="1/1", help="every Nth, from the Kth on")
    parser.add_argument("--samples", type=int, nargs="+", default=sorted(BOUNDS), choices=sorted(BOUNDS))
    parser.add_argument("--again", action="store_true", help="render what is known, too")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="write pictures: Candela's, then Cycles'")
    parser.add_argument("--truth", metavar="PYTHON", help="trace light with Mitsuba in this interpreter, and keep that")
    parser.add_argument("--photons", type=int, default=60_000_000, help="for --truth")
    parser.add_argument("--page", action="store_true", help=f"write {PAGE.name} from what is known")


def command(options: argparse.Namespace) -> int:
    import addon

    addon.register()
    known = read()
    made = [one for one in chosen(options) if options.again or any(str(n) not in known.get(key(one), {})
                                                                   for n in options.samples)]  # fmt: skip
    stage = _stage()
    if options.truth:
        made = chosen(options)
        for names in made:
            pair_truth.make(_room(stage, names), key(names), SIZE, options.truth, options.photons)
    for number, names in enumerate(rarest_first(made, known)):
        found = measure(stage, names, options.samples, options.keep)
        known = read()  # another process may have written
        known[key(names)] = known.get(key(names), {}) | found
        RESULTS.parent.mkdir(exist_ok=True)
        write_whole(RESULTS, json.dumps(known, indent=0))
        print(f"{number + 1}/{len(made)}  {line(names, found)}", flush=True)
    wanted = {key(one): known[key(one)] for one in chosen(options) if key(one) in known}
    print(table(summary(wanted)))
    print(table(worst(wanted)))
    if options.page:
        write_page(known)
    return 1 if any(colour(one) == RED for found in wanted.values() for one in found.values()) else 0


def _stage():
    from tests.techniques.conftest import Stage

    return Stage()


def _room(stage, names: tuple[str, ...]) -> Room:
    room = Room(stage)
    for name in names:
        FEATURES[name](room)
    return room


def key(names: tuple[str, ...]) -> str:
    return " + ".join(names)


def chosen(options: argparse.Namespace) -> list[tuple[str, ...]]:
    """What is asked for, as names of features."""
    names, chance = list(FEATURES), random.Random(options.seed)
    if options.alone:
        made = [(name,) for name in names if not options.only or name in options.only]
    elif options.triples:
        made = [tuple(sorted(chance.sample(names, 3), key=names.index)) for _ in range(options.triples)]
    else:
        made = list(itertools.combinations(names, 2))
        if options.only:
            wanted = set(options.only)
            unknown = wanted - set(names)
            if unknown:
                raise SystemExit(f"There is no feature {', '.join(sorted(unknown))}; there are {', '.join(names)}.")
            enough = 2 if len(wanted) == 2 else 1
            made = [one for one in made if len(wanted & set(one)) >= enough]
        if options.sample:
            made = chance.sample(made, min(options.sample, len(made)))
    first, _, step = options.part.partition("/")
    return made[int(first) - 1 :: int(step or 1)]


def rarest_first(made: list[tuple[str, ...]], known: dict[str, dict]) -> list[tuple[str, ...]]:
    """In an order in which each feature soon meets some others: next comes what has met least, media last of equals.

    A run that is ended early has so looked at all features, and one that goes on has compiled their programs at once.
    """
    met = dict.fromkeys(FEATURES, 0)
    for names in known:
        met |= {name: met[name] + 1 for name in names.split(" + ") if name in met}
    left, order = sorted(made, key=lambda names: (sum(name in DEAR for name in names), names)), []
    while left:
        following = min(left, key=lambda names: sum(met[name] + DEAR.get(name, 0) for name in names) / len(names))
        left.remove(following)
        order.append(following)
        met |= {name: met[name] + 1 for name in following}
    return order


def measure(stage, names: tuple[str, ...], samples: list[int], keep: Path | None = None) -> dict[str, dict]:
    """By number of samples: error of the picture in which these features meet, or why there is none."""
    from addon.compare.reference import combined_alone, reference, render_passes
    from addon.frame import ledger

    try:
        room = _room(stage, names)
        truth = reference(room.scene, REFERENCE_SAMPLES[0], size=SIZE)
    except Exception:
        traceback.print_exc()
        return {str(n): {"failed": "the scene or its reference: " + traceback.format_exc(limit=1)} for n in samples}
    commit = ages.git("rev-parse", "--short=10", "HEAD") or ""
    pictures: dict[int, np.ndarray] = {}
    found: dict[str, dict] = {}
    for n in samples:
        started = resource.getrusage(resource.RUSAGE_SELF)
        extra = combined_alone(room.layer) if n > 1 else []
        try:
            drawn = render_passes(room.scene, "CANDELA", n, 1, size=SIZE, extra=extra)
        except Exception as error:
            found[str(n)] = {"failed": str(error) or type(error).__name__}
            continue
        spent = resource.getrusage(resource.RUSAGE_SELF)
        pictures[n] = drawn.images["combined"][..., :3]
        wrong = [said for check in room.checks if (said := of_check(check, drawn.layers))]
        if n == 1 and (off := sum_of_passes(drawn.images)) > sum_of_passes(truth.images) + APART:
            wrong.append(f"the light passes differ from the picture by {off:.3f} of its mean")
        found[str(n)] = ({"failed": "; ".join(wrong)} if wrong else {}) | {
            "commit": commit,
            "notes": [str(note) for note in ledger.latest().notes],
            "seconds": spent.ru_utime - started.ru_utime,
        }
    for doubt, count in enumerate(REFERENCE_SAMPLES[: 2 if DEAR.keys() & set(names) else None]):
        if doubt:
            truth = reference(room.scene, count, size=SIZE)
        beside = {n: beside_truth(own, truth, key(names), n, doubt) for n, own in pictures.items()}
        if all(one.get("good") for one in beside.values()):
            break
    for n, one in beside.items():
        found[str(n)] = one | {"reference": count} | found[str(n)]
        if keep is not None:
            from bench.cases import write_pictures

            pixels = truth.images["combined"][..., :3]
            write_pictures(keep, f"{key(names).replace(' ', '_')}_{n}", pictures[n], pixels)
    return found


def beside_truth(own: np.ndarray, truth, names: str, samples: int, doubt: int) -> dict:
    """A picture beside the references, or light traced for it; `doubt`: of them, see `judged`."""
    pixels, half = truth.images["combined"][..., :3], truth.half["combined"][..., :3]
    traced = pair_truth.known().get(names)
    if traced is not None and own.shape == pixels.shape:
        shown = sum(truth.images[f"{name}_color"][..., :3] for name in ("transmission", "glossy"))
        own, pixels, half = (_clear(one, shown) for one in (own, traced.mean(axis=0), (traced[0] - traced[1]) / 2))
    return judged(own, pixels, half, samples, doubt)


def of_check(check, layers: dict[str, np.ndarray]) -> str:
    """What is wrong of a picture's layers, a missing one, too."""
    try:
        return check(layers)
    except KeyError as missing:
        return f"the file has no layer {missing}"


def sum_of_passes(images: dict[str, np.ndarray]) -> float:
    """How far the light of all paths together is from the picture, of its mean."""
    from addon.compare.passes import light_paths
    from addon.frame.light_paths import LIGHT_PATHS

    paths, whole = light_paths(images), images["combined"][..., :3]
    total = sum(paths[path.name] for path in LIGHT_PATHS if path.name in paths)
    return float(np.abs(total - whole).mean()) / max(float(np.abs(whole).mean()), 1e-6)


def judged(own: np.ndarray, truth: np.ndarray, half: np.ndarray, samples: int, doubt: int = 1) -> dict:
    """Error of a picture (H, W, 3) beside the mean of two references and half their difference.

    `doubt`: 0: the difference allows nothing; 1: it widens the bounds; 2: that of the mean by two standard errors over
    the blocks, since few paths that find a lamp in a mirror make one difference of means small or large by chance.
    """
    if not np.isfinite(own).all():
        return {"failed": "values that are not finite"}
    if own.shape != truth.shape:
        return {"failed": f"a picture of {own.shape[1]}x{own.shape[0]} pixels beside {truth.shape[1]}x{truth.shape[0]}"}
    mean, most, relmse = float(truth.mean()) + BLACK, *BOUNDS[samples]
    error, floor = _of_blocks(own - truth, truth), _of_blocks(half, truth)
    ratio, apart = (float(own.mean()) + BLACK) / mean, _blocks(half).mean(axis=-1)
    of_mean = (0.0, abs(float(half.mean())), 2 * float(np.sqrt((apart**2).sum())) / apart.size)[doubt] / mean
    return {
        "ratio": ratio, "blocks": error, "floor": floor, "negative": int((own < 0).sum()),
        "good": bool(abs(ratio - 1.0) <= most + of_mean and error <= relmse + (2 * floor if doubt else 0.0)),
    }  # fmt: skip


def _clear(image: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """The blocks of a picture that show no glass or gloss, side by side: (BLOCK, BLOCK N, 3)."""
    rows, columns = (extent // BLOCK for extent in image.shape[:2])
    parts = image[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK, 3).swapaxes(1, 2)
    return np.concatenate(parts[~_blocks(shown).any(axis=-1)], axis=1)


def _of_blocks(difference: np.ndarray, truth: np.ndarray) -> float:
    """relMSE of the means of blocks."""
    from addon.compare.metrics import LUMINANCE

    apart, light = _blocks(difference), _blocks(truth) @ LUMINANCE
    dark = max(DARK * float(light.mean()), 1e-6)
    return float(((apart**2).mean(axis=-1) / (light**2 + dark**2)).mean())


def _blocks(image: np.ndarray) -> np.ndarray:
    height, width = (extent // BLOCK * BLOCK for extent in image.shape[:2])
    parts = image[:height, :width].astype(np.float64).reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, -1)
    return parts.mean(axis=(1, 3))


def colour(one: dict) -> str:
    """Of a result: whether it is right, warned of, or wrong without a word."""
    if "failed" in one:
        return RED
    return GREEN if one["good"] else AMBER if one["notes"] else RED


def line(names: tuple[str, ...], found: dict[str, dict]) -> str:
    told = []
    for n, one in sorted(found.items(), key=lambda item: int(item[0])):
        if "failed" in one:
            told.append(f"{n}: {one['failed']}")
        else:
            figures = f"{one['ratio']:.3f} {one['blocks']:.4f} (floor {one['floor']:.4f}, {one['seconds']:.1f} s)"
            told.append(f"{n}: {colour(one)} {figures}")
    return f"{key(names)}   {'   '.join(told)}"


# ------------------------------------------------------------------------------------------------------------ results


def read(path: Path = RESULTS) -> dict[str, dict[str, dict]]:
    """Results by names of the features and number of samples."""
    return json.loads(path.read_text("utf-8")) if path.is_file() else {}


def summary(known: dict[str, dict[str, dict]]) -> list[list[str]]:
    rows = [["samples", "drawn", GREEN, AMBER, RED]]
    for n in sorted(BOUNDS):
        colours = [colour(found[str(n)]) for found in known.values() if str(n) in found]
        rows.append([str(n), str(len(colours)), *(str(colours.count(one)) for one in (GREEN, AMBER, RED))])
    return rows


def worst(known: dict[str, dict[str, dict]], most: int = 20) -> list[list[str]]:
    """The pairs farthest from their bounds, and what was said of them."""
    entries = []
    for names, found in known.items():
        for n, one in found.items():
            if colour(one) != GREEN:
                bound = BOUNDS[int(n)]
                far = 1e9 if "failed" in one else max(abs(one["ratio"] - 1) / bound[0], one["blocks"] / bound[1])
                entries.append((far, names, n, one))
    rows = [["features", "samples", "", "mean over Cycles'", "relMSE of blocks", "said"]]
    for _, names, n, one in sorted(entries, key=lambda entry: -entry[0])[:most]:
        if "failed" in one:
            rows.append([names, n, RED, "–", "–", one["failed"].strip().splitlines()[-1]])
        else:
            said = "; ".join(one["notes"])
            rows.append([names, n, colour(one), f"{one['ratio']:.3f}", f"{one['blocks']:.4f}", said])
    return rows


def nearest(known: dict[str, dict[str, dict]], samples: int = 16, most: int = 8) -> list[list[str]]:
    """What is nearest to its bounds of all that is within them."""
    ratio, relmse = BOUNDS[samples]
    found = [
        (names, one) for names, by in known.items() if colour(one := by.get(str(samples), {"failed": ""})) == GREEN
    ]
    near = sorted(found, key=lambda item: -max(abs(item[1]["ratio"] - 1) / ratio, item[1]["blocks"] / relmse))
    rows = [["features", "mean over Cycles'", "relMSE of blocks"]]
    return [*rows, *([names, f"{one['ratio']:.3f}", f"{one['blocks']:.4f}"] for names, one in near[:most])]


def write_page(known: dict[str, dict[str, dict]]) -> None:
    """The page's tables and its picture, of all pairs that are known."""
    alone, pairs, triples = (
        {names: found for names, found in known.items() if names.count(" + ") == n} for n in (0, 1, 2)
    )
    draw(pairs)
    if not PAGE.exists():
        write_whole(PAGE, f"# Features that meet\n\n{begin(COMMAND)}\n<!-- end of what is written -->\n")
    every = len(FEATURES) * (len(FEATURES) - 1) // 2
    text = (
        f"Features alone:\n\n{table(summary(alone))}\n\n{table(worst(alone))}\n\n"
        f"{len(pairs)} of {every} pairs:\n\n{table(summary(pairs))}\n\n"
        f"![Pairs of features](images/{PICTURE.name})\n\n{table(worst(pairs, 30))}\n\n"
        f"{len(triples)} triples at random:\n\n{table(summary(triples))}\n\n{table(worst(triples))}\n\n"
        f"Nearest to their bounds of all that are green, with 16 samples:\n\n{table(nearest(known))}"
    )
    put_between(PAGE, COMMAND, text)


def draw(pairs: dict[str, dict[str, dict]]) -> None:
    """A triangle: 16 samples below the diagonal, 1 above it."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt
    from matplotlib.colors import ListedColormap

    names = list(FEATURES)
    values = {GREEN: 1, AMBER: 2, RED: 3}
    cells = np.zeros((len(names), len(names)))
    for pair, found in pairs.items():
        if not set(pair.split(" + ")) <= set(names):  # a feature that is no more
            continue
        first, second = (names.index(name) for name in pair.split(" + "))
        for n, one in found.items():
            row, column = (max(first, second), min(first, second))
            cells[(row, column) if n == "16" else (column, row)] = values[colour(one)]
    figure, axes = plt.subplots(figsize=(11, 11))
    shades = ListedColormap(["#e8e8e8", "#5aa469", "#e0a030", "#c0392b"])
    axes.imshow(cells, cmap=shades, vmin=0, vmax=3)
    axes.set_xticks(range(len(names)), names, rotation=90, fontsize=8)
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.set_title("16 samples below the diagonal, 1 sample above: green right, amber said, red wrong, grey not drawn")
    figure.tight_layout()
    figure.savefig(PICTURE, dpi=80)
    plt.close(figure)
