"""Program that draws the picture of a finished structure while another process writes files.

    python -P picture_program.py

The program loads the drawing modules and reads a line of JSON: a `pickle` file and a PNG file. The pickle holds a
`dsfab.render.client_picture.ClientPicture`. The program prints the name of the PNG file.
"""

import json
import pickle
import sys
from pathlib import Path


def main() -> None:
    """Draw the picture that standard input requests."""
    sys.path.append(str(Path(__file__).parents[2]))  # finds dsfab if it is not installed
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401

    import dsfab.render.client_picture  # noqa: F401  (loads while there is no design yet)
    from dsfab.render.picture import write_png

    arguments_file, path = json.loads(sys.stdin.readline())
    pixels = pickle.loads(Path(arguments_file).read_bytes()).render()
    sys.stdout.write(f"{write_png(pixels, Path(path))}\n")


if __name__ == "__main__":
    main()
