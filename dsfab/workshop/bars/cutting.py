r"""Bars and the plates of their nodes as flat parts.

plate of a node, from outside       bar, from outside
      _| |_                          ____________________________
     |_ o _|   o node                \ o o                    o o |   corners near other bars are cut off
       | |     each arm has a fold   /____________________________|"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.workshop.bars.joints import BarEnd, BarLattice, Joint, LatticeBar
from dsfab.workshop.bars.lattice import BAR_CLEARANCE
from dsfab.workshop.parts import NAME_SHARE, NODE_LETTERS, FlatPart, Fold, Hole, half_plane_clip, label, text_length

BOLT_SPACINGS = ((3.0, 4.0, 3.0), (2.0, 3.0, 2.0), (2.0, 2.0))
"""Distances in bolt diameters: fold to first bolt, bolt to bolt, bolt to plate's end. The first fitting row is used."""
LEG_NAME = "ground"  # name of a plate's arm that stands on the ground


@dataclass(frozen=True)
class BarStock:
    """Thickness of bars and of node plates, diameter of bolts, and largest height of letters (m)."""

    bar: float
    plate: float
    bolt: float
    letters: float

    @property
    def lever(self) -> float:
        """Distance between the middles of a bar and of a plate (m)."""
        return (self.bar + self.plate) / 2

    def bolt_stations(self, bar: LatticeBar) -> tuple[tuple[float, ...], float]:
        """Return distances (m) from a bar's end to its bolts and the plate's end; () and 0 if the bar is too short."""
        clear, room = BAR_CLEARANCE * self.bolt, bar.length / 2
        for *steps, end_distance in BOLT_SPACINGS:
            stations = clear + self.bolt * np.cumsum(steps)
            if stations[-1] + end_distance * self.bolt <= room:
                return tuple(stations.tolist()), float(stations[-1] + end_distance * self.bolt)
        return (), 0.0


def bar_part(bar: LatticeBar, nodes: tuple[str, str], stock: BarStock) -> FlatPart:
    """Return a bar as a flat part. nodes : names of the nodes."""
    L, half, clear = bar.length, bar.bay.width / 2, BAR_CLEARANCE * stock.bolt
    low, high = (clear if end.root else 0.0 for end in bar.ends)
    P = np.array([[low, -half], [L - high, -half], [L - high, half], [low, half]])
    for sign, end in zip((1, -1), bar.ends, strict=True):
        for a, b in _mitres(end, stock, clear):
            P = half_plane_clip(P, sign * a, b + (min(sign, 0) * a[0] * L))
    stations, _ = stock.bolt_stations(bar)
    begin_bolts, end_bolts = (np.array(stations) if end.root else np.zeros(0) for end in bar.ends)
    holes = [Hole(np.array([r, 0.0]), stock.bolt, nodes[0]) for r in begin_bolts]
    holes += [Hole(np.array([L - r, 0.0]), stock.bolt, nodes[1]) for r in end_bolts[::-1]]
    inner = begin_bolts.max(initial=low) + stock.bolt, L - end_bolts.max(initial=high) - stock.bolt
    marks = tuple(_bar_marks(bar, nodes, inner, min(stock.letters, 0.6 * half)))
    axis = np.array([[low, 0.0], [L - high, 0.0]])
    return FlatPart(bar.bay.id, bar.bay.member, bar.bay.span, P, tuple(holes), marks=marks, axis=axis).along_x()


def _mitres(end: BarEnd, stock: BarStock, clear: float) -> Iterator[tuple[Floats, float]]:
    for side, gap in ((1, end.after), (-1, end.before)):
        if 0 < gap < np.pi:
            c, s = np.cos(gap / 2), np.sin(gap / 2)
            apart = clear / 2 + stock.bar / 2 * abs(np.sin(end.dip)) * s
            yield np.array([-np.cos(end.dip) * s, side * c]), end.root * s - apart


def mitre_length(bar: LatticeBar, end: BarEnd, stock: BarStock) -> float:
    """Return the length (m) that the oblique cuts at an end remove from a bar."""
    half = bar.bay.width / 2
    cuts = [(b - abs(a[1]) * half) / a[0] for a, b in _mitres(end, stock, BAR_CLEARANCE * stock.bolt)]
    return float(np.clip(max(cuts, default=0.0), 0.0, bar.length))


def _bar_marks(bar: LatticeBar, nodes: tuple[str, str], inner: tuple[float, float], height: float) -> Iterator[Floats]:
    room = inner[1] - inner[0]
    names = [nodes[0], bar.bay.id, nodes[1]]
    long = sum(text_length(name, height) for name in names) + 4 * height
    if long > NAME_SHARE * room:
        names = [bar.bay.id]
        long = text_length(bar.bay.id, height)
    height *= min(1.0, NAME_SHARE * room / long)
    if height < 0.003 * min(1.0, bar.bay.width / 0.02):  # metres: smaller letters are not readable
        return
    places = [inner[0] + inner[1]] if len(names) == 1 else [2 * inner[0], inner[0] + inner[1], 2 * inner[1]]
    for name, twice, side in zip(names, places, (0,) if len(names) == 1 else (1, 0, -1), strict=True):
        x = twice / 2 + side * (text_length(name, height) / 2 + height)
        yield from label(name, np.array([x, 0.0]), 0.0, height)


def plate_part(joint: Joint, lattice: BarLattice, stock: BarStock) -> FlatPart:
    """Return the unfolded plate of a node as a flat part."""
    arms = plate_arms(joint, lattice, stock)
    outline = _plate_outline(joint, arms)
    holes = [Hole(np.zeros(2), stock.bolt, joint.node.id)]
    anchor = joint.leg.anchor if joint.leg else 0.0
    diameters = {a.bar: anchor if a.bar == LEG_NAME else stock.bolt for a in arms}
    holes += [Hole(a.point(r, 0.0), diameters[a.bar], a.bar) for a in arms for r in a.holes]
    folds = tuple(Fold(np.stack([a.point(a.fold, -joint.half), a.point(a.fold, joint.half)]), a.dip) for a in arms)
    marks = tuple(_plate_marks(joint, arms, stock))
    basics = joint.node.id, "", (0.0, 0.0), outline, tuple(holes)
    return FlatPart(*basics, marks=marks, layer=-stock.lever, folds=folds, thickness=stock.plate).at_origin()


def plate_arms(joint: Joint, lattice: BarLattice, stock: BarStock) -> "list[PlateArm]":
    """Return the arms of a node's plate, counter-clockwise."""
    arms = [PlateArm.from_bar(joint, lattice.bars[k], side, stock) for k, side in joint.bars]
    if joint.leg is None:
        return arms
    leg, root = joint.leg, joint.root
    holes = tuple(root + r for r in leg.holes)
    azimuth = lattice.azimuth(joint, leg.way)
    arms.append(PlateArm(LEG_NAME, azimuth, -leg.fold, root, holes, root + leg.length, 0.0, root))
    arms.sort(key=lambda arm: arm.azimuth)
    gaps = np.diff([arm.azimuth for arm in arms], append=2 * np.pi)
    return [replace(arm, after=float(gap)) for arm, gap in zip(arms, gaps, strict=True)]


@dataclass(frozen=True)
class PlateArm:
    """Arm of a flat node plate. Angles are in radians.
    azimuth : direction of the arm, counter-clockwise.    dip : fold angle.    after : angle to the next arm.
    fold, holes, end, root : metres from the node to the fold, the holes, the arm's end, and the bar's beginning."""

    bar: str
    azimuth: float
    dip: float
    fold: float
    holes: tuple[float, ...]
    end: float
    after: float
    root: float

    @classmethod
    def from_bar(cls, joint: Joint, bar: LatticeBar, side: int, stock: BarStock) -> "PlateArm":
        """Return the arm of a node's plate for a bar. side : end of the bar, 0 or 1."""
        end, (stations, end_distance) = bar.ends[side], stock.bolt_stations(bar)
        setback = stock.lever * np.tan(end.dip / 2)
        holes = tuple(end.root - 2 * setback + r for r in stations)
        root = end.root - 2 * setback
        return cls(bar.bay.id, end.azimuth, end.dip, end.root - setback, holes, root + end_distance, end.after, root)

    def point(self, r: float, y: float) -> Floats:
        """Return the point (2,) at a distance r along the arm, and y to the left of the arm (m)."""
        c, s = np.cos(self.azimuth), np.sin(self.azimuth)
        return np.array([r * c - y * s, r * s + y * c])


def _plate_outline(joint: Joint, arms: Sequence[PlateArm]) -> Floats:
    a, corners = joint.half, list[Floats]()
    for arm, next_arm in zip(arms, [*arms[1:], arms[0]], strict=True):
        corners += [arm.point(arm.end, -a), arm.point(arm.end, a)]
        notch = a / np.tan(arm.after / 2) if arm.after < 2 * np.pi - 1e-9 else -np.inf
        if notch > -a:
            corners.append(arm.point(notch, a))
        else:
            corners += [arm.point(-a, a), next_arm.point(-a, -a)]
    return np.array(corners)


def _plate_marks(joint: Joint, arms: Sequence[PlateArm], stock: BarStock) -> Iterator[Floats]:
    height = min(stock.letters, NODE_LETTERS, 0.5 * joint.half)
    for k, arm in enumerate(arms):
        stops = [arm.fold, *arm.holes]
        inside = 0.6 * stock.bolt
        rooms = [(stops[0], stops[1] - inside)] if len(stops) > 1 else [(arm.fold, arm.end)]
        rooms += [(stops[1] + inside, stops[2] - inside)] if len(stops) > 2 else []
        words = [f"{np.degrees(arm.dip):+.1f}", arm.bar] if len(rooms) > 1 else [arm.bar]
        if k == 0:
            rooms, words = [(inside, arm.fold), *rooms], [joint.node.id, *words]
        for (low, high), text in zip(rooms, words, strict=True):
            tall = height * min(1.0, NAME_SHARE * (high - low) / text_length(text, height))
            if tall > 0.2 * height:
                yield from label(text, arm.point((low + high) / 2, 0.0), arm.azimuth, tall)
