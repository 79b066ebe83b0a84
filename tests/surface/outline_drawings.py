"""Outlines and drawings of them."""

from pathlib import Path

import ezdxf
import numpy as np

from dsfab.surface import ClosedCurves


def star(seed: int, corners: int) -> np.ndarray:
    """(k, 2) a polygon that does not cross itself, around (0, 0)."""
    rng = np.random.default_rng(seed)
    turn = np.sort(2 * np.pi * (np.arange(corners) + 0.8 * rng.random(corners)) / corners)
    return (0.3 + rng.random(corners))[:, None] * np.c_[np.cos(turn), np.sin(turn)]


def drawing(path: Path, unit: int = 4) -> "ezdxf.document.Drawing":
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = unit
    return document


DOOR = ClosedCurves(curves=(((-0.3, -2, -0.5), (0.3, -2, -0.5), (0.3, -2, 0.4), (-0.3, -2, 0.4)),))
