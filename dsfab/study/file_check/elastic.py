"""A solid of ten-node tetrahedra: stiffness assembled by scikit-fem, solved with dsfab's sparse Cholesky.

Points of the sheet lie inside the solid. A quadratic tetrahedron gives the displacement there as a sum of those of its
nodes, u(x) = sum N_a(x) u_a. Forces and supports use the same weights: their sum is 1 and they reproduce x, so that the
resultant of the loads and its moment are kept to rounding, wherever the nodes are.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.spatial import cKDTree

from dsfab.arrays import Floats, Ints
from dsfab.errors import StaticsError
from dsfab.sparse import NotPositiveDefinite, factorise
from dsfab.statics import Material
from dsfab.study.file_check.tetrahedra import Tetrahedra

AT_ONCE = 20_000
"""Tetrahedra assembled together: 30 x 30 entries each, which is 150 MB."""

NEAR = 40
"""Tetrahedra that are tried for a point, those with the nearest centres first."""

OUTSIDE = 0.25
"""A point may be this far outside its tetrahedron, in barycentric coordinates: skins are chords of curved sheets."""

LARGEST = 1_200_000
"""More unknowns than this are not solved."""


@dataclass(frozen=True, eq=False)
class SolidModel:
    """Stiffness K (N, N), N/m, of a solid, and where its unknowns are.

    points : (N / 3, 3) nodes.     node : (N,) the node that each unknown sits on.
    """

    mesh: Tetrahedra
    K: csr_array
    points: Floats
    node: Ints
    _dofs: Ints

    @classmethod
    def of(cls, mesh: Tetrahedra, material: Material) -> "SolidModel":
        """Assemble. Raises StaticsError for more than `LARGEST` unknowns."""
        from skfem import ElementTetP2, ElementVector, MeshTet

        tets = MeshTet(np.ascontiguousarray(mesh.X.T), np.ascontiguousarray(mesh.T.T), sort_t=True)
        element = ElementVector(ElementTetP2())
        count = 3 * (tets.p.shape[1] + tets.edges.shape[1])
        if count > LARGEST:
            raise StaticsError(f"the solid model has {count:,} unknowns, more than the {LARGEST:,} that are solved")
        K, dofs = _assembled(tets, element, material)
        points = np.concatenate([tets.p.T, tets.p.T[tets.edges.T].mean(axis=1)])
        node = np.empty(count, dtype=np.int64)
        corners, middles = tets.p.shape[1], tets.edges.shape[1]
        node[: 3 * corners] = np.repeat(np.arange(corners), 3)
        node[3 * corners :] = corners + np.repeat(np.arange(middles), 3)
        return cls(Tetrahedra(tets.p.T, tets.t.T), K, points, node, dofs)

    @cached_property
    def _tree(self) -> Any:
        return cKDTree(self.mesh.X[self.mesh.T].mean(axis=1))

    def at(self, points: Floats, reach: float) -> csr_array:
        """(3 k, N) from the unknowns to the displacements of points (k, 3): x, y, z of the first, then of the second.

        reach : metres that a point may lie outside the solid.   Raises StaticsError for one that lies farther out.
        """
        tet, local = self._inside(points, reach)
        phi = _shapes(local)  # (10, k)
        k = len(points)
        rows = np.broadcast_to(3 * np.arange(k)[None, None] + np.arange(3)[None, :, None], (10, 3, k))
        columns = self._dofs[:, tet].reshape(10, 3, k)
        values = np.broadcast_to(phi[:, None], (10, 3, k))
        entries = (values.ravel(), (rows.ravel(), columns.ravel()))
        return csr_array(coo_array(entries, shape=(3 * k, self.K.shape[0])))

    def _inside(self, points: Floats, reach: float) -> tuple[Ints, Floats]:
        """The tetrahedron (k,) that holds each point best, and the point's place in it (3, k)."""
        near = np.asarray(self._tree.query(points, k=min(NEAR, len(self.mesh.T)))[1]).reshape(len(points), -1)
        P = self.mesh.X[self.mesh.T[near]]
        edges = np.swapaxes(P[:, :, 1:] - P[:, :, :1], 2, 3)
        local = np.linalg.solve(edges, (points[:, None] - P[:, :, 0])[..., None])[..., 0]
        lowest = np.minimum(local.min(axis=2), 1 - local.sum(axis=2))
        best = lowest.argmax(axis=1)
        own = np.arange(len(points))
        out = np.maximum(-lowest[own, best], 0) * np.abs(edges[own, best]).max(axis=(1, 2))
        lost = np.flatnonzero((lowest[own, best] < -OUTSIDE) | (out > reach))
        if len(lost):
            place = points[lost[0]].round(4).tolist()
            raise StaticsError(
                f"{len(lost)} of {len(points)} loaded or held points of the sheet have no material of the file around "
                f"them (first at {place} m)"
            )
        return near[own, best], local[own, best].T


def _assembled(tets: Any, element: Any, material: Material) -> tuple[csr_array, Ints]:
    """The stiffness, and the unknowns of each tetrahedron (30, k)."""
    from skfem import Basis
    from skfem.models.elasticity import lame_parameters, linear_elasticity

    form = linear_elasticity(*lame_parameters(material.young, material.poisson))
    K: csr_array | None = None
    for start in range(0, tets.t.shape[1], AT_ONCE):
        part = np.arange(start, min(start + AT_ONCE, tets.t.shape[1]))
        basis = Basis(tets, element, elements=part, intorder=2)  # strains are linear: exact
        added = csr_array(form.assemble(basis))
        K = added if K is None else csr_array(K + added)
        dofs = basis.dofs.element_dofs
    if K is None:
        raise StaticsError("the solid has no tetrahedra")
    return K, np.asarray(dofs, dtype=np.int64)


def _shapes(local: Floats) -> Floats:
    """(10, k) the quadratic shape functions at local places (3, k), in scikit-fem's order."""
    from skfem import ElementTetP2

    return np.stack([ElementTetP2().lbasis(local, a)[0] for a in range(10)])


@dataclass(frozen=True, eq=False)
class Holding:
    """What keeps a model in place: springs, N/m, along combinations of its unknowns.

    rows : (r, N) one combination each.     stiffness : (r,) N/m; a rigid support is a very stiff spring.
    """

    rows: csr_array
    stiffness: Floats


def compliances(model: SolidModel, holding: Holding, forces: Sequence[Floats]) -> Floats:
    """(c,) f . u, joules, of each force (N,). Raises StaticsError when the solid is not held."""
    weighted = diags_array(holding.stiffness) @ holding.rows
    K = csr_array(model.K + holding.rows.T @ weighted)
    scale = 1 / np.sqrt(K.diagonal())
    inner = csr_array(diags_array(scale) @ K @ diags_array(scale))
    inner.sort_indices()
    f = scale[:, None] * np.stack(forces, axis=1)
    try:
        solve = factorise(inner, model.points, model.node)
    except NotPositiveDefinite:
        raise StaticsError("the solid is not held by the supports, or falls into pieces") from None
    x = solve(f)
    x = x + solve(f - inner @ x)
    return np.asarray((f * x).sum(axis=0))
