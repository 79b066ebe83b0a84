"""Light for pictures: a sun with a soft edge, an overcast sky and a faint floor, as many small lamps.

A point is lit by a lamp that sees it (Williams 1978, shadow maps); the mean over many lamps gives the soft shadows of a
plaster model.
"""

from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.render.scene import Floats32, Pixels, Scene
from dsfab.render.view import View

SHARES = (0.60, 0.44, 0.14)
"""Light on a surface that faces the sun from the sun; that faces the middle of the sky, of the floor, from those."""

AMBIENT = 0.10
"""Light that reaches every point."""

CHUNK = 1 << 15
"""Points lit at a time: what fits the cache."""

ROWS = 64
"""Rows of the picture whose points are found at a time."""

FLOOR_STEP = 6
"""Pixels of the picture for one of the floor: its shadows are soft."""

FLOOR_REACH = 4.0
"""The floor is drawn to this many radii around the structure."""


@dataclass(frozen=True)
class LightQuality:
    """Number of lamps in the sun, in the sky and below; side of the pictures that lamps see, pixels.

    sharp : that of the sun's, whose shadows are sharper; coarse : that of the others.
    blur  : of the floor's shadows, of the sun and of the others, as shares of the picture's height.
    finer : drawn at so many times the size and averaged: smooth edges.
    """

    sun: int = 10
    sky: int = 36
    below: int = 8
    sharp: int = 1280
    coarse: int = 768
    blur: tuple[float, float] = (0.004, 0.028)
    finer: int = 2

    def fitting(self, height: int) -> "LightQuality":
        """The same for a picture of this many rows: what lamps see need not be finer than what the eye sees."""
        sharp, coarse = max(320, 2 * height), max(256, round(1.3 * height))
        return replace(self, sharp=min(self.sharp, sharp), coarse=min(self.coarse, coarse))


FINE, QUICK = LightQuality(), LightQuality(5, 14, 3, 448, 256, (0.012, 0.05))
"""For a picture that stands alone, and for one of a hundred."""

ROUGH = LightQuality(3, 7, 2, 320, 192, (0.012, 0.05), finer=1)
"""For one that another one replaces in a moment."""


@dataclass(frozen=True, eq=False)
class Lamps:
    """towards (k, 3) unit vectors, the sun first; strength (k,) on a surface that faces the lamp."""

    towards: Floats
    strength: Floats
    quality: LightQuality

    def open(self, normal: Floats) -> tuple[float, float]:
        """Light on a free surface with this unit normal (3,): of the sun, and of everything else."""
        each = np.maximum(self.towards @ normal, 0) * self.strength
        return float(each[: self.quality.sun].sum()), float(each[self.quality.sun :].sum()) + AMBIENT


def lamps(view: View, floor: Floats, quality: LightQuality = FINE) -> Lamps:
    """The lamps for a view, over a floor with this unit normal (3,): the sun stands over the eye's left shoulder, the
    sky over what things stand or lie on."""
    back = -view.forward
    level = back - (back @ floor) * floor
    level /= max(float(np.linalg.norm(level)), 0.2)
    sun = level * 0.45 - view.right * 0.62 + floor * 0.95
    if view.front:
        sun = view.up * 0.5 - view.right * 0.42 + floor
    groups = [_cap(quality.sun, np.radians(6.0)) @ _frame(sun / np.linalg.norm(sun))]
    groups.append(_cap(quality.sky, np.radians(78.0)) @ _frame(floor))
    groups.append(_cap(quality.below, np.radians(75.0)) @ _frame(-floor))
    strength = [
        np.full(len(group), share / (group @ _unit(group.mean(axis=0))).sum())
        for group, share in zip(groups, SHARES, strict=True)
    ]
    return Lamps(np.concatenate(groups), np.concatenate(strength), quality)


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))


def _cap(count: int, half_angle: float) -> Floats:
    """(count, 3) unit vectors spread evenly over a cap around the third axis (golden spiral)."""
    index = np.arange(count) + 0.5
    z = 1 - index / count * (1 - np.cos(half_angle))
    turn = index * np.pi * (3 - np.sqrt(5))
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)


def _frame(towards: Floats) -> Floats:
    """Rows: two unit vectors across and `towards` itself."""
    across = np.cross(np.eye(3)[np.argmin(np.abs(towards))], towards)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(towards, across), towards])


def lit(scene: Scene, all_lamps: Lamps, points: Floats32, normals: Floats32) -> Floats32:
    """(2, k) light of the sun and of everything else on `points`, which face along `normals`, both (3, k), radii."""
    light = np.zeros((2, points.shape[1]), dtype=np.float32)
    light[1] = AMBIENT
    # a lamp's picture is sampled at random places around the point: its steps become a grain that the eye averages
    grain = np.random.default_rng(1).uniform(-1.2, 1.2, (2, CHUNK)).astype(np.float32)
    quality = all_lamps.quality
    with scene.lamps():
        for number, (towards, strength) in enumerate(zip(all_lamps.towards, all_lamps.strength, strict=True)):
            frame = _frame(towards)
            heights = scene.lamp(frame, quality.sharp if number < quality.sun else quality.coarse)
            into = light[int(number >= quality.sun)]
            for start in range(0, points.shape[1], CHUNK):
                part = slice(start, start + CHUNK)
                cosine = _along(normals[:, part], frame[2])
                seen = _sees(heights, frame, points[:, part], normals[:, part], grain[:, : len(cosine)])
                into[part] += np.float32(strength) * np.maximum(cosine, 0) * seen
    return light


def _along(vectors: Floats32, direction: Floats) -> Floats32:
    """(k,) components of (3, k) vectors; by hand, because BLAS takes ten times as long for products so thin."""
    x, y, z = direction.astype(np.float32)
    return np.asarray(vectors[0] * x + vectors[1] * y + vectors[2] * z)


def _sees(heights: Floats32, frame: Floats, points: Floats32, normals: Floats32, grain: Floats32) -> Bools:
    """Whether a lamp with the picture `heights` sees points (3, k)."""
    side = len(heights)
    step = np.float32(2.5 / side)
    above = points + step * normals  # on the surface itself a lamp's pixels, which are steps, would throw shadows
    i = ((_along(above, frame[0]) + 1) * np.float32(side / 2) + grain[0]).astype(np.int32)
    j = ((_along(above, frame[1]) + 1) * np.float32(side / 2) + grain[1]).astype(np.int32)
    outside = (i < 0) | (j < 0) | (i >= side) | (j >= side)
    index = np.where(outside, 0, j * np.int32(side) + i)
    return np.asarray(outside | (heights.ravel()[index] < _along(above, frame[2]) + step))


def rays(view: View, width: int, height: int) -> tuple[Floats32, Floats32]:
    """(w,) and (h,) slopes of the rays through the pixels, along `view.right` and `view.up`."""
    x = (2 * np.arange(width) + 1 - width) / height * view.slope
    y = -(2 * np.arange(height) + 1 - height) / height * view.slope
    return x.astype(np.float32), y.astype(np.float32)


def shaded(
    scene: Scene, view: View, pixels: Pixels, all_lamps: Lamps, floor: Floats, level: float | None
) -> tuple[Floats32, Floats32 | None]:
    """The light on the drawn pixels (k,), in their order, and on the floor: coarse (h, w) share of its open light.

    The floor is the plane at `level` along `floor`, in the scene's units; without a level there is none.
    """
    height, width = pixels.depth.shape
    if level is None:
        return lit(scene, all_lamps, *_points(scene, view, pixels)).sum(axis=0), None
    coarse = (height // FLOOR_STEP, width // FLOOR_STEP)
    spots, there = _floor_points(scene, view, floor, level, coarse)
    points, normals = _points(scene, view, pixels, spare=spots.shape[1])
    drawn = points.shape[1] - spots.shape[1]
    points[:, drawn:], normals[:, drawn:] = spots, floor[:, None]
    light = lit(scene, all_lamps, points, normals)
    return light[:, :drawn].sum(axis=0), _floor_share(
        light[:, drawn:], there, all_lamps.open(floor), all_lamps.quality.blur
    )


def _points(scene: Scene, view: View, pixels: Pixels, spare: int = 0) -> tuple[Floats32, Floats32]:
    """(3, k + spare) points of the k drawn pixels in the scene's units, and their normals, turned towards the eye."""
    hit = np.isfinite(pixels.depth)
    ends = np.concatenate([[0], np.cumsum(hit.sum(axis=1))])
    points, normals = (np.empty((3, int(ends[-1]) + spare), dtype=np.float32) for _ in range(2))
    for top in range(0, len(hit), ROWS):  # in strips: bounds the memory
        rows = slice(top, top + ROWS)
        here = slice(ends[top], ends[min(top + ROWS, len(hit))])
        _strip_points(scene, view, pixels, hit, rows, (points[:, here], normals[:, here]))
    return points, normals


def _strip_points(
    scene: Scene, view: View, pixels: Pixels, hit: Bools, rows: slice, into: tuple[Floats32, Floats32]
) -> None:
    """Points and normals of the drawn pixels in some rows."""
    (points, normal), (height, width) = into, hit.shape
    row, column = np.nonzero(hit[rows])
    x, y = rays(view, width, height)
    x, y, depth = x[column], y[rows][row], pixels.depth[rows][row, column]
    eye = (view.eye - scene.centre) / scene.radius
    normal[:] = pixels.normal[rows][row, column].T
    normal /= np.float32(127.5)
    normal -= 1
    away = np.zeros_like(depth)
    for a in range(3):
        ray = x * np.float32(view.right[a]) + y * np.float32(view.up[a]) + np.float32(view.forward[a])
        away += ray * normal[a]
        points[a] = ray * depth + np.float32(eye[a])
    length = np.maximum(np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2), np.float32(1e-6))
    normal /= np.where(away > 0, -length, length)


def _floor_points(
    scene: Scene, view: View, floor: Floats, level: float, shape: tuple[int, int]
) -> tuple[Floats32, Bools]:
    """(3, k) points of the floor near the structure, and the pixels (h, w) of a coarse picture that show them."""
    x, y = rays(view, shape[1], shape[0])
    eye = (view.eye - scene.centre) / scene.radius
    ray = x[None, :, None] * view.right + y[:, None, None] * view.up + view.forward
    fall = ray @ floor
    far = np.divide(level - eye @ floor, fall, out=np.full(fall.shape, np.inf), where=fall < 0)
    points = eye + np.where(np.isfinite(far), far, 0.0)[:, :, None] * ray
    there = np.isfinite(far) & (np.linalg.norm(points, axis=2) < FLOOR_REACH)
    return points[there].T.astype(np.float32), there


def _floor_share(
    light: Floats32, there: Bools, open_light: tuple[float, float], blurs: tuple[float, float]
) -> Floats32:
    """(h, w) share of light on the floor; the sky's shadows, few lamps' worth, are blurred to what many would give."""
    from scipy.ndimage import gaussian_filter  # whoever only needs to know what light there is waits for it otherwise

    whole = sum(open_light)
    share = np.ones(there.shape, dtype=np.float32)
    for part, free, blur in zip(light, open_light, blurs, strict=True):
        lost = np.zeros(there.shape, dtype=np.float32)
        lost[there] = (free - part) / whole
        share -= gaussian_filter(lost, blur * there.shape[0])
    return share
