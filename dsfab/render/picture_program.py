"""Draws the picture of a finished structure: a program of its own, so that files are written at the same time.

    python -P picture_program.py

loads what draws, and then reads its arguments from its input, a list as one line of JSON: a file of `pickle` that holds
the arguments of `dsfab.render.picture.picture` as a dictionary, and the PNG file to write. It prints the name of that.
"""

import json
import pickle
import sys
from pathlib import Path


def main() -> None:
    """Draw what standard input asks for."""
    sys.path.append(str(Path(__file__).parents[2]))  # where dsfab is, if it is not installed
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401

    from dsfab.render.picture import drawn_picture, write_png

    given, path = json.loads(sys.stdin.readline())
    pixels = drawn_picture(**pickle.loads(Path(given).read_bytes()))
    sys.stdout.write(f"{write_png(pixels, Path(path))}\n")


if __name__ == "__main__":
    main()
