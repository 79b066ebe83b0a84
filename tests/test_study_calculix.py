"""The elements against CalculiX, a solver that is not ours: the same meshes with six-node triangles (S6, CPS6).

Never its three-node shells (S3): they reach 0.56 of a clamped plate. Skipped where `ccx` is not installed.
"""

import shutil
import subprocess

import numpy as np
import pytest

from dsfab.statics import VERDICT, Elements, Equilibrium
from dsfab.statics.elements import edge_frames
from dsfab.study.verification import TESTS
from dsfab.study.verification.problem import Problem

CCX = shutil.which("ccx")
pytestmark = pytest.mark.skipif(CCX is None, reason="CalculiX is not installed: apt-get install calculix-ccx")


def lines(*rows) -> str:
    """Cards; CalculiX reads no more than 20 characters of a number."""
    return "\n".join(", ".join(f"{v:.11e}" if isinstance(v, float) else str(v) for v in row) for row in rows)


def ccx_value(problem: Problem, folder, element: str, thickness: float | None = None) -> float:
    """The problem's value as CalculiX finds it, with a middle node on each straight edge.

    The nodal loads of quadratic triangles follow from ours: phi_i = hat_i - half the bubbles of the edges at i.
    """
    surface, edges = problem.surface, problem.surface.edges
    n, h = surface.n, thickness or problem.thickness
    X = np.concatenate([surface.V, surface.V[edges.ends].mean(axis=1)])
    T = np.concatenate([surface.F, n + edges.of], axis=1) + 1
    on_edges = problem.spread.bubble_forces(surface, VERDICT)[:, 2:]
    middle = np.einsum("ed,edx->ex", on_edges, edge_frames(surface))
    corner = problem.force + problem.spread.vertex_forces(surface)
    np.add.at(corner, edges.ends.ravel(), -np.repeat(middle, 2, axis=0) / 2)
    force = np.concatenate([corner, middle])
    held = np.concatenate([problem.fixed, problem.fixed[edges.ends].all(axis=1) & edges.boundary[:, None]])
    clamped = np.zeros(len(X), dtype=bool)
    clamped[n:] = problem.clamped
    clamped[edges.ends[problem.clamped]] = True
    plane = element.startswith("CPS")
    section = "*SOLID SECTION" if plane else "*SHELL SECTION"
    text = f"""*NODE, NSET=ALL
{lines(*((i + 1, *x) for i, x in enumerate(X.tolist())))}
*ELEMENT, TYPE={element}, ELSET=SHEET
{lines(*((k + 1, *t) for k, t in enumerate(T.tolist())))}
*MATERIAL, NAME=M
*ELASTIC
{problem.material.young}, {problem.material.poisson}
{section}, ELSET=SHEET, MATERIAL=M
{h}
*BOUNDARY
{lines(*((i + 1, x + 1, x + 1) for i, x in np.argwhere(held) if not (plane and x == 2)))}
{"" if plane else lines(*((i + 1, 4, 6) for i in np.flatnonzero(clamped)))}
*STEP
*STATIC
*CLOAD
{lines(*((i + 1, x + 1, float(force[i, x])) for i, x in np.argwhere(np.abs(force) > 1e-12 * np.abs(force).max())))}
*NODE PRINT, NSET=ALL
U
*END STEP
"""
    (folder / "job.inp").write_text("\n".join(row for row in text.splitlines() if row.strip()) + "\n")
    subprocess.run([CCX, "job"], cwd=folder, capture_output=True, timeout=120, check=True)
    table = np.loadtxt(folder / "job.dat", skiprows=3)
    u = np.zeros((len(X), 3))
    u[table[:, 0].astype(int) - 1] = table[:, 1:4]
    return problem.value(Equilibrium(u[:n], np.zeros((n, 3)), 0.0, 0.0))


def test_quadratic_membranes_agree_with_plane_stress_triangles(tmp_path):
    """CalculiX expands CPS6 to solid wedges: the panel is made thin, so that they are in plane stress."""
    problem = TESTS["cook"].problem(8, "union_jack")
    thin = 0.01
    theirs = ccx_value(problem, tmp_path, "CPS6", thickness=thin) * thin
    assert problem.solve(Elements("quadratic", None)) == pytest.approx(theirs, rel=2e-4)


@pytest.mark.parametrize(
    ("name", "cells", "within"),
    [
        ("plate_supported", 16, 0.005),
        ("plate_clamped", 32, 0.02),  # theirs is still 1.3 % below the series solution, ours at it
        ("straight_beam_out_of_plane", 4, 0.01),
        ("twisted_beam_in_plane", 2, 0.005),
        ("scordelis_lo", 16, 0.002),
    ],
)
def test_the_pair_for_verdicts_agrees_with_six_node_shells(name, cells, within, tmp_path):
    problem = TESTS[name].problem(cells, "union_jack")
    assert problem.solve(VERDICT) == pytest.approx(ccx_value(problem, tmp_path, "S6"), rel=within)
