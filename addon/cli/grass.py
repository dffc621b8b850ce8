"""The verb `grass`: renders a patch of grass by Cycles, and goes on where an earlier run was stopped."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..grass import directions
from ..grass.blades import Recipe
from ..grass.generate import Order, default_folder, generate
from ..grass.patch import MOST_CHROMA, MOST_LUMA, SUFFIX, PatchError
from ..snapshot.scene import one_line
from .files import output
from .refused import USAGE, Refused
from .terminal import progress, quiet


def add_arguments(parser: argparse.ArgumentParser, count) -> None:
    """`count` reads a whole number of at least 1."""
    recipe, order = Recipe(), Order()
    parser.add_argument("output", metavar=f"PATCH{SUFFIX}", type=Path)
    parser.add_argument("--size", metavar="METRES", type=float, default=recipe.size, help="of the tile's side")
    parser.add_argument("--height", metavar="METRES", type=float, default=recipe.height, help="of the longest blades")
    parser.add_argument("--blades", metavar="N", type=count, default=recipe.blades, help="of a tile")
    parser.add_argument("--seed", metavar="N", type=count, default=recipe.seed)
    parser.add_argument("--texels", metavar="N", type=count, default=order.texels, help="along the tile's side")
    parser.add_argument("--views", metavar="N", type=count, default=order.views.number, help="directions (most: 81)")
    parser.add_argument("--grazing", action="store_true", help="a further ring of 24 views at 85 degrees")
    parser.add_argument("--lights", metavar="N", type=count, default=order.lights.number, help="directions (most: 21)")
    parser.add_argument("--samples", metavar="N", type=count, default=order.samples, help="of Cycles, per texel")
    parser.add_argument("--luma", metavar="N", type=count, default=order.luma, help="components of each view")
    parser.add_argument("--chroma", metavar="N", type=count, default=order.chroma, help="of each colour difference")
    parser.add_argument("--verbose", action="store_true", help="show what Blender itself prints")


def order_of(options: argparse.Namespace) -> Order:
    """What the options ask for. Raises Refused."""
    if options.luma > MOST_LUMA or options.chroma > MOST_CHROMA:
        raise Refused(f"A patch has at most {MOST_LUMA} components of luma and {MOST_CHROMA} of chroma.", USAGE)
    views = directions.thinned(directions.VIEWS, options.views)
    if options.grazing:
        views = directions.Rings((*views.polar, directions.GRAZING), (*views.counts, 24))
    try:
        return Order(
            Recipe(options.size, options.height, options.blades, options.seed), options.texels, views,
            directions.thinned(directions.LIGHTS, options.lights), options.samples, options.luma, options.chroma,
        )  # fmt: skip
    except ValueError as error:
        raise Refused(str(error), USAGE) from None


def make_patch(options: argparse.Namespace) -> None:
    """Render what is missing of the views and write the patch. Raises Refused."""
    if options.output.suffix != SUFFIX:
        raise Refused(f"The output must end in {SUFFIX}, and {options.output.name} does not.", USAGE)
    order = order_of(options)
    path = output(default_folder() / options.output, folder=False)
    done, whole = 0, order.views.number
    try:
        with quiet(options.verbose) as terminal:
            for done, whole in generate(order, path):
                progress(terminal, f"{done} of {whole} views")
            progress(terminal, "")
    except PatchError as error:
        raise Refused(str(error)) from None
    except KeyboardInterrupt:
        raise Refused(f"Interrupted after {done} of {whole} views; the same command goes on from there.") from None
    print(one_line(str(path)))
