"""Program that draws pictures of a finished structure while another process writes files.

    python -P picture_program.py

Each line of standard input is JSON: the names of a pickle file and of a PNG file. The program prints the name of each
finished PNG file."""

import json
import pickle
import sys
from pathlib import Path


def main() -> None:
    """Draw the pictures that standard input requests."""
    sys.path.append(str(Path(__file__).parents[2]))  # finds dsfab even if dsfab is not installed
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401

    import dsfab.render.build_pictures  # noqa: F401  (loads while there is no design yet)
    from dsfab.render.picture import write_png

    for line in sys.stdin:
        picture_file, path = json.loads(line)
        pixels = pickle.loads(Path(picture_file).read_bytes()).render()
        sys.stdout.write(f"{write_png(pixels, Path(path))}\n")


if __name__ == "__main__":
    main()
