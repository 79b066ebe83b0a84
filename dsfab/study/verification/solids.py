"""A sheet as a solid of quadratic wedges, solved by CalculiX where that is installed: it knows no theory of sheets."""

import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.errors import StaticsError
from dsfab.statics import Material
from dsfab.surface import Surface

CCX = "ccx"
"""CalculiX's solver, as its package names it."""

PATIENCE = 600.0
"""Seconds after which it is stopped."""

ENERGY = re.compile(r"total internal energy.*?\n\s*\n\s*(\S+)")

Projection = Callable[[Floats], tuple[Floats, Floats]]
"""Points near the middle surface (k, 3) -> points on it, metres, and unit normals there."""


@dataclass(frozen=True, eq=False)
class Wedges:
    """A solid of one wedge (C3D15) for each triangle, in metres.

    nodes  : (p, 3).        elements : (m, 15) in CalculiX's order: corners below, corners above, middles of the edges
             below, middles above, middles of the upright edges.
    columns : (n, 3) of each vertex of the sheet: its nodes below, above and in the middle of the thickness.
    middles : (e, 2) of each edge: its nodes below and above.
    """

    nodes: Floats
    elements: Ints
    columns: Ints
    middles: Ints


def wedges(surface: Surface, thickness: float, projection: Projection) -> Wedges:
    """The solid between the two surfaces that are half a thickness off the middle one along its normals."""
    edges, F = surface.edges, surface.F
    n, e = surface.n, len(edges.ends)
    corner, normal = projection(surface.V)
    middle, across = projection(surface.V[edges.ends].mean(axis=1))
    up, over = thickness / 2 * normal, thickness / 2 * across
    nodes = np.concatenate([corner - up, corner + up, corner, middle - over, middle + over])
    columns = np.arange(n)[:, None] + n * np.arange(3)
    middles = 3 * n + np.arange(e)[:, None] + e * np.arange(2)
    # bottom and top as seen from the side that the normals point to: faces that run the other way round are turned
    turned = (surface.normals * normal[F[:, 0]]).sum(axis=1) < 0
    F, of = np.where(turned[:, None], F[:, ::-1], F), np.where(turned[:, None], edges.of[:, [1, 0, 2]], edges.of)
    parts = [columns[F, 0], columns[F, 1], middles[of, 0], middles[of, 1], columns[F, 2]]
    return Wedges(nodes, np.concatenate(parts, axis=1), columns, middles)


def solid_compliance(solid: Wedges, material: Material, held: Ints, gravity: Floats) -> float | None:
    """Joules, under the solid's own weight, by CalculiX; None where that is not installed.

    held    : nodes that do not move.       gravity : (3,) m/s2.

    Raises StaticsError where CalculiX fails.
    """
    program = shutil.which(CCX)
    if program is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "solid.inp").write_text(_text(solid, material, held, gravity), encoding="ascii")
        try:
            done = subprocess.run(
                [program, "solid"], cwd=folder, capture_output=True, text=True, timeout=PATIENCE, check=False
            )
        except subprocess.TimeoutExpired as error:
            raise StaticsError(f"CalculiX did not solve the solid within {PATIENCE:g} s") from error
        result = Path(folder) / "solid.dat"
        found = ENERGY.search(result.read_text(encoding="ascii")) if result.exists() else None
    if done.returncode or not found:
        raise StaticsError(f"CalculiX did not solve the solid: {done.stdout.strip()[-200:]}")
    return 2 * float(found[1])


def _text(solid: Wedges, material: Material, held: Ints, gravity: Floats) -> str:
    size = float(np.linalg.norm(gravity))
    used = np.unique(solid.elements)
    lines = ["*NODE, NSET=ALL", *(f"{k + 1},{','.join(f'{x:.12e}' for x in solid.nodes[k])}" for k in used)]
    lines.append("*ELEMENT, TYPE=C3D15, ELSET=S")
    lines += [f"{k},{','.join(map(str, row + 1))}" for k, row in enumerate(solid.elements, start=1)]
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", f"{material.young},{material.poisson}"]
    lines += ["*DENSITY", f"{material.density}", "*SOLID SECTION, ELSET=S, MATERIAL=M", "*BOUNDARY"]
    lines += [f"{k + 1},1,3" for k in np.intersect1d(held, used)]
    lines += ["*STEP", "*STATIC", "*DLOAD", f"S,GRAV,{size},{','.join(f'{x / size:.12e}' for x in gravity)}"]
    lines += ["*EL PRINT, ELSET=S, TOTALS=ONLY", "ELSE", "*END STEP", ""]
    return "\n".join(lines)


def nodes_of(solid: Wedges, surface: Surface, where: Bools) -> Ints:
    """All nodes of the end faces that stand on the boundary edges between marked vertices (n,)."""
    edges = surface.edges
    on = edges.boundary & where[edges.ends].all(axis=1)
    return np.unique(np.concatenate([solid.columns[edges.ends[on]].ravel(), solid.middles[on].ravel()]))
