"""Sheets: surfaces that are cut into material and void cells. Also parts of sheets, and finer meshes."""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.core.arrays import Bools, Floats, Ints, group_sums, lock
from dsfab.core.errors import PatternError
from dsfab.slicing.cutting.walls import Walls
from dsfab.surface import Surface, spanned_edges

if TYPE_CHECKING:
    import compas.datastructures
    import pyvista
    import trimesh


VOID = -1  # The family of a void cell.

ON_SIMPLEX = 1 - 1e-9
"""Smallest value of an interpolated mask that counts as 1; the difference to 1 allows for rounding errors."""


@dataclass(frozen=True, eq=False)
class SheetPart:
    """A part of a cut surface, as a separate surface. cut_surface : all cells.    surface : the part.
    cells, vertices : (f,), (k,) numbers of the part's cells and vertices in `cut_surface`, ascending."""

    cut_surface: Surface
    surface: Surface
    cells: Ints
    vertices: Ints

    @classmethod
    def from_cells(cls, cut_surface: Surface, mask: Bools) -> Self:
        """Return the part of a cut surface that `mask` (m',) marks. The mask must mark at least one cell."""
        F, used = cut_surface.F[mask], np.zeros(cut_surface.n, dtype=bool)
        used[F] = True
        surface = Surface(cut_surface.V[used], (np.cumsum(used) - 1)[F])
        return cls(cut_surface, surface, np.flatnonzero(mask), np.flatnonzero(used))

    @cached_property
    def parent_edges(self) -> Ints:
        """(e,) for each edge of `surface`, its number in `cut_surface`."""
        edges = np.empty(len(self.surface.edges.ends), dtype=np.int64)
        edges[self.surface.edges.of] = self.cut_surface.edges.of[self.cells]
        return edges

    @cached_property
    def walls(self) -> Bools:
        """(e,) mask of the part's boundary edges that lie in the interior of `cut_surface`."""
        return np.asarray(self.surface.edges.boundary & ~self.cut_surface.edges.boundary[self.parent_edges])


class LineKind(IntEnum):
    """Kinds of lines on which the sides of cells lie."""

    NONE = 0  # no line: the side lies inside the material or inside the void
    RIM = 1  # the boundary of the uncut surface
    END = 2  # edges of the uncut mesh where stripes end, because the next face has no field for stripes
    LEVEL = 3  # an edge of a stripe, or the outline of a kept region
    FILLET = 4  # the arc of a round corner, replaced by straight chords
    STRIP = 5  # the outline of added material: a bridge, a straight bar, or a strip that widens a member
    DISC = 6  # the outline of a disc of material, added where material touched only in a point
    CHORD = 7  # straight lines along which spikes were cut off


@dataclass(frozen=True, eq=False)
class CutLines:
    """Lines on which the sides of cells lie. The first three lines are `NONE`, `RIM` and `END`.
    kind   : (l,) the `LineKind` of each line.    field : (l,) index of the field for kind LEVEL; -1 for other kinds.
    number : (l,) for kind LEVEL, 2 j for the lower and 2 j + 1 for the upper edge of stripe j. For other kinds, the
             number among the lines of this kind.
    circle : (l, 7) centre, unit axis and radius of a fillet, metres; 0 for other kinds."""

    kind: Ints
    field: Ints
    number: Ints
    circle: Floats

    @classmethod
    def first_three(cls) -> "CutLines":
        """Return the three lines that every sheet has: `NONE`, `RIM` and `END` (see `LineKind`)."""
        return cls(np.arange(3), np.full(3, -1), np.zeros(3, dtype=np.int64), np.zeros((3, 7)))

    @property
    def count(self) -> int:
        """Number of lines, including `NONE`, `RIM` and `END`."""
        return len(self.kind)

    def with_more(self, kind: LineKind, count: int, field: int = -1, circle: Floats | None = None) -> "CutLines":
        """Return these lines, followed by `count` new lines of a kind. circle : (count, 7) see `CutLines`."""
        number = np.arange(count) + (0 if kind == LineKind.LEVEL else int((self.kind == kind).sum()))
        circle = np.zeros((count, 7)) if circle is None else circle
        columns = (np.full(count, int(kind)), np.full(count, field), number, circle)
        return CutLines(*(np.concatenate(pair) for pair in zip(vars(self).values(), columns, strict=True)))


@dataclass(frozen=True, eq=False)
class Sheet:
    """A cut surface with n' vertices and m' triangles (cells). Each cell lies in one face of the uncut surface (n, m).
    surface  : the cells, with the orientation of their parent faces.
    parent   : (m',) uncut face that contains each cell.
    family   : (m',) index of the field that made a cell material; `VOID` (-1) for void cells.
    weights  : (n', n) barycentric weights of the vertices on the uncut vertices, up to three in each row.
    stubs    : number of places where stripes were removed or straightened.
    sides_on : (m', 3) for each half-edge, the index of its line in `lines`. An example without void, of one stripe:

                   3
               +-------+.  5               1    : the rim, where the stripe ends at the boundary of the surface
             1 |0   0 / 0 `+               3, 4 : the two edges of the stripe, of kind `LineKind.LEVEL`
               |  / 0   0  | 4             5    : a fillet, with its circle
               +-----------+               0    : inside the material
                     4"""

    surface: Surface
    parent: Ints
    family: Ints
    weights: csr_array
    stubs: int = 0
    sides_on: Ints = dataclasses.field(default_factory=lambda: np.empty(0, dtype=np.int64))
    lines: CutLines = dataclasses.field(default_factory=CutLines.first_three)

    def __post_init__(self) -> None:
        lock(self, "parent", np.int64, (None,))
        lock(self, "family", np.int64, (None,))
        if len(self.sides_on) != self.surface.m:  # default: no half-edge lies on a line
            object.__setattr__(self, "sides_on", np.zeros((self.surface.m, 3), dtype=np.int64))
        lock(self, "sides_on", np.int64, (self.surface.m, 3))
        weights = csr_array(self.weights, copy=True)
        weights.sum_duplicates()
        for part in (weights.data, weights.indices, weights.indptr):
            part.setflags(write=False)
        object.__setattr__(self, "weights", weights)
        shapes = (len(self.parent), len(self.family), weights.shape[0])
        if shapes != (self.surface.m, self.surface.m, self.surface.n):
            raise ValueError(
                f"the arrays need {self.surface.m} cells and {self.surface.n} vertices, but have the shapes {shapes}"
            )

    def to_trimesh(self) -> "trimesh.Trimesh":
        """The cells as a trimesh object, metres."""
        return self.surface.to_trimesh()

    def to_pyvista(self) -> "pyvista.PolyData":
        """The cells as a pyvista mesh, metres, with the cell data `family` and `parent`."""
        mesh = self.surface.to_pyvista()
        mesh.cell_data["family"], mesh.cell_data["parent"] = self.family, self.parent
        return mesh

    def to_compas(self) -> "compas.datastructures.Mesh":
        """The cells as a COMPAS mesh, metres; raises SurfaceError if compas is not installed."""
        return self.surface.to_compas()

    @cached_property
    def material(self) -> Bools:
        """(m',) mask of the material cells."""
        return np.asarray(self.family != VOID)

    @property
    def material_area(self) -> float:
        """Area of the material cells, square metres."""
        return float(self.surface.areas[self.material].sum())

    @property
    def has_openings(self) -> bool:
        """True for a sheet with both material and void cells."""
        material = self.material
        return bool(material.any() and not material.all())

    @cached_property
    def material_part(self) -> SheetPart:
        """The material cells; at least one must exist."""
        return SheetPart.from_cells(self.surface, self.material)

    @cached_property
    def void_part(self) -> SheetPart:
        """The void cells; at least one must exist."""
        return SheetPart.from_cells(self.surface, ~self.material)

    @cached_property
    def walls(self) -> Walls:
        """The edges between material and void, as chains around the openings."""
        return Walls.from_cells(self.surface, ~self.material)

    def carry(self, x: Floats) -> Floats:
        """Interpolate values x (n, ...) from vertices of the uncut surface to vertices of this sheet (n', ...)."""
        return np.asarray(self.weights @ x)

    def carry_corners(self, x: Floats, F: Ints) -> Floats:
        """Interpolate values x (m, 3, k) at the corners of uncut faces F (m, 3); return (n', k) at the vertices.
        A vertex takes values of the uncut face of its first cell. Other faces may have other values (Moebius strip)."""
        corner = np.full(self.surface.n, -1)
        corner[self.surface.F[::-1, ::-1].ravel()] = np.arange(3 * self.surface.m)[::-1]
        parent = self.parent[corner // 3]
        weights = self.weights.tocoo()
        row, column = weights.coords
        corner_place = (F[parent[row]] == column[:, None]).argmax(axis=1)
        values = weights.data[:, None] * x[parent[row], corner_place]
        return np.asarray(
            np.where((corner >= 0)[:, None], group_sums(row.astype(np.int64), values, self.surface.n), 0.0)
        )

    def vertices_between(self, surface: Surface, marks: Bools, edges: Bools | None = None) -> Bools:
        """Return a mask (n', ...) of the vertices that lie on or between marked vertices (n, ...) of the uncut surface.
        edges : (e, ...) marked edges of the uncut surface; default: edges between marked vertices (`spanned_edges`).
        A vertex inside a face counts if all three edges of the face are marked, and not all are on the boundary."""
        result: Bools = np.asarray(self.carry(marks.astype(np.float64)) >= ON_SIMPLEX)
        table = surface.edges
        edges = spanned_edges(surface.F, table, marks) if edges is None else edges
        column, weight = weight_entries(self.weights)
        nonzero = weight > 1 - ON_SIMPLEX
        free = np.ones(self.surface.n, dtype=bool)
        for i, j in ((0, 1), (1, 2), (0, 2)):
            on_edge = np.flatnonzero(nonzero[:, i] & nonzero[:, j])
            edge = table.edges_between(column[on_edge, i], column[on_edge, j])
            result[on_edge] &= edges[edge]
            free[on_edge] &= table.boundary[edge]
        result[nonzero.all(axis=1) & free] = False
        return result

    def same_vertex(self) -> Ints:
        """Return the vertex (n,) of this sheet at each uncut vertex, -1 for vertices that the cut removed."""
        weights = self.weights.tocoo()
        is_vertex = weights.data >= ON_SIMPLEX
        vertex = np.full(weights.shape[1], -1)
        vertex[weights.coords[1][is_vertex]] = weights.coords[0][is_vertex]
        return vertex

    def subset(self, mask: Bools | None = None) -> "Sheet":
        """Return a sheet of only the marked cells (m',), by default the material. Vertices get new numbers.
        Raises PatternError if no cell is marked."""
        return self._material_sheet if mask is None else self._part_sheet(mask)

    @cached_property
    def _material_sheet(self) -> "Sheet":
        return self._part_sheet(self.material)

    def _part_sheet(self, mask: Bools) -> "Sheet":
        if not mask.any():
            raise PatternError(
                f"the pattern keeps none of the {self.surface.m} cells; lower the threshold or raise the frequency"
            )
        part = self.material_part if mask is self.material else SheetPart.from_cells(self.surface, mask)
        weights = self.weights[part.vertices]
        columns = (self.parent[mask], self.family[mask], weights, self.stubs)
        return Sheet(part.surface, *columns, self._outline_lines(part.surface, mask), self.lines)

    @cached_property
    def lines_of_edges(self) -> Ints:
        """(m', 3) index in `lines` of each half-edge. A half-edge without a line takes the line of its twin."""
        line, twin = self.sides_on.ravel(), self.surface.edges.twins
        return np.where((line == 0) & (twin >= 0), line[twin], line).reshape(-1, 3)

    def _outline_lines(self, part: Surface, mask: Bools) -> Ints:
        outline = part.edges.outline
        sides_on = np.zeros(3 * part.m, dtype=np.int64)
        sides_on[outline] = self.lines_of_edges[mask].ravel()[outline]
        sides_on[outline[sides_on[outline] == 0]] = LineKind.END
        return sides_on.reshape(-1, 3)


def weight_entries(weights: csr_array) -> tuple[Ints, Floats]:
    """Return columns and values (k, 3) of the nonzero weights in each row of (k, n); shorter rows end with zeros."""
    count = np.diff(weights.indptr)
    place = np.arange(weights.nnz) - np.repeat(weights.indptr[:-1], count)
    row = np.repeat(np.arange(len(count)), count)
    column, value = np.zeros((len(count), 3), dtype=np.int64), np.zeros((len(count), 3))
    column[row, place], value[row, place] = weights.indices, weights.data
    return column, value


def hydraulic_diameters(part: Surface, walls: Bools, label: Ints, count: int) -> Floats:
    """Return the hydraulic diameter (count,) of each piece of a part: 4 area / perimeter, metres.
    The diameter is infinite for a piece with boundary edges that are not walls.
    walls : (e,) mask of edges between material and void.    label : (f,) piece of each face."""
    length = part.edge_lengths
    edge = np.flatnonzero(part.edges.boundary)
    piece = label[part.edges.order[part.edges.start[:-1]][edge] // 3]
    perimeter = np.bincount(piece, length[edge], count)
    enclosed = (np.bincount(piece, ~walls[edge], count) == 0) & (perimeter > 0)
    areas = np.bincount(label, part.areas, count)
    sizes: Floats = np.divide(4 * areas, perimeter, out=np.full(count, np.inf), where=enclosed)
    return sizes


def weighted_medians(values: Floats, weight: Floats, label: Ints, count: int) -> Floats:
    """Return the weighted median (count,) of the values (k,) with each label; inf for a label without values.
    NaN values do not count.    weight, label : (k,) of each value."""
    valid = np.flatnonzero((weight > 0) & ~np.isnan(values))
    order = valid[np.lexsort((values[valid], label[valid]))]
    x, group = values[order], label[order]
    total = np.bincount(group, weight[order], count)
    upto = np.cumsum(weight[order]) - (np.cumsum(total) - total)[group]
    half = np.flatnonzero(upto >= 0.5 * total[group])
    result = np.full(count, np.inf)
    result[group[half][::-1]] = x[half][::-1]
    return result


CREASE_COSINE = np.cos(np.radians(30))  # smallest cosine between a face's normal and the mean normal, except at creases


@dataclass(frozen=True, eq=False)
class SmoothSurface:
    """A smooth surface over flat faces. A point with barycentric weights l moves by the sum of 4 l_i l_j bulge_ij.
    surface : the flat faces.
    bulge   : (e, 3) vector from the middle of each edge to its curve, metres; 0 for flat faces and creases.

    The curve of an edge a-b is cubic, and perpendicular to the normals n_a and n_b at its ends:

        bulge = ((a - b) . n_a n_a + (b - a) . n_b n_b) / 8 [Vlachos, Peters, Boyd and Mitchell 2001]"""

    surface: Surface
    bulge: Floats

    def __post_init__(self) -> None:
        lock(self, "bulge", np.float64, (len(self.surface.edges.ends), 3))

    @classmethod
    def from_surface(cls, surface: Surface) -> "SmoothSurface":
        """Return the smooth surface through the vertices of `surface`."""
        normals, F, edges = _corner_normals(surface), surface.F, surface.edges
        start, end = F, np.roll(F, -1, axis=1)
        chord = surface.V[end] - surface.V[start]  # (m, half-edge, 3)
        n_a, n_b = normals, np.roll(normals, -1, axis=1)
        bent = (_normal_component(chord, n_b) - _normal_component(chord, n_a)) / 8
        total = np.stack([np.bincount(edges.of.ravel(), bent[..., k].ravel()) for k in range(3)], axis=1)
        return cls(surface, total / edges.count[:, None])

    def points(self, weights: csr_array) -> Floats:
        """Return points (k, 3) of the smooth surface, m. weights : (k, n) barycentric, each row in a single face."""
        flat = np.asarray(weights @ self.surface.V)
        if not self.bulge.any():
            return flat
        edges, (column, weight) = self.surface.edges, weight_entries(weights)
        for i, j in ((0, 1), (1, 2), (0, 2)):
            product = 4 * weight[:, i] * weight[:, j]
            between = np.flatnonzero(product > 0)
            numbers = edges.edges_between(column[between, i], column[between, j])
            flat[between] += product[between, None] * self.bulge[numbers]
        return flat


def _normal_component(chord: Floats, normal: Floats) -> Floats:
    return np.asarray((chord * normal).sum(axis=-1, keepdims=True) * normal)


def _corner_normals(surface: Surface) -> Floats:
    """Return unit normals (m, 3, 3) at face corners: the mean normal of the vertex, or the face normal at a crease."""
    corner, face = surface.F.ravel(), np.repeat(np.arange(surface.m), 3)
    first_face = np.zeros(surface.n, dtype=np.int64)
    first_face[corner[::-1]] = face[::-1]
    face_normals = surface.normals[face]
    # turn normals to the side of the vertex's first face, because a surface may be one-sided (Moebius strip)
    side = np.where((face_normals * surface.normals[first_face[corner]]).sum(axis=1) < 0, -1.0, 1.0)
    weighted = face_normals * (side * surface.areas[face])[:, None]
    mean = np.stack([np.bincount(corner, weighted[:, k], surface.n) for k in range(3)], axis=1)
    mean = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    smooth = np.abs((face_normals * mean[corner]).sum(axis=1)) > CREASE_COSINE
    return np.asarray(np.where(smooth[:, None], mean[corner], face_normals).reshape(-1, 3, 3))


def finer(sheet: Sheet, smooth: SmoothSurface) -> Sheet:
    """Return a sheet with every triangle divided into four and all vertices on `smooth`. New vertices come last.
    `Sheet.weights` still refer to the uncut surface, because supports and loads are defined there."""
    F, edges, n = sheet.surface.F, sheet.surface.edges, sheet.surface.n
    a, b = edges.ends.T
    weights = csr_array(vstack([sheet.weights, 0.5 * (sheet.weights[a] + sheet.weights[b])]))
    weights.data[weights.data < 1e-12] = 0.0  # removes rounding errors
    weights.eliminate_zeros()
    mid = n + edges.of
    parts = [np.stack([F[:, k], mid[:, k], mid[:, k - 1]], axis=1) for k in range(3)]
    surface = Surface(smooth.points(weights), np.concatenate([*parts, mid]))
    return Sheet(surface, np.tile(sheet.parent, 4), np.tile(sheet.family, 4), weights)


def meshes(sheet: Sheet, smooth: SmoothSurface) -> Iterator[Sheet]:
    """Yield the cut mesh with its vertices on the smooth surface, then finer and finer meshes, without end."""
    mesh = dataclasses.replace(sheet, surface=Surface(smooth.points(sheet.weights), sheet.surface.F))
    while True:
        yield mesh
        mesh = finer(mesh, smooth)
