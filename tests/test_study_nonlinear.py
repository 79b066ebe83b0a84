"""Large displacements by CalculiX: a toggle that snaps through, a column that buckles; skipped where it is missing."""

from math import pi

import numpy as np
import pytest

from dsfab.statics import Material
from dsfab.study.nonlinear import solid_check, solid_model
from dsfab.surface import LoadCase, Surface
from tests.calculix import needs_ccx
from tests.test_statics_modes import hold
from tests.zoo import grid


def up(surface: Surface) -> np.ndarray:
    """(n, 3) the normals of vertices, upwards."""
    found = np.zeros((surface.n, 3))
    for corner in surface.F.T:
        np.add.at(found, corner, surface.normals * np.sign(surface.normals[:, 2:]))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def pressed(surface, fixed, force, clamped) -> LoadCase:
    """Clamped at edges between marked vertices."""
    edges = clamped[surface.edges.ends].all(axis=1) & surface.edges.boundary
    return LoadCase(fixed, force, np.zeros(surface.n, dtype=bool), clamped=edges)


def toggle(cells=24) -> tuple[Surface, LoadCase]:
    """Two straight bars of .753 x .243 in between fixed ends, 25.886 in apart, their joint .386 in above; a pound
    presses on it [Williams 1964]."""
    flat = grid(cells, 1, 2 * 12.943, 0.753)
    x = flat.V[:, 0]
    height = 0.386 * (1 - np.abs(x / 12.943 - 1))
    s = Surface(np.stack([x, flat.V[:, 1], height], axis=1), flat.F)
    ends, top = (x < 1e-9) | (x > 25.885999), np.abs(x - 12.943) < 1e-9
    force = top[:, None] * np.array([0, 0, -1.0]) / top.sum()
    return s, pressed(s, hold(s, (ends, "xyz")), force, ends)


def column(cells=24) -> tuple[Surface, LoadCase]:
    """A strip of 1 x .1 m, 10 mm thick, clamped at one end and pressed at the other by a newton."""
    s = grid(cells, 1, 1.0, 0.1)
    root, tip = s.V[:, 0] < 1e-9, s.V[:, 0] > 1 - 1e-9
    force = tip[:, None] * np.array([-1.0, 0, 0]) / tip.sum()
    return s, pressed(s, hold(s, (root, "xyz")), force, root)


def checked(given, thickness, material, imperfection, case="load"):
    s, load = given
    model = solid_model(s, up(s), thickness, material, load)
    return solid_check(model, case, imperfection, 120.0, lambda *words: None)


@needs_ccx
def test_a_column_buckles_at_its_euler_load():
    """pi^2 E I / (2 L)^2; with an imperfection of a 300th it moves far before, and no more load can be had."""
    found = checked(column(), 0.01, Material(210e9, 0.0), 1 / 300)
    euler = pi**2 * 210e9 * 0.1 * 0.01**3 / 12 / 4
    assert found.linear == pytest.approx(euler, rel=5e-3)
    assert found.given_way
    assert 0.88 < found.limit / found.linear <= 1.02
    assert found.triangles == 48


@needs_ccx
def test_a_toggle_snaps_through_far_below_its_buckling_load():
    """34 pounds [Williams 1964; Wood and Zienkiewicz 1977: 33.8 to 34.1], half of what linear theory says."""
    found = checked(toggle(), 0.243, Material(10.3e6, 0.0), 1e-6)
    assert found.limit == pytest.approx(34.0, rel=0.04)
    assert found.given_way
    assert found.linear > 1.5 * found.limit
    assert found.told.startswith("load: gives way at ")
