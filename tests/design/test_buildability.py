"""Objections and notes of the statics of a design, on either side of the limit of each."""

import numpy as np
import pytest

import dsfab
from dsfab.core.errors import SurfaceError
from dsfab.design import Design
from dsfab.statics import facet_number
from tests.shapes import grid, lifted


def plate(load: dict, support: dict | None = None, **statics: object) -> dsfab.Preset:
    """A steel plate of 2 m x 1 m, held along its short edges or by another support."""
    ends = [{"at": {"pick": "side", "axis": "x", "end": end}} for end in ("min", "max")]
    return dsfab.Preset(
        surface=grid(16, 8, 2.0, 1.0),
        supports=[*ends, support] if support else ends,
        loads=[load],
        statics={"thickness": 0.02, "material": "S235"} | statics,
    )


def objections(preset: dsfab.Preset) -> str:
    return " ".join(Design(preset).statics.objections)


def test_a_plate_that_would_move_by_more_than_a_tenth_of_its_span_is_refused():
    load = {"kind": "pressure", "pressure": 1e3}
    movement = Design(plate(load)).statics.equilibrium.largest_displacement
    for share, refused in ((0.09, False), (0.11, True)):
        preset = plate({**load, "pressure": 1e3 * share * 2.0 / movement}, check=False)
        assert ("would move by" in objections(preset)) == refused


@pytest.mark.parametrize(("height", "refused"), [(0.5, False), (0.6, True)])
def test_a_load_at_a_point_above_the_plate_is_refused_if_it_is_a_quarter_of_the_size_away(height, refused):
    """The plate's diagonal is 2.24 m, and a quarter of it .56 m."""
    preset = plate({"kind": "force", "force": [0, 0, -1e3], "at": {"pick": "nearest", "points": [[1, 0.5, height]]}})
    if not refused:
        assert Design(preset).statics
        return
    with pytest.raises(SurfaceError, match="away from the nearest vertex"):
        Design(preset).statics  # noqa: B018


@pytest.mark.parametrize(("offset", "noted"), [(0.0625, False), (1.0, True)])
def test_a_support_of_one_vertex_is_noted_if_it_carries_more_than_a_twentieth(offset, noted):
    at = {"pick": "nearest", "points": [[offset, 0.5, 0]]}
    preset = plate({"kind": "pressure", "pressure": 1e3}, {"at": at, "hold": "z"})
    design = Design(preset).until("statics")
    assert any("holds only 1 vertex" in note.text for note in design.notes) == noted


@pytest.mark.parametrize(("slope", "refused"), [(2e-3, False), (5e-4, True)])
def test_snow_on_a_wall_is_refused_unless_a_thousandth_of_it_lies_there(slope, refused):
    flat = grid(6, 6, 1.0, 1.0)
    wall = dsfab.Surface(np.stack([flat.V[:, 0], slope * flat.V[:, 1], flat.V[:, 1]], axis=1), flat.F)
    preset = dsfab.Preset(
        surface=wall,
        supports=[
            {"at": {"pick": "side", "axis": "z", "end": "min"}},
            {"at": {"pick": "side", "axis": "z", "end": "max"}, "hold": "y"},
        ],
        loads=[{"kind": "snow", "pressure": 1e3}],
        statics={"thickness": 0.02, "material": "S235", "check": False},
    )
    assert ("is parallel to its faces" in objections(preset)) == refused


def vault(rise: float, **statics: object) -> dsfab.Preset:
    """A shallow vault of 1 m x 1 m under pressure, held along two sides."""
    ends = [{"at": {"pick": "side", "axis": "x", "end": end}} for end in ("min", "max")]
    return dsfab.Preset(
        surface=lifted(lambda x, _: 4 * rise * x * (1 - x)),
        supports=ends,
        loads=[{"kind": "pressure", "pressure": 1e3}],
        statics={"thickness": 0.03, "material": "S235", "bending": "hhj"} | statics,
    )


def notes(preset: dsfab.Preset) -> str:
    return " ".join(note.text for note in Design(preset).until("statics").notes)


@pytest.mark.parametrize(("rise", "layers"), [(0.01, True), (0.014, False)])
def test_the_pattern_follows_all_layers_if_bending_stores_half_of_the_energy(rise, layers):
    """Bending stores 59 % of the energy of the lower vault, and 43 % of that of the higher one."""
    assert ("follows the stress of all layers" in notes(vault(rise, stress="auto"))) == layers


@pytest.mark.parametrize(("number", "noted"), [(0.17, False), (0.23, True)])
def test_a_mesh_whose_flat_faces_bend_too_much_is_noted(number, noted):
    thickness = 0.03 * facet_number(vault(0.1).surface.mesh, 0.03) / number
    assert ("each flat face bends" in notes(vault(0.1, thickness=thickness, check=False))) == noted
