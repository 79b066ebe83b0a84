"""Upright planks: closed forms, drawings bent back into space, and bodies that go into each other's slots."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import ezdxf
import manifold3d
import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from shapely import Polygon, affinity

from dsfab.app.cli import main
from dsfab.core.errors import PatternError
from dsfab.design import Design
from dsfab.export import flat_dxf
from dsfab.members import member_graph
from dsfab.preset.file import load_preset, with_overrides
from dsfab.workshop import refolded_plan, workshop_plan
from dsfab.workshop.bodies import strip_body
from dsfab.workshop.files import part_drawing
from dsfab.workshop.plan import WorkshopPlan
from dsfab.workshop.planks import PlankStock, plank_courses, plank_plan, slots, standing_order
from dsfab.workshop.planks.slots import SLIDE_ANGLE, largest_deviation, plank_crossings, slot_width
from tests.analytic import SURFACES
from tests.designs import sliced

STOCK = PlankStock(thickness=0.018, depth=0.12, bolt=0.012, splice="cover", letters=(0.02, 0.008))
ROOM = [(2.484, 1.234)]
UP = np.array([0.0, 0.0, 1.0])


@cache
def graph_of(name, edge=0.4):
    given = SURFACES[name](edge)
    return member_graph(given.surface, given.sheet(), given.pattern)


@cache
def plan_of(name, edge=0.4, stock=STOCK):
    graph = graph_of(name, edge)
    return plank_plan(graph, np.tile(UP, (graph.sheet.surface.n, 1)), stock, ROOM, 0.0)


@cache
def whole_of(name):
    """A plan as a workshop's, of planks alone."""
    plan = plan_of(name)
    return WorkshopPlan("planks", 0.018, plan.parts, (), (), (), graph_of(name), planks=plan)


# --- closed forms


@pytest.mark.parametrize("degrees", [30, 57, 79, 90])
def test_a_slot_is_as_wide_as_two_crossing_planks_lie_in_each_other(degrees):
    band = Polygon([(-9, -0.5), (9, -0.5), (9, 0.5), (-9, 0.5)])
    x0, _, x1, _ = band.intersection(affinity.rotate(band, degrees, origin=(0, 0))).bounds
    assert slot_width(1.0, np.radians(degrees)) == pytest.approx(x1 - x0, rel=1e-9)


@pytest.mark.slow
def test_meridians_of_a_sphere_are_rings_with_slots_at_equal_angles():
    """Planks in planes through the middle: rings of radii R - h/2 and R + h/2, slots .1 radians apart."""
    graph, rings = graph_of("sphere", 0.2), 0
    outward = np.einsum("ki,ki->k", graph.by_id["B05"].axis.N, graph.by_id["B05"].axis.P).mean()
    for part in plan_of("sphere", 0.2).planks.pieces:
        if graph.by_id[part.member].family != "minor":
            continue
        rings += 1
        middle, radius = fitted_circle(part.axis)
        assert radius == pytest.approx(6.5, rel=1e-2)
        away = np.linalg.norm(part.outline - middle, axis=1)
        edges = np.abs(away - radius) > STOCK.depth / 4
        assert np.abs(np.abs(away - radius)[edges] - STOCK.depth / 2).max() < 8e-4
        outer = beside(part.axis, part.outline)[1] > STOCK.depth / 4  # on the side of the normals
        assert ((away > radius)[outer] == (outward > 0)).all()
        bottoms = slot_bottoms(part.outline, part.axis) - middle
        angle = np.unwrap(np.arctan2(bottoms[:, 1], bottoms[:, 0]))
        assert np.abs(np.abs(np.diff(angle)) - 0.1 * 6.5 / radius).max(initial=0) < 4e-4
    assert rings > 12


def test_twisted_edges_are_longer_than_drawn_as_a_helix_says():
    """sqrt((1 - y kn)^2 + (y tg)^2) - (1 - y kn), kn = tg = 1 / 2R of helices at 45 degrees, along their length."""
    graph, plan = graph_of("cylinder"), plan_of("cylinder")
    k, y = 1 / (2 * 4.45), STOCK.depth / 2
    more = np.hypot(1 - y * k, y * k) - (1 - y * k)
    for name in ("A05", "B06"):
        member = graph.by_id[name]
        assert plan.planks.longer[name] == pytest.approx(more * member.length, rel=0.1)
    assert max(plan.planks.bends.values()) < 2e-4  # helices do not bend in the surface
    assert f"up to {1e3 * max(plan.planks.longer.values()):.3g} mm longer" in plan.lines[1]


def test_a_slot_widens_with_the_lean_of_the_assembly_direction():
    crossing = plan_of("hypar").planks.crossings.crossings[7]
    one, two = crossing.ways
    lower, upper = crossing.slot_leans(crossing.normal + 0.1 * one - 0.2 * two)
    assert (lower, upper) == (pytest.approx(0.1), pytest.approx(0.2))


def test_planks_that_meet_at_under_thirty_degrees_get_no_slot(monkeypatch):
    """As the angle of each node says."""
    monkeypatch.setattr(slots, "slot_crossing", lambda node, *given: node)
    graph = graph_of("hypar")
    two = [node for node in graph.nodes if node.kind == "crossing"][:2]
    nodes = [replace(node, angle=angle) for node, angle in zip(two, (25.0, 35.0), strict=True)]
    found = plank_crossings(SimpleNamespace(nodes=nodes, by_id=graph.by_id), dict.fromkeys(graph.by_id))
    assert (found.sharp_nodes, found.crossings) == ([two[0].id], [two[1].id])


def fitted_circle(P):
    """Middle and radius of the circle nearest to points (k, 2) [Kasa 1976]."""
    x, y, c = np.linalg.lstsq(np.c_[2 * P, np.ones(len(P))], (P**2).sum(axis=1), rcond=None)[0]
    return np.array([x, y]), np.sqrt(c + x**2 + y**2)


# --- drawings alone, bent back


def beside(axis, points):
    """Lengths along a line and distances to its left of points, which may lie beyond its ends."""
    a, way = axis[:-1], np.diff(axis, axis=0)
    long = np.linalg.norm(way, axis=1)
    t = np.einsum("qsi,si->qs", points[:, None] - a, way) / long**2
    low, high = np.zeros(len(way)), np.ones(len(way))
    low[0], high[-1] = -np.inf, np.inf
    t = np.clip(t, low, high)
    off = points[:, None] - (a + t[..., None] * way)
    k, q = np.linalg.norm(off, axis=2).argmin(axis=1), np.arange(len(points))
    left = (way[k, 0] * off[q, k, 1] - way[k, 1] * off[q, k, 0]) / long[k]
    return np.r_[0, np.cumsum(long)][k] + t[q, k] * long[k], left


def slot_bottoms(outline, axis):
    """(q, 2) middles between inner corners that follow each other: they are near the axis, edges are not."""
    inner = np.abs(beside(axis, outline)[1]) < STOCK.depth / 4
    pairs = inner & np.roll(inner, -1)
    return ((outline + np.roll(outline, -1, axis=0)) / 2)[pairs]


def read(part, folder):
    path = folder / "part.dxf"
    path.write_bytes(flat_dxf(part_drawing(part)))
    space = ezdxf.readfile(path).modelspace()
    lines = [space.query(f'LWPOLYLINE[layer=="{layer}"]') for layer in ("CUT", "AXIS")]
    return [np.array([p[:2] for p in line.get_points()]) / 1000 for (line,) in lines]


@pytest.mark.parametrize(
    "name", ["hypar", *(pytest.param(name, marks=pytest.mark.slow) for name in ("sphere", "cylinder", "catenoid"))]
)
def test_slots_of_drawings_bent_back_are_where_the_other_plank_is(name, tmp_path):
    """Each plank's middle line is laid on its member's axis by lengths; both slots of a node end at one place."""
    graph, plan, found = graph_of(name), plan_of(name), {}
    courses = plank_courses(graph, STOCK)[0]
    some = set(sorted({part.member for part in plan.planks.pieces if part.member[0] == "A"})[1:3])
    nodes = [node for node in graph.nodes if some & set(node.members) and node.kind == "crossing"]
    wanted = some | {member for node in nodes for member in node.members}
    for part in plan.planks.pieces:
        if part.member in wanted:
            outline, axis = read(part, tmp_path)
            course = courses[part.member]
            s = np.linspace(*part.span, 4001)
            P, N = (CubicSpline(course.s, x)(s) for x in (course.P, course.N))
            long = np.r_[0, np.cumsum(np.linalg.norm(np.diff(P, axis=0), axis=1))]
            assert np.linalg.norm(np.diff(axis, axis=0), axis=1).sum() == pytest.approx(long[-1], abs=3e-4)
            along, y = beside(axis, slot_bottoms(outline, axis))
            for a, b in zip(along, y, strict=True):
                at, n = (np.array([np.interp(a, long, c) for c in x.T]) for x in (P, N))
                place = at + b * n / np.linalg.norm(n)
                near = min(nodes, key=lambda node: np.linalg.norm(node.point - place))
                if np.linalg.norm(near.point - place) < 0.02:
                    found.setdefault(near.id, []).append(place)
    assert {node.id for node in nodes} == set(found)
    for node in nodes:
        one, two = found[node.id]
        off = two - one
        assert np.linalg.norm(off - (off @ node.normal) * node.normal) < 1e-4
        assert abs(off @ node.normal) == pytest.approx(2e-4, abs=2e-5)  # the air between both


def body(strip, shift=(0, 0, 0)):
    V, F = strip_body(strip, STOCK.thickness)
    solid = manifold3d.Manifold(manifold3d.Mesh64(V + shift, F.astype(np.uint64)))
    assert solid.status() == manifold3d.Error.NoError
    return solid


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sphere", "hypar"])
def test_crossing_planks_do_not_collide_during_assembly(name):
    """Bodies of planks as thick as they are: the upper one, off by some of the way on which it comes, meets none."""
    plan, strips = plan_of(name), {one.id: one for one in refolded_plan(whole_of(name)).strips}
    pieces = [part for part in plan.planks.pieces if part.member[0] == "B"]
    upper = max(pieces, key=lambda part: plan.planks.slide_angles[part.id])  # of many slots
    here = [one for one in plan.planks.crossings.crossings if one.members[1] == upper.member]
    here = [one for one in here if upper.span[0] <= one.at[1] <= upper.span[1]]
    normals = np.array([one.normal for one in here])
    assert len(here) > 2
    assert np.radians(4) < largest_deviation(normals) <= SLIDE_ANGLE + 1e-9
    i, j = np.unravel_index((normals @ normals.T).argmin(), (len(here),) * 2)
    way = (normals[i] + normals[j]) / np.linalg.norm(normals[i] + normals[j])
    lower = [
        body(strips[part.id])
        for one in (here[0], here[-1])
        for part in plan.planks.pieces
        if part.member == one.members[0] and part.span[0] < one.at[0] < part.span[1]
    ]
    assert len(lower) >= 2
    for lifted in (0.0, 0.02, 0.04, 0.06, 0.1):
        moved = body(strips[upper.id], lifted * way)
        assert max((moved ^ other).volume() for other in lower) < 3e-9  # three cubic millimetres, by the mesh
    aside = body(strips[upper.id], 0.002 * here[0].ways[1])
    assert (aside ^ lower[0]).volume() > 1e-7  # slots are no wider than they need to be


# --- what cannot be, and where planks end


def test_arches_are_assembled_before_purlins():
    vault = sliced(load_preset("barrel_vault", {"surface.edge": 0.5}))
    assert [one for one in standing_order(vault.members, UP) if one in ("major", "minor")] == ["minor", "major"]
    thick = with_overrides(vault.preset, {"workshop.route": "planks", "workshop.depth": 0.1})
    with pytest.raises(
        PatternError,
        match=r"100 mm deep and 80 mm thick is not slender enough for an upright plank: "
        r"set workshop\.t",
    ):
        workshop_plan(Design.from_preset(thick, vault).until("slicing"))
    model = with_overrides(vault.preset, {"workshop.route": "planks", "workshop.model": 50})
    with pytest.raises(PatternError, match="dsfab builds models only from strips"):
        workshop_plan(Design.from_preset(model, vault).until("slicing"))


@pytest.mark.slow
def test_planks_of_a_vault_stand_on_the_ground_and_are_written(tmp_path, capsys):
    """workshop/test_bars.py has such files written twice."""
    changes = ["surface.edge=0.5", "workshop.route=planks", "workshop.thickness=0.03"]
    words = ["workshop", "barrel_vault", *(x for change in changes for x in ("--set", change))]
    assert main([*words, "--ifc", "-o", str(tmp_path / "one")]) == 0
    said = capsys.readouterr().out
    assert "18 upright planks, 200 mm deep and 30 mm thick, are bent out of their plane" in said
    assert "ends of planks at supports are cut parallel to the ground" in said
    names = {path.name for path in (tmp_path / "one").iterdir()}
    assert {"nest.dxf", "assembly.pdf", "index.html", "members.ifc", "cutlist.csv"} <= names
    vault = sliced(load_preset("barrel_vault", {"surface.edge": 0.5}))
    asked = with_overrides(vault.preset, {"workshop.route": "planks", "workshop.thickness": 0.03})
    plan = workshop_plan(Design.from_preset(asked, vault))
    arches = [strip for strip in refolded_plan(plan).strips if strip.member[0] == "B" and ".c" not in strip.id]
    low = np.array([strip.edges[..., 2].min() for strip in arches])
    assert np.sum(low < 0.1) == 24  # both ends of twelve arches
    assert np.abs(low[low < 0.1]).max() < 5e-3  # the springing lines are at z = 0


@pytest.mark.slow
def test_crowded_and_steep_slots_give_a_note():
    thick = plan_of("sphere", 0.4, PlankStock(0.3, 0.6, 0.012, "none", (0.02, 0.008)))
    assert any(line.startswith("NOT POSSIBLE: these slots are omitted") for line in thick.lines)
    assert thick.planks.crowded
    bolts = plan_of("sphere", 0.4, PlankStock(0.018, 0.12, 0.09, "cover", (0.02, 0.008)))
    assert any(line.startswith("NOT POSSIBLE to slide together") for line in bolts.lines) == bool(bolts.planks.stuck)
