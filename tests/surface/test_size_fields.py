"""Edges that are shorter where a field changes: sizes in closed form, and meshes that follow the stress."""

import pickle

import numpy as np
import pytest

import dsfab
from dsfab.core.errors import DsfabError
from dsfab.design import regions_and_loads
from dsfab.surface import SizeField, Surface, change_sizes, remeshed_surface
from tests.canopy import canopy
from tests.shapes import grid, jittered, sphere

pytestmark = pytest.mark.slow

EDGE, FINEST = 0.4, 0.02


def tangent(surface: Surface, direction: np.ndarray) -> np.ndarray:
    """(m, 3, 3) stress along a direction (3,) or (m, 3), within each face, of size 1."""
    along = np.broadcast_to(direction, (surface.m, 3))
    along = along - surface.normals * np.einsum("mi,mi->m", along, surface.normals)[:, None]
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    return np.einsum("mi,mj->mij", along, along)


# --- sizes


def test_a_linear_field_has_one_size():
    plate = jittered(grid(40, 40, 1.0, 1.0), 0.0)
    field = (1 + 2 * plate.centroids[:, 0])[:, None, None] * np.diag([1.0, 0.0, 0.0])
    usual = np.sqrt((3**3 - 1) / 6)  # of 1 + 2 x on [0, 1]
    inside = ((plate.V[:, :2] > 0.1) & (plate.V[:, :2] < 0.9)).all(axis=1)
    sizes = change_sizes(plate, field, 10.0, 1e-6)[inside]
    assert sizes == pytest.approx(0.25 * usual / 2, rel=0.04)
    rough = jittered(grid(40, 40, 1.0, 1.0))
    field_there = (1 + 2 * rough.centroids[:, 0])[:, None, None] * np.diag([1.0, 0.0, 0.0])
    assert change_sizes(rough, field_there, 10.0, 1e-6)[inside] == pytest.approx(0.25 * usual / 2, rel=0.2)
    assert change_sizes(plate, -1e9 * field, 10.0, 1e-6)[inside] == pytest.approx(sizes, rel=1e-12)


def test_a_field_that_turns_with_the_surface_does_not_change():
    flat = grid(30, 20, 2 * np.pi * 0.7, 2.0)
    angle, z, _ = flat.V.T
    vault = Surface(np.c_[np.cos(angle), np.sin(angle), z], flat.F)
    hoops = tangent(vault, np.c_[-vault.centroids[:, 1], vault.centroids[:, 0], np.zeros(vault.m)])
    assert change_sizes(vault, hoops, EDGE, FINEST) == pytest.approx(EDGE)
    ball = sphere(3)
    even = np.eye(3) - np.einsum("mi,mj->mij", ball.normals, ball.normals)
    assert change_sizes(ball, even, EDGE, FINEST) == pytest.approx(EDGE)


def test_zero_stress_requests_no_refinement():
    plate = grid(5, 5, 1.0, 1.0)
    assert change_sizes(plate, np.zeros((plate.m, 3, 3)), EDGE, FINEST) == pytest.approx(EDGE)


def test_edges_follow_sizes_that_lie_on_another_mesh():
    plate, coarse = grid(30, 30, 4.0, 4.0), grid(8, 8, 4.0, 4.0)
    wanted = np.where(coarse.V[:, 0] < 1.5, 0.08, 0.3)
    new = remeshed_surface(plate, 0.3, sizes=[SizeField(coarse, wanted)])
    middle = new.V[new.edges.ends].mean(axis=1)[:, 0]
    assert new.edge_lengths[middle < 1].mean() == pytest.approx(0.08, rel=0.15)
    assert new.edge_lengths[middle > 3.2].mean() == pytest.approx(0.3, rel=0.15)
    two = remeshed_surface(plate, 0.3, sizes=[SizeField(coarse, wanted), SizeField(coarse, wanted[::-1])])
    middle = np.abs(two.V[two.edges.ends].mean(axis=1)[:, 0] - 2)
    assert two.edge_lengths[middle > 1].mean() == pytest.approx(0.08, rel=0.15)


# --- meshes


def quarter_plate_with_hole() -> Surface:
    """A quarter of a plate of 20 m with a hole of 1 m radius in its middle."""
    angle, out = np.meshgrid(np.linspace(0, np.pi / 2, 65), np.linspace(0, 1, 21) ** 2, indexing="ij")
    r = 1 + out * (10 / np.maximum(np.cos(angle), np.sin(angle)) - 1)
    V = np.stack([r * np.cos(angle), r * np.sin(angle), 0 * r], axis=-1).reshape(-1, 3)
    k = np.arange(65 * 21).reshape(65, 21)
    a, b, c, d = k[:-1, :-1].ravel(), k[1:, :-1].ravel(), k[1:, 1:].ravel(), k[:-1, 1:].ravel()
    return Surface(V, np.concatenate([np.stack([a, d, c], 1), np.stack([a, c, b], 1)]))


def pulled(thickness: float = 0.1, **surface: object) -> dsfab.Preset:
    """The plate pulled with 1 MPa at its right side."""
    return dsfab.Preset(
        surface={"mesh": quarter_plate_with_hole(), **surface},
        supports=[
            dsfab.Support(dsfab.Side("x", "min", 1e-3), hold="x"),
            dsfab.Support(dsfab.Side("y", "min", 1e-3), hold="y"),
            dsfab.Support(dsfab.All(), hold="z"),
        ],
        loads=[dsfab.Line(dsfab.Side("x", "max", 1e-3), (1e6 * thickness, 0, 0))],
        statics={"thickness": thickness},
    )


def largest_stress(preset: dsfab.Preset) -> tuple[int, float]:
    """Triangles, and the largest stress, MPa: three at the hole of a wide plate [Kirsch 1898]."""
    design = dsfab.Design.from_preset(preset)
    return design.surface.m, float(design.statics.answers.stress.largest.max()) / 1e6


def test_the_stress_at_a_hole_is_as_good_on_far_fewer_triangles():
    """Of three meshes each: where the vertices lie moves the largest of a face by a fiftieth."""
    few, by_stress = np.transpose(
        [largest_stress(pulled(edge=edge, finest=0.05, finest_at="stress")) for edge in (0.5, 0.6, 0.7)]
    )
    many, even = np.transpose([largest_stress(pulled(edge=edge)) for edge in (0.18, 0.2, 0.22)])
    assert (many > 5 * few).all()
    assert np.abs(by_stress - 3).mean() < min(np.abs(even - 3).mean(), 0.06)


def of_canopy(thickness: float = 0.05, finest: float = 0.1, **pattern: object) -> dsfab.Preset:
    return dsfab.Preset(
        surface={"mesh": canopy(0.3), "edge": 0.4, "finest": finest, "finest_at": "stress"},
        supports=[dsfab.Support(dsfab.Box((0, 0, 0), (1, 1, 0.02), relative=True, boundary=True))],
        loads=[dsfab.SelfWeight()],
        statics={"thickness": thickness},
        pattern=pattern,
    )


def test_feet_get_smaller_triangles_and_the_note_says_so():
    design = dsfab.Design.from_preset(of_canopy())
    surface, held = design.surface, design.statics.load.supported
    sizes = surface.edge_lengths
    at_feet = held[surface.edges.ends].any(axis=1)
    assert sizes[at_feet].mean() < 0.12 < 0.5 * np.quantile(sizes, 0.9)
    assert sizes.max() < 1.5 * 0.4
    assert any("with small triangles where the stress changes" in note.text for note in design.notes)


@pytest.mark.slow
def test_a_revised_thickness_makes_the_mesh_of_a_fresh_design():
    thin, thick = of_canopy(0.03), of_canopy(0.4)
    revised = dsfab.revise(dsfab.Design.from_preset(thin).until("statics"), thick).surface
    fresh = dsfab.Design.from_preset(thick).surface
    assert np.array_equal(revised.V, fresh.V)
    assert not np.array_equal(fresh.V, dsfab.Design.from_preset(thin).surface.V)
    assert thick.first_difference(thin) == "surface"


def test_voids_count_and_supports_are_found_again_in_another_process():
    oculus = {"do": "void", "at": dsfab.Ball((1.0, 5.0, 3.5), 1.2)}
    preset = of_canopy(finest=0.25, region=[oculus])
    surface = dsfab.Design.from_preset(preset).surface
    before = [np.flatnonzero(one.at.vertices(surface)) for one in regions_and_loads.acting_on(preset, surface).support]
    surface = pickle.loads(pickle.dumps(surface))  # without the results of this process
    after = [np.flatnonzero(one.at.vertices(surface)) for one in regions_and_loads.acting_on(preset, surface).support]
    assert all(len(a) and np.array_equal(a, b) for a, b in zip(before, after, strict=True))


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"edge": 0.5, "finest_at": "stress"}, "surface: finest_at = 'stress' needs the key finest"),
        ({"edge": 0.5, "finest": 0.1, "finest_at": "wind"}, r"surface\.finest_at = 'wind': .*'curvature', 'stress' or"),
    ],
)
def test_keys_that_do_not_go_together_are_refused(keys, says):
    with pytest.raises(DsfabError, match=says):
        pulled(**keys)
