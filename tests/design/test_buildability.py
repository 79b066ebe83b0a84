"""Objections and notes of the statics of a design, on either side of the limit of each."""

import pytest

import dsfab
from dsfab.design import Design
from dsfab.statics import facet_number
from tests.shapes import grid, lifted

ENDS = [{"at": {"pick": "side", "axis": "x", "end": end}} for end in ("min", "max")]


def plate(load: dict, **statics: object) -> dsfab.Preset:
    """A steel plate of 2 m x 1 m, held along its short edges."""
    return dsfab.Preset(
        surface=grid(16, 8, 2.0, 1.0),
        supports=ENDS,
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


def vault(rise: float, **statics: object) -> dsfab.Preset:
    """A shallow vault of 1 m x 1 m under pressure, held along two sides."""
    return dsfab.Preset(
        surface=lifted(lambda x, _: 4 * rise * x * (1 - x)),
        supports=ENDS,
        loads=[{"kind": "pressure", "pressure": 1e3}],
        statics={"thickness": 0.03, "material": "S235", "bending": "hhj"} | statics,
    )


def notes(preset: dsfab.Preset) -> str:
    return " ".join(note.text for note in Design(preset).until("statics").notes)


@pytest.mark.parametrize(("rise", "layers"), [(0.01, True), (0.014, False)])
def test_the_pattern_follows_all_layers_if_bending_stores_half_of_the_energy(rise, layers):
    """Bending stores 59 % of the energy of the lower vault, and 43 % of that of the higher one."""
    assert ("follows the stress in all layers" in notes(vault(rise, stress="auto"))) == layers


@pytest.mark.parametrize(("number", "noted"), [(0.17, False), (0.23, True)])
def test_a_mesh_whose_flat_faces_bend_too_much_is_noted(number, noted):
    thickness = 0.03 * facet_number(vault(0.1).surface.mesh, 0.03) / number
    assert ("each flat face bends" in notes(vault(0.1, thickness=thickness, check=False))) == noted
