"""The surface cut along regions; loads and supports on the uncut and the cut surface."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, group_sums
from dsfab.core.derived import derived_results
from dsfab.core.errors import StaticsError, SurfaceError
from dsfab.diffusion import Symmetry
from dsfab.preset.model import Preset
from dsfab.results import Log
from dsfab.slicing import Sheet
from dsfab.slicing.cutting.sheet import ON_SIMPLEX
from dsfab.statics import SpreadLoad, spread_load
from dsfab.surface import (
    ACTION_OF_LOAD,
    All,
    Load,
    LoadCase,
    LoadParts,
    PatternRegion,
    Support,
    Surface,
    VerticesLeft,
    combined_case,
    edges_of,
    link_components,
    load_cases,
    region_key,
    with_regions,
)

IMAGE_DIFFERENCE = 0.3
"""Largest difference of a region or guide from its symmetric image, as a fraction of its area."""


def surface_with_regions(preset: Preset, surface: Surface, log: Log) -> Surface:
    """Return the surface without voids, cut along the outlines of the preset's regions.
    Raises SurfaceError for a region outside of the surface, and for a void that contains a support or load.
    A void that separates a piece of the surface from all supports also raises SurfaceError."""
    regions, voids = preset.pattern.region, preset.pattern.voids
    cut = with_regions(surface, regions)
    for k in voids:
        log.note("surface", f"{region_key(regions, k)} is void: {cut.taken[k]:.3g} m2 of {surface.area:.4g} m2")
    if voids:
        derived_results(cut.surface)[_before_voids] = cut.whole, cut.vertices
        _check_pieces(preset, surface, cut.surface)
    return cut.surface


class Acting(NamedTuple):
    """The supports and loads that act on a surface."""

    support: tuple[Support, ...]
    load: tuple[Load, ...]


def acting_on(preset: Preset, surface: Surface) -> Acting:
    """Return the supports and the loads of a preset on its surface.
    Raises SurfaceError if all vertices of a support or load are inside voids."""
    section = preset.surface
    if not preset.pattern.voids:
        return Acting(section.support, section.load)
    uncut, vertices = _before_voids(preset, surface)
    words = _void_names(preset)
    support, load = (
        tuple(
            _remaining_entry(f"surface.{key}.{k}", entry, uncut, vertices, surface.edges.ends, words)
            for k, entry in enumerate(getattr(section, key))
        )
        for key in ("support", "load")
    )
    return Acting(support, load)


def whole_surface(preset: Preset, surface: Surface) -> Surface:
    """Return the surface of a preset before its voids are cut out."""
    return _before_voids(preset, surface)[0] if preset.pattern.voids else surface


def _before_voids(preset: Preset, surface: Surface) -> tuple[Surface, Ints]:
    results = derived_results(surface)
    if _before_voids not in results:
        from dsfab.design.surface_and_statics import base_surface  # at the top, this import would be circular

        cut = with_regions(base_surface(preset), preset.pattern.region)
        results[_before_voids] = cut.whole, cut.vertices
    uncut, vertices = results[_before_voids]
    return uncut, vertices


def _remaining_entry(key: str, entry: Any, uncut: Surface, vertices: Ints, edges: Ints, voids: str) -> Any:
    picker = getattr(entry, "at", None)
    if picker is None or isinstance(picker, All):
        return entry
    picked = picker.vertices(uncut)[vertices]
    picked_left = np.flatnonzero(picked)
    if not len(picked_left):
        raise SurfaceError(f"all vertices of {key} are inside {voids}; make the void smaller, or pick other vertices")
    edges_left = edges[picked[edges].all(axis=1)]
    is_picked = edges_of(picker, uncut)[uncut.edges.edges_between(*vertices[edges_left].T)]
    ends = tuple(map(tuple, edges_left[is_picked].tolist()))
    return replace(entry, at=VerticesLeft(tuple(picked_left.tolist()), ends=ends))


def one_sided_message(surface: Surface, regions: Sequence[PatternRegion], symmetry: Symmetry | None) -> str:
    """Return a sentence about regions that are less symmetric than the stripes; '' if there are none."""
    if symmetry is None:
        return ""
    exceptions = []
    for k, region in enumerate(regions):
        if region.do == "void":
            continue  # voids are cut out of the surface, so `symmetry` already considers them
        inside = region.faces(surface)
        differing_areas = [float(surface.areas @ (inside[images] != inside)) for images in symmetry.faces]
        matching = int((np.array(differing_areas) <= IMAGE_DIFFERENCE * float(surface.areas @ inside)).sum())
        if matching < symmetry.order:
            exceptions.append(f"{region_key(regions, k)} at {matching}")
    message = (
        f"stripes are equal at {symmetry.order} symmetric places, but these regions are equal at fewer places: "
        f"{', '.join(exceptions)}"
    )
    return message if exceptions else ""


def _void_names(preset: Preset) -> str:
    names = [region_key(preset.pattern.region, k) for k in preset.pattern.voids]
    return f"the void {names[0]}" if len(names) == 1 else f"the voids {', '.join(names)}"


def _check_pieces(preset: Preset, before: Surface, after: Surface) -> None:
    count, label = after.pieces
    supports = acting_on(preset, after).support
    if count == before.pieces[0] or not supports:
        return
    supported: Bools = np.logical_or.reduce([support.at.vertices(after) for support in supports])
    area = np.bincount(label, after.areas, count)
    loose = np.bincount(label, supported[after.F].any(axis=1), count) == 0
    if loose.any():
        piece = int(np.where(loose, area, 0.0).argmax())
        x, y, z = np.average(after.centroids[label == piece], axis=0, weights=after.areas[label == piece])
        raise SurfaceError(
            f"{_void_names(preset)} separate{'s' if len(preset.pattern.voids) == 1 else ''} {int(loose.sum())} of "
            f"{count} pieces of the surface from all supports; the largest of these pieces ({area[piece]:.3g} m2) is "
            f"around ({x:.3g}, {y:.3g}, {z:.3g}) m; leave a connection, support the piece, or enlarge the void over it"
        )


@dataclass(frozen=True, eq=False)
class Loading:
    """A load case or a combination. name : name of the case or combination; '' for the sum of all cases.
    load    : supports, and forces on vertices.    spread : loads that are constant on each face or edge.
    factors : factor of each case in a combination, by case name; None for a case."""

    name: str
    load: LoadCase
    spread: SpreadLoad
    factors: Mapping[str, float] | None = None


def loadings(preset: Preset, surface: Surface) -> list[Loading]:
    """Return the load cases of a preset, then its combinations. If there are several cases, their sum comes last.
    Raises SurfaceError for a support or a load without vertices."""
    section, weight = preset.surface, preset.statics.area_weight
    acting = acting_on(preset, surface)
    loads = load_cases(surface, acting.support, acting.load, weight)
    parts = {name: spread_load(surface, [ld for ld in acting.load if ld.case == name], weight) for name in loads}
    cases = [Loading(name, load, parts[name]) for name, load in loads.items()]
    sums = [(combination.name, dict(combination.factors)) for combination in section.sums]
    if len(loads) > 1:
        sums.append(("", dict.fromkeys(loads, 1.0)))
    return cases + [
        Loading(name, combined_case(loads, factors), SpreadLoad.total(parts, factors), factors)
        for name, factors in sums
    ]


@dataclass(frozen=True, eq=False)
class CoveringLoads:
    """Transfer of loads from a covering, such as glass, to a cut sheet. The uncut surface has m faces.
    to      : (m,) for each face, the face with material that carries the load; -1 if there is none.
    area    : (m,) area of material in each face, m2.    place : (m, 3) centroid of this material, metres.
    opening : (m,) number of the opening that contains each face; -1 for faces with material."""

    surface: Surface
    to: Ints
    area: Floats
    place: Floats
    opening: Ints

    @classmethod
    def for_sheet(cls, surface: Surface, sheet: Sheet) -> Self:
        """Find the material of a cut sheet that carries the loads of a covering. surface : the uncut surface."""
        cells, m = sheet.surface, surface.m
        area: Floats = np.bincount(sheet.parent, cells.areas, m).astype(np.float64)
        area_moment = group_sums(sheet.parent, cells.areas[:, None] * cells.centroids, m)
        carries = area > 0.02 * surface.areas  # faces with less material carry no load
        carries = carries if carries.any() else area > 0
        place = np.where(carries[:, None], area_moment / np.where(area > 0, area, 1.0)[:, None], surface.centroids)
        f, g, _ = _face_steps(surface)
        inner = ~carries[f] & ~carries[g]
        _, part = link_components(m, f[inner], g[inner])
        return cls(surface, nearest_faces(surface, carries), area, place, np.where(carries, -1, part))

    def forces(self, covered: Floats) -> Floats:
        """Return forces (m, 3), N, on the material in each face. covered : (m, 3) tractions on the covering, Pa.
        Raises StaticsError for a load on a piece of the surface without material."""
        load = covered * self.surface.areas[:, None]
        lost = np.flatnonzero((self.to < 0) & load.any(axis=1))
        if len(lost):
            place = ", ".join(f"{x:.3g}" for x in self.surface.centroids[lost[0]])
            raise StaticsError(
                f"the load near ({place}) m has no support, because that piece of the surface has no material; load "
                f"other faces, or change pattern.rim, or a phase or mode of the stripes"
            )
        force = self._by_opening(load)
        turning = np.cross(self.surface.centroids, load) - np.cross(self.place, force)
        count, piece = self.surface.pieces
        bears = np.flatnonzero(self.opening < 0)
        lacking = group_sums(piece, turning, count)
        force[bears] += _moment_forces(piece[bears], self.place[bears], self.area[bears], lacking)
        return force

    def _by_opening(self, load: Floats) -> Floats:
        loaded_faces = np.flatnonzero((self.opening >= 0) & (self.to >= 0))
        force = group_sums(self.to[self.to >= 0], load[self.to >= 0], len(load))
        # a face may take the load of several openings, so count pairs of opening and face
        pair, pair_index = np.unique(
            np.stack([self.opening[loaded_faces], self.to[loaded_faces]]), axis=1, return_inverse=True
        )
        group, number = np.unique(pair[0], return_inverse=True)
        turning = np.cross(self.surface.centroids[loaded_faces] - self.place[self.to[loaded_faces]], load[loaded_faces])
        moment = group_sums(number[pair_index], turning, len(group))
        weight = np.bincount(pair_index, self.surface.areas[loaded_faces]).astype(np.float64)
        moment_forces = _moment_forces(number, self.place[pair[1]], weight, moment)
        load_size = np.bincount(number[pair_index], np.linalg.norm(load[loaded_faces], axis=1), len(group))
        moment_too_large = np.bincount(number, np.linalg.norm(moment_forces, axis=1), len(group)) > load_size
        moment_forces[moment_too_large[number]] = 0.0
        np.add.at(force, pair[1], moment_forces)
        return force


def nearest_faces(surface: Surface, marked: Bools) -> Ints:
    """Return the number (m,) of the marked face nearest to each face along the surface; -1 if unconnected."""
    f, g, length = _face_steps(surface)
    steps = coo_array((length, (f, g)), shape=(surface.m, surface.m)).tocsr()
    predecessor = dijkstra(
        steps, directed=False, indices=np.flatnonzero(marked), min_only=True, return_predecessors=True
    )[2]
    return np.where(predecessor < 0, -1, predecessor).astype(np.int64)


def _face_steps(surface: Surface) -> tuple[Ints, Ints, Floats]:
    edges = surface.edges
    face, edge = edges.order // 3, edges.of.ravel()[edges.order]
    pairs = np.flatnonzero(edge[1:] == edge[:-1])
    f, g, middle = face[pairs], face[pairs + 1], surface.V[edges.ends[edge[pairs]]].mean(axis=1)
    reach = [np.linalg.norm(surface.centroids[x] - middle, axis=1) for x in (f, g)]
    return f, g, reach[0] + reach[1]


def _moment_forces(group: Ints, place: Floats, weight: Floats, moment: Floats) -> Floats:
    """Return forces (k, 3), N, at points. In each group, the forces have zero sum and the moment (g, 3), N m.
    group : (k,) group of each point.    place : (k, 3) points, m.    weight : (k,) weights of the forces."""
    count = len(moment)
    total = np.bincount(group, weight, count)
    middle = group_sums(group, weight[:, None] * place, count) / np.where(total > 0, total, 1.0)[:, None]
    r = place - middle[group]
    inertia = np.zeros((count, 3, 3))
    point_inertia = (r * r).sum(axis=1)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None, :]
    np.add.at(inertia, group, weight[:, None, None] * point_inertia)
    # places in a strip narrower than sqrt(1e-9) times its length count as a line
    theta = np.einsum("gij,gj->gi", np.linalg.pinv(inertia, rcond=1e-9, hermitian=True), moment)
    return np.asarray(weight[:, None] * np.cross(theta[group], r))


LOST_LOAD_REMEDY = (
    "set pattern.rim, raise pattern.keep, or change a phase or a mode of the stripes"  # For messages on lost loads.
)


def lost_load(surface: Surface, material: Sheet, sheet: Sheet, loads: Iterable[LoadCase]) -> str:
    """Return a clause about the first load of which over 1 % acts on loose pieces; '' if there is none.
    material : all material, with loose pieces.    sheet : material without loose pieces."""
    dropped = (material.same_vertex() >= 0) & (sheet.same_vertex() < 0)
    for load in loads:
        size = np.linalg.norm(load.point, axis=1) * load.loaded
        if (lost := size[dropped].sum()) > 0.01 * size.sum():
            place = surface.V[dropped][size[dropped].argmax()].round(3).tolist()
            return (
                f"the load at {place} m ({lost:.3g} N) acts on a piece of material that is not connected to a support"
            )
    return ""


def permanent_loads(preset: Preset, surface: Surface, load: LoadCase) -> dict[str, LoadCase]:
    """Return the loads whose mass vibrates with the sheet, by name: cladding, other permanent loads, and snow.
    load : load case that has the supports."""
    by_case, snow, permanent = dict[str, list[Load]](), dict[str, list[Load]](), list[Load]()
    for entry in acting_on(preset, surface).load:
        action = preset.surface.actions.get(entry.case) or ACTION_OF_LOAD.get(entry.kind)
        if entry.kind == "cladding" or (action == "permanent" and entry.kind != "self_weight"):
            by_case.setdefault(entry.case, []).append(replace(entry, case="load", name=""))
        elif action in ("snow", "snow high") and preset.statics.snow_mass:
            snow.setdefault(entry.case, []).append(entry)
    for entries in by_case.values():
        repeated = list(permanent)
        for entry in entries:
            if entry in repeated:
                repeated.remove(entry)
            else:
                permanent.append(entry)
    cases = {str(k): load.with_loads(surface, [entry], 0.0) for k, entry in enumerate(permanent)}
    if snow:
        heaviest = min(
            (load.with_loads(surface, x, 0.0) for x in snow.values()), key=lambda case: case.force[:, 2].sum()
        )
        cases["snow"] = combined_case({"snow": heaviest}, {"snow": preset.statics.snow_mass})
    return cases


def sheet_loads(surface: Surface, material: Sheet, sheet: Sheet, loads: Mapping[str, LoadCase]) -> dict[str, LoadCase]:
    """Transfer loads from the uncut surface to a cut sheet, by name. material : the sheet with its loose pieces.
    Raises StaticsError if over 1 % of a load acts on loose pieces."""
    if lost := lost_load(surface, material, sheet, loads.values()):
        raise StaticsError(f"{lost}; {LOST_LOAD_REMEDY}")
    return loads_on(surface, sheet, loads)


def loads_on(surface: Surface, sheet: Sheet, loads: Mapping[str, LoadCase]) -> dict[str, LoadCase]:
    """Transfer loads from the uncut surface to a cut sheet; return the new loads by name."""
    covered = any(load.parts is not None and load.parts.covered.any() for load in loads.values())
    covering = CoveringLoads.for_sheet(surface, sheet) if covered else None
    return {name: sheet_load(surface, sheet, load, covering) for name, load in loads.items()}


def sheet_load(surface: Surface, sheet: Sheet, load: LoadCase, covering: CoveringLoads | None = None) -> LoadCase:
    """Transfer supports and loads from the uncut surface to a cut sheet.
    A concentrated force on a removed vertex moves to the nearest vertex of the sheet, which changes its moment.
    Raises StaticsError if no supported vertex remains, and if no material is near a concentrated force."""
    supported = sheet_supports(surface, sheet, load)
    point = _moved_forces(surface, sheet, load.point)
    if load.parts is None:
        return replace(supported, force=point)
    covered = np.zeros((sheet.surface.m, 3))
    if load.parts.covered.any():
        covering = covering or CoveringLoads.for_sheet(surface, sheet)
        material = np.bincount(sheet.parent, sheet.surface.areas, surface.m)
        covered = (covering.forces(load.parts.covered) / np.where(material > 0, material, 1.0)[:, None])[sheet.parent]
    parts = LoadParts(point, load.parts.weight[sheet.parent], load.parts.bare[sheet.parent], covered)
    return supported.with_parts(sheet.surface, parts)


def sheet_supports(surface: Surface, sheet: Sheet, load: LoadCase) -> LoadCase:
    """Transfer the supports from the uncut surface to a cut sheet; return a load case without loads.
    Raises StaticsError if no supported vertex remains."""
    sheet_vertex = sheet.same_vertex()
    fixed = sheet.vertices_between(surface, load.fixed, _edges_or_none(load.fixed_edges))
    remaining = np.flatnonzero(sheet_vertex >= 0)
    spring = np.zeros((sheet.surface.n, 3))
    np.add.at(spring, sheet_vertex[remaining], load.spring[remaining])
    if not (fixed.any() or spring.any()):
        raise StaticsError("the cut removed all supported vertices; set pattern.keep to protect the supports")
    clamped = _within_edges(surface, sheet, load.clamped) if load.clamped.any() else load.clamped[:0]
    return LoadCase(fixed, np.zeros_like(spring), sheet.vertices_between(surface, load.loaded), spring, clamped)


def _moved_forces(surface: Surface, sheet: Sheet, force: Floats) -> Floats:
    sheet_vertex, acting = sheet.same_vertex(), np.flatnonzero((force != 0).any(axis=1))
    target = sheet_vertex[acting]
    is_lost = target < 0
    if is_lost.any():
        nearest = cKDTree(sheet.surface.V).query(surface.V[acting[is_lost]])
        moved, target[is_lost] = np.asarray(nearest[0]), np.asarray(nearest[1])
        if moved.max() > 0.1 * surface.size:
            place = surface.V[acting[is_lost][moved.argmax()]].round(3).tolist()
            raise StaticsError(
                f"the load at {place} m has no material within {moved.max():.3g} m; set pattern.keep to protect loads"
            )
    moved_force = np.zeros((sheet.surface.n, 3))
    np.add.at(moved_force, target, force[acting])
    return moved_force


def held_vertices(surface: Surface, sheet: Sheet, load: LoadCase) -> Bools:
    """Return a mask (n',) of the supported vertices of a cut sheet."""
    edges = _edges_or_none(load.fixed_edges)
    return sheet.vertices_between(surface, load.supported, None if edges is None else np.asarray(edges.any(axis=1)))


def _edges_or_none(edges: Bools) -> Bools | None:
    return edges if len(edges) else None


def _within_edges(surface: Surface, sheet: Sheet, marked: Bools) -> Bools:
    ends = sheet.surface.edges.ends
    weight_sums = csr_array(sheet.weights[ends[:, 0]] + sheet.weights[ends[:, 1]])
    weight_sums.data[weight_sums.data < 1 - ON_SIMPLEX] = 0.0
    weight_sums.eliminate_zeros()
    weight_sums.sort_indices()
    on_edge = np.flatnonzero(np.diff(weight_sums.indptr) == 2)
    first_entry = weight_sums.indptr[on_edge]
    key = weight_sums.indices[first_entry].astype(np.int64) * surface.n + weight_sums.indices[first_entry + 1]
    marked_ends = np.sort(surface.edges.ends[marked], axis=1)
    is_within = np.zeros(len(ends), dtype=bool)
    is_within[on_edge[np.isin(key, marked_ends[:, 0] * surface.n + marked_ends[:, 1])]] = True
    return is_within
