"""Finite elements of sheets by name, and needles (very flat triangles)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal, Self, get_args

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Floats, Ints
from dsfab.core.derived import derived
from dsfab.core.errors import StaticsError
from dsfab.surface.mesh import Surface

Membrane = Literal["constant", "quadratic", "hybrid"]
Bending = Literal["hinge", "midedge", "hhj"]
BUBBLES = ("along", "across", "normal")
"""Directions of edge bubbles. An edge bubble is a quadratic displacement that is zero at the two ends of an edge."""


@dataclass(frozen=True)
class Elements:
    """Types of the finite elements of a sheet.
    membrane : `constant` (strain), `quadratic` (six-node triangle), or the more accurate `hybrid`.
    bending  : `hinge` (accurate only for stress directions), `midedge`, or the more accurate `hhj`.
               None means that the sheet deforms only in its plane."""

    membrane: Membrane = "constant"
    bending: Bending | None = "hinge"

    @classmethod
    def from_name(cls, name: str) -> Self:
        """Return the `Elements` for a name, such as "quadratic+hhj". Raises StaticsError for an unknown name."""
        pairs = [cls(membrane, bending) for membrane in get_args(Membrane) for bending in get_args(Bending)]
        match = next((pair for pair in pairs if str(pair) == name), None)
        if match is None:
            raise StaticsError(f"elements {name!r} do not exist; choose {', '.join(map(str, pairs))}")
        return match

    def __str__(self) -> str:
        return f"{self.membrane}+{self.bending or 'none'}"

    @property
    def is_reported(self) -> bool:
        """True if reports may show results of these elements."""
        return any(self in (pair, pair.in_plane) for pair in REPORTED)

    @property
    def in_plane(self) -> "Elements":
        """Elements with the same membrane type and without bending."""
        return replace(self, bending=None)

    @property
    def on_edges(self) -> tuple[str, ...]:
        """Names of the unknowns that each edge has, such as `rotation` or `along`."""
        bending = {"midedge": ("rotation",), "hhj": ("rotation", "slope")}.get(self.bending or "", ())
        membrane = ("along", "across") if self.membrane != "constant" else ()
        return bending + membrane + (("normal",) if self.bending == "hhj" else ())

    def unknowns(self, surface: Surface) -> int:
        """Return the number of unknowns: 3 n displacements, then the unknowns of edges."""
        return 3 * surface.n + len(self.on_edges) * len(surface.edges.ends)

    def columns(self, surface: Surface, *names: str) -> Ints:
        """Return the indices (m, 9 + 3 len(names)) of each face's unknowns in the vector of all unknowns.
        Displacements x, y, z of the corners come first; then each name's unknowns of the three edges."""
        corners = (3 * surface.F[:, :, None] + np.arange(3)).reshape(-1, 9)
        count = len(surface.edges.ends)
        groups = [3 * surface.n + self.on_edges.index(name) * count + surface.edges.of for name in names]
        return np.concatenate([corners, *groups], axis=1)


PAPER = Elements("constant", "hinge")  # Elements of [Madan, Jacobson and Levin].
INVERSE_MASS = 12 * (np.eye(3) - 0.25)  # Inverse mass matrix of linear functions on a triangle, times its area.


def half_edge_signs(surface: Surface) -> Floats:
    """Return a sign (m, 3) for each half-edge of a face: 1 if it starts at the lower vertex number, else -1."""
    return np.where(np.roll(surface.F, -1, axis=1) > surface.F, 1.0, -1.0)


@derived
def edge_frames(surface: Surface) -> Floats:
    """Return three unit vectors for each edge (e, 3, 3): along it, across it in the sheet, and normal to the sheet."""
    edges = surface.edges
    t = surface.V[edges.ends[:, 1]] - surface.V[edges.ends[:, 0]]
    t = t / np.linalg.norm(t, axis=1, keepdims=True)
    # `area_normal` x half-edge sign does not depend on a face's orientation, and is opposite in adjacent faces
    area_normal = surface.normals * surface.areas[:, None]
    signed = (half_edge_signs(surface)[:, :, None] * area_normal[:, None, :]).reshape(-1, 3)
    n = signed[edges.order[edges.start[:-1]]]
    n[edges.count == 2] -= signed[edges.pairs[:, 1]]
    area = np.bincount(edges.of.ravel(), np.repeat(surface.areas, 3))
    undefined = np.flatnonzero((edges.count > 2) | (np.linalg.norm(n, axis=1) < 0.3 * area))
    if len(undefined):
        tensors = np.zeros((len(edges.ends), 3, 3))
        np.add.at(tensors, edges.of.ravel(), np.repeat(_outer(surface.normals, area_normal), 3, axis=0))
        first_face = edges.order[edges.start[undefined]] // 3
        # add weight to the first face, as three faces at 120 degrees give no unique eigenvector
        tensors[undefined] += 0.01 * _outer(surface.normals[first_face], area_normal[first_face])
        n[undefined] = np.linalg.eigh(tensors[undefined])[1][:, :, -1]
    n = n / np.linalg.norm(n, axis=1, keepdims=True)
    frames = np.stack([t, np.cross(n, t), n], axis=1)
    frames.flags.writeable = False
    return frames


def voigt(a: Floats, b: Floats) -> Floats:
    """Return the components (xx, yy, 2 xy) (..., 3) of the symmetric part of a b^T, for plane vectors a, b (..., 2)."""
    return np.stack([a[..., 0] * b[..., 0], a[..., 1] * b[..., 1], a[..., 0] * b[..., 1] + a[..., 1] * b[..., 0]], -1)


def tensor_matrices(planar: Floats) -> Floats:
    """Return symmetric tensors as matrices (..., 2, 2). planar : (..., 3) their components (xx, yy, xy)."""
    xx, yy, xy = np.moveaxis(planar, -1, 0)
    return np.stack([np.stack([xx, xy], axis=-1), np.stack([xy, yy], axis=-1)], axis=-2)


def assemble_blocks(blocks: Floats, columns: Ints, size: int) -> csr_array:
    """Assemble the element matrices `blocks` (m, c, c) of all faces into one sparse matrix (size, size).
    columns : (m, c) index of the unknown that belongs to each row and column of a block."""
    # K = S^T Z needs no sorting: Z stacks the rows of all blocks, S^T sums rows by unknown
    m, c = columns.shape
    columns = columns.astype(np.int32 if max(m * c * c, size) < 2**31 else np.int64)
    count = np.arange(m * c + 1, dtype=columns.dtype)
    Z = csr_array((blocks.ravel(), np.repeat(columns, c, axis=0).ravel(), c * count), (m * c, size))
    S = csr_array((np.ones(m * c), columns.ravel(), count), (m * c, size))
    K = csr_array(csr_array(S.T) @ Z)  # convert S.T to CSR here; else scipy would convert the larger matrix Z
    K.sort_indices()
    return K


def zero_padded(K: csr_array, size: int) -> csr_array:
    """Return the matrix K with zero rows and columns appended, up to the shape (size, size)."""
    indptr = np.concatenate([K.indptr, np.full(size - K.shape[0], K.indptr[-1])])
    return csr_array((K.data, K.indices, indptr), shape=(size, size))


def _outer(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, :, None] * b[:, None, :])


Quantity = Literal["compliance", "compliance_once", "displacement", "stress", "frequency", "buckling", "six_nodes"]
"""Results that appear in reports; `USES` lists the elements that compute each result."""

Aid = Literal["needles", "spread", "ranking", "directions"]
"""Internal purposes of elements, described in `USES`. Results for these purposes never appear in reports."""


@dataclass(frozen=True)
class Use:
    """A purpose (`about`) and the pair of membrane and bending elements that it uses.
    tolerance : largest relative error that tests accept on their finest mesh; None if no test checks the elements."""

    pair: Elements
    tolerance: float | None
    about: str


_HYBRID, _SIX_NODES = Elements("hybrid", "hhj"), Elements("quadratic", "hhj")

USES: Mapping[Quantity | Aid, Use] = MappingProxyType(
    {
        "compliance": Use(_SIX_NODES, 0.02, "compliance with its error bound, from finer and finer meshes"),
        "compliance_once": Use(_HYBRID, 0.02, "compliance by one solve"),
        "displacement": Use(_HYBRID, 0.02, "displacements and reactions"),
        "stress": Use(_HYBRID, 0.02, "stress and utilisation"),
        "frequency": Use(_HYBRID, 0.02, "natural frequencies"),
        "buckling": Use(_HYBRID, 0.02, "factors of linear buckling"),
        "six_nodes": Use(_SIX_NODES, 0.02, "expected results of programs with six-node triangles"),
        "needles": Use(Elements("quadratic", "midedge"), None, "single solve of a sheet with needle-shaped triangles"),
        "spread": Use(
            Elements("quadratic", "midedge"), None, "second computation of compliance, which only gives the error bound"
        ),
        "ranking": Use(Elements("constant", "midedge"), None, "comparison of many candidate designs by stiffness"),
        "directions": Use(PAPER, None, "directions of the stress, computed as in [Madan, Jacobson and Levin]"),
    }
)
"""Elements for each quantity or purpose. `dsfab.study.verdict.estimates` is calibrated for these elements."""

REPORTED: tuple[Elements, ...] = tuple(dict.fromkeys(use.pair for use in USES.values() if use.tolerance is not None))
"""Elements whose results may appear in reports."""


def elements_of(use: Quantity | Aid) -> Elements:
    """Return the elements for one of the `USES`, such as "stress". Raises KeyError for an unknown use."""
    return USES[use].pair


def tolerance_of(quantity: Quantity) -> float:
    """Return the largest relative error that tests accept for a reported quantity."""
    tolerance = USES[quantity].tolerance
    assert tolerance is not None  # every quantity has a tolerance
    return tolerance


NEEDLE = 0.02
"""A triangle is a needle if its smallest height is less than this fraction of its longest edge."""


def _longest_edges(surface: Surface) -> Floats:
    corners = surface.V[surface.F]
    return np.asarray(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1))


def heights(surface: Surface) -> Floats:
    """Return the smallest height of each triangle (m,), metres."""
    return np.asarray(2 * surface.areas / _longest_edges(surface))


def flatness(surface: Surface) -> Floats:
    """Return the ratio (m,) of each triangle's smallest height to its longest edge."""
    return np.asarray(2 * surface.areas / _longest_edges(surface) ** 2)


def needle_message(surface: Surface) -> str:
    """Return a message about needles (very flat triangles) in the mesh; '' if there are no needles."""
    shape = flatness(surface)
    count = int((shape < NEEDLE).sum())
    if not count:
        return ""
    where = surface.centroids[shape.argmin()].round(3).tolist()
    are = "triangle is a needle" if count == 1 else "triangles are needles"
    return (
        f"{count} of {surface.m} {are}: the height is under {NEEDLE:g} times the longest edge (the thinnest triangle, "
        f"with {shape.min():.1g} times, is around {where} m)"
    )
