"""The README's picture out of a comparison: Candela's render and Cycles' side by side, each with its name.

    python tools/pictures.py [FOLDER] [PICTURE]

FOLDER holds candela.png and cycles.png, as `python -m addon compare` writes them (out/picture unless told otherwise);
PICTURE is docs/images/demo.png unless told otherwise.
"""

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.image import imread

ROOT = Path(__file__).resolve().parent.parent
LABELS = {"candela.png": "Candela", "cycles.png": "Cycles"}
GAP = 8  # pixels between the two


def side_by_side(folder: Path, picture: Path) -> None:
    """Write both pictures pixel for pixel in one row; SystemExit with a sentence when one is missing."""
    try:
        images = [imread(folder / name) for name in LABELS]
    except OSError as error:
        raise SystemExit(f"{error.filename} could not be read; `make pictures` writes it.") from None
    height, width = images[0].shape[:2]
    figure = plt.figure(figsize=(2 * width + GAP, height), dpi=1)
    for number, (image, label) in enumerate(zip(images, LABELS.values())):
        figure.figimage(image, xo=number * (width + GAP), yo=0)
        style = {"boxstyle": "round,pad=0.45", "facecolor": "black", "alpha": 0.55, "linewidth": 0}
        figure.text(
            (number * (width + GAP) + 14) / (2 * width + GAP), 1 - 14 / height, label,
            color="white", fontsize=15 * 72, va="top", bbox=style,
        )  # fmt: skip
    figure.patch.set_alpha(0)
    picture.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(picture, dpi=1)


if __name__ == "__main__":
    places = [Path(argument) for argument in sys.argv[1:]]
    defaults = [ROOT / "out" / "picture", ROOT / "docs" / "images" / "demo.png"]
    side_by_side(*places, *defaults[len(places) :])
