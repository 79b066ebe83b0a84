"""Remeshing: even triangles on the same surface; boundaries, creases, corners, plan and topology stay."""

import numpy as np
import pytest

import dsfab
from dsfab.errors import DsfabError, SurfaceError
from dsfab.surface import Surface, refined, remeshed
from dsfab.surface.creases import feature_edges
from dsfab.surface.nearest import nearest
from dsfab.surface.topology import euler_characteristic, manifold_faults, pieces
from tests.canopy import canopy
from tests.zoo import ZOO, grid, jittered, sphere, zoo


def smallest_angle(surface: Surface) -> float:
    """Degrees."""
    P = surface.V[surface.F]
    u, v = np.roll(P, -1, axis=1) - P, np.roll(P, 1, axis=1) - P
    angles = np.arctan2(np.linalg.norm(np.cross(u, v), axis=2), np.einsum("mci,mci->mc", u, v))
    return float(np.degrees(angles.min()))


def samples(surface: Surface, edges: np.ndarray, count: int = 9) -> np.ndarray:
    """(k, 3) points along marked edges."""
    t = np.linspace(0, 1, count)[:, None, None]
    a, b = surface.V[surface.edges.ends[edges]].transpose(1, 0, 2)
    return ((1 - t) * a + t * b).reshape(-1, 3)


def farthest(points: np.ndarray, surface: Surface, edges: np.ndarray) -> float:
    """The largest distance of points from marked edges, metres; 0 of no points."""
    if not len(points):
        return 0.0
    return float(nearest(points, surface.V, surface.edges.ends[edges]).distance.max())


def check_kept(old: Surface, new: Surface, edge: float, tolerance: float = 0.02) -> None:
    """Boundaries both ways, creases, vertices on the surface, extent, topology and sides."""
    assert farthest(samples(old, old.edges.boundary), new, new.edges.boundary) <= tolerance * edge
    assert farthest(samples(new, new.edges.boundary), old, old.edges.boundary) <= tolerance * edge
    inner = feature_edges(old) & ~old.edges.boundary
    every = np.ones(len(new.edges.ends), dtype=bool)
    assert farthest(samples(old, inner), new, every) <= tolerance * edge
    assert nearest(new.V, old.V, old.F).distance.max() <= 1e-9 * old.size
    assert new.V.min(axis=0) == pytest.approx(old.V.min(axis=0), abs=1e-12 * old.size)
    assert new.V.max(axis=0) == pytest.approx(old.V.max(axis=0), abs=1e-12 * old.size)
    assert euler_characteristic(new.F, new.edges) == euler_characteristic(old.F, old.edges)
    assert pieces(new.F, new.edges)[0] == pieces(old.F, old.edges)[0]
    assert len(new.loops) == len(old.loops)
    assert len(manifold_faults(new.F, new.edges, new.n)) == len(manifold_faults(old.F, old.edges, old.n))


def folded(angle: float = 90.0, cells: int = 8) -> Surface:
    """Two squares of 1 m that meet at an angle."""
    flat = jittered(grid(2 * cells, cells, 2.0, 1.0), 0.0)
    x, y, _ = flat.V.T
    turn, over = np.radians(180 - angle), np.maximum(x - 1, 0)
    return Surface(np.c_[np.minimum(x, 1) + over * np.cos(turn), y, over * np.sin(turn)], flat.F)


def annulus(around: int = 64, across: int = 10) -> Surface:
    """A flat ring between radii 1 and 2."""
    flat = grid(around, across, 2 * np.pi, 1.0)
    angle, r = flat.V[:, 0], 1 + flat.V[:, 1]
    V = np.round(np.c_[r * np.cos(angle), r * np.sin(angle), 0 * r], 12)
    points, of = np.unique(V, axis=0, return_inverse=True)
    return Surface(points, of.reshape(-1)[flat.F])


# --- closed forms


@pytest.mark.parametrize("edge", [0.4, 0.13, 0.03])
def test_a_plate_keeps_its_area_and_its_plane(edge):
    plate = jittered(grid(12, 12, 1.0, 1.0))
    new = remeshed(plate, edge)
    assert new.area == pytest.approx(1, abs=1e-12)
    assert np.abs(new.V[:, 2]).max() <= 1e-15
    assert (new.normals[:, 2] > 0.999).all()
    assert smallest_angle(new) > 25
    assert new.mean_edge == pytest.approx(edge, rel=0.15)
    check_kept(plate, new, edge)


@pytest.mark.parametrize("edge", [0.3, 0.05])
def test_a_folded_plate_keeps_its_crease(edge):
    plate = folded()
    new = remeshed(plate, edge)
    assert new.area == pytest.approx(2, abs=1e-12)
    crease = feature_edges(new) & ~new.edges.boundary
    assert new.edge_lengths[crease].sum() == pytest.approx(1, abs=1e-12)
    assert np.abs(samples(new, crease)[:, [0, 2]] - [1, 0]).max() < 1e-12
    assert smallest_angle(new) > 25
    check_kept(plate, new, edge)


def test_a_ring_keeps_its_two_loops_and_shrinks_by_its_chords_alone():
    ring, edge = annulus(), 0.15
    new = remeshed(ring, edge)
    assert len(new.loops) == 2
    assert new.area == pytest.approx(ring.area, rel=0.01)
    check_kept(ring, new, edge)


def test_a_smooth_sphere_is_rounder_than_its_facets():
    """Radius and area are those of the sphere through the vertices: 9 and 10 times nearer than on facets."""
    ball, edge = sphere(3), 0.06
    flat, smooth = remeshed(ball, edge), remeshed(ball, edge, smooth=True)
    off = [np.abs(np.linalg.norm(s.V, axis=1) - 1).max() for s in (flat, smooth)]
    assert off[1] < off[0] / 9
    assert off[1] < 0.0016
    assert 4 * np.pi - smooth.area < (4 * np.pi - flat.area) / 7


# --- laws over odd shapes


@zoo
@pytest.mark.parametrize("share", [2.0, 0.5])
def test_the_zoo_is_kept(name, share):
    old = ZOO[name]()
    edge = share * old.mean_edge
    new = remeshed(old, edge)
    check_kept(old, new, edge)
    assert smallest_angle(new) > 20 or name == "obtuse"  # whose corners are sharp


@pytest.mark.parametrize("smooth", [False, True])
def test_the_same_surface_gives_the_same_mesh(smooth):
    one, two = (remeshed(canopy(0.5), 0.4, 0.1, smooth) for _ in range(2))
    assert np.array_equal(one.V, two.V)
    assert np.array_equal(one.F, two.F)


# --- smooth refining


def test_smooth_refining_keeps_boundaries_and_creases():
    roof = canopy(0.5)
    finer = refined(roof, 0.2, smooth=True)
    assert np.ptp(finer.V, axis=0)[:2] == pytest.approx(np.ptp(roof.V, axis=0)[:2], abs=1e-12)
    assert farthest(samples(finer, finer.edges.boundary), roof, roof.edges.boundary) < 1e-12
    assert farthest(samples(roof, roof.edges.boundary), finer, finer.edges.boundary) < 1e-12
    sharp = refined(folded(), 0.05, smooth=True)
    assert sharp.area == pytest.approx(2, abs=1e-12)


# --- refusals


@pytest.mark.parametrize(
    ("edge", "finest", "says"),
    [
        (0.0, 0.0, "must be a positive length in metres"),
        (np.nan, 0.0, "must be a positive length in metres"),
        (0.1, 0.2, "the finest edge, 0.2 m, must lie between 0 and the edge, 0.1 m"),
        (9.0, 0.0, "edges of 9 m are longer than the surface, 3.46 m"),
        (1e-5, 0.0, "edges of 1e-05 m takes over 4,000,000 triangles"),
    ],
)
def test_impossible_lengths_are_refused(edge, finest, says):
    with pytest.raises(SurfaceError, match=says):
        remeshed(sphere(3), edge, finest)


def test_a_finest_edge_that_takes_too_many_triangles_is_refused(monkeypatch):
    monkeypatch.setattr("dsfab.surface.remesh.remeshing.LARGEST", 300)
    ball = Surface(0.1 * sphere(3).V, sphere(3).F)
    assert remeshed(ball, 0.1).m < 300
    with pytest.raises(SurfaceError, match=r"edges of 0\.01 m takes over 300 triangles on a surface 0\.346 m large"):
        remeshed(ball, 0.1, 0.01)


def test_what_is_no_sheet_is_refused():
    fan = Surface([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0]], [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    with pytest.raises(SurfaceError, match=r"1 edges have more than two faces \(first: 0-1\); split the surface there"):
        remeshed(fan, 0.4)
    twice = Surface(fan.V, [[0, 1, 2], [0, 2, 1]])
    with pytest.raises(SurfaceError, match=r"1 faces repeat an earlier face \(first: 1\); remove them"):
        remeshed(twice, 0.4)


# --- presets


def preset(**surface: object) -> dsfab.Preset:
    return dsfab.Preset(
        surface={"mesh": canopy(0.8), **surface},
        supports=[dsfab.Support(dsfab.Boundary())],
        loads=[dsfab.SelfWeight()],
        statics={"thickness": 0.05},
    )


def test_a_preset_remeshes_its_mesh_and_keeps_its_keys(tmp_path):
    made = preset(edge=0.5, finest=0.2, smooth=True)
    surface = made.surface.build()
    expected = remeshed(canopy(0.8), 0.5, 0.2, smooth=True)
    assert np.array_equal(surface.V, expected.V)
    assert np.array_equal(surface.F, expected.F)
    assert preset().surface.build().m == canopy(0.8).m
    dsfab.Design(made).surface  # noqa: B018
    dsfab.write(canopy(0.8), tmp_path / "roof.obj")
    text = dsfab.load_preset("roof", {"surface.edge": 0.5, "surface.unit": "mm"}, mesh=tmp_path / "roof.obj")
    assert text.surface.edge == 0.5
    assert text.surface.build().mean_edge == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"edge": 0.5, "refine": 0.2}, "surface: give either edge .* or refine .*, not both"),
        ({"finest": 0.2}, "surface: finest goes with edge"),
        ({"edge": 0.2, "finest": 0.5}, "surface: finest = 0.5 must not be longer than edge = 0.2"),
        ({"edge": -1}, "surface.edge = -1: should be greater than or equal to 0"),
    ],
)
def test_keys_that_do_not_go_together_are_refused(keys, says):
    with pytest.raises(DsfabError, match=says):
        preset(**keys)
