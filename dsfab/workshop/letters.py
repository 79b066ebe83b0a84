"""Letters of single strokes, as engravers draw them: outlines of letters would be cut out or engraved twice.

Each letter is a few polylines on a grid 4 wide and 6 high, of points "xy". Small letters are small capitals.
"""

import numpy as np

from dsfab.arrays import Floats

HIGH, WIDE, SPACE = 6, 4, 2
SMALL = 0.7
"""Height of small letters over that of capitals."""

GLYPHS = {
    "A": "00 26 40|12 32", "B": "00 06 36 45 34 03|33 42 41 30 00", "C": "45 36 16 05 01 10 30 41",
    "D": "00 06 26 44 42 20 00", "E": "46 06 00 40|03 33", "F": "46 06 00|03 33", "G": "45 36 16 05 01 10 30 41 43 23",
    "H": "00 06|40 46|03 43", "I": "20 26|10 30|16 36", "J": "46 41 30 10 01", "K": "00 06|46 03 40", "L": "06 00 40",
    "M": "00 06 23 46 40", "N": "00 06 40 46", "O": "10 01 05 16 36 45 41 30 10", "P": "00 06 36 45 44 33 03",
    "Q": "10 01 05 16 36 45 41 30 10|22 40", "R": "00 06 36 45 44 33 03|23 40",
    "S": "45 36 16 05 04 13 33 42 41 30 10 01",
    "T": "20 26|06 46", "U": "06 01 10 30 41 46", "V": "06 20 46", "W": "06 10 23 30 46", "X": "00 46|06 40",
    "Y": "06 23 46|23 20", "Z": "06 46 00 40", "0": "10 01 05 16 36 45 41 30 10|01 45", "1": "05 26 20|10 30",
    "2": "05 16 36 45 44 00 40", "3": "05 16 36 45 44 33 42 41 30 10 01|13 33", "4": "30 36 02 42",
    "5": "46 06 03 33 42 41 30 10 01", "6": "45 36 16 05 01 10 30 41 42 33 03", "7": "06 46 10",
    "8": "13 04 05 16 36 45 44 33 13 02 01 10 30 41 42 33", "9": "01 10 30 41 45 36 16 05 04 13 43",
    ".": "20 21", "-": "13 33", "+": "13 33|22 24", "/": "00 46", "_": "00 40", " ": "",
}  # fmt: skip


def strokes(text: str, height: float) -> list[Floats]:
    """(k, 2) polylines of a line of text, its lower left corner at the origin, in the unit of its height.

    What is no letter, digit or one of . - + / _ is drawn as a dash.
    """
    found, x = list[Floats](), 0.0
    for letter in text:
        scale = height / HIGH * (SMALL if letter.islower() else 1.0)
        for line in filter(None, GLYPHS.get(letter.upper(), GLYPHS["-"]).split("|")):
            points = np.array([[int(xy[0]), int(xy[1])] for xy in line.split()], dtype=np.float64)
            found.append(points * scale + [x, 0.0])
        x += (WIDE + SPACE) * scale
    return found


def text_length(text: str, height: float) -> float:
    """How long a line of text is, in the unit of its height."""
    wide = sum((WIDE + SPACE) * (SMALL if letter.islower() else 1.0) for letter in text)
    return (wide - SPACE) * height / HIGH
