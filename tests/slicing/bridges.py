"""A check that narrow members were widened."""

import pytest

from dsfab.slicing import Sheet
from dsfab.surface import Surface
from dsfab.surface.topology import manifold_faults
from tests.slicing.laws import check_laws, material_area


def check_bridged(uncut: Surface, before: Sheet, after: Sheet) -> None:
    """Material is added only, and fits."""
    check_laws(uncut, after)
    assert manifold_faults(after.surface.F, after.surface.edges, after.surface.n) == ()
    assert material_area(after) >= material_area(before)
    assert after.weights @ uncut.V == pytest.approx(after.surface.V, abs=1e-12)
