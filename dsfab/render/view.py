"""The view of a picture."""

from dataclasses import dataclass

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import DsfabError
from dsfab.surface import LoadCase, Surface

VIEW_DEGREES = 24.0  # degrees; vertical view angle, small for a weak perspective


@dataclass(frozen=True, eq=False)
class View:
    """Camera at `eye` that looks along `forward`; `right` and `up` span the picture. slope : tan(half the view angle).
    floor : unit normal of the floor.    front : True for a plate seen from the front."""

    eye: Floats
    right: Floats
    up: Floats
    forward: Floats
    slope: float
    floor: Floats
    front: bool

    def page_coordinates(self, points: Floats) -> Floats:
        """Return places (k, 3) of points (k, 3) in the picture: x, y and depth (m).
        In a square picture, x is 1 at its right edge, and y is 1 at its upper edge."""
        local = (points - self.eye) @ np.stack([self.right, self.up, self.forward], axis=1)
        local[:, :2] /= self.slope * local[:, 2:]
        return np.asarray(local)


def up_axis(V: Floats, surface: Surface | None, load: LoadCase | None) -> Floats:
    """Return the unit vector (3,) that points up for vertices V (n, 3): y or z."""
    z, y = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
    if load is None or surface is None:
        return z
    net = load.force.sum(axis=0)
    if not -net[1] > 0.9 * np.linalg.norm(net):
        return z
    if _is_plate(V):
        return y if abs(_normal(V)[1]) < 0.5 else z
    lowest, highest = V[:, 1].min(), V[:, 1].max()
    return y if surface.V[load.supported, 1].mean() < lowest + 0.3 * (highest - lowest) else z


def _principal_spread(V: Floats) -> tuple[Floats, Floats]:
    values, axes = np.linalg.eigh(np.cov((V - V.mean(axis=0)).T))
    return np.sqrt(np.maximum(values[::-1], 0.0)), axes.T[::-1]


def _is_plate(V: Floats) -> bool:
    spread, _ = _principal_spread(V)
    return bool(spread[2] < 0.03 * spread[1])


def _normal(V: Floats) -> Floats:
    return np.asarray(_principal_spread(V)[1][2])


@dataclass(frozen=True, eq=False)
class ViewSide:
    """Side from which a picture shows a structure. towards : (3,) direction to the eye."""

    towards: Floats
    up: Floats
    floor: Floats
    front: bool


def best_side(V: Floats, up: Floats) -> ViewSide:
    """Return an oblique view of vertices V (n, 3) from above, or the front view of a standing plate."""
    if _is_plate(V) and abs(_normal(V) @ up) < 0.7:
        return _face_on(_normal(V), up)
    front, right = _plan_axes(V, up)
    depth, width, height = np.ptp(V @ np.stack([front, right, up], axis=1), axis=0)
    # the eye looks down on low structures, and almost horizontally at towers
    lift = np.radians(np.interp(height / max(width, depth), [0.0, 0.15, 0.35, 1.0, 2.0], [40.0, 32.0, 24.0, 17.0, 9.0]))
    turn = np.radians(32.0)
    level = np.cos(turn) * front + np.sin(turn) * right
    return ViewSide(np.cos(lift) * level + np.sin(lift) * up, up, up, False)


NAMED_ANGLES = {"top": (0.0, 90.0), "front": (0.0, 4.0), "side": (90.0, 4.0)}
"""Azimuth and elevation (degrees) of named views. Front and side are raised slightly to show the ground."""


def named_side(V: Floats, up: Floats, name: str) -> ViewSide:
    """Return the view of vertices V (n, 3) with a name: iso, top, front, side, or 'azimuth,elevation' in degrees.
    Azimuth turns from the front to the right. Elevation is measured from the ground. Raises DsfabError."""
    if name == "iso":
        return best_side(V, up)
    azimuth, elevation = NAMED_ANGLES[name] if name in NAMED_ANGLES else _angles(name)
    front, right = _plan_axes(V, up)
    turn, lift = np.radians([azimuth, elevation])
    level = np.cos(turn) * front + np.sin(turn) * right
    towards = np.cos(lift) * level + np.sin(lift) * up
    return ViewSide(towards, np.cos(lift) * up - np.sin(lift) * level, up, False)


def _angles(name: str) -> tuple[float, float]:
    try:
        azimuth, elevation = (float(word) for word in name.split(","))
    except ValueError:
        azimuth = elevation = np.nan
    if not (np.isfinite(azimuth) and abs(elevation) <= 90):
        raise DsfabError(
            f"view {name!r} is not known; use iso, top, front, side, or azimuth,elevation in degrees such as 30,20 "
            "(elevation from -90 to 90)"
        )
    return azimuth, elevation


def _face_on(normal: Floats, up: Floats) -> ViewSide:
    strongest = int(np.argmax(np.abs(normal)))
    normal = normal * np.sign(normal[strongest]) * (-1.0 if strongest == 1 else 1.0)
    level = normal - (normal @ up) * up
    level /= np.linalg.norm(level)
    towards = level - 0.11 * np.cross(level, up) + 0.08 * up
    return ViewSide(towards / np.linalg.norm(towards), up, normal, True)


def _plan_axes(V: Floats, up: Floats) -> tuple[Floats, Floats]:
    vertical = int(np.argmax(np.abs(up)))
    right = np.eye(3)[{0: 1, 1: 0, 2: 0}[vertical]]
    front = np.cross(right, up)
    plan = V @ np.stack([right, front], axis=1)
    values, axes = np.linalg.eigh(np.cov((plan - plan.mean(axis=0)).T))
    if values[1] > 1.5 * values[0]:
        long = axes[:, 1] * (1.0 if axes[np.argmax(np.abs(axes[:, 1])), 1] > 0 else -1.0)
        right = long[0] * right + long[1] * front
        front = np.cross(right, up)
    return front, right


def fit_view(points: Floats, side: ViewSide, box: tuple[float, float, float, float]) -> View:
    """Return the view from `side` in which points (n, 3) fill a box of the page.
    box : left, right, bottom and top in coordinates of `View.page_coordinates`."""
    right, vertical, towards = _picture_frame(side)
    forward = -towards
    slope = float(np.tan(np.radians(VIEW_DEGREES / 2)))
    low, high = points.min(axis=0), points.max(axis=0)
    middle, reach = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    distance, centre = 2 * reach / slope, middle
    left_x, right_x, bottom, top = box
    for _ in range(30):
        view = View(centre + distance * towards, right, vertical, forward, slope, side.floor, side.front)
        x, y, _ = view.page_coordinates(points).T
        scale = max(np.ptp(x) / (right_x - left_x), np.ptp(y) / (top - bottom))
        shift = (x.min() + x.max() - left_x - right_x) / 2 * right + (y.min() + y.max() - bottom - top) / 2 * vertical
        centre = centre + shift * slope * distance
        distance *= scale
        if abs(scale - 1) < 1e-4 and np.linalg.norm(shift) < 1e-4:
            break
    return view


def plan_and_elevation(V: Floats, up: Floats) -> tuple[ViewSide, ViewSide]:
    """Return two views of vertices V (n, 3): from above, and towards the long side."""
    across = np.eye(3)[{0: 1, 1: 0, 2: 0}[int(np.argmax(np.abs(up)))]]
    turns = np.radians(np.arange(90.0))
    rights = np.outer(np.cos(turns), across) + np.outer(np.sin(turns), np.cross(up, across))
    wide, deep = (np.ptp(V @ axes.T, axis=0) for axes in (rights, np.cross(up, rights)))
    k = int(np.argmin(wide * deep * np.where(turns > 0, 1.02, 1.0)))
    right = rights[k] if wide[k] >= deep[k] else np.cross(up, rights[k])
    front = np.cross(right, up)
    return ViewSide(up, -front, up, False), ViewSide(front, up, up, False)


FAR = 400.0  # distance of the eye in a parallel view, divided by the diagonal of the box around all points


def plane_extents(points: Floats, side: ViewSide) -> Floats:
    """Return the width and height (2,), metres, of points (n, 3) in a parallel projection."""
    return np.asarray(np.ptp(points @ _picture_frame(side)[:2].T, axis=0))


def parallel_view(points: Floats, side: ViewSide, size: tuple[int, int], pixels_per_metre: float) -> View:
    """Return the view of points (n, 3) from far away. size : width and height of the picture, pixels."""
    frame = _picture_frame(side)
    places = points @ frame.T
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    distance = FAR * float(np.linalg.norm(np.ptp(points, axis=0)))
    slope = size[1] / 2 / pixels_per_metre / distance
    eye = middle @ frame + distance * side.towards
    return View(eye, frame[0], frame[1], -side.towards, slope, side.floor, side.front)


def _picture_frame(side: ViewSide) -> Floats:
    right = np.cross(side.up, side.towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(side.towards, right), side.towards])
