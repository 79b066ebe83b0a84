"""A verdict on a sheet that its needles keep from being solved."""

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array, vstack

from dsfab.slicing import Sheet
from dsfab.statics import Material, SheetMaterial
from dsfab.study.verdict import LoadedSurface, check, whole_sheet
from dsfab.surface import LoadCase, Surface
from tests.shapes import lifted


def wavy() -> LoadedSurface:
    """A wavy sheet that is held at one end, under forces at the other."""
    surface = lifted(lambda x, y: 0.3 * np.sin(3 * x) * y, 6)
    x = surface.V[:, 0]
    end = x > x.max() - 1e-9
    load = LoadCase(np.repeat((x < x.min() + 0.2)[:, None], 3, axis=1), np.outer(end, [0, 0, -100.0]), end)
    return LoadedSurface(surface, SheetMaterial(Material(2e9, 0.3, 1.0), 0.01), {"load": load})


def with_needles(surface: Surface, share: float) -> Sheet:
    """All of it, with a vertex more in every fourth face, that share of its height off an edge: one needle for each."""
    n, F = surface.n, surface.F
    face = np.arange(0, surface.m, 4)
    rest, new = np.setdiff1d(np.arange(surface.m), face), n + np.arange(len(face))
    near = np.tile([share, (1 - share) / 2, (1 - share) / 2], len(face))
    more = csr_array((near, (np.repeat(np.arange(len(face)), 3), F[face].ravel())), shape=(len(face), n))
    weights = csr_array(vstack([eye_array(n), more]))
    a, b, c = F[face].T
    cells = np.concatenate([F[rest], np.c_[a, b, new], np.c_[b, c, new], np.c_[c, a, new]])
    parent = np.concatenate([rest, face, face, face])
    return Sheet(Surface(weights @ surface.V, cells), parent, np.zeros(len(cells), dtype=int), weights)


def test_a_sheet_with_needles_is_solved_with_better_cells():
    """It was called nearly a mechanism, which it is not."""
    setting = wavy()
    spoilt = with_needles(setting.surface, 1e-7)
    alone, found, sound = (
        check(setting, spoilt),
        check(setting, spoilt, cells=spoilt),
        check(setting, whole_sheet(setting.surface)),
    )
    assert "nearly a mechanism" in alone.reason
    assert "nearly a mechanism" not in found.reason
    assert len(found.levels) > len(alone.levels)
    assert found.levels[0].triangles < spoilt.surface.m
    assert found.value == pytest.approx(sound.value, rel=found.bound + sound.bound)
