"""`python -m addon render | compare | plan | tune FILE.blend …`, where Blender is installed as a Python module."""

import importlib
import os
import sys


def main() -> int:
    try:
        import bpy  # noqa: F401
    except ImportError as error:
        print(f"Blender could not be loaded as a Python module: {error}.", file=sys.stderr)
        return 1
    from . import cli

    importlib.import_module(__package__).register()
    return cli.main(sys.argv[1:], "python -m addon")


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # Blender 4.5 as a module waits forever in its exit handlers once a GPU was used
