"""What is asked of evenly spaced stripes when they are made: lines, fields, archive, competitors, sweeps, revisions."""

import json
from collections import Counter
from dataclasses import fields as names_of

import ezdxf
import numpy as np
import pytest

import dsfab
from dsfab import design
from dsfab.core.arrays import distances_from_segments
from dsfab.core.errors import DsfabError, PresetError
from dsfab.design.design import Design
from dsfab.design.output.archive import design_fields, design_lines, read_archive, write_archive
from dsfab.design.output.files import deliverable
from dsfab.export import write
from dsfab.pattern import frequency_for
from dsfab.preset.file import load_preset, preset_toml, with_overrides
from dsfab.study import compare_at
from dsfab.study.baselines import ComparisonTask
from dsfab.study.fabrication import fabrication, fewer_stripes
from dsfab.study.sweeps.metrics import metric_value
from tests.presets import DOME_MODES

SMALL = {"surface.edge": 0.6, "pattern.method": "stripes", "pattern.major.spacing": 1.6, "pattern.minor.spacing": 1.0}


NEAR = 0.05
"""Lines end where openings do, which are moved onto vertices by this share of an edge at most."""


@pytest.fixture(scope="module")
def dome() -> Design:
    return dsfab.run(load_preset(DOME_MODES, SMALL))


@pytest.fixture(scope="module")
def cantilever() -> Design:
    return dsfab.run(load_preset("cantilever", {"surface.edge": 0.05, "pattern.method": "stripes"}))


def segments(lines):
    starts, ends = zip(*((line.points[:-1], line.points[1:]) for line in lines), strict=True)
    return np.concatenate(starts), np.concatenate(ends)


@pytest.mark.slow
@pytest.mark.parametrize("which", ["dome", "cantilever"])
def test_middles_end_on_middles_or_with_the_sheet(which, request):
    """Or at a face that has no phase: there the member ends too."""
    made = request.getfixturevalue(which)
    lines, even = design_lines(made), made.pattern.even
    blank = np.any([phase.singular for phase in even.phases], axis=0)
    odd = made.surface.V[made.surface.F[blank]].reshape(-1, 3)
    outline = segments([line for line in lines if line.kind == "edge"])
    on_others = 0
    for name, other in (("major", "minor"), ("minor", "major")):
        crossing = segments([line for line in lines if line.layer == f"centre-{other}"])
        for line in (line for line in lines if line.layer == f"centre-{name}" and not line.is_closed):
            for end in line.points[[0, -1]]:
                meets = distances_from_segments(end[None], *crossing).min() < NEAR * made.surface.mean_edge
                on_others += meets
                near = len(odd) and np.linalg.norm(odd - end, axis=1).min() < made.surface.mean_edge
                assert meets or near or distances_from_segments(end[None], *outline).min() < 1e-6, (line.id, end)
    assert on_others > 5
    assert any(len(wanted) for wanted in even.wanted)  # so something is halved


def test_middles_are_as_long_as_the_density_says(dome):
    """Co-area: lines in all are as long as the integral of their number per metre; they miss singular faces only, and
    what is taken off as it ends in the air.

    The line along the base has the surface on one side only, and counts half.
    """
    lines, even, surface = design_lines(dome), dome.pattern.even, dome.surface
    for k, name in enumerate(("major", "minor")):
        slope = np.linalg.norm(even.phases[k].gradients(surface), axis=1) * ~even.phases[k].singular
        chart = even.chart
        share = np.bincount(chart.parent, chart.surface.areas * chart.scale[chart.surface.F[:, 0], k], surface.m)
        asked = float(slope @ share)
        mine = [line for line in lines if line.layer == f"centre-{name}"]
        length = sum(
            line.length * (0.5 if np.ptp(line.points[:, 2]) + line.points[0, 2] < 1e-9 else 1) for line in mine
        )
        assert length == pytest.approx(asked, rel=0.05)


def test_edges_outline_the_sheet_and_lie_beside_the_middle_of_their_number(cantilever):
    """Its phases have one value nearly everywhere, so edges are at z = k + d or k - d, d in periods of all lines."""
    lines, sheet, pattern = design_lines(cantilever), cantilever.sheet, cantilever.pattern
    even = pattern.even
    ends = sheet.surface.V[sheet.surface.edges.ends[sheet.surface.edges.boundary]]
    outline = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum()
    assert sum(line.length for line in lines if line.kind == "edge") == pytest.approx(outline)
    near = {tuple(v): i for i, v in enumerate(sheet.surface.V.round(9).tolist())}
    for k, name in enumerate(("major", "minor")):
        seen = even.phases[k].corners(cantilever.surface)[:, :, None]
        z = sheet.carry_corners(seen, cantilever.surface.F)[:, 0]
        levels = {int(v) for i, n in enumerate(pattern.names) if n == name for v in pattern.levels[i]}
        drawn = {line.number for line in lines if line.layer == f"centre-{name}"}
        assert drawn <= levels
        off = []
        for line in (line for line in lines if line.layer == f"edges-{name}"):
            at = [near[tuple(point)] for point in line.points.round(9).tolist()]
            off.append(np.median(np.abs(z[at] - line.number)))
        most = 2 ** len(even.wanted[k])
        assert np.quantile(off, 0.95) < 0.51 * most  # stripes whose edges meet; one or two pass a face without a phase
        assert len(off) > 20


def test_lines_of_a_design_have_names_of_their_own(dome):
    lines = design_lines(dome)
    assert len({line.id for line in lines}) == len(lines)
    assert {"centre-major", "centre-minor", "edges-major", "edges-minor"} <= {line.layer for line in lines}
    rings = [line for line in lines if line.layer == "centre-major"]
    assert all(line.is_closed for line in rings)
    assert rings == sorted(rings, key=lambda line: (line.number, line.part))


@pytest.mark.parametrize(
    "suffix",
    [
        *(".svg", ".csv", ".json"),
        *(pytest.param(suffix, marks=pytest.mark.slow) for suffix in (".dxf", ".3dm", ".lines.step")),
    ],
)
def test_all_line_formats_write_evenly_spaced_stripes(suffix, dome, tmp_path):
    """Each is read back as it is written; of two the layers are counted again here."""
    thing, how = deliverable(dome, suffix)
    path = write(thing, tmp_path / f"dome{suffix}", name="dome", **how)
    counts = Counter(line.layer for line in how["details"].lines)
    assert counts["centre-major"] >= 4
    if suffix == ".dxf":
        entities = [entity for entity in ezdxf.readfile(path).modelspace() if entity.has_xdata("DSFAB")]
        found = {(entity.get_xdata("DSFAB")[0].value, entity.dxf.layer) for entity in entities}
        assert found == {(line.id, line.layer.upper()) for line in how["details"].lines}
    if suffix == ".json":
        told = json.loads(path.read_text())["lines"]
        assert Counter(line["id"].rpartition("-")[0].rstrip("-") for line in told) == counts


def test_fields_have_one_value_at_each_vertex(dome):
    fields, even = design_fields(dome), dome.pattern.even
    for k, name in enumerate(("major", "minor")):
        middle, density = fields[f"{name} middle [m]"], fields[f"{name} density [1/m]"]
        assert middle.shape == (dome.surface.n,)
        assert f"{name} phase [1]" not in fields
        assert (middle >= 0).all()
        assert (middle * density <= 0.5 + 1e-12).all()
        at = dome.surface.V
        lines = [line for line in design_lines(dome) if line.layer == f"centre-{name}"]
        true = np.array([distances_from_segments(point[None], *segments(lines)).min() for point in at])
        assert (
            np.median(np.abs(true - middle)) < 0.06
        )  # of 1 m and more: lines bend, and some of them are near the crown
        assert fields[f"{name} wave [1]"] == pytest.approx(1 - 4 * middle * density)
        assert np.array_equal(density, even.density[:, k])


def test_the_archive_keeps_every_array(dome, tmp_path):
    write_archive(dome, tmp_path)
    back = read_archive(tmp_path, dome.preset)
    assert back is not None
    ours, theirs = dome.pattern.even, back.pattern.even
    assert theirs is not None
    for one, two in zip(dome.pattern.fields, back.pattern.fields, strict=True):
        assert type(one) is type(two)
        parts = [part.name for part in names_of(one)] if hasattr(one, "corners") else []
        for part in parts:
            a, b = getattr(one, part), getattr(two, part)
            assert (a is None) == (b is None)
            assert a is None or (a.dtype == b.dtype and a.tobytes() == b.tobytes()), part
    for k in (0, 1):
        for part in ("value", "sign", "shift", "singular"):
            assert getattr(ours.phases[k], part).tobytes() == getattr(theirs.phases[k], part).tobytes(), part
        assert [x.tobytes() for x in ours.wanted[k]] == [x.tobytes() for x in theirs.wanted[k]]
    for part in ("slope", "density"):
        assert getattr(ours, part).tobytes() == getattr(theirs, part).tobytes()
    assert ours.first == theirs.first
    for part in ("parent", "z", "scale"):
        assert getattr(ours.chart, part).tobytes() == getattr(theirs.chart, part).tobytes()
    assert ours.chart.surface.V.tobytes() == theirs.chart.surface.V.tobytes()
    assert (ours.chart.weights != theirs.chart.weights).nnz == 0
    for one, two in zip(design_lines(dome), design_lines(back), strict=True):
        assert (one.id, one.points.tobytes()) == (two.id, two.points.tobytes())


@pytest.mark.parametrize(
    "change",
    [
        {"pattern.width.solid_fraction": 0.5},
        pytest.param({"pattern.width": {"rule": "graded", "solid_fraction": 0.3}}, marks=pytest.mark.slow),
        pytest.param({"pattern.rim": 0.2, "pattern.keep": 0.1, "pattern.minor.threshold": 0.1}, marks=pytest.mark.slow),
        pytest.param({"slicing.snap": 0.1}, marks=pytest.mark.slow),
    ],
)
def test_another_width_keeps_the_stripes(change, dome):
    other = dsfab.revise(dome, with_overrides(dome.preset, change))
    assert other.pattern.even is dome.pattern.even
    assert other.seconds["stripes"] == dome.seconds["stripes"]
    assert other.sheet.surface.n != dome.sheet.surface.n


@pytest.mark.parametrize(
    "change",
    [
        {"pattern.major.spacing": 1.5},
        pytest.param({"pattern.halve": False}, marks=pytest.mark.slow),
        pytest.param({"pattern.symmetry": "none"}, marks=pytest.mark.slow),
        pytest.param({"surface.load.1.force": [0, 0, -9e4]}, marks=pytest.mark.slow),
    ],
)
def test_another_distance_or_load_makes_the_stripes_anew(change, dome):
    made = design.draft(with_overrides(dome.preset, change), earlier=dome)
    assert made.pattern.even is not dome.pattern.even
    fresh = design.draft(with_overrides(dome.preset, change))
    for ours, theirs in zip(made.pattern.even.phases, fresh.pattern.even.phases, strict=True):
        assert np.array_equal(ours.value, theirs.value)


def test_stripes_come_back_after_modes(dome):
    modes = design.draft(with_overrides(dome.preset, {"pattern.method": "modes"}), earlier=dome)
    assert modes.pattern.even is None
    back = design.draft(dome.preset, earlier=modes)
    assert np.array_equal(back.pattern.even.slope, dome.pattern.even.slope)


def test_competitors_share_the_mean_distance(dome):
    task = ComparisonTask.from_design(dome, 60.0)
    assert task.even is dome.pattern.even
    pairs = ((dome.diffusion.major, 1.6), (dome.diffusion.minor, 1.0))
    asked = [frequency_for(dome.surface, modes.mode(1), spacing) for modes, spacing in pairs]
    assert task.frequency == pytest.approx(asked)
    given = task.on_modes.pattern
    assert (given.method, given.major.spacing, given.minor.spacing) == ("modes", 1.6, 1.0)
    assert given.width == dome.preset.pattern.width
    on_modes = ComparisonTask.from_design(design.draft(load_preset(DOME_MODES, {"surface.edge": 1.2})), 60.0)
    assert on_modes.on_modes is on_modes.preset


@pytest.mark.slow
def test_a_comparison_at_another_mass_widens_the_same_stripes(dome):
    found = compare_at(dome, 0.5, ["isotropic", "grid"])
    assert found.design.area_fraction == pytest.approx(0.5, abs=1e-3)
    assert found.design.structure.names == dome.pattern.names  # the coarse lines, and those between them
    for rival in found.rivals:
        assert rival.error == ""
        assert rival.area_fraction == pytest.approx(0.5, abs=1e-3)
        assert found.gain(rival.name) > 1.2


def test_a_sweep_varies_the_distance_and_measures_widths():
    made, width = None, []
    for spacing in (2.0, 1.2):
        preset = load_preset(DOME_MODES, SMALL | {"pattern.major.spacing": spacing, "pattern.width.solid_fraction": 0.0,
                                              "pattern.width.member": 0.3})  # fmt: skip
        made = Design.from_preset(preset, made)
        width.append(metric_value("min_width", made))
        assert made.pattern.even is not None
    assert width == pytest.approx([0.3, 0.3], rel=0.1)


def test_fabrication_asks_for_more_distance(dome):
    limited = dsfab.revise(dome, with_overrides(dome.preset, {"fabrication.min_member": 0.5}))
    changes = fewer_stripes(limited, fabrication(limited))
    assert changes.keys() == {"pattern.major.spacing", "pattern.minor.spacing"}
    assert changes["pattern.major.spacing"] > 1.6 / 0.86


@pytest.mark.parametrize(
    ("changes", "spacings"),
    [
        ({"pattern.major.spacing": 1.1}, (1.1, 0.0)),
        ({"pattern.major": {"spacing": 1.1}, "pattern.minor": {}}, (1.1, 0.0)),
        ({"pattern.major": {"spacing": 0, "frequency": 0}}, (0.0, 0.0)),
        ({}, (0.0, 0.0)),
    ],
)
def test_no_frequency_needs_to_be_taken_back(changes, spacings, tmp_path):
    """The dome has frequencies in its file; what is set instead of them takes their place."""
    preset = load_preset(DOME_MODES, {"pattern.method": "stripes", **changes})
    assert (preset.pattern.major.spacing, preset.pattern.minor.spacing) == spacings
    assert preset.pattern.minor.distance(144.0, 0.3) == 1.0
    assert preset.pattern.minor.distance(144.0, 1.2) == 1.2  # not closer than triangles are large
    (tmp_path / "again.toml").write_text(preset_toml(preset))
    assert load_preset(tmp_path / "again.toml") == preset


def test_one_of_two_keys_takes_the_place_of_the_other_and_both_are_refused():
    spaced = with_overrides(load_preset(DOME_MODES), {"pattern.major.spacing": 0.8})
    assert (spaced.pattern.major.spacing, spaced.pattern.major.frequency) == (0.8, 0.0)
    back = with_overrides(spaced, {"pattern.major.frequency": 7.0})
    assert back.pattern == load_preset(DOME_MODES).pattern
    both = {"pattern.major.spacing": 0.8, "pattern.major.frequency": 7.0}
    for method in ("modes", "stripes"):
        with pytest.raises(PresetError, match=r"pattern\.major: give either frequency or spacing"):
            load_preset(DOME_MODES, both | {"pattern.method": method})


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"pattern.major.spacing": 0.001},
            r"pattern\.major\.spacing = 0\.001 m is too fine for this mesh, .* 0\.31 m or",
        ),
        (
            {"pattern.minor.spacing": 1000.0},
            r"pattern\.minor\.spacing = 1000 m is too large for two stripes on this surface, .* 17\.4 m",
        ),
        ({"pattern.minor.spacing": 1200.0}, r"the default is .* m \(lengths are in metres: 1\.2 for 1200 mm\)$"),
        ({"pattern.minor.spacing": 1e6}, r"the default is [\d.]+ m$"),
        (
            {"pattern.minor.spacing": 8.5},
            r"pattern\.minor\.spacing = 8\.5 m is too large for two stripes on this surface",
        ),
        ({"pattern.major.spacing": -1.0}, r"pattern\.major\.spacing = -1\.0: should be greater than or equal to 0"),
        ({"pattern.method": "stripe"}, r"pattern\.method = 'stripe': should be .* did you mean stripes"),
    ],
)
def test_a_mistyped_value_is_refused_in_one_sentence(changes, told):
    with pytest.raises(DsfabError, match=told):
        design.draft(load_preset(DOME_MODES, SMALL | changes))
