"""What ISO 10303-511 (advanced_face), -514 (advanced_brep) and -42 ask of a STEP file, of every way that one is made.

OCCT reads files that break these rules, other programs need not: an edge on a polyline of two points is none.
"""

import re
from collections import Counter
from dataclasses import replace
from functools import cache, partial

import pytest

from dsfab.design.output.files import curved_sheet
from dsfab.export.cad.step import file, strategies
from dsfab.export.cad.step.by_members.draft import member_draft
from dsfab.export.cad.step.folded_sheets import planar_file
from dsfab.export.cad.step.smooth.build import SmoothPlan
from dsfab.export.cad.step.smooth.solid import file_text
from dsfab.export.part import part_of
from dsfab.surface.shapes.roofs import barrel_vault
from tests.export.folded_sheets import folded_part, openings, ridged_roof
from tests.export.holed_sheets import holed_sheet
from tests.export.holed_sheets import thickened as thickened_plate
from tests.export.member_networks import cylinder_grid, cylinder_strip, draft_of
from tests.export.planar_solids import plate_with_hole
from tests.smooth import THICKNESS, holed, thickened

SURFACES = {"PLANE", "CYLINDRICAL_SURFACE", "B_SPLINE_SURFACE_WITH_KNOTS", "SURFACE_OF_LINEAR_EXTRUSION"}
CURVES = {"LINE", "CIRCLE", "POLYLINE", "B_SPLINE_CURVE_WITH_KNOTS", "SURFACE_CURVE"}

Found = dict[int, tuple[str, str]]


def entities(text: str) -> Found:
    """Word and arguments of every entity by its number; of complex ones no word."""
    return {int(k): (word, rest) for k, word, rest in re.findall(r"^#(\d+)=([A-Z_0-9]*)\(?(.*?)\)?;$", text, re.M)}


def referred(found: Found, k: int) -> list[int]:
    return [int(i) for i in re.findall(r"#(\d+)", found[k][1])]


def broken(text: str) -> Counter[str]:
    """The rules that entities of a file break, and how often."""
    found = entities(text)
    wrong = Counter[str]()
    for k, (word, rest) in found.items():
        to = referred(found, k)
        wrong["there is no such entity"] += sum(i not in found for i in to)
        words = [found[i][0] for i in to if i in found]
        if word == "EDGE_CURVE":
            short = words[-1] == "POLYLINE" and len(referred(found, to[2])) < 3
            wrong["an edge is not between two vertices"] += words[:2] != ["VERTEX_POINT"] * 2
            wrong[f"an edge lies on {words[-1]}"] += words[-1] not in CURVES
            wrong["an edge lies on a polyline of two points"] += short
        elif word == "SURFACE_CURVE":
            wrong["a curve on surfaces has no curve of their parameters"] += set(words[1:]) != {"PCURVE"}
        elif word == "ADVANCED_FACE":
            wrong[f"a face lies on {words[-1]}"] += words[-1] not in SURFACES
            wrong["a face has two outer bounds"] += words.count("FACE_OUTER_BOUND") > 1
        elif word == "EDGE_LOOP":
            wrong["a loop is open"] += not closed(found, to)
        elif word.startswith("B_SPLINE") and "KNOTS" in word:
            wrong["a spline has another number of knots"] += not knotted(word, rest)
    uses = Counter(re.findall(r"=ORIENTED_EDGE\('',\*,\*,(#\d+,\.[TF]\.)\)", text))
    edges = sum(word == "EDGE_CURVE" for word, _ in found.values())
    wrong["an edge is not used once each way"] += set(uses.values()) != {1} or len(uses) != 2 * edges
    return +wrong


def closed(found: Found, steps: list[int]) -> bool:
    """Whether each oriented edge of a loop begins where the one before it ends."""
    ends = [referred(found, referred(found, k)[0])[:2][:: 1 if found[k][1].endswith(".T.") else -1] for k in steps]
    return all(one[1] == two[0] for one, two in zip(ends, [*ends[1:], ends[0]], strict=True))


def knotted(word: str, rest: str) -> bool:
    """Whether knots are counted as often as degree and poles say."""
    count = 2 if "SURFACE" in word else 1
    degrees = [int(d) for d in rest.split(",")[1 : 1 + count]]
    rows = re.findall(r"\((#[#\d,]+)\)", rest)
    poles = [len(rows), len(rows[0].split(","))] if count == 2 else [len(rows[0].split(","))]
    times = [sum(map(int, one.split(","))) for one in re.findall(r"\((\d+(?:,\d+)*)\)", rest)][:count]
    return times == [p + d + 1 for p, d in zip(poles, degrees, strict=True)]


def faceted() -> str:
    part = replace(strategies.prepare(part_of(plate_with_hole(), "a", 10**6)), step="faceted")
    return b"".join(file.encode(part)).decode()


def planar() -> str:
    part = strategies.prepare(part_of(thickened_plate(holed_sheet()), "a", 10**6))
    return b"".join(file.encode(replace(part, step="planar", tolerance=0.2))).decode()


def at_folds() -> str:
    surface = ridged_roof()
    return "".join(planar_file(folded_part(surface, openings(surface))[0]).texts)


def by_members() -> str:
    part, _, _ = draft_of(surface := cylinder_strip(), cylinder_grid(surface))
    return member_draft(part, SmoothPlan(part)).text


def smooth(traced: bool) -> str:
    surface = barrel_vault(2.0, 3.0, 0.7, 0.15)
    sheet = holed(surface, [[0.0, 0.3, 0.7]], 0.4)
    made = partial(curved_sheet, surface, sheet, THICKNESS)
    part = replace(strategies.prepare(part_of(thickened(surface, sheet), "a", 10**6)), curved=made, step="smooth")
    model = (plan := SmoothPlan(part)).build(next(plan.layouts())).model
    model.pieces[:] = [replace(piece, traced=traced) for piece in model.pieces]
    return file_text(part, [(model, k) for k in range(len(model.pieces))])


WAYS = {
    "faceted": faceted,
    "planar": planar,
    "folds": at_folds,
    "members": by_members,
    "smooth": partial(smooth, False),
    "smooth, traced": partial(smooth, True),
}


@cache
def text_of(way: str) -> str:
    return WAYS[way]()


@pytest.mark.parametrize("way", WAYS)
def test_every_way_keeps_to_the_rules_of_the_schema(way):
    assert broken(text_of(way)) == {}
    assert text_of(way).count("=ADVANCED_FACE(") >= 6


SPOILT = {
    "no such entity": (r"(=EDGE_CURVE\('',#\d+,#\d+,)#\d+", r"\1#0"),
    "not between two vertices": (r"(=EDGE_CURVE\('',)#(\d+),#\d+,#(\d+)", r"\1#\2,#\3,#\3"),
    "polyline of two points": (r"B_SPLINE_CURVE_WITH_KNOTS\('',1,(\(.*?\)).*\)", r"POLYLINE('',\1)"),
    "an edge lies on PLANE": (r"=LINE\(", "=PLANE("),
    "curve of their parameters": (r"=PCURVE\(", "=LINE("),
    "a face lies on": (r"=PLANE\(", "=POINT("),
    "two outer bounds": (r"=FACE_BOUND\(", "=FACE_OUTER_BOUND("),
    "a loop is open": (r"(=EDGE_LOOP\('',\()(#\d+),(#\d+)", r"\1\3,\2"),
    "another number of knots": (r"\(4,4\)", "(4,3)"),
    "not used once each way": (r"(=ORIENTED_EDGE\('',\*,\*,#\d+),\.[TF]\.", r"\1,.T."),
}


@pytest.mark.parametrize("rule", SPOILT)
def test_each_rule_is_seen_broken(rule):
    told = [broken(re.sub(*SPOILT[rule], text)) for text in map(text_of, WAYS) if re.search(SPOILT[rule][0], text)]
    assert any(rule in one for counter in told for one in counter), told
