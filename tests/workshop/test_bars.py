"""Bars between nodes: closed forms of their lengths and angles, and a structure put together from drawings alone."""

import csv
import io
from collections import deque
from dataclasses import replace
from functools import cache

import ezdxf
import numpy as np
import pytest
from scipy.optimize import brentq

from dsfab.app.cli import main
from dsfab.core.errors import PatternError
from dsfab.core.messages import length
from dsfab.design import Design
from dsfab.export import flat_dxf
from dsfab.members import member_graph
from dsfab.preset.file import load_preset, with_overrides
from dsfab.workshop import Layering, workshop_plan
from dsfab.workshop.bars import BAR_CLEARANCE, BarStock, bar_plan
from dsfab.workshop.bars.cutting import bar_part, mitre_length
from dsfab.workshop.bars.joints import BarEnd, Footing, LatticeBar, bar_lattice, leg_lines, leg_plates
from dsfab.workshop.bars.lattice import Bay, member_lattice
from dsfab.workshop.files import bar_rows, part_drawing, table_csv
from dsfab.workshop.parts import half_plane_clip, polygon_area
from dsfab.workshop.plan import construction_route, design_bars
from dsfab.workshop.planks.slots import PlankCrossings
from dsfab.workshop.strips import strip_limits
from tests.analytic import SURFACES
from tests.designs import sliced

STOCK = BarStock(bar=0.04, plate=0.005, bolt=0.01, letters=0.02)
RADIUS = {"sphere": 6.5, "cylinder": 4.45}


@cache
def graph_of(name, edge=0.2):
    given = SURFACES[name](edge)
    return member_graph(given.surface, given.sheet(), given.pattern)


@cache
def plan_of(name, edge=0.2):
    graph = graph_of(name, edge)
    return bar_plan(graph, np.tile([0.0, 0.0, 1.0], (graph.sheet.surface.n, 1)), STOCK)


def whole(name, edge=0.2):
    """Bars between two crossings, with their nodes in space, each with the family of its member."""
    graph = graph_of(name, edge)
    found = bar_lattice(graph, member_lattice(graph, STOCK.bolt), STOCK.bar, STOCK.bolt)
    nodes = {node.id: node for node in graph.nodes}
    for bar in found.bars:
        ends = [found.lattice.nodes[end.node] for end in bar.ends]
        if all(end.joined and nodes[end.id].kind == "crossing" for end in ends):
            yield bar, ends, graph.by_id[bar.bay.member].family


# --- closed forms


def sphere_errors(edge):
    """The largest errors of lengths, metres, dips and twists, degrees, between crossings of a sphere."""
    R, lengths, dips, twists = RADIUS["sphere"], [], [], []
    for bar, (one, _), family in whole("sphere", edge):
        t = np.arccos(one.point[2] / R)
        chord = 2 * R * np.sin(0.05) if family == "minor" else 2 * R * np.sin(t) * np.sin(0.08)
        dip = np.arcsin(chord / 2 / R)
        if bar.ends[0].root == pytest.approx(bar.ends[1].root, abs=1e-4):
            lengths.append(bar.length - (chord - 2 * bar.ends[0].root * np.cos(dip)))
        dips += [end.dip - dip for end in bar.ends]
        twists.append(bar.twist)
    assert len(lengths) > 60
    return np.abs(lengths).max(), np.degrees(np.abs(dips).max()), np.degrees(np.abs(twists).max())


def test_bars_of_a_sphere_dip_by_half_of_their_angle_and_do_not_turn():
    """Planes of nodes are mirrored in the middle of a bar: sin dip = chord / 2R, length = chord - 2 e cos dip."""
    off, dip, twist = sphere_errors(0.2)
    assert off < 4e-3  # nodes are on a mesh with edges of .2
    assert dip < 0.25
    assert twist < 0.1


@pytest.mark.slow
def test_errors_of_bars_fall_with_the_edge():
    coarse, fine = sphere_errors(0.2), sphere_errors(0.1)
    assert fine[0] < 1e-3
    assert all(one < 0.5 * other for one, other in zip(fine, coarse, strict=True))


def test_bars_of_helices_turn_as_the_cylinder_says():
    """Between tangent planes 2 h apart, at an angle b to the axis: sin dip = sin b sin h, tan(twist / 2) = cos b tan h;
    b is that of the roots, which are e before the nodes."""
    R = RADIUS["cylinder"]
    h, high = 0.8 / np.sqrt(2) / R / 2, 0.8 / np.sqrt(2)
    signs = set()
    for bar, _, family in whole("cylinder"):
        e = bar.ends[0].root
        if abs(e - bar.ends[1].root) > 1e-3:
            continue

        def off(b, e=e):
            lean = np.sqrt(1 - (np.sin(b) * np.sin(h)) ** 2)
            across = 2 * R * np.sin(h) - 2 * e * np.sin(b) * np.cos(h) ** 2 / lean
            return across * np.cos(b) - (high - 2 * e * np.cos(b) / lean) * np.sin(b)

        b = brentq(off, 0.3, 1.3)
        dip, twist = np.arcsin(np.sin(b) * np.sin(h)), 2 * np.arctan(np.cos(b) * np.tan(h))
        assert [end.dip for end in bar.ends] == pytest.approx([dip, dip], abs=np.radians(0.3))
        assert abs(bar.twist) == pytest.approx(twist, abs=np.radians(0.2))
        signs.add((family, np.sign(bar.twist)))
    assert len(signs) == 2  # one family of helices is right-handed, the other is not


def test_bars_of_a_hypar_are_its_own_lines():
    """Lines of z = x y / c: no dip and no bow; they turn by the angle between the normals (-y, -x, c) of their ends."""
    c, found = 6.0, 0
    for bar, ends, _ in whole("hypar"):
        P = np.array([end.point for end in ends])
        N = np.stack([-P[:, 1], -P[:, 0], np.full(2, c)], axis=1)
        N /= np.linalg.norm(N, axis=1)[:, None]
        assert abs(bar.twist) == pytest.approx(np.arccos(N[0] @ N[1]), abs=np.radians(0.25))
        assert np.degrees([end.dip for end in bar.ends]) == pytest.approx([0, 0], abs=0.45)
        assert bar.sagitta < 3e-3
        assert bar.length == pytest.approx(np.linalg.norm(P[1] - P[0]) - sum(end.root for end in bar.ends), abs=1e-4)
        found += 1
    assert found > 100


# --- put together from drawings


def read(part):
    """Lines and circles of a drawing by layer, as ezdxf alone reads them, metres."""
    space = ezdxf.read(io.StringIO(flat_dxf(part_drawing(part)).decode())).modelspace()
    lines = {}
    for line in space.query("LWPOLYLINE"):
        lines.setdefault(line.dxf.layer, []).append(np.array([p[:2] for p in line.get_points()]) / 1000)
    return lines, np.array([tuple(one.dxf.center)[:2] for one in space.query("CIRCLE")]) / 1000


def arms_of(part):
    """(azimuth, where it is folded, its first hole) of each arm, counter-clockwise from the first one, by a drawing:
    its first circle is the node, and holes beyond a fold are those of its arm."""
    lines, circles = read(part)
    middle, holes = circles[0], circles[1:] - circles[0]
    found = []
    for fold in lines["FOLD"]:
        way = fold.mean(axis=0) - middle
        far = np.linalg.norm(way)
        way = way / far
        mine = [hole for hole in holes if hole @ way > far and abs(way[0] * hole[1] - way[1] * hole[0]) < 1e-6]
        found.append((np.arctan2(way[1], way[0]), far, min(np.linalg.norm(hole) for hole in mine)))
    return [(azimuth - found[0][0], *rest) for azimuth, *rest in found]


def turned(x, axis, angle):
    return x * np.cos(angle) + np.cross(axis, x) * np.sin(angle) + axis * (axis @ x) * (1 - np.cos(angle))


class Kit:
    """Parts as drawings, and the list of bars: all that somebody has who puts them together."""

    def __init__(self, plan):
        self.parts = {part.id: part for part in plan.parts}
        text = table_csv(bar_rows(plan, {}))
        self.rows = [row for row in csv.DictReader(io.StringIO(text)) if {row["from"], row["to"]} <= set(self.parts)]
        self.arms = {name: arms_of(self.parts[name]) for row in self.rows for name in (row["from"], row["to"])}
        self.long = {}
        for row in self.rows:
            holes = read(self.parts[row["bar"]])[1]
            self.long[row["bar"]] = np.linalg.norm(holes[:, None] - holes, axis=2).max()

    def arm(self, row, side):
        azimuth = np.radians(float(row[f"{side}_along_deg"]))
        return min(self.arms[row[side]], key=lambda arm: abs(np.angle(np.exp(1j * (arm[0] - azimuth)))))

    def next_node(self, frame, row, side, other):
        """The place, first direction and normal of the node at the other end of a bar, from those at one end."""
        P, x, n = frame
        azimuth, far, hole = self.arm(row, side)
        dip, end_dip, twist = (
            np.radians(float(row[key])) for key in (f"{side}_dip_deg", f"{other}_dip_deg", "twist_deg")
        )
        u = turned(x, n, azimuth)
        d, m = np.cos(dip) * u - np.sin(dip) * n, np.cos(dip) * n + np.sin(dip) * u
        first = P - STOCK.lever * n + far * u + (hole - far) * d + STOCK.lever * m
        last = first + self.long[row["bar"]] * d
        m = turned(m, d, twist)
        azimuth, far, hole = self.arm(row, other)
        n = np.cos(end_dip) * m + np.sin(end_dip) * d
        u = (-d + np.sin(end_dip) * n) / np.cos(end_dip)
        place = last - STOCK.lever * m + (hole - far) * d - far * u + STOCK.lever * n
        return place, turned(u, n, -azimuth), n


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sphere", "hypar"])
def test_bars_and_plates_assembled_from_drawings_meet_at_the_designed_nodes(name):
    """From one node on, bar by bar, by plates and bars as DXF and by bars.csv alone; folds, dips and twists count."""
    plan = plan_of(name, 0.3)
    kit, joints = Kit(plan), {joint.node.id: joint for joint in plan.bar_lattice.joints}
    start = joints[kit.rows[len(kit.rows) // 2]["from"]]
    k, side = start.bars[0]
    n, d = start.node.normal, plan.bar_lattice.bars[k].direction * (1 - 2 * side)
    x = d - (d @ n) * n
    placed = {start.node.id: (start.node.point, x / np.linalg.norm(x), n)}
    queue, closed = deque(placed), []
    while queue:
        here = queue.popleft()
        for row, side, other in [(row, *way) for row in kit.rows for way in (("from", "to"), ("to", "from"))]:
            if row[side] == here:
                found = kit.next_node(placed[here], row, side, other)
                if row[other] not in placed:
                    placed[row[other]] = found
                    queue.append(row[other])
                closed.append(np.linalg.norm(found[0] - placed[row[other]][0]))
    assert set(placed) == {one for one, joint in joints.items() if joint.node.joined}
    assert max(np.linalg.norm(P - joints[one].node.point) for one, (P, _, _) in placed.items()) < 1e-4
    assert len(closed) > len(placed)
    assert max(closed) < 1e-4  # a way around a mesh ends where it began


# --- parts


def test_a_half_plane_cuts_a_square():
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    kept = half_plane_clip(square, np.array([1.0, 1.0]), 0.5)
    assert sorted(map(tuple, kept.round(9).tolist())) == [(0.0, 0.0), (0.0, 0.5), (0.5, 0.0)]
    assert len(half_plane_clip(square, np.array([1.0, 0.0]), -1.0)) == 0


def test_a_corner_is_cut_along_the_plane_between_two_bars():
    """In one plane, at an angle g: half a clearance beside the line at g / 2, that begins e before the bar."""
    g, e, half = np.radians(40), 0.1, 0.06
    ends = BarEnd(0, 0.0, 0.0, np.pi, g, e), BarEnd(1, 0.0, 0.0, np.pi, np.pi, e)
    up = np.tile([0.0, 0.0, 1.0], (2, 1))
    bay = Bay("A1.1", "A1", (0, 1), (0.0, 1.2), 2 * half)
    bar = LatticeBar(bay, ends, np.array([[0.0, 0, 0], [1.0, 0, 0]]), up, 0.0)
    part, clear = bar_part(bar, ("N1", "N2"), STOCK), BAR_CLEARANCE * STOCK.bolt
    corners = part.outline - part.holes[0].at + [STOCK.bolt_stations(bar)[0][0], 0.0]
    reach = (half * np.cos(g / 2) + clear / 2) / np.sin(g / 2) - e
    wanted = [(clear, -half), (1 - clear, -half), (1 - clear, half), (reach, half)]
    assert len(corners) == 5
    for corner in wanted:
        assert np.linalg.norm(corners - corner, axis=1).min() < 1e-9
    assert [mitre_length(bar, end, STOCK) for end in ends] == pytest.approx([reach, 0.0])
    near = replace(bar, ends=(replace(ends[0], after=np.radians(5)), ends[1]))
    assert mitre_length(near, near.ends[0], STOCK) == bar.length


def test_the_sharpest_angle_has_a_place_and_bars_that_lose_a_side_are_named():
    """Of a ball with doors an angle of 7 degrees was told, and not of which of 1,193 bars."""
    plan = plan_of("sphere")
    joint = next(joint for joint in plan.bar_lattice.joints if len(joint.bars) == 4)
    (k, side), (other, beside) = joint.bars[:2]
    bars = list(plan.bar_lattice.bars)
    ends = [list(bars[k].ends), list(bars[other].ends)]
    ends[0][side] = replace(ends[0][side], after=np.radians(7))
    ends[1][beside] = replace(ends[1][beside], before=np.radians(7))
    bars[k], bars[other] = replace(bars[k], ends=tuple(ends[0])), replace(bars[other], ends=tuple(ends[1]))
    names = bars[k].bay.id, bars[other].bay.id
    told = replace(plan, bar_lattice=replace(plan.bar_lattice, bars=tuple(bars))).lines
    (angle,) = (line for line in told if "smallest angle" in line)
    assert angle.endswith(f"is 7 degrees, between {names[0]} and {names[1]} at {joint.node.id}")
    (lost,) = (line for line in told if "lose more than half of one side" in line)
    assert lost.startswith("2 bars lose")
    assert all(name in lost for name in names)
    assert not any("half of one side" in line for line in plan.lines)


@pytest.mark.parametrize("name", ["cylinder", pytest.param("sphere", marks=pytest.mark.slow)])
def test_bars_of_a_node_are_apart_and_bolts_pass_bar_and_plate(name):
    """In space: the plane between two bars that stands on the plate has all of each bar on its side."""
    plan = plan_of(name)
    parts, least = {part.id: part for part in plan.parts}, []
    for joint in plan.bar_lattice.joints:
        for k, side in joint.bars:
            bar = plan.bar_lattice.bars[k]
            end, part, n = bar.ends[side], parts[bar.bay.id], joint.node.normal
            d = bar.direction * (1 - 2 * side)
            m, u = bar.normals[side], (d - (d @ n) * n) / np.linalg.norm(d - (d @ n) * n)
            hole = part.holes[0 if side == 0 else -1].at
            way = (part.axis[1] - part.axis[0]) / np.linalg.norm(part.axis[1] - part.axis[0]) * (1 - 2 * side)
            off = part.outline - hole
            r = off @ way + STOCK.bolt_stations(bar)[0][0]
            y = off @ np.array([-way[1], way[0]])
            for z in (-STOCK.bar / 2, STOCK.bar / 2):
                V = bar.points[side] - joint.node.point + r[:, None] * d + y[:, None] * np.cross(m, d) + z * m
                V = V[r < bar.length / 2]
                for gap, way_in in ((end.after, 1), (end.before, -1)):
                    if gap < np.pi:
                        wall = turned(u, n, way_in * gap / 2)
                        least.append(
                            -way_in * (V @ np.cross(n, wall)).max() if way_in > 0 else (V @ np.cross(n, wall)).min()
                        )
        if joint.node.joined:
            drilled = [hole.bolt for k, _ in joint.bars for hole in parts[plan.bar_lattice.bars[k].bay.id].holes]
            assert drilled.count(joint.node.id) == len(parts[joint.node.id].holes) - 1
    assert min(least) > 0.9 * 0.25 * STOCK.bolt / 2


def test_members_too_near_to_each_other_for_bars_are_refused_in_a_sentence():
    graph = graph_of("hypar")
    with pytest.raises(
        PatternError,
        match=r"bays \(parts of members between nodes\) are too short for a bar with a "
        r"bolt of 60 mm .* workshop.route",
    ):
        member_lattice(graph, 0.06)


# --- routes and files


@pytest.fixture(scope="module")
def vault():
    """Too shallow for planks."""
    changes = {"surface.edge": 0.3, "statics.material": "GL24h", "workshop.stock": [[5.0, 1.25]], "workshop.depth": 0.1}
    return sliced(load_preset("barrel_vault", changes))


def test_auto_takes_bars_if_strips_cannot_be_bent_and_gives_the_excess(vault):
    """Strain t |kn| / 2 against strength over stiffness; the thickest strips are as much thinner as that is more."""
    graph, statics = vault.members, vault.preset.statics
    limit = statics.strength / statics.young
    limits = strip_limits(graph, vault.surface, 0.04, limit, 0.012)
    thick = construction_route(vault, graph, Layering(0.04, 2, 0.012))
    assert thick.name == "bars"
    assert thick.bars.stock.bar == 0.08
    times = max(limits.bending, limits.shape) / limit
    assert f"{times:.1f} times the strain that the material bears" in thick.reason
    assert f"that can be bent is {length(0.04 * limit / limits.bending)}" in thick.reason
    thin = construction_route(vault, graph, Layering(0.99 * limits.thickest, 2, 0.012))
    assert thin.name == "strips"
    assert "can be bent" in thin.reason
    assert construction_route(vault, graph, Layering(1.01 * limits.thickest, 2, 0.012)).name == "bars"
    bolted = Design.from_preset(with_overrides(vault.preset, {"workshop.bolt": 0.08}), vault).until("slicing")
    near = construction_route(bolted, graph, Layering(0.04, 2, 0.08))
    assert near.name == "strips"
    small = Design.from_preset(with_overrides(vault.preset, {"workshop.stock": [[2.5, 1.25]]}), vault).until("slicing")
    long = construction_route(small, graph, Layering(0.04, 2, 0.012))
    assert long.name == "strips"
    assert "but bars are longer than the stock (B" in long.reason
    assert "but bars are impossible too" in near.reason
    assert "use workshop.route" not in near.reason  # strips are the route that was taken
    assert "upright planks are impossible: a plank that is 100 mm deep and 80 mm thick" in near.reason


def test_auto_takes_planks_where_bars_would_leave_the_surface_and_planks_can_be_bent_and_put_on(vault):
    """By more than half of a member's width."""
    graph, statics = vault.members, vault.preset.statics
    deep = Design.from_preset(with_overrides(vault.preset, {"workshop.depth": 0.2}), vault).until("slicing")
    route = construction_route(deep, graph, Layering(0.04, 2, 0.012))
    assert route.name == "planks"
    limit, bends = statics.strength / statics.young, route.planks.planks.bends
    assert 0 < max(bends.values()) < limit
    bars = design_bars(vault, graph)
    assert bars.largest_sagitta > 0.1  # half of a member's width
    assert (
        f"bars would be up to {length(bars.largest_sagitta)} from the surface, but members are only 200 "
        f"mm" in route.reason
    )
    assert f"to a strain of {max(bends.values()):.2%} (allowed: {limit:.2%}); planks cross at 88" in route.reason
    assert_hindrances(route.planks)


def assert_hindrances(plan):
    """What planks would be that cannot be built, in numbers."""
    assert not plan.obstacle
    bend = max(plan.planks.bends.values())
    assert f"bend out of their plane to a strain of {bend:.2%}" in replace(plan, limit=0.9 * bend).obstacle
    for changes, said in (
        ({"stuck": {"A01": 0.3, "A02": 0.4}}, "in 2 planks, slots differ by up to 23 degrees"),
        ({"crowded": ["N1 in A01"]}, "without wood between these slots: N1 in A01"),
        (
            {"crossings": PlankCrossings([], ["N7"])},
            "meet at angles below 30 degrees at N7, which is too sharp for slots",
        ),
    ):
        assert said in replace(plan, planks=replace(plan.planks, **changes)).obstacle


@pytest.mark.parametrize("t", [10, 45, 90, 120])
def test_legs_are_level_and_point_outwards(t):
    """On a sphere, where the normal is t off the vertical: the fold is t; normals that point inwards turn its sign."""
    t = np.radians(t)
    n = np.array([np.sin(t), 0.0, np.cos(t)])
    footing = Footing(np.array([5 * n]), np.array([0.0, 0.0, 1.0]), 0.1, 0.016)
    (leg,) = footing.legs(np.array([5 * n]), n[None], [0.1]).values()
    (other,) = footing.legs(np.array([5 * n]), -n[None], [0.1]).values()
    assert abs(leg.fold) == pytest.approx(t if t <= np.pi / 2 else np.pi - t)
    for one, normal in ((leg, n), (other, -n)):
        assert one.way @ n == pytest.approx(0, abs=1e-12)
        assert one.way[2] < 0
        level = np.cos(one.fold) * one.way + np.sin(one.fold) * normal
        assert level == pytest.approx([1 if t <= np.pi / 2 else -1, 0, 0], abs=1e-9)
    assert footing.legs(np.array([5 * n + [0.3, 0, 0]]), n[None], [0.1]) == {}
    flat = footing.legs(np.array([5 * n]), np.array([[0.0, 0.0, 1.0]]), [0.1])
    assert flat == {0: None}


def test_a_plate_below_strips_has_a_hole_for_the_bolt_of_its_node_and_two_for_anchors():
    graph = graph_of("cylinder")
    node = max((one for one in graph.nodes if one.kind == "crossing"), key=lambda one: one.point[0])
    footing = Footing(node.point[None], np.array([0.0, 0.0, 1.0]), 1e-3, 0.016)
    parts, flat = leg_plates(graph, Layering(0.018, 2, 0.012), footing, 0.005)
    (part,) = parts
    assert flat == []
    assert part.thickness == 0.005
    assert part.layer == pytest.approx(-0.009 - 0.009 - 0.0025)  # below the lower of two layers
    assert [hole.bolt for hole in part.holes] == [node.id, "anchor", "anchor"]
    assert [hole.diameter for hole in part.holes] == [0.012, 0.016, 0.016]
    at, (fold,) = np.array([hole.at for hole in part.holes]), part.folds
    assert fold.line[:, 0] - at[0, 0] == pytest.approx(np.full(2, 0.12 / 2 + 0.012), abs=3e-3)
    assert at[1:, 0] - fold.line[0, 0] == pytest.approx([3 * 0.016, 7 * 0.016])
    slope = np.arctan2(abs(node.normal[0]), node.normal[2])
    assert fold.angle == pytest.approx(-slope, abs=1e-6)
    (line,) = leg_lines([fold.angle], [])
    assert line.endswith(f"fold the leg by {np.degrees(slope):.0f} to {np.degrees(slope):.0f} degrees")
    assert leg_lines([], ["N1"]) == [line for line in leg_lines([0.5], ["N1"]) if line.startswith("no leg at N1: ")]


def test_node_plates_of_a_vault_follow_the_slope_of_the_arch_at_its_springing(vault):
    """An arch of 2.5 m over 8 m: at half of the band from its edge it falls by acos(1 - 2.5 / R) - band / 2R."""
    asked = Design.from_preset(
        with_overrides(vault.preset, {"workshop.route": "bars", "workshop.anchor": 0.016}), vault
    )
    plan, R = design_bars(asked.until("slicing"), vault.members), (4**2 + 2.5**2) / 5
    legs = [joint for joint in plan.bar_lattice.joints if joint.leg]
    assert len(legs) > 20
    assert not plan.legless
    assert all(abs(abs(joint.node.point[0]) - 4) < 0.2 or abs(abs(joint.node.point[1]) - 4) < 0.2 for joint in legs)
    wanted = np.arcsin(4 / R) - 0.1 / R
    assert [joint.leg.fold for joint in legs] == pytest.approx(np.full(len(legs), wanted), abs=np.radians(1.5))
    parts = {part.id: part for part in plan.parts}
    for joint in legs:
        part = parts[joint.node.id]
        assert sum(hole.diameter == 0.016 for hole in part.holes) == 2
        assert len(part.folds) == len(joint.bars) + 1
        assert polygon_area(part.outline) > 0
    assert any("have a leg with anchors; to make the leg level, fold the leg by 6" in line for line in plan.lines)


@pytest.mark.slow
def test_the_command_writes_bars_as_drawings_lists_and_documents_and_the_same_twice(vault, tmp_path, capsys):
    changes = ["surface.edge=0.3", "statics.material=GL24h", "workshop.stock=[5.0, 1.25]", "workshop.depth=0.1"]
    words = ["workshop", "barrel_vault", *(x for change in changes for x in ("--set", change))]
    assert main([*words, "--ifc", "-o", str(tmp_path / "one")]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith("route bars: layers of 40 mm")
    assert any("straight bars of 80 mm on" in line for line in said)
    assert any("of 80 mm and 5 mm" in line for line in said)
    assert main([*words, "--ifc", "-o", str(tmp_path / "two"), "--quiet"]) == 0
    one, two = ({path.name: path.read_bytes() for path in (tmp_path / name).iterdir()} for name in ("one", "two"))
    assert one == two
    bars = list(csv.DictReader(io.StringIO(one["bars.csv"].decode())))
    parts = list(csv.DictReader(io.StringIO(one["cutlist.csv"].decode())))
    assert {row["file"] for row in bars} <= set(one)
    assert sum(int(row["count"]) for row in parts if row["thickness_mm"] == "80.0") == len(bars)
    assert one["assembly.pdf"].startswith(b"%PDF")
    assert {"nest.dxf", "nest.svg", "cutlist.xlsx", "members.ifc"} <= set(one)
    assert '"All bars and plates"' in one["index.html"].decode()
    assert main([*words, "--set", "workshop.route=strips", "-o", str(tmp_path / "one"), "--quiet"]) == 0
    assert not (tmp_path / "one" / "bars.csv").exists()


def test_bars_of_a_model_and_bars_longer_than_the_stock_are_refused_in_a_sentence(vault):
    model = Design.from_preset(
        with_overrides(vault.preset, {"workshop.route": "bars", "workshop.model": 50}), vault
    ).until("slicing")
    with pytest.raises(PatternError, match="dsfab builds models only from strips"):
        workshop_plan(model)
    stock = {"workshop.route": "bars", "workshop.stock": [[2.5, 1.25]]}
    short = Design.from_preset(with_overrides(vault.preset, stock), vault).until("slicing")
    with pytest.raises(PatternError, match=r"part B\d+\.\d is 2\.\d+ x 0\.2\d* m and fits on no sheet"):
        workshop_plan(short)
