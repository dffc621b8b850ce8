"""`python -m bench VERB`, one of the table below: see the module of each, or ask `--help`."""

from __future__ import annotations

import argparse
import os
import sys
from importlib import import_module

FILES = {"random": "random_scenes", "all": "everything"}  # of verbs that are named otherwise
NAMES = (
    "run", "again", "auto", "beside", "bias", "bright", "growth", "direct", "indirect", "left", "implicit_visibility",
    "media", "memory", "micro_rendering", "cases", "caustics", "prism", "profile", "compiling", "counted",
    "gallery", "glare", "gpu", "grass", "edges", "others", "random", "reflection_costs", "reflections", "relief",
    "strips", "soft_sources", "subsurface", "textures", "trees", "window", "subsurface_costs", "page", "pages",
    "points_motion", "ages", "hashes", "mutations", "pairs", "flicker", "orbit", "all",
)  # fmt: skip
VERBS = {name: import_module(f"bench.{FILES.get(name, name)}") for name in NAMES}


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    commands = parser.add_subparsers(metavar="|".join(VERBS), required=True)
    for name, module in VERBS.items():
        about = module.__doc__.split("\n\n")[0]
        one = commands.add_parser(name, help=about.split(": `")[0], description=about)
        module.add_options(one)
        one.set_defaults(command=module.command)
    options = parser.parse_args(arguments)
    return options.command(options)


if __name__ == "__main__":
    code = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # Blender 4.5 as a module waits forever in its exit handlers once a GPU was used
