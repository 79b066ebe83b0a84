"""Published results of the paper.

Source: A. Madan, A. Jacobson, D. I. W. Levin, Diffusion Structures for Architectural Stripe Pattern Generation.
Table 1 has the parameters, Table 2 sizes and seconds. The captions are ours."""

from dataclasses import dataclass
from typing import Literal

Claim = Literal["", "web", "beam", "beams", "grid"]


@dataclass(frozen=True)
class Parameters:
    """A figure's row in Table 1 of the paper: force magnitude, anisotropy, and pairs (major, minor) of settings."""

    gamma: float
    r: float
    modes: tuple[int, int]
    thresholds: tuple[float, float]
    frequencies: tuple[float, float]
    phases: tuple[float, float]


@dataclass(frozen=True)
class Timings:
    """A row of Table 2: vertices, triangles, and seconds of each step; bending is None if the paper omits it."""

    vertices: int
    triangles: int
    membrane: float
    bending: float | None
    statics: float
    stress: float
    diffusion: float
    modes: float


@dataclass(frozen=True)
class PaperFigure:
    """A figure of the paper by Madan, Jacobson and Levin.
    label    : number and letter in the paper.    caption : content of the figure.
    row      : row of the figure in Table 1, or None.    timings : row of the figure in Table 2.
    stand_in : reason why dsfab's surface differs from the paper's surface, or ''.
    claim    : structure that the caption claims: web, beam, beams, grid; or ''."""

    label: str
    preset: str
    caption: str
    row: Parameters | None
    timings: Timings
    stand_in: str = ""
    claim: Claim = ""


def _row(
    gamma: float, r: float, a: int, b: int, u: float, w: float, phases: tuple[float, float] = (0.0, 0.0)
) -> Parameters:
    return Parameters(gamma, r, (a, b), (0.0, 0.0), (u, w), phases)


TABLE_1 = {
    "pavilion": _row(100, 100, 1, 3, 5, 5),
    "hanging_bar": _row(5, 100, 1, 1, 8, 8),
    "corner_held": _row(0.5, 100, 1, 1, 8, 8),
    "rollers": _row(1, 100, 1, 1, 8, 8),
    "bridge": _row(50, 10, 3, 3, 20, 20),
    "camel_head": _row(10, 100, 1, 1, 8, 8),
    "camel_nose": _row(5, 100, 1, 3, 8, 8, (0.0, 0.2)),
    "camel_ears": _row(10, 100, 1, 3, 8, 8),
    "pirate": _row(100, 100, 2, 2, 20, 20),
    "climbing_hold": _row(1, 100, 1, 1, 10, 10),
    "bob": _row(10, 100, 1, 2, 15, 15),
    "mouse": _row(10, 100, 1, 2, 5, 5, (0.0, 0.15)),
    "boys_surface": _row(1000, 75, 3, 4, 16, 16),
    "twisty_tower": Parameters(1000, 10, (3, 3), (-0.16, -0.13), (4, 7), (1, 0.57)),
    "sphere": _row(1, 100, 1, 1, 10, 10),
    "turkey": _row(1, 100, 2, 3, 24, 31),
}
"""Table 1 of Madan et al., by preset: force magnitude, anisotropy; modes, frequencies and phases (major, minor)."""

PLANE = Timings(7891, 15855, 0.076, None, 0.085, 0.029, 0.028, 0.231)
CAMEL = Timings(11717, 23323, 0.175, 0.748, 3.419, 0.003, 0.063, 0.477)
TABLE_2 = {
    "pavilion": Timings(6273, 12288, 0.101, 0.197, 0.858, 0.002, 0.028, 0.176),
    **dict.fromkeys(("hanging_bar", "corner_held", "rollers"), PLANE),
    "bridge": Timings(26114, 52224, 0.424, 3.389, 8.849, 0.007, 0.129, 1.340),
    **dict.fromkeys(("camel_none", "camel_head", "camel_nose", "camel_ears"), CAMEL),
    "pirate": Timings(29304, 58604, 0.429, 4.124, 8.855, 0.008, 0.147, 1.305),
    "climbing_hold": Timings(3934, 7868, 0.083, 0.117, 0.628, 0.001, 0.020, 0.143),
    "bob": Timings(5344, 10688, 0.105, 0.198, 1.887, 0.002, 0.027, 0.654),
    "mouse": Timings(2954, 5904, 0.0465, 0.065, 0.263, 0.001, 0.0132, 0.075),
    "boys_surface": Timings(13387, 26199, 0.241, 0.961, 2.144, 0.003, 0.0732, 0.502),
    "twisty_tower": Timings(23695, 47398, 0.418, 2.920, 17.722, 0.007, 0.129, 1.417),
    "sphere": Timings(15361, 30718, 0.253, None, 1.342, 0.004, 0.081, 0.647),
    "turkey": Timings(20099, 40194, 0.282, 1.982, 3.951, 0.004, 0.107, 0.709),
}
"""Table 2 of the paper, by preset. All plates have the same mesh, and all camels have the same mesh."""

STAND_INS = {
    **dict.fromkeys(("hanging_bar", "corner_held", "rollers"), "the lengths of the plate's sides are not published"),
    **dict.fromkeys(("camel_none", "camel_head", "camel_nose", "camel_ears"), "the paper's mesh has no stated licence"),
    **dict.fromkeys(
        ("pavilion", "bridge", "climbing_hold", "mouse", "twisty_tower"), "Madan et al. have not published their mesh"
    ),
    "pirate": "Madan et al. used a commercial mesh (TurboSquid 1084497)",
    "bob": "Bob is in Keenan Crane's 3D Model Repository; load its file with --mesh",
    "turkey": "the paper's mesh is on Thingiverse (3957882)",
}
"""Reasons why dsfab uses a surface that differs from the paper's surface, by preset."""

CAPTIONS: tuple[tuple[str, str, str, Claim], ...] = (
    ("teaser", "pavilion", "A pavilion: stress directions, diffusion, structure, with a tree for scale.", ""),
    ("2D a", "hanging_bar", "A bar held on the left and pulled down on the right.", ""),
    ("2D b", "corner_held", "Held at the corners and pulled from below.", ""),
    ("2D c", "rollers", "A plate pushed down; its corners can roll sideways.", ""),
    ("bridge", "bridge", "The metal frame of a bridge, regular even where stress directions diverge.", ""),
    ("camel a", "camel_none", "No force: there is no stress to follow.", "grid"),
    ("camel b", "camel_head", "Pressed on the head.", "web"),
    ("camel c", "camel_nose", "Pressed on the nose.", "beam"),
    ("camel d", "camel_ears", "Ears pushed down.", "beams"),
    ("showcase a", "pirate", "A glass pirate, held at the feet and pushed on the back of the head.", ""),
    ("showcase b", "climbing_hold", "A climbing hold, bolted to the wall and pressed down from above.", ""),
    ("showcase c", "bob", "Bob, pressed down on the head.", ""),
    ("showcase d", "mouse", "A mouse being left-clicked.", ""),
    ("showcase e", "boys_surface", "Boy's surface, pressed at the peak.", ""),
    ("showcase f", "twisty_tower", "A twisty tower, pressed down from the top.", ""),
    ("showcase g", "sphere", "A sphere, compressed at one pole and held at the other.", "web"),
    ("showcase h", "turkey", "A turkey, held at its base feathers and pushed on its head.", ""),
)
"""Label, preset, caption and claim of each figure, in the order of the paper by Madan et al."""

FIGURES = tuple(
    PaperFigure(label, preset, caption, TABLE_1.get(preset), TABLE_2[preset], STAND_INS.get(preset, ""), claim)
    for label, preset, caption, claim in CAPTIONS
)
"""Figures of the paper, in order."""
