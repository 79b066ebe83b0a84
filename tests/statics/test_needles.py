"""One solve for a number that is told: by the elements of its use, or by those that bear needles of faces."""

import numpy as np
import pytest

from dsfab.core.errors import StaticsError
from dsfab.statics import Material, SheetModel, elements_of, needle_message, solve_cases, solve_for
from dsfab.surface import LoadCase, Surface
from tests.shapes import lifted


def bent_sheet(gap: float) -> SheetModel:
    """A wavy sheet with a vertex so near to a neighbour, as a share of their edge, that two faces are needles."""
    surface = lifted(lambda x, y: 0.3 * np.sin(3 * x) * y, 10)
    V, middle = surface.V.copy(), int(np.abs(surface.V[:, :2] - 0.5).sum(axis=1).argmin())
    beside = surface.F[(middle == surface.F).any(axis=1)]
    other = int(beside[beside != middle][0])
    V[middle] = V[other] + gap * (V[middle] - V[other])
    return SheetModel(Surface(V, surface.F), Material(2e9, 0.3), 0.01)


def pressed(surface: Surface, held: float) -> dict[str, LoadCase]:
    x = surface.V[:, 0]
    end = x > x.max() - 1e-9
    force = np.where(end[:, None], [0.0, 0.0, -100.0], 0.0)
    return {"load": LoadCase(np.repeat((x < x.min() + held)[:, None], 3, axis=1), force, end)}


def test_needle_triangles_are_solved_by_robust_elements():
    whole, spoilt = bent_sheet(1.0), bent_sheet(1e-5)
    loads = pressed(spoilt.surface, 0.15)
    with pytest.raises(StaticsError):
        solve_cases(spoilt, loads, elements_of("displacement"))
    found = solve_for(spoilt, loads, "displacement")["load"]
    assert found.elements == elements_of("needles")
    sound = solve_for(whole, pressed(whole.surface, 0.15), "displacement")["load"]
    assert sound.elements == elements_of("displacement")
    assert found.compliance == pytest.approx(sound.compliance, rel=0.1)


def test_a_mechanism_is_refused_with_needles_or_without():
    for gap in (1.0, 1e-5):
        sheet = bent_sheet(gap)
        with pytest.raises(StaticsError, match="hold more directions"):
            solve_for(sheet, pressed(sheet.surface, 1e-9), "compliance_once")


@pytest.mark.parametrize(("height", "count"), [(0.017, 1), (0.023, 0)])
def test_a_triangle_is_a_needle_if_it_is_lower_than_a_fiftieth_of_its_longest_edge(height, count):
    message = needle_message(Surface([[0, 0, 0], [3, 0, 0], [1.5, 3 * height, 0], [1, -1, 0]], [[0, 1, 2], [1, 0, 3]]))
    assert message.startswith("1 of 2 triangle is a needle") == bool(count)
    assert bool(message) == bool(count)
