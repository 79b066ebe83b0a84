"""Published results of the paper: the preset of each figure, and its rows in the paper's tables.

A. Madan, A. Jacobson, D. I. W. Levin, Diffusion Structures for Architectural Stripe Pattern Generation. Table 1 holds
the parameters, Table 2 sizes and seconds on a laptop of 2015 (dual-core i5). The captions are our own words."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Parameters:
    """A row of Table 1: force magnitude, anisotropy, and (major, minor) mode, threshold, frequency and phase."""

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
    """A figure of the paper.

    label    : number and letter in the paper.
    preset   : preset of the figure.
    caption  : content of the figure.
    row      : its row of Table 1; None for the camel without load, which Table 1 omits.
    timings  : its row of Table 2; figures with the same mesh share a row.
    stand_in : reason why dsfab's surface is not the paper's; '' for a surface by a formula.
    claim    : claim of the paper that a check covers: web, beam, beams (between loads) or grid; or ''."""

    label: str
    preset: str
    caption: str
    row: Parameters | None
    timings: Timings
    stand_in: str = ""
    claim: Literal["", "web", "beam", "beams", "grid"] = ""


def _row(gamma: float, r: float, a: int, b: int, u: float, w: float, phases: tuple[float, float]) -> Parameters:
    return Parameters(gamma, r, (a, b), (0.0, 0.0), (u, w), phases)


NONE = (0.0, 0.0)
UNPUBLISHED = "the paper's mesh is not published"
PLANE = Timings(7891, 15855, 0.076, None, 0.085, 0.029, 0.028, 0.231)
CAMEL = Timings(11717, 23323, 0.175, 0.748, 3.419, 0.003, 0.063, 0.477)

FIGURES: tuple[PaperFigure, ...] = (
    PaperFigure(
        "teaser",
        "pavilion",
        "A pavilion: stress directions, diffusion, structure, with a tree for scale.",
        _row(100, 100, 1, 3, 5, 5, NONE),
        Timings(6273, 12288, 0.101, 0.197, 0.858, 0.002, 0.028, 0.176),
        UNPUBLISHED,
    ),
    PaperFigure(
        "2D a",
        "hanging_bar",
        "A bar held on the left and pulled down on the right.",
        _row(5, 100, 1, 1, 8, 8, NONE),
        PLANE,
        "the plate's sides are not published",
    ),
    PaperFigure(
        "2D b",
        "corner_held",
        "Held at the corners and pulled from below.",
        _row(0.5, 100, 1, 1, 8, 8, NONE),
        PLANE,
        "the plate's sides are not published",
    ),
    PaperFigure(
        "2D c",
        "rollers",
        "Pushed down; the corners roll sideways.",
        _row(1, 100, 1, 1, 8, 8, NONE),
        PLANE,
        "the plate's sides are not published",
    ),
    PaperFigure(
        "bridge",
        "bridge",
        "The metal frame of a bridge, regular also where the stress field parts.",
        _row(50, 10, 3, 3, 20, 20, NONE),
        Timings(26114, 52224, 0.424, 3.389, 8.849, 0.007, 0.129, 1.340),
        UNPUBLISHED,
    ),
    PaperFigure(
        "camel a",
        "camel_none",
        "No force: the stress says nothing.",
        None,
        CAMEL,
        "the paper's mesh has no stated licence",
        "grid",
    ),
    PaperFigure(
        "camel b",
        "camel_head",
        "Pressed on the head.",
        _row(10, 100, 1, 1, 8, 8, NONE),
        CAMEL,
        "the paper's mesh has no stated licence",
        "web",
    ),
    PaperFigure(
        "camel c",
        "camel_nose",
        "Pressed on the nose.",
        _row(5, 100, 1, 3, 8, 8, (0.0, 0.2)),
        CAMEL,
        "the paper's mesh has no stated licence",
        "beam",
    ),
    PaperFigure(
        "camel d",
        "camel_ears",
        "Ears pushed down.",
        _row(10, 100, 1, 3, 8, 8, NONE),
        CAMEL,
        "the paper's mesh has no stated licence",
        "beams",
    ),
    PaperFigure(
        "showcase a",
        "pirate",
        "A glass pirate, held at the feet and pushed on the back of the head.",
        _row(100, 100, 2, 2, 20, 20, NONE),
        Timings(29304, 58604, 0.429, 4.124, 8.855, 0.008, 0.147, 1.305),
        "the paper's mesh is sold (TurboSquid 1084497)",
    ),
    PaperFigure(
        "showcase b",
        "climbing_hold",
        "A climbing hold, bolted to the wall and pressed down from above.",
        _row(1, 100, 1, 1, 10, 10, NONE),
        Timings(3934, 7868, 0.083, 0.117, 0.628, 0.001, 0.020, 0.143),
        UNPUBLISHED,
    ),
    PaperFigure(
        "showcase c",
        "bob",
        "Bob, pressed down on the head.",
        _row(10, 100, 1, 2, 15, 15, NONE),
        Timings(5344, 10688, 0.105, 0.198, 1.887, 0.002, 0.027, 0.654),
        "Bob is in Keenan Crane's 3D Model Repository; --mesh takes it",
    ),
    PaperFigure(
        "showcase d",
        "mouse",
        "A mouse being left-clicked.",
        _row(10, 100, 1, 2, 5, 5, (0.0, 0.15)),
        Timings(2954, 5904, 0.0465, 0.065, 0.263, 0.001, 0.0132, 0.075),
        UNPUBLISHED,
    ),
    PaperFigure(
        "showcase e",
        "boys_surface",
        "Boy's surface, pressed at the peak.",
        _row(1000, 75, 3, 4, 16, 16, NONE),
        Timings(13387, 26199, 0.241, 0.961, 2.144, 0.003, 0.0732, 0.502),
    ),
    PaperFigure(
        "showcase f",
        "twisty_tower",
        "A twisty tower, pressed down from the top.",
        Parameters(1000, 10, (3, 3), (-0.16, -0.13), (4, 7), (1, 0.57)),
        Timings(23695, 47398, 0.418, 2.920, 17.722, 0.007, 0.129, 1.417),
        UNPUBLISHED,
    ),
    PaperFigure(
        "showcase g",
        "sphere",
        "A sphere, compressed at one pole and held at the other.",
        _row(1, 100, 1, 1, 10, 10, NONE),
        Timings(15361, 30718, 0.253, None, 1.342, 0.004, 0.081, 0.647),
        claim="web",
    ),
    PaperFigure(
        "showcase h",
        "turkey",
        "A turkey, held at its base feathers and pushed on its head.",
        _row(1, 100, 2, 3, 24, 31, NONE),
        Timings(20099, 40194, 0.282, 1.982, 3.951, 0.004, 0.107, 0.709),
        "the paper's mesh is on Thingiverse (3957882)",
    ),
)
"""All figures of the paper, in order."""
