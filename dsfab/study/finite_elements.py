"""A sheet with its supports and loads as a model of six-node triangles, for a solver that is not ours.

The triangles are the same flat facets with a node in the middle of each edge; their quadratic displacements are those
of `quadratic` + `hhj` (`six_nodes` in `dsfab.statics.uses`), so the two must agree.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.errors import StaticsError
from dsfab.export.calculix import CalculixModel, Element
from dsfab.statics import SheetModel, SpreadLoad, elements_of
from dsfab.statics.elements import edge_frames
from dsfab.statics.supports import held_faces, held_middles
from dsfab.surface import Surface

THIN = 0.01
"""Thickness of CPS6 sections over the mean edge, at most. CalculiX makes solid wedges of them whose change of thickness
is continuous, which costs shear when they are thick: a cut cantilever was 0.15 to 0.2 % too stiff with a section as
thick as a third of the mean edge, and 0.02 to 0.03 % too stiff at a hundredth and below."""


def six_node_triangles(surface: Surface) -> tuple[Floats, Ints]:
    """Nodes (n + e, 3), metres: the vertices, then the middles of the edges; triangles (m, 6): corners, then middles.

    The fourth node is between the first two, the fifth between the second and the third, the sixth behind.
    """
    edges = surface.edges
    middles = surface.V[edges.ends].mean(axis=1)
    return np.concatenate([surface.V, middles]), np.concatenate([surface.F, surface.n + edges.of], axis=1)


def nodal_forces(surface: Surface, force: Floats, spread: SpreadLoad | None = None) -> Floats:
    """(n + e, 3) newtons on the nodes of six-node triangles that do the same work as our loads.

    force  : (n, 3) newtons on the vertices, the share of `spread` included.
    spread : loads per area and per length, which act on bubbles too.

    The quadratic shape of a corner is its hat function less half of the bubbles of its edges, and that of a middle node
    is the bubble, so middles take what acts on the bubbles and corners lose half of it.
    """
    middle = np.zeros((len(surface.edges.ends), 3))
    if spread is not None:
        on_bubbles = spread.bubble_forces(surface, elements_of("six_nodes"))[:, -3:]
        middle = np.einsum("ed,edx->ex", on_bubbles, edge_frames(surface))
    corner = force.copy()
    np.add.at(corner, surface.edges.ends.ravel(), -np.repeat(middle, 2, axis=0) / 2)
    return np.concatenate([corner, middle])


def held_nodes(surface: Surface, supports: Mapping[str, Bools]) -> dict[str, Bools]:
    """By support, the held directions (n + e, 3) of all nodes, from those of the vertices (n, 3).

    Middles are held where our edges are (`held_middles` of all supports together). One between two supports belongs to
    the first of them that holds an end.
    """
    ends = surface.edges.ends
    left = held_middles(surface, _held_by_any(surface, supports))
    found = {}
    for name, fixed in supports.items():
        middles = left & fixed[ends].any(axis=1)
        left = left & ~middles
        found[name] = np.concatenate([fixed, middles])
    return found


def _held_by_any(surface: Surface, supports: Mapping[str, Bools]) -> Bools:
    """(n, 3) directions held by some support; all supports may be springs."""
    return np.asarray(np.logical_or.reduce([np.zeros((surface.n, 3), dtype=bool), *supports.values()]))


def six_node_model(
    sheet: SheetModel,
    supports: Mapping[str, Bools],
    steps: Mapping[str, Floats],
    springs: Floats | None = None,
    element: Element = "S6",
    axis: int = 2,
) -> CalculixModel:
    """The model of a sheet. Faces that are held in all directions do not turn, as in ours.

    supports : by name, (n, 3) held directions of the vertices.
    steps    : by name, (n + e, 3) newtons, see `nodal_forces`.
    springs  : (n, 3) newtons per metre on the vertices.
    element  : CPS6 for a flat sheet that is loaded in its plane, across the coordinate `axis`.
    """
    surface, material, clamped = sheet.surface, sheet.material, sheet.clamped
    edges = surface.edges
    X, T = six_node_triangles(surface)
    still = np.zeros(len(X), dtype=bool)
    still[T[held_faces(surface, _held_by_any(surface, supports)).all(axis=1)]] = True
    if clamped is not None:
        still[surface.n :] = clamped
        still[edges.ends[clamped]] = True
    soft = np.zeros((len(X), 3))
    if springs is not None:
        soft[: surface.n] = springs
    held = held_nodes(surface, supports)
    model = CalculixModel(
        X, T, sheet.thickness, material.young, material.poisson, steps, held, still, soft, material.density
    )
    return model if element == "S6" else in_plane(model, axis, THIN * surface.mean_edge)


def axes_of_file(axis: int) -> Ints:
    """(3,) the coordinates that become x, y and z of a file when a sheet is seen along the coordinate `axis`."""
    return np.asarray(np.roll(np.arange(3), 2 - axis))


def in_plane(model: CalculixModel, axis: int, thickness: float) -> CalculixModel:
    """The model in CPS6, seen along the coordinate `axis`: the two others become x and y.

    thickness : metres, of the section at most; a stiffer material makes up for it, so that displacements, reactions and
                energy stay and stresses grow.
    """
    if np.ptp(model.nodes[:, axis]) > 1e-9 * np.ptp(model.nodes, axis=0).max():
        raise StaticsError("a sheet that is not flat cannot be solved in its plane; choose S6 elements")
    turn = axes_of_file(axis)
    nodes = model.nodes[:, turn] * (1, 1, 0) + 0.0  # no -0
    notes = list(model.notes)
    if axis != 2:
        notes.append(f"AXES: x and y of this file are {'xyz'[turn[0]]} and {'xyz'[turn[1]]} of the surface")
    share = min(1.0, thickness / model.thickness)
    if share < 1:
        notes.append(
            f"SECTION: {model.thickness * share:.6g} m with Young's modulus {model.young / share:.6g} Pa stands for "
            f"{model.thickness:.6g} m with {model.young:.6g} Pa: CalculiX makes solids of plane elements, which are in "
            f"plane stress when they are thin. Displacements and reactions stay; divide stresses by {1 / share:.5g}"
        )
    return replace(
        model,
        element="CPS6",
        nodes=nodes,
        thickness=model.thickness * share,
        young=model.young / share,
        steps={name: force[:, turn] for name, force in model.steps.items()},
        supports={name: held[:, turn] for name, held in model.supports.items()},
        springs=model.springs[:, turn],
        notes=tuple(notes),
    )
