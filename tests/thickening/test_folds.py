"""Small folds of a sheet are smoothed, offsets that do not see their faces too, and both are told."""

import numpy as np

from dsfab.surface import Surface
from dsfab.thickening.repair import flatten_contacts, unfold
from dsfab.thickening.self_intersection import intersecting_pairs
from dsfab.thickening.skin import Skin
from tests.shapes import grid
from tests.thickening.thick_solids import check_sound, made

CELL = 1 / 12


def folded_plate() -> Surface:
    """A plate of 12 by 12 cells, one vertex pulled through the cell beyond the next one and down under it."""
    V = grid(12, 12, 1.0, 1.0).V.copy()
    at = np.linalg.norm(V - [0.5, 0.5, 0], axis=1).argmin()
    over = np.linalg.norm(V - [0.5 + CELL, 0.5, 0], axis=1).argmin()
    V[at] += [1.6 * CELL, 0.1 * CELL, -0.3 * CELL]
    V[over, 2] -= 0.5 * CELL
    return Surface(V, grid(12, 12, 1.0, 1.0).F)


def test_a_fold_smaller_than_the_thickness_is_smoothed_with_a_note():
    plate = folded_plate()
    assert len(intersecting_pairs(plate.V, plate.F)) > 0
    solid = made(plate, 0.25)
    check_sound(solid)
    assert solid.repairs.pairs == 0
    assert solid.repairs.rung == "thinned"
    assert 0 < solid.repairs.moved < 12
    assert 0 < solid.repairs.moved_by < 3 * CELL
    assert any("the sheet had folds smaller than its thickness" in note for note in solid.notes)


def test_a_fold_larger_than_the_thickness_is_left_for_the_union():
    plate = folded_plate()
    sheet = unfold(plate, np.tile([0, 0, 0.01], (plate.n, 1)))
    assert sheet.V is plate.V
    assert len(sheet.crossing) == len(intersecting_pairs(plate.V, plate.F))


def test_an_offset_that_sees_a_face_from_behind_is_turned_with_its_vertex():
    plate = grid(6, 6, 1.0, 1.0)
    D = np.tile([0, 0, 0.05], (plate.n, 1))
    at = np.linalg.norm(plate.V - [0.5, 0.5, 0], axis=1).argmin()
    D[at] = [0.02, 0.02, -0.04]
    skin = Skin.from_surface(plate)
    backslash = skin.shorter_diagonals(plate.V, D)
    pairs = intersecting_pairs(skin.vertices(plate.V, D), skin.faces(backslash))
    assert len(pairs) > 0
    V, after, left = flatten_contacts(plate, skin, D, backslash, pairs)
    assert len(left) == 0
    assert len(intersecting_pairs(skin.vertices(V, after), skin.faces(backslash))) == 0
    assert after[at, 2] > 0
    assert np.linalg.norm(after, axis=1).min() > 0.1 * 0.05
    assert np.abs(V - plate.V).max() < 0.1
