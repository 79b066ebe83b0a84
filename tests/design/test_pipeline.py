"""The whole line: every preset to a proven solid, revisions that reuse, and the numbers recorded for each preset."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import dsfab
from dsfab.core.errors import DsfabError
from dsfab.design import PARTS, ROWS, TIMED
from dsfab.preset.model import STAGES
from tests.designs import sliced
from tests.meshes import mesh_file
from tests.presets import (
    BARREL_VAULT_MODES,
    DOME_MODES,
    FIGURINE_MODES,
    GLOBE_MODES,
    ROOF_MODES,
    SPHERE_GRADED_MODES,
    on_modes,
)

SMALL = {
    "dome": {"surface.edge": 0.7, "pattern.width": {}},
    "globe": {"surface.edge": 0.13},
    "barrel_vault": {"surface.edge": 0.55},
    "cantilever": {"surface.edge": 0.07},
    "tower": {"surface.edge": 0.9},
}
"""The shipped shapes on coarse meshes, for tests of laws rather than of numbers."""


TORUS = {
    "shape": "torus",
    "edge": 0.8,
    "support": [{"at": {"pick": "side", "axis": "z", "end": "min", "depth": 0.2}}],
    "load": [{"kind": "self_weight"}],
}


@pytest.fixture(scope="module")
def small():
    return {name: dsfab.run(dsfab.load_preset(on_modes(name), changes)) for name, changes in SMALL.items()}


def judged(design) -> None:
    """A solid by status, closedness, volume and genus, by judges that are not ours."""
    solid, sheet = design.solid, design.sheet.surface
    mesh = trimesh.Trimesh(solid.V, solid.F, process=False)
    assert mesh.is_volume
    assert mesh.volume == pytest.approx(solid.volume, rel=1e-9)
    assert solid.volume == pytest.approx(sheet.area * design.preset.statics.thickness, rel=0.02)
    assert mesh.body_count >= len(design.slicing.pieces)
    euler = len(solid.V) - len(mesh.edges_unique) + len(solid.F)
    assert solid.genus == len(design.slicing.pieces) - euler // 2


@pytest.mark.parametrize("name", SMALL)
def test_every_shape_gives_a_closed_solid_whose_volume_is_area_times_thickness(small, name):
    judged(small[name])


def _stem(value) -> str | None:
    return Path(value).stem if isinstance(value, str) else None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "vertices", "kept", "genus"),
    [
        (DOME_MODES, 2509, 0.400, 300),
        (GLOBE_MODES, 2892, 0.450, 316),
        (BARREL_VAULT_MODES, 2464, 0.369, 56),
        (SPHERE_GRADED_MODES, 4002, 0.500, 552),
        ("dome", 2509, 0.400, 240),
        ("globe", 4002, 0.450, 287),
        ("barrel_vault", 2464, 0.339, 39),
        ("cantilever", 5988, 0.500, 82),
        ("tower", 2800, 0.312, 155),
        ("cantilever_light", 5988, 0.300, 102),
        ("sphere_graded", 4002, 0.500, 223),
        ("snow_vault", 2623, 0.450, 169),
        ("gridshell", 9392, 0.277, 330),
    ],
    ids=_stem,
)
def test_presets_keep_their_recorded_numbers(name, vertices, kept, genus):
    design = sliced(dsfab.load_preset(name))
    judged(design)
    assert design.surface.n == vertices
    assert len(design.slicing.pieces) == 1
    assert design.slicing.pieces[0].held
    assert design.slicing.pieces[0].loaded == design.load.loaded.any()
    assert design.statics.equilibrium.imbalance < 1e-8
    assert design.sheet.surface.area / design.surface.area == pytest.approx(kept, abs=0.005)
    assert design.solid.genus == pytest.approx(genus, abs=4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("preset", "file", "changes"),
    [
        (FIGURINE_MODES, "bob.obj", {}),
        (ROOF_MODES, "hypar.obj", {}),
        ("figurine", "spot.obj", {}),
        ("roof", "hypar.obj", {"surface.refine": 0.15}),
        ("roof", "roof_with_opening.obj", {"surface.refine": 0.15}),
        ("roof", "Botanic.obj", {"statics.thickness": 0.1}),
    ],
    ids=_stem,
)
def test_real_surfaces_give_proven_solids(preset, file, changes):
    judged(sliced(dsfab.load_preset(preset, changes, mesh=mesh_file(file))))


def test_same_preset_same_solid(small):
    again = dsfab.run(dsfab.load_preset(DOME_MODES, SMALL["dome"]))
    assert np.array_equal(again.solid.V, small["dome"].solid.V)
    assert np.array_equal(again.solid.F, small["dome"].solid.F)


@pytest.mark.parametrize(
    ("changes", "first"),
    [
        ({"surface.span": 11.0}, "surface"),
        ({"statics.young": 70e9}, "statics"),
        ({"diffusion.gamma": 3.0}, "diffusion"),
        ({"pattern.major.frequency": 5.0}, "pattern"),
        ({"slicing.snap": 0.1}, "slicing"),
        ({"thickening.thinnest": 0.5}, "thickening"),
        ({"export.step_faces": 5}, None),
    ],
)
def test_revise_remakes_the_changed_stage_and_reuses_all_before(small, changes, first):
    old, preset = small["dome"], dsfab.load_preset(DOME_MODES, {**SMALL["dome"], **changes})
    new = dsfab.revise(old, preset)
    made = len(STAGES) if first is None else STAGES.index(first)
    for i, stage in enumerate(("surface", "statics", "diffusion", "pattern", "slicing")):
        assert (getattr(new, stage) is getattr(old, stage)) == (i < made)
    fresh = dsfab.run(preset)
    assert np.array_equal(new.solid.V, fresh.solid.V)
    assert np.array_equal(new.solid.F, fresh.solid.F)
    assert new.notes == fresh.notes
    assert set(new.seconds) == set(fresh.seconds)


def test_every_stage_is_announced_in_order_and_timed(small):
    said = []
    design = dsfab.run(dsfab.load_preset(DOME_MODES, SMALL["dome"]), lambda stage, doing: said.append((stage, doing)))
    assert [stage for stage, _ in said] == ["surface", "statics", "diffusion", "pattern", "slicing", "thickening"]
    assert all(doing for _, doing in said)
    rows = {row for rows in (*ROWS.values(), *PARTS.values()) for row in rows}
    assert set(design.seconds) == rows - {
        "choice",
        "method",
        "stripes",
        "widths",
    }  # nothing is auto, evenly spaced or stressed
    assert set(TIMED) <= set(design.seconds)
    assert "bending" not in small["cantilever"].seconds  # a flat sheet in its plane does not bend


def test_kept_share_without_kept_regions_is_that_of_two_independent_families():
    """Stripes along x and y on a plate, m = 0.2: 1 - (1 - 0.4)^2 of the area, up to the ends of the stripes."""
    changes = {**SMALL["cantilever"], "pattern.keep": 0, "pattern.rim": 0, "pattern.width": {}, "slicing.loose": "keep"}
    for family in ("major", "minor"):
        changes |= {f"pattern.{family}.threshold": 0.2, f"pattern.{family}.frequency": 40.0, "diffusion.r": 1}
    design = dsfab.run(dsfab.load_preset("cantilever", {**changes, "pattern.minor.mode": 2}))
    assert design.sheet.surface.area / design.surface.area == pytest.approx(1 - 0.6**2, abs=0.03)


@pytest.mark.parametrize("threshold", [-1.0, 1.0])
def test_one_family_may_cover_all_or_nothing(threshold):
    changes = {**SMALL["dome"], "pattern.minor.threshold": threshold, "slicing.loose": "keep"}
    design = dsfab.run(dsfab.load_preset(DOME_MODES, changes))
    whole = design.sheet.surface.area == pytest.approx(design.surface.area, rel=1e-12)
    assert whole == (threshold == -1.0)


def test_loose_pieces_are_dropped_with_a_note_or_kept_on_request():
    changes = {**SMALL["dome"], "pattern.minor.threshold": 1.0, "pattern.keep": 0.3}
    dropped = dsfab.run(dsfab.load_preset(DOME_MODES, changes))
    kept = dsfab.run(dsfab.load_preset(DOME_MODES, {**changes, "slicing.loose": "keep"}))
    assert all(piece.held for piece in dropped.slicing.pieces)
    assert len(kept.slicing.pieces) > len(dropped.slicing.pieces)
    assert not all(piece.held for piece in kept.slicing.pieces)
    assert any("reach no support and were dropped" in note.text for note in dropped.notes)
    assert any("reach no support and were kept" in note.text for note in kept.notes)
    areas = [piece.area for piece in kept.slicing.pieces]
    assert sum(areas) == pytest.approx(kept.sheet.surface.area)


def test_a_load_on_removed_material_gives_a_note():
    changes = {**SMALL["dome"], "pattern.keep": 0.0, "pattern.minor.mode": 7}
    changes |= {"pattern.major.threshold": 0.35, "pattern.minor.threshold": 0.35}
    seen = set()
    for phase in (0.0, 0.25, 0.5, 0.75):
        phases = {"pattern.major.phase": phase, "pattern.minor.phase": 0.3}
        design = dsfab.run(dsfab.load_preset(DOME_MODES, {**changes, **phases}))
        seen.add(any("loaded points lie on removed material" in note.text for note in design.notes))
    assert seen == {True, False}


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"pattern.major.mode": 9}, r"pattern\.major\.mode = 9, but dsfab computes only 8"),
        ({"pattern.major.threshold": 1.0, "pattern.minor.threshold": 1.0, "pattern.keep": 0.0}, "leaves no material"),
        ({"surface.support.0.hold": "z"}, "can move along"),
        ({"surface.support": []}, "no support"),
        ({"surface.load": []}, "no load"),
        ({"surface.support.0.at": {"pick": "ball", "center": [0, 0, 90], "radius": 1}}, "picks no vertex"),
        ({"statics.density": 0.0}, "self_weight"),
        ({"surface": TORUS, "statics.thickness": 2.0, "thickening.thinnest": 0.9}, r"bends so sharply at \(.* m that"),
        ({"statics.thickness": 60.0}, r"17\.. m large and the sheet 60 m thick, which is impossible"),
        ({"statics.thickness": 6e-5}, "which is impossible; check surface.unit"),
        ({"surface.edge": 1e-4}, "edge"),
    ],
)
def test_designs_that_cannot_be_built_are_refused_with_a_sentence(changes, says):
    with pytest.raises(DsfabError, match=says) as caught:
        dsfab.run(dsfab.load_preset(DOME_MODES, {**SMALL["dome"], **changes}))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


def test_a_coarse_mesh_gives_a_note_with_a_better_size(small):
    assert any("coarse for the anisotropy r = 100" in note.text for note in small["dome"].notes)
    fine = dsfab.run(dsfab.load_preset(DOME_MODES, {**SMALL["dome"], "diffusion.r": 2.0}))
    assert not any("coarse" in note.text for note in fine.notes)


def test_an_unusual_thickness_gives_a_note():
    thick = dsfab.run(dsfab.load_preset(DOME_MODES, {**SMALL["dome"], "statics.thickness": 2.0}))
    assert any("statics need a ratio of size to thickness of about" in note.text for note in thick.notes)


def test_a_load_that_bends_the_sheet_too_far_gives_a_note():
    soft = {**SMALL["dome"], "statics.young": 1e6, "statics.check": False}
    notes = dsfab.run(dsfab.load_preset(DOME_MODES, soft)).notes
    assert any("over a tenth of its span" in note.text for note in notes)
