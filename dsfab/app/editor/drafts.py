"""Drafts for the page: the striped mesh and the cut sheet as bytes, and their measures."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from dsfab.app.editor.jobs import Telling
from dsfab.core.arrays import Bools, Floats, unit_vectors
from dsfab.core.errors import DsfabError
from dsfab.design import Design, Log, least_widths, refusal
from dsfab.design.pattern_measures import measured_pattern
from dsfab.design.slicing_and_thickening import slicing_step
from dsfab.design.stripe_pattern import least_width, stripe_stresses
from dsfab.pattern import WIDTH_RULES, frequency_for, slopes, vertex_means
from dsfab.render.colouring import STEEPEST, diverging, rising, signed
from dsfab.render.marks import POINT_LOAD, SPREAD_LOAD, SUPPORTS, Spacing, thinned
from dsfab.render.striped_mesh import StripedMesh, distances, finite
from dsfab.render.view import ANGLE, best_side, up_axis
from dsfab.results import SlicingResult
from dsfab.slicing import Sheet
from dsfab.slicing.measures.widths import features, kept_cells, under
from dsfab.surface import LoadCase, Surface, nearest, weights_at

TYPES = {"f": "float32", "i": "uint32", "u": "uint32", "b": "uint8"}


def packed(facts: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Pack facts and arrays (...) into one message; floats as 32 bits, integers as unsigned 32 bits."""
    table, blocks, place = {}, [], 0
    for name, array in arrays.items():
        kind = TYPES[array.dtype.kind]
        block = np.ascontiguousarray(array, dtype=np.dtype(kind).newbyteorder("<")).tobytes()
        table[name] = {"type": kind, "shape": list(array.shape), "at": place}
        block += bytes(-len(block) % 4)
        blocks.append(block)
        place += len(block)
    head = json.dumps({**facts, "arrays": table}, allow_nan=False).encode()
    head += b" " * (-len(head) % 4)
    return len(head).to_bytes(4, "little") + head + b"".join(blocks)


def model(draft: Design) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return facts and arrays of the surface, phases, distances, answers and marks.

    V (n, 3), metres, F (m, 3) and their fields are those of the mesh of the stripes (see `StripedMesh`). If this is a
    chart, loops, loads and supports refer to the vertices `uncut`.
    """
    surface, statics, modes = draft.surface, draft.statics, draft.diffusion
    mesh = StripedMesh.of(draft)
    up = up_axis(surface.V, surface, draft.load)
    side = best_side(surface.V, up)
    middle = (surface.V.min(axis=0) + surface.V.max(axis=0)) / 2
    answers = {"stress": _stress(draft), "u": statics.answers.equilibrium.u}
    every = range(1, len(modes.major.lam) + 1) if not mesh.even else ()
    facts = {
        "centre": middle.tolist(),
        "size": surface.size,
        "area": surface.area,
        "up": up.tolist(),
        "towards": side.towards.tolist(),
        "viewUp": side.up.tolist(),
        "angle": ANGLE,
        "triangles": surface.m,
        "creased": creased(surface),
        "widthRules": WIDTH_RULES,
        "lines": {name: [_lines(surface, getattr(modes, name).mode(k)) for k in every] for name in ("major", "minor")},
        "limits": {
            "stress": _steepest(answers["stress"]),
            "displacement": float(np.linalg.norm(answers["u"], axis=1).max()),
        },
        "loops": [len(loop) for loop in surface.loops],
    }
    arrays = {
        "V": mesh.surface.V - middle,
        "F": mesh.surface.F,
        "normals": mesh.normals,
        **_phases(draft, mesh),
        "kept": mesh.carry(finite(distances(draft), 1e9)),
        "along": mesh.carry(_along(draft)),
        **{name: mesh.carry(value) for name, value in answers.items()},
        **({"uncut": surface.V - middle} if mesh.even else {}),
        **_marks(surface, draft.load, statics.answers.equilibrium.reaction, middle),
        "loops": np.concatenate([*surface.loops, np.empty(0, dtype=np.int64)]).astype(np.int64),
    }
    return facts, arrays


def widths(draft: Design) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return numbers of the pattern, half-widths (n, 2) in periods, and slopes (n, 2) at frequency 1.

    For evenly spaced stripes, slopes are lines per metre, and `shares` (n, 2) factors on the half-widths of the rules
    (see `StripedMesh`).
    """
    pattern, ask, surface = draft.pattern, draft.preset.pattern, draft.surface
    mesh = StripedMesh.of(draft)
    facts = {
        "method": "stripes" if mesh.even else "modes",
        "frequency": list(pattern.frequency),
        "phase": list(pattern.phase),
        "mode": [1, 1] if mesh.even else list(pattern.mode),
        "factor": pattern.factor,
        "least": least_width(draft.preset, surface) if mesh.even else 0.0,
        "member": ask.width.widths(np.sqrt(surface.area)).member,
        "pattern": ask.model_dump(mode="json"),
        "notes": [f"{note.stage}: {note.text}" for note in draft.notes],
        "refused": refusal(draft.preset, draft.statics),
        "seconds": sum(draft.seconds.values()),
    }
    arrays = {"half": mesh.half_widths(pattern), "slope": _slopes(draft, mesh)}
    return facts, arrays | ({"shares": mesh.shares} if mesh.even else {})


def colours() -> dict[str, list[list[int]]]:
    """Return the colour scales, 64 steps each."""
    both, up = np.linspace(-1, 1, 64), np.linspace(0, 1, 64)
    scales = {"diverging": diverging(both), "signed": signed(both), "rising": rising(up)}
    return {name: scale.tolist() for name, scale in scales.items()}


def creased(surface: Surface) -> bool:
    """True if a face differs so much from its corner normals that the shader must light each pixel."""
    normals = surface.normals[:, None, :] * surface.vertex_normals[surface.F]
    return bool(normals.sum(axis=2).min() < 0.8)  # the same cosine as in shader.js


def _phases(draft: Design, mesh: StripedMesh) -> dict[str, Floats]:
    """(k, n) each: the modes of either family, or its one phase."""
    if mesh.even:
        z = mesh.phases(draft)
        return {"major": z[None, :, 0], "minor": z[None, :, 1]}
    return {"major": draft.diffusion.major.X.T, "minor": draft.diffusion.minor.X.T}


def _slopes(draft: Design, mesh: StripedMesh) -> Floats:
    """(n, 2) periods per metre; zeros if no width rule needs them."""
    if mesh.even:
        return mesh.carry(mesh.even.density)
    ask, surface, mode = draft.preset.pattern.width, draft.surface, draft.pattern.mode
    if not ask.widths(1.0).vary:
        return np.zeros((surface.n, 2))
    radius = ask.widths(np.sqrt(surface.area)).radius
    pair = draft.diffusion.major.mode(mode[0]), draft.diffusion.minor.mode(mode[1])
    return np.stack([slopes(surface, x, radius) for x in pair], axis=1)


def _stress(draft: Design) -> Floats:
    """(n,) the principal stress of larger size, Pa, tension positive."""
    principal = draft.diffusion.tensors.principal
    value = np.take_along_axis(principal, np.abs(principal).argmax(axis=1)[:, None], axis=1)[:, 0]
    return vertex_means(draft.surface, value)


def _along(draft: Design) -> Floats:
    """(n, 2) relative stress along both families, for graded widths; 1 without stress."""
    try:
        return stripe_stresses(draft.surface, draft.diffusion, draft.pattern.even)
    except DsfabError:
        return np.ones((draft.surface.n, 2))


def _steepest(value: Floats) -> float:
    return float(np.percentile(np.abs(value), STEEPEST)) or 1.0


def _lines(surface: Surface, x: Floats) -> float:
    """Divisor of a spacing in metres that gives a frequency."""
    try:
        return frequency_for(surface, x, 1.0)
    except DsfabError:
        return 0.0


def _marks(surface: Surface, load: LoadCase, reaction: Floats, middle: Floats) -> dict[str, Floats]:
    """Arrows for groups of forces: (k, 6) place and newtons; places (k, 3) of supports."""
    acts = (np.linalg.norm(load.force, axis=1) > 0) & ~load.fixed.all(axis=1)
    V = surface.V - middle
    pulls = [_gathered(V, load.force, acts & load.loaded, POINT_LOAD, surface.size)]
    pulls.append(_gathered(V, load.force, acts & ~load.loaded, SPREAD_LOAD, surface.size))
    held = V[load.held]
    few = held[thinned(held, surface.size, SUPPORTS)] if len(held) else held
    push = _gathered(V, reaction, np.linalg.norm(reaction, axis=1) > 0, SUPPORTS, surface.size)
    return {"points": pulls[0], "spread": pulls[1], "supports": few, "reactions": push}


def _gathered(V: Floats, force: Floats, acts: Bools, spacing: Spacing, size: float) -> Floats:
    """(k, 6) the forces on marked vertices, each added to the nearest arrow."""
    at = np.flatnonzero(acts)
    if not len(at):
        return np.zeros((0, 6))
    some = at[:: max(len(at) // 3000, 1)]  # more take longer and look the same
    taken = some[thinned(V[some], size, spacing)]
    owner = cKDTree(V[taken]).query(V[at])[1]
    total = np.stack([np.bincount(owner, force[at, i], len(taken)) for i in range(3)], axis=1)
    return np.concatenate([V[taken], total], axis=1)


TINTS = ("major", "minor")
"""Families with a colour of their own; other material has the next one."""


def settled(made: Design, sheet: Sheet) -> dict[str, NDArray[Any]]:
    """Return arrays of a cut sheet with k vertices, one for each family that meets there, and m faces.

    V : (k, 3) metres from the middle of the surface.    F : (m, 3).    E : (e, 2) sides of its outlines.
    tint : (k,) 0 major, 1 minor, 2 other material.    normals : (k, 3) unit, of the uncut surface.
    corners, shares : (k, 3) each, vertices of the mesh of the stripes, and barycentric weights there.
    """
    surface, drawn = sheet.surface, StripedMesh.of(made).surface
    tints = np.array([TINTS.index(name) if name in TINTS else len(TINTS) for name in made.pattern.names])
    tint = np.repeat(tints[sheet.family], 3)
    pairs, F = np.unique(surface.F.ravel() * (len(TINTS) + 1) + tint, return_inverse=True)
    vertex = pairs // (len(TINTS) + 1)
    V = surface.V[vertex]
    there = nearest(V, drawn.V, drawn.F)
    corners = drawn.F[there.simplex]
    normals = sheet.carry_corners(made.surface.vertex_normals[made.surface.F], made.surface.F)[vertex]
    middle = (made.surface.V.min(axis=0) + made.surface.V.max(axis=0)) / 2
    outline = surface.edges.ends[surface.edges.count == 1]
    return {
        "V": V - middle,
        "F": F.reshape(-1, 3),
        "E": np.searchsorted(vertex, outline),
        "tint": (pairs % (len(TINTS) + 1)).astype(float),
        "normals": unit_vectors(normals),
        "corners": corners,
        "shares": np.clip(weights_at(there.place, drawn.V, corners), 0.0, 1.0),
    }


def cut_as_built(made: Design, progress: Telling | None = None) -> tuple[SlicingResult, list[str]]:
    """Return the cut and tidied sheet of a draft, and notes.

    Raises DsfabError when the pattern leaves no material.
    """
    log = Log(progress)
    cut = slicing_step(made.preset, made.surface, made.statics, made.pattern, log)
    return cut, [f"{note.stage}: {note.text}" for note in log.notes]


def figures(made: Design, cut: SlicingResult, notes: list[str]) -> dict[str, Any]:
    """Return square metres, kilograms (sheet area times thickness), pieces and widths in metres, for JSON.

    under, bars_under : whether the narrowest member, and each bar of the histogram, is under the least width.
    """
    preset, sheet = made.preset, cut.sheet.surface
    found = features(cut.cells, kept_cells(cut.cells, cut.sheet), made.pattern.names)
    least = preset.fabrication.min_member or least_widths(made.settled, made.surface).member
    limits, share = found.histogram(least)
    narrow = found.member
    return {
        "area": sheet.area,
        "share": sheet.area / made.surface.area,
        "mass": sheet.area * preset.statics.thickness * preset.statics.density,
        "pieces": len(cut.pieces),
        "loose": sum(not piece.held for piece in cut.pieces),
        "narrowest": None if narrow is None else narrow.size,
        "under": narrow is not None and bool(under(narrow.size, least)),
        "place": None if narrow is None else narrow.place.tolist(),
        "limits": limits.tolist(),
        "widths": share.tolist(),
        "bars_under": under((limits[1:] + limits[:-1]) / 2, least).tolist(),  # one bar ends at the least width
        "min_member": least,
        "pattern": _pattern(made, cut),
        "compliance": made.statics.equilibrium.compliance,
        "notes": notes,
    }


def _pattern(made: Design, cut: SlicingResult) -> dict[str, Any]:
    found = measured_pattern(made, False, cut.cells, cut.sheet)
    open_ = [family.opening for _, family in found.families if family.opening[2] > 0]
    between = [min(one[0] for one in open_), max(one[2] for one in open_)] if open_ else None
    return {"dead_ends": found.dead_ends, "slits": found.slits, "openings": between}
