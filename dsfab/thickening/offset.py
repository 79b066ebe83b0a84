"""Offset vectors of the uncut surface: where the two skins of the sheet run.

They are found before anything is cut and carried through the slicer as linear attributes, so that every cut sheet is a
part of one thickened surface: where the prisms of that surface are valid, no two pieces of the sheet can meet.

        V + D   o-------o   upper skin               side = "out": skins V + 2 D and V
                 \\     /
        V        o-----o    the surface              side = "in":  skins V and V - 2 D
                /       \\
        V - D  o---------o  lower skin

A surface with one side only has no upper skin: D is seen from the first face around each vertex, and other faces there
may have it on their lower side (`Offsets.sides`).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dsfab.arrays import Floats, Ints, cross, first, lengths, lock
from dsfab.errors import SolidError
from dsfab.surface.cover import corner_sides, one_sided_pieces
from dsfab.surface.mesh import Surface
from dsfab.thickening.check import check_oriented
from dsfab.thickening.normals import CHUNK, corner_angles, mitres, visible_normals

Side = Literal["mid", "out", "in"]

SHIFT = {"mid": 0, "out": 1, "in": -1}
"""By how many D the middle of the sheet lies off the surface."""

SAFE_JACOBIAN = 0.2
"""Smallest Bernstein coefficient of a prism that counts as safe, as a share of a straight prism's. 0.05 was measured
to be too weak, 0.4 not to end on real meshes."""

SHRINK = 0.85
"""What an offset is multiplied by while a prism around it is not safe."""

SMALLEST_OFFSET = 0.05
"""Share of the asked thickness below which an offset is not shrunk: the exact test has the last word there."""


@dataclass(frozen=True, eq=False)
class Offsets:
    """Half-thickness vectors of a surface.

    D        : (n, 3) half of the way from the lower to the upper skin, metres. Zero without faces.
    limited  : number of vertices where the surface bends too tightly for the asked thickness.
    smallest : the smallest share of the asked thickness that was left there; 1 when nothing was limited.
    tightest : the vertex at which that is.
    sides    : (m, 3) of 1 and -1: whether D lies on a face's own side at its corners (see `corner_sides`); all 1 but on
               surfaces with one side only.
    """

    D: Floats
    limited: int
    smallest: float
    tightest: int
    sides: Ints

    def __post_init__(self) -> None:
        lock(self, "D", np.float64, (None, 3))
        lock(self, "sides", np.int64, (None, 3))

    def at_corners(self, F: Ints) -> Floats:
        """(m, 3, 3) D at the corners of the faces F (m, 3), each seen from its face: what the slicer carries."""
        seen: Floats = self.D[F] * self.sides[:, :, None]
        return seen


def offsets(surface: Surface, thickness: float | Floats, side: Side = "mid") -> Offsets:
    """Offset vectors that make a sheet of `thickness` (metres, measured normal to its faces) around a surface.

    Each runs along the normal that is most visible from the faces around its vertex, is lengthened at creases (mitre,
    at most twice), and is shortened where the prisms over the faces would fold over.

    thickness : of the whole sheet, or (n,) at each vertex.
    side : where the sheet lies: around the surface, or on one side of it: "out" is where the normals point.

    Raises SolidError for a thickness that is not positive everywhere, for surfaces that are not manifolds or could be
    oriented but are not, and for one side of a surface that has one only.
    """
    t = _checked_thickness(surface, thickness)
    check_oriented(surface)
    if side != "mid" and one_sided_pieces(surface.F, surface.edges).any():
        raise SolidError(f'side = "{side}" needs a surface with two sides, and this one has one only; use "mid"')
    sides = corner_sides(surface.F, surface.edges)
    weights, faces = corner_angles(surface), surface.normals[:, None, :] * sides[:, :, None]
    N = visible_normals(surface, weights, faces)
    full = 0.5 * N * (t * mitres(surface, N, weights, faces))[:, None]
    share = safe_shares(surface, full, sides, SHIFT[side])
    limited = int((share < 1).sum())
    return Offsets(full * share[:, None], limited, float(share.min()), int(share.argmin()), sides)


def _checked_thickness(surface: Surface, thickness: float | Floats) -> Floats:
    """(n,) metres."""
    t = np.asarray(thickness, dtype=np.float64)
    if t.shape not in ((), (surface.n,)):
        raise SolidError(f"thickness has shape {t.shape}; give one number, or one for each of {surface.n} vertices")
    bad = np.flatnonzero(~(np.isfinite(t) & (t > 0)))
    if len(bad) and not t.shape:
        raise SolidError(f"thickness = {thickness} m cannot be built; give a positive number of metres")
    if len(bad):
        raise SolidError(f"the thickness is not a positive number at {len(bad)} vertices (first: {first(bad)})")
    return np.broadcast_to(t, surface.n)


def safe_shares(surface: Surface, D: Floats, sides: Ints, shift: int = 0) -> Floats:
    """(n,) shares of D (n, 3) that leave every prism over a face with a Jacobian that is clearly positive.

    A corner that its own offset vector does not see, or hardly, is asked for less: no shrinking can help it.
    sides : as in `Offsets`.    shift : as in `SHIFT`.
    """
    share = np.ones(surface.n)
    look = np.arange(surface.m)
    while len(look):
        shrinks, left = np.zeros(surface.n, dtype=bool), D * share[:, None]
        for k in range(0, len(look), CHUNK):
            some = look[k : k + CHUNK]
            F = surface.F[some]
            d = left.take(F, axis=0)
            C, asked = _prism_jacobians(surface.V.take(F, axis=0) + shift * d, d * sides[some][:, :, None])
            least = np.minimum(np.minimum(C[:, 0], C[:, 1]), C[:, 2])
            tight = ((least < asked) & (asked > 0)).any(axis=1)
            shrinks[F[tight]] = True
        shrinks &= share > SMALLEST_OFFSET
        share[shrinks] = np.maximum(share[shrinks] * SHRINK, SMALLEST_OFFSET)
        look = np.flatnonzero(shrinks[surface.F].any(axis=1))
    return share


def _prism_jacobians(P: Floats, d: Floats) -> tuple[Floats, Floats]:
    """Coefficients (m, 3, 3) of the Jacobian of prisms P + s d, -1 <= s <= 1, and what each corner (m, 3) must reach.

    The Jacobian is quadratic in s and linear over the face: coefficient [k, v] belongs to power k of s (Bernstein) and
    corner v. All positive means that the prism does not fold over. Divided by twice the area and the mean |d|.
    P, d : (m, 3, 3) corners and half-thickness vectors of the faces, both on the side their normals point to.
    """
    e1, e2 = P[:, 1] - P[:, 0], P[:, 2] - P[:, 0]
    d1, d2 = d[:, 1] - d[:, 0], d[:, 2] - d[:, 0]
    flat = cross(e1, e2)
    normals = cross(e1 - d1, e2 - d2), flat - cross(d1, d2), cross(e1 + d1, e2 + d2)
    scale = (lengths(flat) * lengths(d).mean(axis=1))[:, None]
    C = np.stack([np.einsum("mi,mvi->mv", N, d) / scale for N in normals], axis=1)
    straight = np.einsum("mi,mvi->mv", flat, d) / scale
    return C, np.minimum(SAFE_JACOBIAN, 0.5 * straight)
