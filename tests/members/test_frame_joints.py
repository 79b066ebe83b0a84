"""What a beam model joins, divides and holds where no node of the members says so: stars, tapers, heads of columns."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dsfab.members import Member, MemberGraph
from dsfab.members.frame import BeamMaterial, Frame, frame_of, solve_frame
from dsfab.members.frame.beams import beams_along
from dsfab.members.frame.joints import AxisJoints, join_ends, joints_at_nodes
from dsfab.surface import LoadCase, Surface
from tests.members.axes import axis
from tests.shapes import grid, subsurface

CONCRETE = BeamMaterial(33e9, 0.2, 2500.0)
UP = [0, 0, 1]


def member(name: str, ends: tuple, cells, widths: tuple = (0.2, 0.2), stations: int = 21) -> Member:
    """A straight member from one end (2,) to the other, of widths there."""
    line = axis(np.linspace([*ends[0], 0], [*ends[1], 0], stations), UP)
    sides = np.linspace(*widths, stations)[:, None] / 2 * np.ones(2)
    return Member(name, "strip", "major", 0, 1, np.asarray(cells), 1.0, line, sides, ("free", "free"))


def graph(surface: Surface, *members: Member) -> MemberGraph:
    return MemberGraph(SimpleNamespace(surface=surface), np.arange(surface.m), members, ())


def groups(given: MemberGraph) -> int:
    """Into how many the members fall that nodes and links join."""
    joints = joints_at_nodes(given)
    join_ends(joints)
    number = {member.id: k for k, member in enumerate(joints.members_with_axis)}
    by_node = {node: number[name] for name, found in joints.on.items() for _, node in found}
    pairs = [(by_node[one], by_node[other]) for one, other, _ in joints.links]
    pairs += [(number[name], by_node[node]) for name, found in joints.on.items() for _, node in found]
    n = len(number)
    return connected_components(coo_array((np.ones(len(pairs)), np.array(pairs).reshape(-1, 2).T), shape=(n, n)))[0]


@pytest.mark.parametrize("knot", [0.0, 0.1])
def test_the_arms_of_a_star_are_connected_without_a_common_node(knot):
    """They end free beside each other, .07 m from the middle, or around a few faces that have no axis: the middle of
    the preset `slab`, at two sizes of triangles."""
    plate = grid(20, 20, 2.0, 2.0)
    x, y = (plate.centroids[:, :2] - 1).T
    star = subsurface(plate, np.minimum(abs(x), abs(y)) < 0.1)
    x, y = (star.centroids[:, :2] - 1).T
    within = np.maximum(abs(x), abs(y)) < knot
    arms = [replace(member("knot", ((0, 0), (1, 1)), np.flatnonzero(within)), axis=None)] if knot else []
    for name, ahead, beside, way in (
        ("E", x, y, (1, 0)),
        ("N", y, x, (0, 1)),
        ("W", -x, y, (-1, 0)),
        ("S", -y, x, (0, -1)),
    ):
        cells = (ahead > 0) & (abs(beside) < 0.1) & ((ahead >= abs(beside)) | (ahead > 0.1)) & ~within
        arms.append(member(name, (1 + 0.07 * np.array(way), 1 + np.array(way)), np.flatnonzero(cells)))
    assert groups(graph(star, *arms)) == 1


def test_ends_that_a_slit_parts_are_not_joined():
    """Though they are nearer to each other than they are wide."""
    plate = grid(10, 2, 1.0, 0.2)
    left, right = (np.flatnonzero(one) for one in (plate.centroids[:, 0] < 0.5, plate.centroids[:, 0] > 0.5))
    ends = ((0.0, 0.1), (0.45, 0.1)), ((0.55, 0.1), (1.0, 0.1))
    assert groups(graph(plate, member("A1", ends[0], left), member("A2", ends[1], right))) == 1
    torn = Surface(np.concatenate([plate.V, plate.V]), np.concatenate([plate.F[left], plate.F[right] + plate.n]))
    halves = np.arange(len(left)), len(left) + np.arange(len(right))
    assert groups(graph(torn, member("A1", ends[0], halves[0]), member("A2", ends[1], halves[1]))) == 2


def test_a_rib_that_tapers_is_as_stiff_as_its_widths():
    """A cantilever five times as wide where it is held: the integral of x^2 / EI along it."""
    plate, L, h = grid(20, 2, 2.0, 0.2), 2.0, 0.3
    load = LoadCase(plate.V[:, :1] + np.zeros(3) < 1e-9, np.zeros((plate.n, 3)), np.zeros(plate.n, dtype=bool))
    rib = member("A1", ((0.0, 0.1), (L, 0.1)), np.arange(plate.m), (0.5, 0.1))
    made = frame_of(graph(plate, rib), plate, {"tip": load}, {}, h, CONCRETE)
    foot, tip = made.points[:, 0].argmin(), made.points[:, 0].argmax()
    fixed, force = np.zeros((len(made.points), 6), dtype=bool), np.zeros((len(made.points), 6))
    fixed[foot], force[tip, 2] = True, -1e3
    found = solve_frame(Frame(**{**vars(made), "fixed": fixed, "loads": {"tip": force}}), shear=False)["tip"]
    x = np.linspace(0, L, 2001)  # from the tip
    expected = 1e3 * np.trapezoid(x**2 / (CONCRETE.young * (0.1 + 0.2 * x) * h**3 / 12), x)
    assert -found.u[tip, 2] == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(("held", "turns"), [((0.9, 1.1), False), ((0.9,), True)])
def test_no_node_turns_where_whole_faces_are_held(held, turns):
    """Of vertices in two rows those of one go to the end of one member, those of the other to that of the next."""
    plate = grid(11, 2, 2.2, 0.2)
    plate = Surface(plate.V - [0.1, 0, 0], plate.F)
    at = np.isclose(plate.V[:, :1], held).any(axis=1)
    load = LoadCase(
        at[:, None] & np.ones(3, dtype=bool), np.tile([0, 0, -1.0], (plate.n, 1)), np.zeros(plate.n, dtype=bool)
    )
    parts = (np.flatnonzero(one) for one in (plate.centroids[:, 0] < 1, plate.centroids[:, 0] > 1))
    spans = ((-0.1, 0.1), (0.95, 0.1)), ((1.05, 0.1), (2.1, 0.1))
    ribs = [member(f"A{k + 1}", ends, cells) for k, (ends, cells) in enumerate(zip(spans, parts, strict=True))]
    made = frame_of(graph(plate, *ribs), plate, {"load": load}, {}, 0.3, CONCRETE)
    fixed = made.fixed[made.fixed.any(axis=1)]
    assert len(fixed) == len(held)
    assert fixed[:, :3].all()
    assert fixed[:, 3:].any() != turns
    assert fixed[:, 3:].all() != turns


def one_rib(length: float = 2.0) -> AxisJoints:
    plate = grid(20, 2, length, 0.2)
    joints = joints_at_nodes(graph(plate, member("A1", ((0.0, 0.1), (length, 0.1)), np.arange(plate.m))))
    joints.ends["A1"] = 0.0, length
    return joints


def test_joints_on_an_axis_share_a_node_if_they_are_nearer_than_a_quarter_of_its_width():
    joints = one_rib()
    (rib,) = joints.members_with_axis
    first, near, beside = (joints.place(rib, 1 + share * 0.2, "joint") for share in (0.0, 0.22, 0.28))
    assert first == near != beside


@pytest.mark.parametrize(("share", "nodes"), [(0.7e-3, 2), (1.3e-3, 3)])
def test_a_bay_shorter_than_a_thousandth_of_the_width_is_no_beam(share, nodes):
    """The end of the member then counts as its last node; a beam of no length would have no stiffness."""
    joints = one_rib(0.19)
    (rib,) = joints.members_with_axis
    joints.on[rib.id].append((share * 0.2, joints.node(rib.axis.frames_at(np.array([share * 0.2]))[0][0], "node")))
    beams = beams_along(joints)
    assert len(np.unique(beams.ends)) == len(beams.ends) + 1 == nodes
