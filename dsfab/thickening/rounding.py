"""Vertices as files of single precision hold them, so that what is tested is what is printed."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.units import MM_PER_M

FINE = 1e-3
"""Vertices are rounded when the largest step of rounding is under this share of half the thickness."""


def rounded(V: Floats) -> Floats:
    """V (n, 3), metres, at the nearest millimetres that single precision knows: STL and 3MF change nothing any more."""
    single: Floats = (V * MM_PER_M).astype(np.float32).astype(np.float64) / MM_PER_M
    return single


def is_fine(V: Floats, D: Floats) -> bool:
    """Whether rounding moves vertices around V (n, 3) by little, compared with half the thickness |D| (n, 3)."""
    step = np.spacing(np.float32(np.abs(V).max() * MM_PER_M)) / MM_PER_M
    return bool(step <= FINE * np.median(np.linalg.norm(D, axis=1)))


def rounding_step(V: Floats, D: Floats) -> float:
    """Metres by which `rounded` moves skins V + 2 D, both (n, 3), at most: three coordinates by half a step each."""
    largest = (np.abs(V).max() + 2 * np.abs(D).max()) * MM_PER_M
    return float(np.spacing(np.float32(largest)) / MM_PER_M)
