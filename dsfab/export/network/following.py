"""Curves of edges over the faces beside them: where a patch or a trimmed face is exactly what a curve runs on."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.network.heights import places
from dsfab.export.network.model import NetPatch
from dsfab.export.network.trimmed import TrimmedFace
from dsfab.export.splines import bernstein

NEARLY = 1e-6
"""Millimetres that faces may be off what a seam goes on for."""

ALONG = np.linspace(0, 1, 17)
"""Where that is measured."""

STEPS = 5
"""Of Newton's method for a point of a side, from the nearest of `ALONG`."""


def on_face(face: TrimmedFace, poles: Floats) -> Floats | None:
    """(2, 4, 2) poles of curves (4, 6) over the outer and the inner surface of a trimmed face, if it follows them."""
    if np.abs(face.gaps(bernstein(ALONG) @ poles)).max() > NEARLY:
        return None
    both = zip((face.outer, face.inner), face.axes, np.split(poles, 2, axis=1), strict=True)
    return np.stack([places(*each) for each in both])


def on_patch(patch: NetPatch, edge: Floats, share: Floats, poles: Floats) -> Floats | None:
    """(2, 2, 2) ends of curves (4, 6) over a patch, if they run along one of its sides.

    edge : (4, 6) of the part that lies on the side.    share : (2,) of its parameter that the curves go on by before
    and after it.
    """
    P = patch.poles
    for axis in (0, 1):
        for fixed in (0, 1):
            side = P[:, -fixed] if axis == 0 else P[-fixed]
            first, last = (_parameter(side, edge[-end]) for end in (0, 1))
            uv = np.full((2, 2), float(fixed))
            uv[:, axis] = first - share[0] * (last - first), last + share[1] * (last - first)
            if _is_on(P, uv, poles):
                return np.stack([uv, uv])
    return None


def _parameter(side: Floats, point: Floats) -> float:
    """Of a point (6,), where on a side (4, 6) it lies, which has it."""
    x = float(ALONG[np.argmin(np.linalg.norm(bernstein(ALONG) @ side - point, axis=1))])
    for _ in range(STEPS):
        here, ahead = (bernstein(np.array([x])) @ side)[0], 3 * (_quadratic(x) @ np.diff(side, axis=0))
        x += float((point - here) @ ahead) / max(float(ahead @ ahead), 1e-300)
    return x if abs(x - round(x)) > 1e-10 else float(round(x))


def _quadratic(x: float) -> Floats:
    """(3,) Bernstein polynomials."""
    return np.array([(1 - x) ** 2, 2 * x * (1 - x), x**2])


def _is_on(P: Floats, uv: Floats, poles: Floats) -> bool:
    """Whether a line over a patch is a curve."""
    at = uv[0] + ALONG[:, None] * (uv[1] - uv[0])
    points = np.einsum("ka,kb,abi->ki", bernstein(at[:, 0]), bernstein(at[:, 1]), P)
    return bool(np.abs(points - bernstein(ALONG) @ poles).max() < NEARLY)
