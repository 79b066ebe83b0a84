"""A cut sheet as a solid of layers of quadratic wedges (C3D15), solved by CalculiX: for `solid_truth`."""

import os
import re
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.errors import DsfabError
from dsfab.slicing import Sheet
from dsfab.statics import flat_axis
from dsfab.study.verdict import LoadedSurface
from dsfab.study.verdict.levels import on_mesh
from dsfab.surface import LoadCase, Surface

ENERGY = re.compile(r"total internal energy.*?\n\s*\n\s*(\S+)")

FORCE = np.array([-1 / 9] * 6 + [1 / 6] * 6 + [2 / 9] * 3)
"""Of a force that is even over a straight wedge of 15 nodes, what goes to each."""


@dataclass(frozen=True, eq=False)
class Layers:
    """Wedges in layers: nodes (p, 3) m; elements (k, 15) in CalculiX's order, and the face (k,) that each stands on;
    upright rows of nodes at the vertices (n, 2 L + 1) and at the edges (e, L + 1), from below."""

    nodes: Floats
    elements: Ints
    face: Ints
    columns: Ints
    middles: Ints


def layers(surface: Surface, thickness: float, fine: Surface, normal: Floats, count: int) -> Layers:
    """fine : the surface with a vertex in the middle of each edge, after the n old ones; normal : (n + e, 3) there."""
    F, edges, n, e = surface.F, surface.edges, surface.n, len(surface.edges.ends)
    columns = np.arange(n * (2 * count + 1)).reshape(n, -1)
    middles = columns.size + np.arange(e * (count + 1)).reshape(e, -1)
    ends, half = np.linspace(-0.5, 0.5, 2 * count + 1) * thickness, np.linspace(-0.5, 0.5, count + 1) * thickness
    upright = fine.V[:n, None] + ends[:, None] * normal[:n, None]
    between = fine.V[n:, None] + half[:, None] * normal[n:, None]
    turned = (surface.normals * normal[F[:, 0]]).sum(axis=1) < 0
    F, of = np.where(turned[:, None], F[:, ::-1], F), np.where(turned[:, None], edges.of[:, [1, 0, 2]], edges.of)
    parts = []
    for k in range(count):
        low, mid, top = columns[F, 2 * k], columns[F, 2 * k + 1], columns[F, 2 * k + 2]
        parts.append(np.concatenate([low, top, middles[of, k], middles[of, k + 1], mid], axis=1))
    nodes = np.concatenate([upright.reshape(-1, 3), between.reshape(-1, 3)])
    return Layers(nodes, np.concatenate(parts), np.tile(np.arange(surface.m), count), columns, middles)


def vertex_normals(surface: Surface) -> Floats:
    """(n, 3) unit normals of the uncut surface, all to one side."""
    normal = np.zeros((surface.n, 3))
    for k in range(3):
        np.add.at(normal, surface.F[:, k], surface.normals * surface.areas[:, None])
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def solid_compliance(setting: LoadedSurface, mesh: Sheet, fine: Sheet, forces: Any, count: int) -> float:
    """J, by CalculiX, of the first load; `fine` is `mesh` with its edges halved."""
    surface, name = mesh.surface, next(iter(setting.loads))
    normal = fine.weights @ vertex_normals(setting.surface)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    solid = layers(surface, setting.made.thickness, fine.surface, normal, count)
    cases, spreads = on_mesh(setting.surface, mesh, setting.loads, forces)
    held = on_mesh(setting.surface, fine, setting.loads, forces)[0][name].fixed
    per_wedge = (spreads[name].face * surface.areas[:, None] / count)[solid.face]
    force = np.zeros_like(solid.nodes)
    np.add.at(force, solid.elements, FORCE[:, None] * per_wedge[:, None])
    plane = flat_axis(setting.surface, *setting.loads.values())
    fixed, opposite = supports(solid, surface, cases[name], held, plane)
    return calculix(solid, setting.made.material, fixed, opposite, force)


def supports(solid: Layers, surface: Surface, case: LoadCase, held: Bools, plane: int | None) -> tuple[Ints, Ints]:
    """Nodes and directions (q, 2) of what does not move; pairs of nodes with directions (r, 3) that move oppositely."""
    n, count = surface.n, solid.middles.shape[1] - 1
    fixed, opposite = [], []
    for rows, at in ((solid.columns, held[:n]), (solid.middles, held[n:])):
        where, way = np.nonzero(at)
        last = rows.shape[1] - 1
        if last % 2 == 0:
            fixed.append(np.stack([rows[where, last // 2], way], axis=1))
        opposite += [np.stack([rows[where, j], rows[where, last - j], way], axis=1) for j in range((last + 1) // 2)]
    if plane is not None:
        fixed.append(np.stack([solid.columns[:, count], np.full(n, plane)], axis=1))
    clamped = np.flatnonzero(case.clamped) if len(case.clamped) == len(surface.edges.ends) else np.empty(0, dtype=int)
    stiff = np.unique(
        np.concatenate([solid.columns[surface.edges.ends[clamped]].ravel(), solid.middles[clamped].ravel()])
    )
    fixed += [np.stack([stiff, np.full(len(stiff), way)], axis=1) for way in range(3)]
    pairs = np.concatenate(opposite)
    return np.unique(np.concatenate(fixed), axis=0), pairs[~np.isin(pairs[:, :2], stiff).any(axis=1)]


def calculix(solid: Layers, material: Any, fixed: Ints, opposite: Ints, force: Floats) -> float:
    """Twice the internal energy, J."""
    used = np.unique(solid.elements)
    lines = [
        "*NODE, NSET=ALL",
        *(f"{k + 1},{x:.12e},{y:.12e},{z:.12e}" for k, (x, y, z) in zip(used, solid.nodes[used], strict=True)),
    ]
    lines.append("*ELEMENT, TYPE=C3D15, ELSET=S")
    lines += [f"{k},{','.join(map(str, row))}" for k, row in enumerate((solid.elements + 1).tolist(), start=1)]
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", f"{material.young},{material.poisson}"]
    lines += ["*SOLID SECTION, ELSET=S, MATERIAL=M", "*BOUNDARY"]
    lines += [f"{k + 1},{way + 1},{way + 1}" for k, way in fixed.tolist()]
    for a, b, way in opposite.tolist():
        lines += ["*EQUATION", "2", f"{a + 1},{way + 1},1.,{b + 1},{way + 1},1."]
    lines += ["*STEP", "*STATIC", "*CLOAD"]
    rows, ways = np.nonzero(force)
    lines += [f"{k + 1},{way + 1},{force[k, way]:.12e}" for k, way in zip(rows, ways, strict=True)]
    lines += ["*EL PRINT, ELSET=S, TOTALS=ONLY", "ELSE", "*END STEP", ""]
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "solid.inp").write_text("\n".join(lines), encoding="ascii")
        run = ["nice", "ccx", "solid"]
        done = subprocess.run(
            run, cwd=folder, capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"}, check=False
        )
        result = Path(folder) / "solid.dat"
        found = ENERGY.search(result.read_text(encoding="ascii")) if result.exists() else None
    if done.returncode or not found:
        raise DsfabError(f"CalculiX: {done.stdout.strip()[-300:]}")
    return 2 * float(found[1])
