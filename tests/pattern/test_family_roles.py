"""Names of families of stripes by the part that they play: arches, hoops and purlins, pulled or pressed."""

import numpy as np
import pytest

from dsfab.core.arrays import unit_vectors
from dsfab.design.pattern_measures import one_family_message
from dsfab.pattern import FamilyRole, StressDirections, family_roles
from dsfab.surface import Surface
from tests.shapes import annulus, lifted, tube


def dome(rise: float = 0.5) -> Surface:
    return lifted(lambda x, y: rise * (1 - x**2 - y**2), cells=12)


def vault() -> Surface:
    return lifted(lambda x, y: 0.5 * (1 - x**2), cells=12)


def level_and_rising(surface: Surface, level: float, rising: float) -> StressDirections:
    """Stresses along level lines, the major family, and across them; x where the surface is level."""
    slope = np.cross([0.0, 0.0, 1.0], surface.normals)
    first = unit_vectors(np.where(np.linalg.norm(slope, axis=1)[:, None] > 1e-9, slope, [1.0, 0.0, 0.0]))
    direction = np.stack([first, np.cross(surface.normals, first)], axis=1)
    return StressDirections(np.tile([level, rising], (surface.m, 1)), direction)


def titles(surface: Surface, level: float, rising: float) -> list[str]:
    return [role.title for role in family_roles(surface, level_and_rising(surface, level, rising))]


def test_level_members_of_a_dome_are_hoops_and_those_of_a_vault_purlins():
    assert titles(dome(), -1.0, -2.0) == ["hoops (major, pressed)", "arches (minor, pressed)"]
    assert titles(dome(), 1.0, -2.0) == ["hoops (major, pulled)", "arches (minor, pressed)"]
    assert titles(vault(), -1.0, -2.0) == ["purlins (major, pressed)", "arches (minor, pressed)"]


@pytest.mark.parametrize("surface", [dome(0.05), tube(24, 8), annulus(24, 8)], ids=["shallow", "tower", "plate"])
def test_a_plate_and_a_tower_have_neither_arches_nor_hoops(surface):
    assert titles(surface, 1.0, -1.0) == ["major members (pulled)", "minor members (pressed)"]


def test_a_hanging_roof_has_no_arches():
    assert titles(dome(-0.5), 1.0, 2.0) == ["major members (pulled)", "minor members (pulled)"]


def test_members_between_level_and_rising_have_no_shape():
    given = level_and_rising(dome(), 1.0, -1.0)
    first, second = given.direction[:, 0], given.direction[:, 1]
    oblique = np.stack([unit_vectors(first + second), unit_vectors(second - first)], axis=1)
    assert {role.shape for role in family_roles(dome(), StressDirections(given.stress, oblique))} == {""}


def test_a_family_that_is_pulled_on_half_of_its_area_is_both():
    surface = annulus(24, 8)
    stress = np.stack([np.sign(surface.centroids[:, 0]), np.full(surface.m, -1.0)], axis=1)
    major, minor = family_roles(surface, StressDirections(stress, level_and_rising(surface, 1, 1).direction))
    assert major.pulled == pytest.approx(0.5, abs=0.05)
    assert major.title == "major members (partly pulled, partly pressed)"
    assert minor.pulled == 0
    assert FamilyRole("minor").title == "minor members"


def test_a_note_names_the_family_that_carries_the_loads():
    roles = family_roles(dome(), level_and_rising(dome(), -1.0, -2.0))
    message = one_family_message(roles, "major")
    assert message.startswith("pattern.families = 'major' draws only the hoops (major, pressed), but the arches")
    assert message.endswith("set pattern.families = 'minor' or 'both'")
    assert one_family_message(roles, "minor") == one_family_message(roles, "both") == ""
    assert one_family_message((FamilyRole("major"), FamilyRole("minor")), "major") == ""
