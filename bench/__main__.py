"""`python -m bench VERB`, one of the table below: see the module of each, or ask `--help`."""

from __future__ import annotations

import argparse
import os
import sys

from bench import (
    again,
    ages,
    auto,
    beside,
    bright,
    cases,
    caustics,
    compiling,
    counted,
    direct,
    edges,
    everything,
    flicker,
    gallery,
    glare,
    gpu,
    grass,
    growth,
    hashes,
    implicit_visibility,
    indirect,
    left,
    media,
    memory,
    micro_rendering,
    mutations,
    orbit,
    others,
    page,
    pages,
    pairs,
    points_motion,
    prism,
    profile,
    random_scenes,
    reflection_costs,
    reflections,
    relief,
    run,
    soft_sources,
    strips,
    subsurface,
    subsurface_costs,
    textures,
    trees,
    window,
)

VERBS = {
    "run": run,
    "again": again,
    "auto": auto,
    "beside": beside,
    "bright": bright,
    "growth": growth,
    "direct": direct,
    "indirect": indirect,
    "left": left,
    "implicit_visibility": implicit_visibility,
    "media": media,
    "memory": memory,
    "micro_rendering": micro_rendering,
    "cases": cases,
    "caustics": caustics,
    "prism": prism,
    "profile": profile,
    "compiling": compiling,
    "counted": counted,
    "gallery": gallery,
    "glare": glare,
    "gpu": gpu,
    "grass": grass,
    "edges": edges,
    "others": others,
    "random": random_scenes,
    "reflection_costs": reflection_costs,
    "reflections": reflections,
    "relief": relief,
    "strips": strips,
    "soft_sources": soft_sources,
    "subsurface": subsurface,
    "textures": textures,
    "trees": trees,
    "window": window,
    "subsurface_costs": subsurface_costs,
    "page": page,
    "pages": pages,
    "points_motion": points_motion,
    "ages": ages,
    "hashes": hashes,
    "mutations": mutations,
    "pairs": pairs,
    "flicker": flicker,
    "orbit": orbit,
    "all": everything,
}


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
