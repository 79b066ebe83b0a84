"""Light of pictures by many lamps with shadow maps (Williams 1978)."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, unit_vectors
from dsfab.render.scene import LAMP_AWAY, LAMP_DEPTHS, Floats32, Pixels, Scene
from dsfab.render.view import View

GRAIN = 1.2  # largest random offset (map pixels); hides the steps of shadow maps
SURFACE_LIFT = 2.5  # height above a surface (map pixels) where its light is computed; prevents false shadows
LARGEST_DEPTH = np.float32(0.9999)  # Largest depth of points in shadow maps: below 1, the depth of empty pixels.
_DEPTH_RANGE = LAMP_DEPTHS[1] - LAMP_DEPTHS[0]


def frame_towards(towards: Floats) -> Floats:
    """Return three orthogonal unit vectors as rows; the third is `towards` (3,)."""
    across = np.cross(np.eye(3)[np.argmin(np.abs(towards))], towards)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(towards, across), towards])


@dataclass(frozen=True, eq=False)
class ShadowMaps:
    """Shadow maps of b lamps. maps : (b, s, s) depth of the nearest surface as seen from each lamp.
    placing : (3 b, 6) matrix from (x, y, z, two random offsets up to `GRAIN`, 1) to columns, rows, depths in the maps.
    towards : (b, 3) unit vectors towards the lamps, times the strengths of the lamps."""

    maps: Floats32
    placing: Floats32
    towards: Floats32

    @classmethod
    def render(cls, scene: Scene, towards: Floats, strength: Floats, side: int) -> Self:
        """Draw the shadow maps of lamps within `with scene.lamps()`. side : pixels.
        towards : (b, 3) unit vectors to the lamps.    strength : (b,) of the lamps."""
        frames = np.stack([frame_towards(direction) for direction in towards])
        maps = np.empty((len(frames), side, side), dtype=np.float32)
        for into, frame in zip(maps, frames, strict=True):
            into[:] = scene.lamp(frame, side)
        placing = np.zeros((3, len(frames), 6))
        placing[:2, :, :3] = frames.swapaxes(0, 1)[:2] * (side / 2)
        placing[:2, :, 5] = side / 2
        placing[0, :, 3] = placing[1, :, 4] = 1.0
        placing[2, :, :3] = -frames[:, 2] / _DEPTH_RANGE
        placing[2, :, 5] = (LAMP_AWAY - LAMP_DEPTHS[0] - SURFACE_LIFT / side) / _DEPTH_RANGE
        weighed = towards * strength[:, None]
        return cls(maps, placing.reshape(-1, 6).astype(np.float32), weighed.astype(np.float32))

    def light_on(self, points: Floats32, normals: Floats32, grain: Floats32) -> Floats32:
        """Return the light (k,) on points (3, k), scene units, with normals (3, k).
        grain : (2, k) random offsets in the shadow maps, pixels."""
        count, side = self.maps.shape[:2]
        queries = np.ones((6, points.shape[1]), dtype=np.float32)
        np.add(points, np.float32(SURFACE_LIFT / side) * normals, out=queries[:3])
        queries[3:5] = grain[:, : points.shape[1]]
        # points outside all shadow maps, for example on distant ground, have no shadow
        reach = np.einsum("ik,ik->k", queries[:3], queries[:3]).max()
        leaves_maps = reach >= (1 - 2 * (GRAIN + 1) / side) ** 2
        column, row, depth = (self.placing @ queries).reshape(3, count, -1)
        i, j = column.astype(np.int32), row.astype(np.int32)
        outside = None
        if leaves_maps:
            outside = (i < 0) | (j < 0) | (i >= side) | (j >= side)
            np.minimum(depth, LARGEST_DEPTH, out=depth)
        j *= np.int32(side)
        j += i
        j += np.arange(0, count * side * side, side * side, dtype=np.int32)[:, None]
        seen = self.maps.ravel().take(j, mode="clip") > depth
        if outside is not None:
            seen |= outside
        light = self.towards @ normals
        np.maximum(light, 0, out=light)
        light *= seen
        return np.asarray(light.sum(axis=0))


LIGHT_SHARES = (0.60, 0.44, 0.14)  # light of sun, sky and floor on a surface that faces the light
AMBIENT = 0.10  # light that every point receives in addition to the light of the lamps
CHUNK = 1 << 15  # number of points coloured together; their arrays fit the processor's cache
TILE = 1 << 10  # number of points lit together by twenty lamps, for the processor's cache


@dataclass(frozen=True)
class LightQuality:
    """Quality of the light. sun, sky, below : numbers of lamps for the sun, for the sky, and below the floor.
    sharp, coarse : width of the square shadow maps of the sun, and of other lamps, pixels.
    blur  : radius of blur of shadows on the floor / height of the picture: for the sun, and for other lamps.
    finer : factor by which a picture is drawn larger and then reduced, for smooth edges."""

    sun: int = 10
    sky: int = 36
    below: int = 8
    sharp: int = 1280
    coarse: int = 640
    blur: tuple[float, float] = (0.004, 0.028)
    finer: int = 2

    @property
    def bytes(self) -> int:
        """Size of all shadow maps, bytes."""
        return 4 * (self.sun * self.sharp**2 + (self.sky + self.below) * self.coarse**2)

    def fitting(self, height: int) -> "LightQuality":
        """Return a copy with shadow maps no larger than a picture with `height` rows of pixels needs."""
        sharp, coarse = max(320, 2 * height), max(256, round(1.3 * height))
        return replace(self, sharp=min(self.sharp, sharp), coarse=min(self.coarse, coarse))


FINE, QUICK = LightQuality(), LightQuality(5, 14, 3, 448, 256, (0.012, 0.05))
"""Light of a single picture, and of each picture in a series."""
ROUGH = LightQuality(3, 7, 2, 320, 192, (0.012, 0.05), finer=1)  # quality of a first, quick picture


@dataclass(frozen=True, eq=False)
class Lamps:
    """Lamps. towards : (k, 3) unit vectors to the lamps, the sun's lamps first.    strength : (k,) of the lamps."""

    towards: Floats
    strength: Floats
    quality: LightQuality

    def open_light(self, normal: Floats) -> tuple[float, float]:
        """Return the light of the sun and of other lamps on a surface without shadows. normal : (3,) unit normal."""
        light_by_lamp = np.maximum(self.towards @ normal, 0) * self.strength
        return float(light_by_lamp[: self.quality.sun].sum()), float(light_by_lamp[self.quality.sun :].sum()) + AMBIENT


def lamps(view: View, floor: Floats, quality: LightQuality = FINE) -> Lamps:
    """Return the lamps of a view. floor : (3,) unit normal of the floor."""
    back = -view.forward
    level = back - (back @ floor) * floor
    level /= max(float(np.linalg.norm(level)), 0.2)
    sun = level * 0.45 - view.right * 0.62 + floor * 0.95
    if view.front:
        sun = view.up * 0.5 - view.right * 0.42 + floor
    groups = [_cap(quality.sun, np.radians(6.0)) @ frame_towards(sun / np.linalg.norm(sun))]
    groups.append(_cap(quality.sky, np.radians(78.0)) @ frame_towards(floor))
    groups.append(_cap(quality.below, np.radians(75.0)) @ frame_towards(-floor))
    strength = [
        np.full(len(group), share / (group @ unit_vectors(group.mean(axis=0))).sum())
        for group, share in zip(groups, LIGHT_SHARES, strict=True)
    ]
    return Lamps(np.concatenate(groups), np.concatenate(strength), quality)


def _cap(count: int, half_angle: float) -> Floats:
    """Return unit vectors (count, 3), spread evenly in a cone around (0, 0, 1). half_angle : of the cone, radians."""
    index = np.arange(count) + 0.5
    z = 1 - index / count * (1 - np.cos(half_angle))
    turn = index * np.pi * (3 - np.sqrt(5))
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)


def lamp_light(scene: Scene, all_lamps: Lamps, points: Floats32, normals: Floats32, paired: int = 0) -> Floats32:
    """Return the light (2, k), of the sun and of other lamps, on points (3, k).
    normals : (3, k).    paired : number of points at the beginning that form pairs of neighbours. In a pair,
    each point gets the light of half of the lamps, except for the sun."""
    light = np.zeros((2, points.shape[1]), dtype=np.float32)
    light[1] = AMBIENT
    quality, numbers = all_lamps.quality, np.arange(len(all_lamps.strength))
    every = (0, points.shape[1], 1)
    with scene.lamps():
        _add_light(scene, all_lamps, numbers[: quality.sun], (points, normals), light[0], {every: 1.0})
        for half in (0, 1):
            asking = {(half, paired, 2): 2.0, (paired, points.shape[1], 1): 1.0}
            _add_light(scene, all_lamps, numbers[quality.sun + half :: 2], (points, normals), light[1], asking)
    return light


def _add_light(
    scene: Scene,
    all_lamps: Lamps,
    lamp_numbers: Ints,
    surface_points: tuple[Floats32, Floats32],
    light: Floats32,
    shares: dict[tuple[int, int, int], float],
) -> None:
    points, normals = surface_points
    side = all_lamps.quality.sharp if lamp_numbers[0] == 0 else all_lamps.quality.coarse
    maps = ShadowMaps.render(scene, all_lamps.towards[lamp_numbers], all_lamps.strength[lamp_numbers], side)
    grain = np.random.default_rng(1).uniform(-GRAIN, GRAIN, (2, TILE)).astype(np.float32)
    for (begin, end, step), times in shares.items():
        for start in range(begin, end, TILE * step):
            part = slice(start, min(start + TILE * step, end), step)
            light[part] += np.float32(times) * maps.light_on(points[:, part], normals[:, part], grain)


def rays(view: View, width: int, height: int) -> tuple[Floats32, Floats32]:
    """Return horizontal slopes (w,) and vertical slopes (h,) of the lines of sight through the pixels."""
    x = (2 * np.arange(width) + 1 - width) / height * view.slope
    y = -(2 * np.arange(height) + 1 - height) / height * view.slope
    return x.astype(np.float32), y.astype(np.float32)


def pixel_and_floor_light(
    scene: Scene, view: View, pixels: Pixels, all_lamps: Lamps, floor: Floats, level: float | None
) -> tuple[Floats32, Floats32 | None]:
    """Return the light (k,) on pixels that show a body, and the ratio of the floor's light to light without shadows.
    floor : (3,) normal of the floor.    level : height along this normal, scene units; None without a floor."""
    height, width = pixels.depth.shape
    hit, paired = np.isfinite(pixels.depth), int(all_lamps.quality.finer > 1)
    if level is None:
        points, N = _points(scene, view, pixels, hit)
        return _in_row_order(lamp_light(scene, all_lamps, points, N, paired * points.shape[1]).sum(axis=0), hit), None
    coarse = (height // 6, width // 6)  # few pixels for the floor, because its shadows are soft
    spots, floor_pixels = _floor_points(scene, view, floor, level, coarse)
    points, N = _points(scene, view, pixels, hit, spare=spots.shape[1])
    count = points.shape[1] - spots.shape[1]
    points[:, count:], N[:, count:] = spots, floor[:, None]
    light = lamp_light(scene, all_lamps, points, N, paired * count)
    share = _floor_share(light[:, count:], floor_pixels, all_lamps.open_light(floor), all_lamps.quality.blur)
    return _in_row_order(light[:, :count].sum(axis=0), hit), share


def _points(scene: Scene, view: View, pixels: Pixels, hit: Bools, spare: int = 0) -> tuple[Floats32, Floats32]:
    points, normals = (np.empty((3, int(hit.sum()) + spare), dtype=np.float32) for _ in range(2))
    for rows, pixel_range in _strips(hit):
        _strip_points(scene, view, pixels, hit, rows, (points[:, pixel_range], normals[:, pixel_range]))
    return points, normals


def _strips(hit: Bools, rows: int = 64) -> Iterator[tuple[slice, slice]]:
    ends = np.concatenate([[0], np.cumsum(hit.sum(axis=1))])
    for top in range(0, len(hit), rows):
        yield slice(top, top + rows), slice(ends[top], ends[min(top + rows, len(hit))])


def _in_row_order(values: Floats32, hit: Bools) -> Floats32:
    for rows, pixel_range in _strips(hit):
        strip = np.empty(hit[rows].shape, dtype=np.float32)
        strip.T[hit[rows].T] = values[pixel_range]
        values[pixel_range] = strip[hit[rows]]
    return values


def _strip_points(
    scene: Scene, view: View, pixels: Pixels, hit: Bools, rows: slice, into: tuple[Floats32, Floats32]
) -> None:
    (points, normal), (height, width) = into, hit.shape
    column, row = np.nonzero(hit[rows].T)
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
    x, y = rays(view, shape[1], shape[0])
    eye = (view.eye - scene.centre) / scene.radius
    ray = x[None, :, None] * view.right + y[:, None, None] * view.up + view.forward
    fall = ray @ floor
    distance = np.divide(level - eye @ floor, fall, out=np.full(fall.shape, np.inf), where=fall < 0)
    points = eye + np.where(np.isfinite(distance), distance, 0.0)[:, :, None] * ray
    is_near = np.isfinite(distance) & (np.linalg.norm(points, axis=2) < 4.0)  # in scene units; farther floor is lit
    return points[is_near].T.astype(np.float32), is_near


def _floor_share(
    light: Floats32, floor_pixels: Bools, open_light: tuple[float, float], blurs: tuple[float, float]
) -> Floats32:
    from scipy.ndimage import gaussian_filter  # this import is slow

    total = sum(open_light)
    share = np.ones(floor_pixels.shape, dtype=np.float32)
    for part, free, blur in zip(light, open_light, blurs, strict=True):
        lost = np.zeros(floor_pixels.shape, dtype=np.float32)
        lost[floor_pixels] = (free - part) / total
        share -= gaussian_filter(lost, blur * floor_pixels.shape[0])
    return share
