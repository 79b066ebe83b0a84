"""What others publish for the same tests: each number as its source has it.

`page`: read in the maker's own document while this was written. `transcript`: read in a public test suite that copies
the paper's table. `recalled`: from a well-known table, without its page at hand.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

Seen = Literal["page", "transcript", "recalled"]


@dataclass(frozen=True)
class Publication:
    """A document, and how its numbers came here."""

    title: str
    seen: Seen

    def __str__(self) -> str:
        note = {"page": "", "transcript": " (from a transcript)", "recalled": " (recalled)"}[self.seen]
        return self.title + note


@dataclass(frozen=True)
class Published:
    """One value over the reference that the source uses.

    cells    : the mesh in the sense of the test here (a whole roof has twice the cells of its quarter), or None where
               the source says `note` only, such as "coarse mesh".
    unknowns : of the source's mesh where the test has none like it (then `cells` is the next coarser one and `note`
               says the source's), else None: counted on the test's mesh.
    constant : whether its membrane is a triangle of constant strain, like that of `constant` here.
    middles  : whether it has nodes in the middle of its sides as well.
    """

    test: str
    element: str
    cells: int | None
    ratio: float
    source: Publication
    unknowns: int | None = None
    constant: bool = False
    middles: bool = False
    note: str = ""


HARDER = Publication("MacNeal and Harder 1985, Finite Elements in Analysis and Design 1, 3-20", "recalled")
STRAIGHT = Publication("Altair OptiStruct 2022 verification problem OS-V 0720", "page")
CURVED = Publication("Altair OptiStruct 2022 verification problem OS-V 0710", "page")
TWISTED = Publication("Altair OptiStruct 2025 verification problem OS-V 0700", "page")
ROOF = Publication("Altair OptiStruct 2022 verification problem OS-V 0730", "page")
CATIA = Publication("Dassault CATIA V5 R18 finite element guide, hemispherical shell", "page")
MIDAS = Publication("MIDAS/Gen verification example 24", "page")
LE1 = Publication("Abaqus 2017 Benchmarks, LE1: plane stress elements, Table 1", "page")
LE3 = Publication("Abaqus 2017 Benchmarks, LE3: hemispherical shell with point loads", "page")
KO = Publication("Ko, Lee, Lee and Bathe 2017, Computers and Structures 193, 187-206, N = 16", "transcript")
TMRFS = Publication(
    "Sangtarash, Ghohani Arab, Sohrabi and Ghasemi 2020, flat shell triangle, Table 9, in FinEtoolsFlexStructures.jl",
    "transcript",
)
SIMO = Publication(
    "Simo, Fox and Rifai 1989, Computer Methods in Applied Mechanics and Engineering 73, 53-92", "recalled"
)
DVORKIN = Publication("Dvorkin and Bathe 1984, Engineering Computations 1, 77-88", "recalled")
FELIPPA = Publication("table of Cook's panel in Felippa 2003, Computer Methods in Applied Mechanics 192", "recalled")

TWELVE_BY_TWO = 12 * 3 * 5
"""Free unknowns of the usual mesh of the twisted beam."""

Ratios = dict[str, tuple[float, ...]]

SHAPES = ("", "_parallelograms", "_trapezoids")

STRAIGHT_BEAMS: tuple[tuple[Publication, str, tuple[float, ...], tuple[float, ...]], ...] = (
    # in plane on the three shapes of cells, then out of plane
    (STRAIGHT, "OptiStruct TRI3", (0.032, 0.012, 0.019), (0.973, 0.955, 0.965)),
    (STRAIGHT, "OptiStruct QUAD4", (0.992, 0.712, 0.173), (0.981, 0.981, 0.964)),
    (STRAIGHT, "OptiStruct TRI6", (0.994, 0.962, 0.972), (1.001, 0.995, 0.999)),
    (HARDER, "NASTRAN QUAD4", (0.904, 0.080, 0.071), (0.986, 0.977, 0.968)),
    (HARDER, "NASTRAN QUAD8", (0.987, 0.995, 0.946), (0.991, 0.985, 0.998)),
)

REFINED: tuple[tuple[str, Publication, tuple[int, ...], Ratios], ...] = (
    ("plate_supported", HARDER, (4, 8, 12, 16), {"NASTRAN QUAD4": (0.981, 1.004, 1.003, 1.002)}),
    ("plate_supported", KO, (32,), {"MITC4": (0.9998,), "MITC3": (1.001,)}),
    ("plate_clamped", KO, (32,), {"MITC4": (0.9980,), "MITC3": (0.9943,)}),
    ("curved_beam_in_plane", CURVED, (1,), {"OptiStruct TRI3": (0.025,), "OptiStruct QUAD4": (0.952,)}),
    ("curved_beam_in_plane", CURVED, (1,), {"OptiStruct TRI6": (1.005,)}),
    ("curved_beam_in_plane", HARDER, (1,), {"NASTRAN QUAD4": (0.833,), "NASTRAN QUAD8": (1.007,)}),
    ("cook", FELIPPA, (2, 4, 8), {"constant strain triangle": (11.99 / 23.96, 18.28 / 23.96, 22.02 / 23.96)}),
    ("cook", FELIPPA, (2, 4, 8), {"bilinear Q4": (11.85 / 23.96, 18.30 / 23.96, 22.08 / 23.96)}),
    ("scordelis_lo", ROOF, (4, 8, 12, 16, 20), {"OptiStruct TRI3": (1.169, 0.753, 0.829, 0.886, 0.920)}),
    ("scordelis_lo", ROOF, (4, 8, 12, 16, 20), {"OptiStruct QUAD4": (1.487, 1.082, 1.035, 1.020, 1.013)}),
    ("scordelis_lo", ROOF, (4, 8, 12, 16, 20), {"OptiStruct TRI6": (1.326, 1.107, 1.077, 1.063, 1.055)}),
    ("scordelis_lo", HARDER, (4, 8, 12, 16, 20), {"NASTRAN QUAD4": (1.376, 1.050, 1.018, 1.008, 1.004)}),
    ("scordelis_lo", DVORKIN, (8, 16), {"MITC4": (0.94, 0.97)}),
    ("scordelis_lo", KO, (32,), {"MITC4": (0.9886,), "MITC4+": (0.9973,), "MITC3": (0.9550,)}),
    ("scordelis_lo", TMRFS, (8, 16, 32, 64), {"Allman triangle": (1.004, 0.987, 0.987, 0.988)}),
    ("scordelis_lo", TMRFS, (8, 16, 32, 64), {"Cook triangle": (0.907, 0.929, 0.950, 0.981)}),
    ("scordelis_lo", TMRFS, (8, 16, 32, 64), {"Providas-Kattis triangle": (0.734, 0.815, 0.873, 0.967)}),
    ("scordelis_lo", TMRFS, (8, 16, 32, 64), {"TMRFS triangle": (0.924, 0.963, 0.974, 0.998)}),
    ("scordelis_lo", TMRFS, (8, 16, 32), {"Shin-Lee triangle": (1.379, 1.023, 1.004)}),
    ("scordelis_lo", TMRFS, (8, 32, 64), {"MITC3+": (0.669, 0.857, 0.955)}),
    ("pinched_cylinder", SIMO, (4, 8, 16), {"MITC4": (0.370, 0.740, 0.930), "Simo mixed": (0.399, 0.763, 0.935)}),
    ("pinched_cylinder", KO, (16,), {"MITC4": (0.9286,), "MITC4+": (0.9313,)}),
    ("holed_hemisphere", CATIA, (2, 4, 6, 8, 10, 12), {"CATIA TR3": (1.127, 1.043, 1.019, 1.009, 1.010, 0.993)}),
    ("holed_hemisphere", CATIA, (2, 4, 6, 8, 10, 12), {"CATIA QD4": (0.757, 1.022, 1.026, 1.016, 1.009, 0.999)}),
    ("holed_hemisphere", HARDER, (2, 4, 6, 8, 10, 12), {"NASTRAN QUAD4": (0.972, 1.024, 1.013, 1.005, 1.001, 0.998)}),
    ("holed_hemisphere", MIDAS, (8,), {"MIDAS plate": (0.0948 / 0.0940,), "SAP2000 shell": (0.0937 / 0.0940,)}),
)

TWISTED_BEAMS: tuple[tuple[Publication, Ratios, str], ...] = (
    # along the width of the tip, and across it
    (TWISTED, {"OptiStruct TRI3": (0.984, 0.839), "OptiStruct QUAD4": (0.992, 0.988)}, "12 x 2, assumed"),
    (HARDER, {"NASTRAN QUAD4": (0.993, 0.985)}, "12 x 2"),
)

NAFEMS: tuple[tuple[str, Publication, float, Ratios], ...] = (
    ("elliptic_membrane", LE1, 92.7, {"Abaqus CPS3": (51.04, 71.26), "Abaqus CPS4": (66.73, 84.54)}),
    ("elliptic_membrane", LE1, 92.7, {"Abaqus CPS6": (89.10, 94.01), "Abaqus CPS8R": (85.80, 90.07)}),
    ("closed_hemisphere", LE3, 0.185, {"Abaqus S3R": (0.080, 0.161), "Abaqus S4R": (0.180, 0.180)}),
    ("closed_hemisphere", LE3, 0.185, {"Abaqus S8R5": (0.179, 0.185), "Abaqus S4": (0.083, 0.175)}),
)
"""Stress in MPa and displacement in metres on NAFEMS's own coarse and fine meshes."""

CONSTANT = ("OptiStruct TRI3", "CATIA TR3", "Abaqus CPS3", "Abaqus S3R", "constant strain triangle")
MIDDLES = ("OptiStruct TRI6", "NASTRAN QUAD8", "Abaqus CPS6", "Abaqus CPS8R", "Abaqus S8R5")


def _published() -> Iterator[Published]:
    for source, element, in_plane, out_of_plane in STRAIGHT_BEAMS:
        for suffix, near, across in zip(SHAPES, in_plane, out_of_plane, strict=True):
            yield _one(f"straight_beam_in_plane{suffix}", element, 1, near, source)
            yield _one(f"straight_beam_out_of_plane{suffix}", element, 1, across, source)
    for source, elements, note in TWISTED_BEAMS:
        for element, pair in elements.items():
            for name, ratio in zip(("in_plane", "out_of_plane"), pair, strict=True):
                yield _one(f"twisted_beam_{name}", element, 1, ratio, source, TWELVE_BY_TWO, note)
    for test, source, cells, elements in REFINED:
        for element, ratios in elements.items():
            for count, ratio in zip(cells, ratios, strict=True):
                yield _one(test, element, count, ratio, source)
    for test, source, reference, elements in NAFEMS:
        for element, pair in elements.items():
            for note, value in zip(("coarse mesh", "fine mesh"), pair, strict=True):
                yield _one(test, element, None, value / reference, source, None, note)


def _one(
    test: str,
    element: str,
    cells: int | None,
    ratio: float,
    source: Publication,
    unknowns: int | None = None,
    note: str = "",
) -> Published:
    return Published(test, element, cells, ratio, source, unknowns, element in CONSTANT, element in MIDDLES, note)


PUBLISHED = tuple(_published())
"""All of them."""
