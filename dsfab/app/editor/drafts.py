"""Drafts (designs before the cut) for the editor's page."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from dsfab.app.editor.jobs import ReportProgress
from dsfab.core.arrays import Bools, Floats, unit_vectors
from dsfab.core.errors import DsfabError
from dsfab.design import Design, Log, least_widths, refusal
from dsfab.design.pattern_measures import measured_pattern
from dsfab.design.slicing_and_thickening import slicing_step
from dsfab.design.stripe_pattern import least_width, stripe_stresses
from dsfab.pattern import WIDTH_RULES, frequency_for, slopes, vertex_means
from dsfab.render.colouring import COLOUR_PERCENTILE, diverging_colours, rising_colours, signed_colours
from dsfab.render.marks import POINT_LOAD_SPACING, SPREAD_LOAD_SPACING, SUPPORT_SPACING, Spacing, thin_points
from dsfab.render.striped_mesh import StripedMesh, distances, finite_distances
from dsfab.render.view import VIEW_DEGREES, best_side, up_axis
from dsfab.results import SlicingResult
from dsfab.slicing import Sheet
from dsfab.slicing.measures.widths import below_limit, features, kept_cells
from dsfab.surface import LoadCase, Surface, nearest_places, weights_at

TYPES = {"f": "float32", "i": "uint32", "u": "uint32", "b": "uint8"}


def pack_message(facts: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Pack JSON values and arrays into the bytes of a message to the page."""
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


def draft_model(draft: Design) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return JSON values and arrays, by name, with which the page draws a draft (a design before the cut).
    V (n, 3) and F (m, 3) are the mesh with the stripes. V is in metres from the middle of the surface's box."""
    surface, statics, modes = draft.surface, draft.statics, draft.diffusion
    mesh = StripedMesh.from_design(draft)
    up = up_axis(surface.V, surface, draft.load)
    side = best_side(surface.V, up)
    middle = (surface.V.min(axis=0) + surface.V.max(axis=0)) / 2
    answers = {"stress": _stress(draft), "u": statics.answers.equilibrium.u}
    mode_numbers = range(1, len(modes.major.lam) + 1) if not mesh.even else ()
    facts = {
        "centre": middle.tolist(),
        "size": surface.size,
        "area": surface.area,
        "up": up.tolist(),
        "towards": side.towards.tolist(),
        "viewUp": side.up.tolist(),
        "angle": VIEW_DEGREES,
        "triangles": surface.m,
        "creased": has_creases(surface),
        "widthRules": WIDTH_RULES,
        "lines": {
            name: [_lines_per_metre(surface, getattr(modes, name).mode(k)) for k in mode_numbers]
            for name in ("major", "minor")
        },
        "limits": {
            "stress": float(np.percentile(np.abs(answers["stress"]), COLOUR_PERCENTILE)) or 1.0,
            "displacement": float(np.linalg.norm(answers["u"], axis=1).max()),
        },
        "loops": [len(loop) for loop in surface.loops],
    }
    arrays = {
        "V": mesh.surface.V - middle,
        "F": mesh.surface.F,
        "normals": mesh.normals,
        **_phases(draft, mesh),
        "kept": mesh.carry(finite_distances(distances(draft), 1e9)),
        "along": mesh.carry(_relative_stress(draft)),
        **{name: mesh.carry(value) for name, value in answers.items()},
        **({"uncut": surface.V - middle} if mesh.even else {}),
        **_mark_arrays(surface, draft.load, statics.answers.equilibrium.reaction, middle),
        "loops": np.concatenate([*surface.loops, np.empty(0, dtype=np.int64)]).astype(np.int64),
    }
    return facts, arrays


def pattern_widths(draft: Design) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return JSON values and arrays (n, 2) of a draft's pattern. Columns: major stripes, minor stripes.
    half   : half the width of a stripe, divided by the distance of stripes.
    slope  : stripes per metre; for stripes from modes, at the frequency 1.
    shares : factor by which the page multiplies half-widths to get `half`; only for evenly spaced stripes."""
    pattern, options, surface = draft.pattern, draft.preset.pattern, draft.surface
    mesh = StripedMesh.from_design(draft)
    facts = {
        "method": "stripes" if mesh.even else "modes",
        "frequency": list(pattern.frequency),
        "phase": list(pattern.phase),
        "mode": [1, 1] if mesh.even else list(pattern.mode),
        "factor": pattern.factor,
        "least": least_width(draft.preset, surface) if mesh.even else 0.0,
        "member": options.width.widths(np.sqrt(surface.area)).member,
        "pattern": options.model_dump(mode="json"),
        "notes": [f"{note.stage}: {note.text}" for note in draft.notes],
        "refused": refusal(draft.preset, draft.statics),
        "seconds": sum(draft.seconds.values()),
    }
    arrays = {"half": mesh.half_widths(pattern), "slope": _slopes(draft, mesh)}
    return facts, arrays | ({"shares": mesh.shares} if mesh.even else {})


def colour_scales() -> dict[str, list[list[int]]]:
    """Return the colour scales by name; each is a list of 64 colours (red, green, blue)."""
    signed, values = np.linspace(-1, 1, 64), np.linspace(0, 1, 64)
    scales = {"diverging": diverging_colours(signed), "signed": signed_colours(signed)}
    return {name: scale.tolist() for name, scale in (scales | {"rising": rising_colours(values)}).items()}


def has_creases(surface: Surface) -> bool:
    """Return True if the surface has sharp folds."""
    normals = surface.normals[:, None, :] * surface.vertex_normals[surface.F]
    return bool(normals.sum(axis=2).min() < 0.8)  # shader.js uses the same cosine


def _phases(draft: Design, mesh: StripedMesh) -> dict[str, Floats]:
    if mesh.even:
        z = mesh.phases(draft)
        return {"major": z[None, :, 0], "minor": z[None, :, 1]}
    return {"major": draft.diffusion.major.X.T, "minor": draft.diffusion.minor.X.T}


def _slopes(draft: Design, mesh: StripedMesh) -> Floats:
    if mesh.even:
        return mesh.carry(mesh.even.density)
    options, surface, mode = draft.preset.pattern.width, draft.surface, draft.pattern.mode
    if not options.widths(1.0).vary:
        return np.zeros((surface.n, 2))
    radius = options.widths(np.sqrt(surface.area)).radius
    pair = draft.diffusion.major.mode(mode[0]), draft.diffusion.minor.mode(mode[1])
    return np.stack([slopes(surface, x, radius) for x in pair], axis=1)


def _stress(draft: Design) -> Floats:
    principal = draft.diffusion.tensors.principal
    value = np.take_along_axis(principal, np.abs(principal).argmax(axis=1)[:, None], axis=1)[:, 0]
    return vertex_means(draft.surface, value)


def _relative_stress(draft: Design) -> Floats:
    try:
        return stripe_stresses(draft.surface, draft.diffusion, draft.pattern.even)
    except DsfabError:
        return np.ones((draft.surface.n, 2))


def _lines_per_metre(surface: Surface, x: Floats) -> float:
    try:
        return frequency_for(surface, x, 1.0)
    except DsfabError:
        return 0.0


def _mark_arrays(surface: Surface, load: LoadCase, reaction: Floats, middle: Floats) -> dict[str, Floats]:
    acts = (np.linalg.norm(load.force, axis=1) > 0) & ~load.fixed.all(axis=1)
    V = surface.V - middle
    loads = [_gathered_forces(V, load.force, acts & load.loaded, POINT_LOAD_SPACING, surface.size)]
    loads.append(_gathered_forces(V, load.force, acts & ~load.loaded, SPREAD_LOAD_SPACING, surface.size))
    places = V[load.supported]
    shown = places[thin_points(places, surface.size, SUPPORT_SPACING)] if len(places) else places
    reactions = _gathered_forces(V, reaction, np.linalg.norm(reaction, axis=1) > 0, SUPPORT_SPACING, surface.size)
    return {"points": loads[0], "spread": loads[1], "supports": shown, "reactions": reactions}


def _gathered_forces(V: Floats, force: Floats, acts: Bools, spacing: Spacing, size: float) -> Floats:
    acting = np.flatnonzero(acts)
    if not len(acting):
        return np.zeros((0, 6))
    candidates = acting[:: max(len(acting) // 3000, 1)]  # 3000 vertices are enough to select places of arrows
    chosen = candidates[thin_points(V[candidates], size, spacing)]
    owner = cKDTree(V[chosen]).query(V[acting])[1]
    total = np.stack([np.bincount(owner, force[acting, i], len(chosen)) for i in range(3)], axis=1)
    return np.concatenate([V[chosen], total], axis=1)


TINTS = ("major", "minor")  # Families of stripes with their own colours; all remaining material has a third colour.


def cut_sheet_arrays(draft: Design, sheet: Sheet) -> dict[str, NDArray[Any]]:
    """Return the mesh of a cut sheet for the page, as arrays by name.
    V : (k, 3) vertices, metres from the surface's middle.    F : (m, 3) faces.    E : (e, 2) edges of the outlines.
    tint    : (k,) kind of material: 0 for major stripes, 1 for minor stripes, 2 for the rest.
    normals : (k, 3) unit normals of the uncut surface.
    corners, shares : (k, 3) corners of the nearest triangle in the mesh with the stripes, and barycentric weights."""
    surface, striped_surface = sheet.surface, StripedMesh.from_design(draft).surface
    tints = np.array([TINTS.index(name) if name in TINTS else len(TINTS) for name in draft.pattern.names])
    tint = np.repeat(tints[sheet.family], 3)
    pairs, F = np.unique(surface.F.ravel() * (len(TINTS) + 1) + tint, return_inverse=True)
    vertex = pairs // (len(TINTS) + 1)
    V = surface.V[vertex]
    nearest_points = nearest_places(V, striped_surface.V, striped_surface.F)
    corners = striped_surface.F[nearest_points.simplex]
    normals = sheet.carry_corners(draft.surface.vertex_normals[draft.surface.F], draft.surface.F)[vertex]
    middle = (draft.surface.V.min(axis=0) + draft.surface.V.max(axis=0)) / 2
    outline = surface.edges.ends[surface.edges.count == 1]
    return {
        "V": V - middle,
        "F": F.reshape(-1, 3),
        "E": np.searchsorted(vertex, outline),
        "tint": (pairs % (len(TINTS) + 1)).astype(float),
        "normals": unit_vectors(normals),
        "corners": corners,
        "shares": np.clip(weights_at(nearest_points.place, striped_surface.V, corners), 0.0, 1.0),
    }


def tidied_cut(draft: Design, progress: ReportProgress | None = None) -> tuple[SlicingResult, list[str]]:
    """Cut a draft and remove loose ends; return the result and notes. Raises DsfabError if no material is left."""
    log = Log(progress)
    cut = slicing_step(draft.preset, draft.surface, draft.statics, draft.pattern, log)
    return cut, [f"{note.stage}: {note.text}" for note in log.notes]


def sheet_figures(draft: Design, cut: SlicingResult, notes: list[str]) -> dict[str, Any]:
    """Return measures of a cut sheet as values for JSON: area (m2), mass (kg), pieces, and widths (m)."""
    preset, sheet = draft.preset, cut.sheet.surface
    solved = draft.statics.answers.equilibrium
    member_features = features(cut.cells, kept_cells(cut.cells, cut.sheet), draft.pattern.names)
    least = preset.fabrication.min_member or least_widths(draft.resolved_preset, draft.surface).member
    limits, share = member_features.histogram(least)
    narrowest = member_features.member
    return {
        "area": sheet.area,
        "share": sheet.area / draft.surface.area,
        "mass": sheet.area * preset.statics.thickness * preset.statics.density,
        "pieces": len(cut.pieces),
        "loose": sum(not piece.held for piece in cut.pieces),
        "narrowest": None if narrowest is None else narrowest.size,
        "under": narrowest is not None and bool(below_limit(narrowest.size, least)),
        "place": None if narrowest is None else narrowest.place.tolist(),
        "limits": limits.tolist(),
        "widths": share.tolist(),
        "bars_under": below_limit((limits[1:] + limits[:-1]) / 2, least).tolist(),  # `least` is a limit between bars
        "min_member": least,
        "pattern": _pattern_figures(draft, cut),
        "compliance": solved.compliance if solved.elements.is_reported else None,
        "notes": notes,
    }


def _pattern_figures(draft: Design, cut: SlicingResult) -> dict[str, Any]:
    quality = measured_pattern(draft, False, cut.cells, cut.sheet)
    open_ = [family.opening for _, family in quality.families if family.opening[2] > 0]
    opening_range = [min(opening[0] for opening in open_), max(opening[2] for opening in open_)] if open_ else None
    return {"dead_ends": quality.dead_ends, "slits": quality.slits, "openings": opening_range}
