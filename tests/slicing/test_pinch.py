"""Pinches: material that meets in one point is joined or split, and everything else stays as it was."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsfab.core.errors import PatternError
from dsfab.slicing import Sheet, cut, resolve_pinches
from dsfab.slicing.finishing import point_contacts
from dsfab.surface import Surface
from dsfab.surface.topology import pieces, pinches
from tests.shapes import ZOO, grid, jittered, sphere, zoo
from tests.slicing.laws import check_laws, material_area

both_rules = pytest.mark.parametrize("rule", ["join", "split"])


def pinch_count(sheet: Sheet) -> int:
    kept = sheet.subset().surface
    return len(pinches(kept.F, kept.edges, kept.n))


def boundary_degree(sheet: Sheet) -> int:
    """Largest number of boundary edges of the material at one vertex: two on a sheet without pinches."""
    edges = sheet.subset().surface.edges
    return int(np.bincount(edges.ends[edges.boundary].ravel()).max(initial=0))


def checkerboard(cells: int = 4, per_cell: int = 4) -> tuple[Surface, Sheet]:
    """Material where sin x sin y > 0, as the second of two fields; the corners of all squares are vertices."""
    plate = grid(cells * per_cell, cells * per_cell, 1.0, 1.0)
    x, y = np.pi * cells * plate.V[:, :2].T
    value = np.sin(x) * np.sin(y)
    value[np.abs(value) < 1e-9] = 0
    return plate, cut(plate, [plate.V[:, 0], value], [[], [0.0]], snap=0)


def noisy(surface: Surface, seed: int = 0) -> Sheet:
    """Material by signs at random vertices, many of them exactly on the level."""
    value = np.random.default_rng(seed).choice([-1.0, 0.0, 1.0], size=surface.n)
    return cut(surface, [value], [[0.0]], snap=0)


@both_rules
def test_checkerboard_is_joined_or_split_at_its_inner_corners(rule):
    plate, sheet = checkerboard()
    inner = 9
    assert pinch_count(sheet) == inner
    assert boundary_degree(sheet) == 4
    radius = 0.4 / 16
    done = resolve_pinches(sheet, radius, rule)
    assert done.pinches == inner
    assert pinch_count(done.sheet) == 0
    assert boundary_degree(done.sheet) == 2
    gain = material_area(done.sheet) - material_area(sheet)
    # half of each disc changes, and a disc is a polygon of eight or four corners in a circle
    change = abs(gain) / (inner * 0.5 * np.pi * radius**2)
    assert 2 / np.pi < change < 1
    assert np.sign(gain) == (1 if rule == "join" else -1)
    assert set(done.sheet.family.tolist()) == {-1, 1}
    kept = done.sheet.subset().surface
    assert pieces(kept.F, kept.edges)[0] == (1 if rule == "join" else 8)
    check_laws(plate, done.sheet)


@both_rules
def test_pinch_on_the_boundary_counts(rule):
    """Two wedges of material that meet in the middle of an edge of the plate."""
    plate = grid(6, 6, 1.0, 1.0)
    value = np.round(12 * (np.abs(plate.V[:, 0] - 0.5) - plate.V[:, 1]))
    sheet = cut(plate, [value], [[0.0]], snap=0)
    kept = sheet.subset().surface
    (at,) = pinches(kept.F, kept.edges, kept.n)
    assert kept.V[at] == pytest.approx([0.5, 0, 0])
    done = resolve_pinches(sheet, 0.05, rule)
    assert (done.pinches, pinch_count(done.sheet)) == (1, 0)
    gain = material_area(done.sheet) - material_area(sheet)
    assert 0 < gain * (1 if rule == "join" else -1) < np.pi * 0.05**2 / 2
    check_laws(plate, done.sheet)


@zoo
@both_rules
@pytest.mark.parametrize("share", [0.02, 0.4, 1.5])
def test_no_pinch_is_left_on_any_surface(name, rule, share):
    """Radii far under, near and over the edge length."""
    surface = ZOO[name]()
    sheet = noisy(surface)
    count, radius = pinch_count(sheet), share * surface.mean_edge
    assert count > 0
    done = resolve_pinches(sheet, radius, rule)
    assert pinch_count(done.sheet) == 0
    assert boundary_degree(done.sheet) == 2
    assert done.pinches > count / 2  # a disc may swallow a neighbour
    # the snap of the rim may widen a disc by a tenth of an edge
    gain = material_area(done.sheet) - material_area(sheet)
    assert abs(gain) <= done.pinches * np.pi * (radius + 0.1 * surface.mean_edge * (share > 0.1)) ** 2
    check_laws(surface, done.sheet)


def two_families(seed: int) -> tuple[Surface, Sheet]:
    """Two random fields with many values on levels."""
    surface = jittered(grid(7, 7, 1.0, 1.0), seed=seed % 3)
    rng = np.random.default_rng(seed)
    fields = [np.round(2 * rng.normal(size=surface.n)) / 2 for _ in range(2)]
    return surface, cut(surface, fields, [[-1.0, 0.0, 0.5], [0.5, 0.75]], snap=0.1)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.floats(0.01, 0.8), st.sampled_from(["join", "split"]))
def test_no_pinch_is_left_on_random_sheets(seed, share, rule):
    surface, sheet = two_families(seed)
    done = resolve_pinches(sheet, share * surface.mean_edge, rule)
    assert pinch_count(done.sheet) == 0
    check_laws(surface, done.sheet)


@pytest.mark.parametrize(("seed", "share"), [(60, 0.6), (83, 0.6), (122, 0.3)])
def test_corner_cuts_remove_the_pinches_that_discs_leave(seed, share, monkeypatch):
    """Sheets on which three rounds of discs keep making a new pinch."""
    surface, sheet = two_families(seed)
    done = resolve_pinches(sheet, share * surface.mean_edge, "split")
    assert pinch_count(done.sheet) == 0
    check_laws(surface, done.sheet)
    monkeypatch.setattr(point_contacts, "CORNER_ROUNDS", 0)
    with pytest.raises(PatternError, match="still meets in a single point at 1 vertex"):
        resolve_pinches(sheet, share * surface.mean_edge, "split")


def test_disc_that_swallows_a_neighbour_counts_once():
    surface = ZOO["obtuse"]()
    sheet = noisy(surface)
    kept = sheet.subset().surface
    at = kept.V[pinches(kept.F, kept.edges, kept.n)]
    apart = np.linalg.norm(at[:, None] - at, axis=2)
    radius = 1.5 * surface.mean_edge
    assert (apart[apart > 0] < radius).any()
    assert resolve_pinches(sheet, radius, "join").pinches < len(at)


@both_rules
def test_corner_cuts_alone_need_one_round(rule, monkeypatch):
    """A corner cut makes no new pinch, whatever the radius; it reaches 0.4 of an edge at most."""
    monkeypatch.setattr(point_contacts, "DISC_ROUNDS", 0)
    monkeypatch.setattr(point_contacts, "CORNER_ROUNDS", 1)
    for surface in (sphere(3), jittered(grid(9, 9, 1.0, 1.0))):
        sheet = noisy(surface, seed=1)
        for radius in (0.05 * surface.mean_edge, 10 * surface.mean_edge):
            done = resolve_pinches(sheet, radius, rule)
            assert 0.5 * pinch_count(sheet) < done.pinches <= pinch_count(sheet)  # a cut may cure its neighbour too
            assert pinch_count(done.sheet) == 0
            check_laws(surface, done.sheet)
            added = done.sheet.surface.V[sheet.surface.n :]
            at = np.flatnonzero(sheet.weights.tocsc().sum(axis=1))
            nearest = np.linalg.norm(added[:, None] - sheet.surface.V[at], axis=2).min(axis=1)
            assert nearest.max() <= min(
                radius,
                0.4
                * np.linalg.norm(
                    surface.V[surface.edges.ends[:, 0]] - surface.V[surface.edges.ends[:, 1]], axis=1
                ).max(),
            ) * (1 + 1e-9)


def test_disc_leaves_another_layer_alone():
    """Two plates closer than the radius: the pinch of one must not fill the void of the other."""
    one = grid(6, 6, 1.0, 1.0)
    surface = Surface(np.concatenate([one.V, one.V + np.array([0, 0, 0.01])]), np.concatenate([one.F, one.F + one.n]))
    value = (one.V[:, 0] - 0.5) * (one.V[:, 1] - 0.5)
    sheet = cut(surface, [np.concatenate([np.round(value, 12), -1 + 0 * value])], [[0.0]], snap=0)
    assert pinch_count(sheet) == 1
    done = resolve_pinches(sheet, 0.1, "join")
    assert material_area(done.sheet) > material_area(sheet)
    assert done.sheet.subset().surface.V[:, 2].max() == 0


def test_joined_cells_belong_to_the_material_at_their_pinch():
    """Two pinches, one of each family."""
    plate = grid(8, 4, 2.0, 1.0)
    x, y = plate.V[:, 0], plate.V[:, 1] - 0.5
    left = np.where(x < 1, np.round((x - 0.5) * y, 12), -1)
    right = np.where(x > 1, np.round((x - 1.5) * y, 12), -1)
    sheet = cut(plate, [left, right], [[0.0], [0.0]], snap=0)
    done = resolve_pinches(sheet, 0.1, "join")
    assert done.pinches >= 2
    centre, family = done.sheet.surface.centroids, done.sheet.family
    for k, middle in enumerate([(0.5, 0.5), (1.5, 0.5)]):
        near = np.linalg.norm(centre[:, :2] - middle, axis=1) < 0.08
        assert near.sum() >= 4
        assert (family[near] == k).all()


def test_sheet_without_pinches_comes_back_itself():
    surface = sphere(2)
    sheet = cut(surface, [surface.V[:, 2]], [[-0.3, 0.3]])
    done = resolve_pinches(sheet, 0.1)
    assert done.sheet is sheet
    assert done.pinches == 0


def test_surface_that_touches_itself_can_be_split_but_not_joined():
    bow_tie = Surface([[0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, -1, 0]], [[0, 1, 2], [0, 3, 4]])
    sheet = cut(bow_tie, [np.zeros(5)], [[-1.0]])
    assert pinch_count(sheet) == 1
    with pytest.raises(PatternError, match=r"single point at 1 vertex \(first: 0\); change slicing.pinch"):
        resolve_pinches(sheet, 0.2, "join")
    done = resolve_pinches(sheet, 0.2, "split")
    assert pinch_count(done.sheet) == 0
    assert material_area(done.sheet) < material_area(sheet)


def test_impossible_requests_are_refused():
    plate, sheet = checkerboard()
    for radius in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(PatternError, match="positive length"):
            resolve_pinches(sheet, radius)
    with pytest.raises(PatternError, match="'join' or 'split'"):
        resolve_pinches(sheet, 0.1, "weld")
    with pytest.raises(PatternError, match="lower the threshold or raise the frequency"):
        resolve_pinches(cut(plate, [plate.V[:, 0]], [[]]), 0.1)
    with pytest.raises(PatternError, match="no material is left"):
        resolve_pinches(sheet, 5.0, "split")
