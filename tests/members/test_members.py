"""Members, nodes and axes: closed forms, and what holds for any design."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array, vstack

from dsfab import preset_for
from dsfab.core.toml_files import shipped_presets
from dsfab.design import Design
from dsfab.members import member_graph
from dsfab.members.assembly import along_structure
from dsfab.members.components import without_slivers
from dsfab.preset.file import load_preset, with_overrides
from dsfab.results import PatternResult
from dsfab.slicing import Sheet, cut
from dsfab.surface import CornerField, Surface
from tests.analytic import SURFACES, WIDTH, chart_grid
from tests.designs import coarse_design, sliced
from tests.meshes import mesh_file
from tests.presets import BARREL_VAULT_MODES, DOME_MODES
from tests.shapes import grid

CALM = 0.6
"""Metres from the ends of an axis, where a spline knows less."""


@cache
def drawn(name, edge):
    given = SURFACES[name](edge)
    return given, member_graph(given.surface, given.sheet(), given.pattern)


@cache
def design(name):
    return sliced(load_preset(name))


# --- closed forms


def bay_errors(given, graph):
    """Metres between the bays of all strips and the truth."""
    found = []
    for member in graph.members:
        bay, nodes = given.truth(member.family, member.stripe)["bay"], graph.nodes_along[member.id]
        others = [graph.by_id[node.members[1 - node.members.index(member.id)]].stripe for node in nodes]
        for one, two, length in zip(others, others[1:], graph.bays(member.id), strict=False):
            found.append(length - abs(two - one) * (bay(min(one, two)) if callable(bay) else bay))
    return np.abs(found)


def curvature_errors(given, graph):
    """Over the largest curvature that is known, by name."""
    found, size = {"kn": [0.0], "kg": [0.0], "tg": [0.0]}, [1e-9]
    for member in graph.members:
        axis, truth = member.axis, given.truth(member.family, member.stripe)
        calm = (axis.s > CALM) & (axis.s < axis.length - CALM)
        for name in found.keys() & truth.keys():
            found[name].append(np.abs(np.abs(getattr(axis, name)[calm]) - abs(truth[name])).max(initial=0.0))
            size.append(abs(truth[name]))
    return {name: max(errors) / max(size) for name, errors in found.items()}


@pytest.mark.parametrize("name", SURFACES)
def test_bays_and_curvatures_come_nearer_as_the_mesh_gets_finer(name):
    coarse, fine = (drawn(name, edge) for edge in (0.4, 0.2))
    assert bay_errors(*fine).max() < 0.5 * bay_errors(*coarse).max() < 0.01
    assert len(bay_errors(*fine)) > 80
    if name != "hypar":  # where there is no curvature to compare with
        one, two = curvature_errors(*coarse), curvature_errors(*fine)
        assert max(two.values()) < max(one.values())


@pytest.mark.slow
@pytest.mark.parametrize("name", SURFACES)
def test_bays_are_right_to_seven_tenths_of_a_millimetre_and_curvatures_to_three_percent(name):
    given, graph = drawn(name, 0.1)
    assert bay_errors(given, graph).max() < 0.7e-3
    if name == "hypar":  # its lines are straight: less than the curvature of a 300 m radius
        calm = [member.axis.kn[5:-5] for member in graph.members]
        assert max(np.abs(kn).max() for kn in calm) < 1 / 300
    else:
        assert max(curvature_errors(given, graph).values()) < 0.03
        assert bay_errors(given, graph).max() < 0.5 * bay_errors(*drawn(name, 0.2)).max()


def test_a_hypar_has_a_node_at_each_crossing_and_members_named_in_order():
    _, graph = drawn("hypar", 0.4)
    assert [member.id for member in graph.members] == [f"{x}{k:02d}" for x in "AB" for k in range(1, 11)]
    stripes = {tuple(graph.by_id[name].stripe for name in node.members) for node in graph.nodes}
    assert stripes == {(i, j) for i in range(-4, 6) for j in range(-4, 6)}
    assert {node.kind for node in graph.nodes} == {"crossing"}
    for node in graph.nodes:
        i, j = (graph.by_id[name].stripe for name in node.members)
        x, y = 0.6 * (i - 0.25), 0.6 * (j - 0.25)
        assert node.point == pytest.approx((x, y, x * y / 6), abs=0.01)
        steep = np.array([-y / 6, -x / 6, 1])
        assert abs(node.normal @ steep) / np.linalg.norm(steep) > 0.999
    assert not graph.notes


def test_crossings_and_members_have_the_drawn_widths():
    _, graph = drawn("cylinder", 0.2)
    inner = [node for node in graph.nodes if node.kind == "crossing"]
    assert np.median([node.area for node in inner]) == pytest.approx(WIDTH**2, rel=0.02)
    assert np.median([node.angle for node in inner]) == pytest.approx(90, abs=0.5)
    widths = [member.mean_width for member in graph.members if member.length > 2]
    assert widths == pytest.approx(np.full(len(widths), WIDTH), rel=0.02)


def test_the_frame_of_an_axis_is_right_handed_and_closes():
    _, graph = drawn("catenoid", 0.2)
    for member in graph.members:
        axis = member.axis
        frames = np.stack([axis.T, axis.B, axis.N], axis=2)
        assert np.einsum("kij,kil->kjl", frames, frames) == pytest.approx(np.tile(np.eye(3), (len(axis.s), 1, 1)))
        assert np.linalg.det(frames) == pytest.approx(np.ones(len(axis.s)))
        steps = np.linalg.norm(np.diff(axis.P, axis=0), axis=1)
        assert np.diff(axis.s) == pytest.approx(steps, rel=2e-3)
        assert axis.frames_at(axis.s[[3]])[0][0] == pytest.approx(axis.P[3])


# --- plates, on which everything is exact


def striped_plate(z, d, edge=0.1, size=(2.0, 1.4), shake=0.2):
    """A plate with the stripes of two fields z(x, y), half-widths d in periods."""
    u, v = (np.linspace(0, one, round(one / edge) + 1) for one in size)
    surface, x, y = chart_grid(lambda x, y: (x, y, 0 * x), u, v, shake)
    values = [field(x, y) for field in z]
    bands = tuple(np.stack([one + d, one - d], axis=1) for one in values)
    levels = tuple(np.arange(np.floor(one.min()) - 1, np.ceil(one.max()) + 2) for one in values)
    widths = tuple(np.full(surface.n, d) for _ in z)
    return surface, PatternResult(("major", "minor"), bands, levels, widths)


def graph_of(surface, pattern):
    return member_graph(surface, cut(surface, pattern.fields, pattern.levels).subset(), pattern)


@settings(max_examples=6, deadline=None)
@given(st.floats(0, np.pi), st.floats(0.5, np.pi / 2), st.floats(0, 1), st.floats(0, 1))
def test_stripes_of_a_plate_cross_exactly_where_both_fields_are_whole(turn, between, one, two):
    angles = turn, turn + between
    z = [
        lambda x, y, a=a, s=s: (x * np.cos(a) + y * np.sin(a)) / 0.31 + s
        for a, s in zip(angles, (one, two), strict=True)
    ]
    surface, pattern = striped_plate(z, 0.15)
    graph = graph_of(surface, pattern)
    assert_whole(graph, cut(surface, pattern.fields, pattern.levels).subset())
    A = np.array([[np.cos(a), np.sin(a)] for a in angles]) / 0.31
    for node in graph.nodes:
        both = np.array([graph.by_id[name].stripe for name in node.members])
        if node.kind == "crossing":
            assert A @ node.point[:2] + (one, two) == pytest.approx(both, abs=1e-6)
            for name, s in zip(node.members, node.at, strict=True):
                assert graph.by_id[name].axis.frames_at(np.array([s]))[0][0] == pytest.approx(node.point, abs=1e-6)
    i, j = (x.ravel() for x in np.meshgrid(np.arange(-15, 15), np.arange(-15, 15)))
    places = np.linalg.solve(A, np.stack([i - one, j - two])).T
    inside = ((places > 0.02) & (places < np.array([2.0, 1.4]) - 0.02)).all(axis=1)
    found = {tuple(graph.by_id[name].stripe for name in node.members) for node in graph.nodes if node.kind != "grazing"}
    assert found >= set(zip(i[inside].tolist(), j[inside].tolist(), strict=True))


@pytest.mark.parametrize("seed", range(3))
def test_members_do_not_depend_on_how_faces_see_a_phase(seed):
    surface, pattern = striped_plate([lambda x, y: 3 * x + 0.4 * y + 0.13, lambda x, y: 2.7 * y - 0.3 * x + 0.21], 0.15)
    plain = graph_of(surface, pattern)
    random = np.random.default_rng(seed)
    fields = []
    for band in pattern.fields:
        sign = np.repeat(random.choice([-1.0, 1.0], surface.m)[:, None], 3, axis=1)
        shift = np.repeat(random.integers(-3, 4, surface.m)[:, None].astype(float), 3, axis=1)
        fields.append(CornerField(band, sign, shift, np.zeros(surface.m, dtype=bool)))
    levels = tuple(np.arange(-20.0, 21.0) for _ in fields)
    seen = graph_of(surface, replace(pattern, fields=tuple(fields), levels=levels))
    assert [(one.id, one.kind) for one in seen.members] == [(one.id, one.kind) for one in plain.members]
    for one, two in zip(seen.members, plain.members, strict=True):
        assert one.area == pytest.approx(two.area, rel=5e-3)  # hidden edges may be snapped from the other side
        assert one.length == pytest.approx(two.length, abs=1e-3)
    found, wanted = (
        {one.members: one.point.tolist() for one in graph.nodes if one.kind == "crossing"} for graph in (seen, plain)
    )
    assert found.keys() == wanted.keys()
    assert all(point == pytest.approx(wanted[pair], abs=1e-6) for pair, point in found.items())


def test_a_stripe_along_the_edge_has_its_axis_on_the_edge():
    surface, pattern = striped_plate([lambda x, y: y / 0.35, lambda x, y: x / 0.5 + 0.1], 0.1, shake=0.0)
    graph = graph_of(surface, pattern)
    assert [one.axis.P[:, 1].mean().round(6) for one in graph.members[:5]] == [0.0, 0.35, 0.7, 1.05, 1.4]
    edge = graph.by_id["A01"]
    assert edge.length == pytest.approx(2.0)
    assert edge.mean_width == pytest.approx(0.035, rel=0.06)  # cut on a mesh, snapped to its vertices
    assert edge.ends[0] == "edge"  # the other end is within a width of a node
    assert len(graph.nodes_along["A01"]) == len(graph.nodes_along["A02"])


def test_a_stripe_whose_middle_is_beside_the_plate_has_an_axis_in_its_own_middle():
    surface, pattern = striped_plate([lambda x, y: y / 0.7 - 0.05, lambda x, y: x / 0.5 + 0.1], 0.12, shake=0.0)
    lowest = graph_of(surface, pattern).members[0]  # z = 0 is at y = .035, and z = -.05 at the edge
    assert lowest.axis.P[:, 1] == pytest.approx(np.full(len(lowest.axis.s), 0.035))
    surface, pattern = striped_plate([lambda x, y: y / 0.7 + 0.05, lambda x, y: x / 0.5 + 0.1], 0.12, shake=0.0)
    lowest = graph_of(surface, pattern).members[0]  # from the edge to z = .12, at y = .049
    assert lowest.axis.P[:, 1] == pytest.approx(np.full(len(lowest.axis.s), 0.0245), abs=1e-6)


def test_a_sliver_at_a_corner_of_its_stripe_is_no_member():
    """At a corner of the strip is a cell above its wall, as of a fillet, and beside that one a cell below it again."""
    surface, pattern = striped_plate([lambda x, y: y / 0.7 - 1 / 14, lambda x, y: x / 2 - 0.8], 1 / 7, shake=0.0)
    sheet = cut(surface, pattern.fields, pattern.levels).subset()
    plain = sheet.subset((sheet.surface.centroids[:, 1] < 0.15) & (sheet.surface.centroids[:, 0] > 0.3))
    V, F = plain.surface.V, plain.surface.F
    a, b = (int(np.hypot(V[:, 0] - x, V[:, 1] - 0.15).argmin()) for x in (0.3, 0.35))
    added = np.array([[0.32, 0.152, 0], [0.29, 0.14, 0]])
    more = Surface(np.concatenate([V, added]), np.concatenate([F, [[a, b, len(V)], [a, len(V), len(V) + 1]]]))
    x, y = added[:, 0] / 2, added[:, 1] / 1.4
    corner = [int(np.hypot(surface.V[:, 0] - x, surface.V[:, 1] - y).argmin()) for x, y in ((0, 0), (2, 0), (0, 1.4))]
    rows = csr_array((np.stack([1 - x - y, x, y], axis=1).ravel(), corner * 2, [0, 3, 6]), shape=(2, surface.n))
    beside = [np.append(one, [one[np.nonzero(a == F)[0][0]]] * 2) for one in (plain.parent, plain.family)]
    graph = member_graph(surface, Sheet(more, *beside, vstack([plain.weights, rows], format="csr")), pattern)
    strip, wanted = (one.by_id["A01"] for one in (graph, member_graph(surface, plain, pattern)))
    assert [one.id for one in graph.members] == ["A01"]
    assert strip.area == pytest.approx(more.area)
    assert (strip.axis.P == wanted.axis.P).all()
    assert np.abs([strip.axis.kg, strip.axis.kn]).max() < 1e-9


def test_a_line_that_turns_back_is_two_members_that_end_at_each_other():
    surface, pattern = striped_plate(
        [lambda x, y: 2.5 * (y + np.abs(x - 1)) + 0.3, lambda x, y: 2 * x + 0.3], 0.15, shake=0.0
    )
    graph = graph_of(surface, pattern)
    bent = [one for one in graph.members if one.id[0] == "A" and one.id[-1] in "ab" and one.length > 0.5]
    assert bent
    for one in bent:
        other = one.id[:-1] + ("b" if one.id[-1] == "a" else "a")
        assert other in one.ends or any(name[0] == "N" for name in one.ends)
        corner = one.axis.P[[0, -1]][np.abs(one.axis.P[[0, -1], 0] - 1).argmin()]
        assert corner[0] == pytest.approx(1, abs=0.06)
        assert np.abs(one.axis.T[4:-4, :2]) == pytest.approx(np.full((len(one.axis.s) - 8, 2), np.sqrt(0.5)), abs=0.02)


def test_members_that_only_touch_are_listed_as_grazing():
    surface, pattern = striped_plate([lambda x, y: (y - 0.4) / 3, lambda x, y: (y - 0.4 - 0.13 - 0.01 * x) / 3], 0.04)
    graph = graph_of(surface, pattern)
    assert [node.kind for node in graph.nodes] == ["grazing"]
    assert graph.nodes[0].members == ("A01", "B01")
    assert "graze" in graph.notes[0]


RIM = 0.12


def beside_a_rim(middle):
    """One strip, .12 m wide, about the zero of a function of x and y in metres; within .12 m of y = 0 all is kept."""
    surface, pattern = striped_plate([lambda x, y: middle(x, y) / 3], 0.02, edge=0.05, shake=0.0)
    levels, widths = (np.array([-RIM]), *pattern.levels), (np.full(surface.n, np.inf), *pattern.half_widths)
    return surface, PatternResult(("rim", "major"), (-surface.V[:, 1], *pattern.fields), levels, widths)


def met(graph, name):
    """The other members at the nodes of one, in their order."""
    return [one for node in graph.nodes_along[name] for one in node.members if one != name]


def test_a_member_that_runs_into_a_rim_ends_at_it():
    """Its middle runs along y = .08, so that .02 m of it are beside the rim; they are the rim's."""
    surface, pattern = beside_a_rim(lambda x, y: y - 0.08 - 0.6 * np.clip(1.2 - x, 0, None) ** 2)
    graph = graph_of(surface, pattern)
    assert_whole(graph, cut(surface, pattern.fields, pattern.levels).subset())
    rim, strip = graph.by_id["rim 1"], graph.by_id["A01"]
    x = np.linspace(0, 1.2 - np.sqrt((RIM - 0.08) / 0.6), 1000)  # where it comes to lie in the rim
    outside = np.hypot(np.diff(x), np.diff(0.6 * (1.2 - x) ** 2)).sum()
    assert strip.length == pytest.approx(outside + 1.5 * RIM, abs=0.06)
    assert strip.ends[0] == "edge"
    assert met(graph, "A01") == ["rim 1"]
    assert strip.width[strip.axis.s > 1.25].min() > 0.9 * RIM
    assert rim.width[np.abs(rim.axis.P[:, 0] - 1.6) < 0.2] == pytest.approx(0.14, abs=0.002)


def test_a_member_that_touches_a_rim_is_two_members():
    surface, pattern = beside_a_rim(lambda x, y: y - 0.05 - 0.9 * np.clip(np.abs(x - 1) - 0.25, 0, None) ** 2)
    graph = graph_of(surface, pattern)
    assert_whole(graph, cut(surface, pattern.fields, pattern.levels).subset())
    assert [one.id for one in graph.members] == ["A01a", "A01b", "rim 1"]
    assert met(graph, "A01a") == met(graph, "A01b") == ["rim 1"]


def test_a_ring_that_lies_on_a_rim_is_open_there():
    graph = graph_of(*beside_a_rim(lambda x, y: np.hypot(x - 1, y - 0.69) - 0.63))
    assert not graph.by_id["A01"].axis.closed
    assert met(graph, "A01") == ["rim 1", "rim 1"]


def test_the_kept_region_of_a_support_is_one_band_without_ends_off_the_sheet():
    """All within .2 m of the line from (.5, 0) to (1.5, 0): its middle turns at both ends, and is .1 m long there."""
    surface, pattern = striped_plate([lambda x, y: (y - 0.6) / 3], 0.02, edge=0.05, shake=0.0)
    x, y, _ = surface.V.T
    away = np.hypot(np.clip(np.abs(x - 1) - 0.5, 0, None), y)
    levels, widths = (np.array([-0.2]), *pattern.levels), (np.full(surface.n, np.inf), *pattern.half_widths)
    pattern = PatternResult(("keep", "major"), (-away, *pattern.fields), levels, widths)
    graph = graph_of(surface, pattern)
    assert_whole(graph, cut(surface, pattern.fields, pattern.levels).subset())
    assert [one.id for one in graph.members] == ["A01", "band 1"]
    band = graph.by_id["band 1"]
    assert band.area == pytest.approx(0.2 + np.pi * 0.2**2 / 2, rel=0.02)
    assert 1 < band.length < 1 + np.pi * 0.1


@pytest.mark.parametrize("degrees", [25, 60, 90])
def test_a_strip_that_crosses_a_rim_goes_on_to_the_edge(degrees):
    a = np.radians(degrees)
    surface, pattern = beside_a_rim(lambda x, y: y * np.cos(a) - (x - 0.9) * np.sin(a))
    strip = graph_of(surface, pattern).by_id["A01"]
    assert np.abs(strip.axis.P[[0, -1], 1]).min() == pytest.approx(0, abs=1e-9)


def test_a_strip_that_lies_in_a_rim_all_along_is_no_member():
    surface, pattern = beside_a_rim(lambda x, y: y - 0.08)
    graph = graph_of(surface, pattern)
    assert [one.id for one in graph.members] == ["rim 1"]
    assert graph.by_id["rim 1"].mean_width == pytest.approx(0.14, abs=0.005)


# --- whatever the design


def assert_whole(graph, sheet):
    """Members together are the sheet, no cell is without an owner, and every overlap is a node or grazing."""
    surface = graph.sheet.surface
    each = np.bincount(graph.source, surface.areas, sheet.surface.m)
    assert np.abs(each - sheet.surface.areas).sum() <= 1e-6 * sheet.surface.area
    owners = np.zeros(surface.m, dtype=np.int64)
    for member in graph.members:
        assert (np.diff(member.cells) > 0).all()
        assert member.area == pytest.approx(surface.areas[member.cells].sum())
        owners[member.cells] += 1
    assert owners.min() >= 1
    pairs = {}
    cells = {member.id: member.cells for member in graph.members}
    near = {name: surface.centroids[some].mean(axis=0) for name, some in cells.items()}
    assert len(cells) == len(graph.members) == len(near)
    shared = np.flatnonzero(owners > 1)
    on = {name: np.isin(shared, some) for name, some in cells.items()}
    names = list(on)
    table = np.stack([on[name] for name in names], axis=1).astype(np.float64)
    overlap = table.T @ (surface.areas[shared, None] * table)
    for i, j in zip(*np.nonzero(np.triu(overlap, 1)), strict=True):
        pairs[names[i], names[j]] = overlap[i, j]
    told = {}
    for node in graph.nodes:
        told[node.members] = told.get(node.members, 0.0) + node.area
    assert told.keys() == pairs.keys()
    assert all(told[pair] == pytest.approx(area) for pair, area in pairs.items())
    assert graph.stub_share <= 0.01 or "stub" in graph.notes[0]
    ends = {end for member in graph.members for end in member.ends} - {"edge", "free"}
    assert ends <= {node.id for node in graph.nodes} | cells.keys()


def assert_on_both(graph, edge):
    """Nodes lie on both axes, as far as the mesh is smooth."""
    off = []
    for node in graph.nodes:
        if node.kind == "crossing":
            for name, s in zip(node.members, node.at, strict=True):
                off.append(np.linalg.norm(graph.by_id[name].axis.frames_at(np.array([s]))[0][0] - node.point))
    assert np.percentile(off, 95) < 0.2 * edge


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "barrel_vault",
        DOME_MODES,
        *(pytest.param(x, marks=pytest.mark.slow) for x in ("cantilever", BARREL_VAULT_MODES)),
    ],
)
def test_members_are_the_finished_sheet(name):
    made = design(name)
    assert_whole(made.members, made.sheet)
    assert_on_both(made.members, made.surface.mean_edge)
    assert made.members is made.members  # worked out once


def test_a_vault_has_arches_purlins_two_edges_and_two_springing_lines_that_are_joined_at_the_corners():
    graph = design("barrel_vault").members
    assert [one.id for one in graph.members] == [
        *("A01", "A02"),
        *(f"B{k:02d}" for k in range(1, 13)),
        *("rim 1", "rim 2", "band 1", "band 2"),
    ]
    x = [graph.by_id[f"B{k:02d}"].axis.P[:, 0].mean() for k in range(1, 13)]
    assert (np.diff(x) > 0).all()
    assert x == pytest.approx(-np.array(x[::-1]), abs=1e-3)
    arch = graph.by_id["B06"]
    radius = (4**2 + 2.5**2) / 5  # of the circle over a span of 8 m with a rise of 2.5 m
    calm = slice(10, -10)
    assert np.abs(arch.axis.kn[calm]) == pytest.approx(np.full(len(arch.axis.s) - 20, 1 / radius), rel=0.05)
    assert arch.length == pytest.approx(2 * radius * np.arcsin(4 / radius), rel=2e-3)
    assert arch.mean_width == pytest.approx(0.2, rel=0.01)
    assert len(graph.nodes_along["B06"]) == 4  # two purlins, two springing lines
    kinds = [node.kind for node in graph.nodes]
    assert (kinds.count("crossing"), kinds.count("branch"), kinds.count("end")) == (24, 28, 4)
    corners = [node for node in graph.nodes if node.kind == "end"]
    assert sorted(node.members for node in corners) == [(f"rim {i}", f"band {j}") for i in (1, 2) for j in (1, 2)]


def test_names_and_numbers_of_members_are_reproducible():
    first = design("barrel_vault")
    again = member_graph(first.surface, first.sheet, Design.from_preset(load_preset("barrel_vault")).pattern)
    for one, two in ((again.members, first.members.members), (again.nodes, first.members.nodes)):
        assert [x.id for x in one] == [x.id for x in two]
    assert [one.length for one in again.members] == [one.length for one in first.members.members]
    assert [one.at for one in again.nodes] == [one.at for one in first.members.nodes]


@pytest.mark.slow
def test_every_second_meridian_of_a_dome_ends_on_a_ring():
    made = design("dome")
    graph = made.members
    assert_whole(graph, made.sheet)
    rings = [one for one in graph.members if one.id.startswith("A")]
    assert [one.axis.closed for one in rings] == [True] * 6
    z = [one.axis.P[:, 2].mean() for one in rings]
    assert (np.diff(z) > 0).all()
    radius = (6**2 + 4**2) / 8
    for one in rings[:3]:
        assert np.abs(one.axis.kn).mean() == pytest.approx(1 / radius, rel=0.02)
    meridians = [one for one in graph.members if one.id.startswith("B")]
    angle = [np.degrees(np.arctan2(*one.axis.P.mean(axis=0)[[1, 0]])) % 360 for one in meridians]
    assert (np.diff(angle[1:]) > 0).all()
    assert len(meridians) == 48
    short = np.array([one.length < 5 for one in meridians])
    assert short[::2].all() != short[1::2].all()
    assert {end[0] for one in meridians for end in one.ends} == {"N"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["globe", "sphere", "snow_vault", "tower", "twisty_tower", "bridge", "pavilion", "hanging_bar", "corner_held"]
    + ["cantilever_light", "climbing_hold", "rollers", "boys_surface"],
)
def test_members_of_shipped_presets_are_their_sheets(name):
    made = coarse_design(name)
    assert_whole(made.members, made.sheet)
    assert_on_both(made.members, made.surface.mean_edge)


OTHERS = ("bob", "camel_ears", "camel_head", "camel_none", "camel_nose", "mouse")
OTHERS += ("gridshell", "pirate", "turkey", "slab", "sphere_graded")
"""Presets that no test above has."""


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_members_of_all_other_presets_are_their_sheets(name):
    made = coarse_design(name)
    assert_whole(made.members, made.sheet)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "file"), [("figurine", "spot.obj"), ("roof", "hypar.obj")])
def test_members_of_presets_for_files_are_their_sheets(name, file, rough_shares):
    preset = load_preset(name, mesh=mesh_file(file))  # design/test_pipeline.py thickens it
    made = sliced(with_overrides(preset, {"surface.edge": 3 * preset.surface.edge}))
    assert_whole(made.members, made.sheet)


def test_members_of_every_preset_are_looked_at():
    """Those of the lists above, and no preset twice."""
    marks = [mark for test in (test_members_are_the_finished_sheet, test_members_of_shipped_presets_are_their_sheets)
             for mark in test.pytestmark if mark.name == "parametrize"]  # fmt: skip
    names = [one if isinstance(one, str) else one.values[0] for mark in marks for one in mark.args[1]]
    names = [str(one) for one in names if not str(one).endswith(".toml")] + [*OTHERS, "figurine", "roof", "dome"]
    assert sorted(names) == sorted(shipped_presets())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Botanic", "blub", "torus"])
def test_members_of_other_surfaces_are_their_sheets(name, rough_shares):
    """An open shell with holes, a fish with fins, a torus; a third of the members. camel_head above is a head."""
    preset = preset_for(mesh_file(f"{name}.obj"))
    apart = 3 * preset.pattern.major.spacing
    spacings = {"pattern.major.spacing": apart, "pattern.minor.spacing": apart}
    made = sliced(with_overrides(preset, {"surface.edge": 4.5 * preset.surface.edge, **spacings}))
    assert_whole(made.members, made.sheet)


# --- names


@settings(deadline=None)
@given(st.integers(3, 40), st.floats(0, 6.28), st.randoms())
def test_meridians_are_numbered_around_the_axis_in_any_input_order(count, turn, random):
    angle = np.sort(np.mod(turn + 2 * np.pi * np.arange(count) / count, 2 * np.pi))
    places = np.stack([np.cos(angle), np.sin(angle), np.full(count, 0.4)], axis=1)
    lengths = np.ones(count)
    mixed = list(range(count))
    random.shuffle(mixed)
    order = along_structure(places[mixed], lengths, 3.0)
    named = places[mixed][order]
    found = np.mod(np.arctan2(named[:, 1], named[:, 0]) + 3e-3, 2 * np.pi)
    assert (np.diff(found) > 0).all()


@settings(deadline=None)
@given(st.integers(1, 30), st.floats(0.1, 5), st.randoms())
def test_arches_are_named_along_a_vault(count, step, random):
    places = np.stack([step * np.arange(count), np.zeros(count), np.ones(count)], axis=1)
    mixed = list(range(count))
    random.shuffle(mixed)
    order = along_structure(places[mixed], np.ones(count), step * count)
    assert places[mixed][order] == pytest.approx(places)


def test_rings_about_one_middle_are_named_from_the_inside():
    order = along_structure(np.zeros((4, 3)), np.array([3.0, 1.0, 4.0, 2.0]), 2.0)
    assert order.tolist() == [1, 3, 0, 2]


def test_a_surface_that_is_all_material_is_one_plate():
    surface = Surface(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    x = surface.V[:, 0]
    pattern = PatternResult(("major",), (x,), (np.array([x.min() - 1]),), (np.full(4, 0.5),))
    graph = graph_of(surface, pattern)
    assert [(one.id, one.kind, one.axis) for one in graph.members] == [("plate 1", "plate", None)]
    assert graph.members[0].area == pytest.approx(1.0)


def test_slivers_join_their_stripe_and_corners_between_stripes_join_none():
    plate = grid(4, 1, 4.0, 1.0)
    column = plate.centroids[:, 0].astype(int)  # a sliver, stripe 1, a corner, stripe 2
    sheet = cut(plate, [plate.V[:, 0]], [[-1.0]])
    cells = without_slivers(sheet, np.array([0, 1, 0, 2])[column], column % 2 == 0)
    assert (cells.label == np.array([1, 1, 0, 2])[column]).all()
    assert (cells.loose == (column == 2)).all()


@pytest.mark.parametrize(("length", "kind"), [(0.8, "disc"), (1.3, "ring")])
def test_kept_material_around_a_short_line_is_a_disc_and_around_a_long_one_it_is_not(length, kind):
    """A disc has over 0.4 of the area of a circle of equal outline; here both lie .1 m around a line: .49 and .35."""
    surface, pattern = striped_plate([lambda x, y: (y - 0.2) / 3], 0.02, edge=0.05, shake=0.0)
    x, y, _ = surface.V.T
    away = np.hypot(np.clip(np.abs(x - 1) - length / 2, 0, None), y - 0.8)
    levels, widths = (np.array([-0.1]), *pattern.levels), (np.full(surface.n, np.inf), *pattern.half_widths)
    graph = graph_of(surface, PatternResult(("keep", "major"), (-away, *pattern.fields), levels, widths))
    assert {member.kind for member in graph.members} == {"strip", kind}
