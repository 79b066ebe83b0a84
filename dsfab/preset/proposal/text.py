"""`ProposedValues`: the values of a proposed preset, and the preset's text."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from dsfab.core.messages import length
from dsfab.preset.proposal.loads import WindRoof, load_tables, toml_line
from dsfab.preset.proposal.marks import TABLES, mark_tables
from dsfab.preset.proposal.reading import UserMesh
from dsfab.preset.proposal.readings import SupportPlace
from dsfab.preset.proposal.shape import is_figure
from dsfab.preset.proposal.sizes import Sizes
from dsfab.surface import Ball, Boundary, Box, Marks, Surface

SHARE = 0.45  # Share of the surface that stays material.


@dataclass(frozen=True, eq=False)
class ProposedValues:
    """Values of a proposed preset. built_in : True if the supports are clamped.    roof : kind of roof for wind loads.
    loads : pressures (Pa) by name, without the weight."""

    size: Sizes
    stands: tuple[SupportPlace, ...]
    built_in: bool
    loads: Mapping[str, float]
    roof: WindRoof = ""
    marks: Mapping[str, Marks] = field(default_factory=dict)


def proposal_text(user_mesh: UserMesh, plan: ProposedValues, keys: Mapping[str, Any], notes: Mapping[str, str]) -> str:
    """Return the preset as TOML with comments. keys : of [surface].    notes : reasons for decisions, by topic."""
    size, stands, marks = plan.size, plan.stands, plan.marks
    surface, stand = user_mesh.surface, () if "support" in marks else stands
    file = "" if "origin" in keys else str(keys.get("file"))  # `origin` does not move the file's curves
    tables = list(mark_tables(marks, file, str(keys.get("unit")), size, size.edge or surface.mean_edge))
    head = [
        f"# {user_mesh.name}: made by `dsfab new`; every value is a proposal. Units: metres, newtons, pascals.",
        toml_line("name", user_mesh.name),
        toml_line("description", _description(surface, plan)),
    ]
    parts = (
        head,
        _surface(keys, notes, size),
        *(_support(surface, plan, place) for place in stand),
        *(table for table in tables if table[0] == TABLES["support"]),
        *load_tables(surface, plan.loads, plan.roof),
        *(table for table in tables if table[0] == TABLES["load"]),
        _statics(plan),
        *_diffusion(plan),
        _pattern(surface, size),
        *(table for table in tables if table[0] not in TABLES.values()),
        *_families(size),
        _widths(),
        [
            "[slicing]",
            toml_line(
                "snap",
                0.01,
                "largest distance by which a cut moves to a vertex, as a share of the edge; small values keep symmetry",
            ),
            toml_line("improve", True, "fewer and better triangles in the cut mesh, for finite elements and CAD"),
        ],
        *_thickening(surface),
        ["[sizing]", toml_line("first", size.thickness, "first guess of the thickness, in metres")],
        [
            "[export]",
            toml_line("step", "quick", "quick: STEP only if it is fast; auto: more kinds of STEP, which takes minutes"),
            toml_line("step_faces", 12_000, "STEP files with more planar faces are slow in CAD; the default is 30000"),
        ],
    )
    return "\n\n".join("\n".join(part) for part in parts) + "\n"


def _surface(keys: Mapping[str, Any], notes: Mapping[str, str], size: Sizes) -> Iterator[str]:
    yield "[surface]"
    comments = {"unit": notes["unit"], "up": notes["up"], "mend": notes.get("mended", "")}
    comments["repair"] = comments["mend"]
    comments["only"] = "parts of the file that form the surface"
    comments["origin"] = "in metres; this point of the mesh becomes the origin of output files"
    for key, value in keys.items():
        if key != "mesh":
            yield toml_line(key, value, comments.get(key, ""))
    if size.edge:
        yield toml_line(
            "edge", size.edge, "edge length of a new, even mesh with the same boundaries and creases, in metres"
        )
    if size.edge and size.coarse:
        yield toml_line("smooth", True, "the new vertices lie on the smooth surface through the old vertices")


def _support(surface: Surface, plan: ProposedValues, place: SupportPlace) -> list[str]:
    digits = max(0, 4 - int(np.floor(np.log10(surface.size))))
    picker = place.picker(0.25 * (plan.size.edge or surface.mean_edge), digits)
    pick = ", ".join(f"{key} = {_toml(value)}" for key, value in _picker_values(picker))
    metres = f"{length(place.length)} of free edge" if place.length else ""
    lines = [
        "[[surface.support]]",
        toml_line("name", place.name, metres),
        f"at = {{ {pick} }}",
        toml_line("hold", "xyz"),
    ]
    return lines + ([toml_line("clamp", True, "built in: no rotation about this edge")] if plan.built_in else [])


def _picker_values(picker: Boundary | Ball | Box) -> Iterator[tuple[str, Any]]:
    yield "pick", picker.pick
    for key in fields(picker):
        value = getattr(picker, key.name)
        if key.name != "pick" and value != key.default:
            yield key.name, value


def _toml(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)


def _statics(plan: ProposedValues) -> Iterator[str]:
    yield "[statics]"
    yield toml_line("material", plan.size.material, "`dsfab materials` lists all materials")
    yield toml_line("thickness", "auto", "auto: the smallest thickness that meets [sizing]; or a number in metres")
    if plan.built_in:
        yield toml_line("bending", "midedge", "elements with rotations; built-in edges need these elements")


def _diffusion(plan: ProposedValues) -> Iterator[list[str]]:
    if "wind" in plan.loads:
        yield ["[diffusion]", toml_line("follow", "combined", "the pattern follows the stress of wind from both sides")]


def _pattern(surface: Surface, size: Sizes) -> Iterator[str]:
    yield "[pattern]"
    yield toml_line("method", "stripes", "evenly spaced stripes along the stress")
    yield toml_line("keep", size.keep, "width of the material around supports, in metres")
    if surface.loops:
        yield toml_line("rim", size.rim, "width of the material along edges and openings, in metres")
    yield toml_line("fillet", size.fillet, "radius of the corners of openings, in metres")


def _families(size: Sizes) -> Iterator[list[str]]:
    for family, words in (("major", "m, distance between members"), ("minor", "m, distance between crossing members")):
        yield [f"[pattern.{family}]", toml_line("spacing", size.spacing, words)]


def _widths() -> Iterator[str]:
    yield "[pattern.width]"
    yield toml_line(
        "rule",
        "constant",
        "constant: equally wide members; graded and stressed: members are wider where the stress is larger",
    )
    yield toml_line("solid_fraction", SHARE, "share of the surface that stays material")


def _thickening(surface: Surface) -> Iterator[list[str]]:
    if is_figure(surface):  # the solid is thin at the sharp bends of sculptures
        yield [
            "[thickening]",
            toml_line("thinnest", 0.05, "smallest accepted thickness at sharp bends, as a share of the full thickness"),
        ]


def _description(surface: Surface, plan: ProposedValues) -> str:
    x, y, z = (length(float(side)) for side in np.ptp(surface.V, axis=0))
    loads = " and ".join(["its own weight", *plan.loads])
    sheet = f"{plan.size.material} of {length(plan.size.thickness)}"
    return f"{x} x {y}, {z} high, {sheet}, on {place_words(plan.stands)}, under {loads}."


def place_words(stands: Sequence[SupportPlace]) -> str:
    """Return a short text for supports, such as 'its base ring' or '4 feet'."""
    kinds = list(dict.fromkeys(place.name.rstrip("0123456789 ") for place in stands))
    if len(stands) == 1:
        return f"its {kinds[0]}"
    plural = {"foot": "feet"}.get(kinds[0], f"{kinds[0]}s")
    return f"{len(stands)} {plural}" if len(kinds) == 1 else f"{len(stands)} parts of its edge"
