"""Volume of a solid as OCCT computes it."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.polynomial import legendre

from dsfab.export.cad.step.worker.shapes import faces_of, parts

VOLUME = 1e-3  # largest relative error that the adaptive rule estimates; real errors are much smaller
MANY_EDGES = 16  # faces with at least this many edges are integrated by Green's theorem


class PlaneSpline(NamedTuple):
    """Curve in a surface's parameter plane. knots : repeated by multiplicity.    way : 1, or -1 for a reversed edge."""

    degree: int
    knots: list[float]
    poles: list[tuple[float, float]]
    way: int


def volume(solid: Any) -> float:
    """Return the volume of a solid, mm3."""
    from OCP.BRep import BRep_Tool
    from OCP.gp import gp_Pnt
    from OCP.TopoDS import TopoDS

    corners = [BRep_Tool.Pnt_s(TopoDS.Vertex(vertex)) for vertex in parts(solid, "VERTEX")]
    count = max(len(corners), 1)
    x, y, z = (sum(axis) / count for axis in zip(*((p.X(), p.Y(), p.Z()) for p in corners), strict=True))
    about = gp_Pnt(x, y, z)
    return sum(_cone(face, about) for face in faces_of(solid))


def _cone(face: Any, about: Any) -> float:
    """Return the volume (mm3) of the cone from a face to a point `about`, positive if the point is behind the face."""
    from OCP.BRepGProp import BRepGProp_Domain, BRepGProp_Face, BRepGProp_Vinert
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopoDS import TopoDS

    ahead = TopoDS.Face(face.Oriented(TopAbs_Orientation.TopAbs_FORWARD))
    edges = [TopoDS.Edge(edge) for edge in parts(ahead, "EDGE")]
    if len(edges) >= MANY_EDGES:
        surface = _spline_surface(ahead)
        outline = [spline for edge in edges if (spline := _spline_on(edge, ahead))]
        if surface is not None and len(outline) == len(edges):
            turned = face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED
            return (-1 if turned else 1) * _cone_on_spline(surface, outline, about)
    return float(BRepGProp_Vinert(BRepGProp_Face(face), BRepGProp_Domain(face), about, VOLUME).Mass())


def _spline_surface(face: Any) -> Any | None:
    from OCP.BRep import BRep_Tool
    from OCP.Geom import Geom_BSplineSurface

    surface = BRep_Tool.Surface_s(face)
    is_unweighted = isinstance(surface, Geom_BSplineSurface) and not (surface.IsURational() or surface.IsVRational())
    return surface if is_unweighted else None


def _spline_on(edge: Any, face: Any) -> PlaneSpline | None:
    end_tolerance = 1e-9  # an edge may be shorter than its curve by this fraction
    from OCP.BRep import BRep_Tool
    from OCP.Geom2d import Geom2d_BSplineCurve
    from OCP.TopAbs import TopAbs_Orientation

    curve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 1.0)
    if not isinstance(curve, Geom2d_BSplineCurve) or curve.IsRational() or curve.IsPeriodic():
        return None
    begin, end = BRep_Tool.Range_s(edge)
    if abs(curve.FirstParameter() - begin) + abs(curve.LastParameter() - end) > end_tolerance * (end - begin):
        return None
    forward = edge.Orientation() == TopAbs_Orientation.TopAbs_FORWARD
    knots = [curve.Knot(i) for i in range(1, curve.NbKnots() + 1) for _ in range(curve.Multiplicity(i))]
    # OCCT's own list of poles takes six times as long
    poles = [(p.X(), p.Y()) for p in map(curve.Pole, range(1, curve.NbPoles() + 1))]
    return PlaneSpline(curve.Degree(), knots, poles, 1 if forward else -1)


def _cone_on_spline(surface: Any, outline: Sequence[PlaneSpline], about: Any) -> float:
    u = [surface.UKnot(i) for i in range(1, surface.NbUKnots() + 1)]
    v = [surface.VKnot(i) for i in range(1, surface.NbVKnots() + 1)]
    p, q = 3 * surface.UDegree(), 3 * surface.VDegree()
    x, y = legendre.leggauss(p)[0], legendre.leggauss(q)[0]
    f = _integrand(surface, about, _span_places(u, x), _span_places(v, y)).reshape(len(u) - 1, p, len(v) - 1, q)
    to_u, to_v = np.linalg.inv(legendre.legvander(x, p - 1)), np.linalg.inv(legendre.legvander(y, q - 1))
    G = legendre.legint(np.einsum("am,imjn,bn->iajb", to_u, f, to_v), lbnd=-1, axis=1)
    G *= np.diff(u)[:, None, None, None] / 2
    G[1:, 0] += np.cumsum(G.sum(axis=1), axis=0)[:-1]  # add the integrals of all earlier spans
    places, dv = _outline_points(outline)
    i, s = _local(u, places[:, 0])
    j, t = _local(v, places[:, 1])
    along_u, along_v = legendre.legvander(s, p) * dv[:, None], legendre.legvander(t, q - 1)
    span = i * (len(v) - 1) + j
    order = np.argsort(span)
    groups = np.split(order, np.flatnonzero(np.diff(span[order])) + 1)
    # einsum avoids BLAS, whose threads wait for each other on a busy machine
    terms = (np.einsum("ka,ab->kb", along_u[k], G[i[k[0]], :, j[k[0]], :]) * along_v[k] for k in groups)
    return sum(float(term.sum()) for term in terms)


def _integrand(surface: Any, about: Any, u: Any, v: Any) -> Any:
    from OCP.gp import gp_Pnt, gp_Vec

    point, along_u, along_v, values = gp_Pnt(), gp_Vec(), gp_Vec(), []
    for u_value in u.tolist():
        for v_value in v.tolist():
            surface.D1(u_value, v_value, point, along_u, along_v)
            values.append(gp_Vec(about, point).Dot(along_u.Crossed(along_v)) / 3)
    return np.array(values)


def _span_places(knots: list[float], x: Any) -> Any:
    K = np.array(knots)
    return ((K[1:] + K[:-1])[:, None] / 2 + np.diff(K)[:, None] / 2 * x).ravel()


def _local(knots: list[float], t: Any) -> tuple[Any, Any]:
    K = np.array(knots)
    i = np.clip(np.searchsorted(K, t, side="right") - 1, 0, len(K) - 2)
    return i, (2 * t - K[i] - K[i + 1]) / (K[i + 1] - K[i])


def _outline_points(outline: Sequence[PlaneSpline]) -> tuple[Any, Any]:
    """Return Gauss points (k, 2) on the curves of an outline, and their weights (k,) for an integral over dv."""
    points = 4  # Gauss points in a span, as in OCCT
    places, weights = [], []
    for degree in sorted({curve.degree for curve in outline}):
        spans = [_spans(curve) for curve in outline if curve.degree == degree]
        K, poles, direction = (np.concatenate(column) for column in zip(*spans, strict=True))
        half = (K[:, degree] - K[:, degree - 1]) / 2
        for x, weight in zip(*legendre.leggauss(points), strict=True):
            points_on_span, slope = _de_boor(K, poles, K[:, degree - 1] + (1 + x) * half)
            places.append(points_on_span)
            weights.append(weight * direction * half * slope[:, 1])
    return np.concatenate(places), np.concatenate(weights)


def _spans(curve: PlaneSpline) -> tuple[Any, Any, Any]:
    """Return, for k spans of a curve of degree d, the knots (k, 2 d), poles (k, d + 1, 2) and `curve.way` (k,)."""
    d = curve.degree
    K = sliding_window_view(np.array(curve.knots[1:-1]), 2 * d)
    poles = sliding_window_view(np.array(curve.poles), d + 1, axis=0).swapaxes(1, 2)
    real = K[:, d] > K[:, d - 1]
    return K[real], poles[real], np.full(np.count_nonzero(real), curve.way)


def _de_boor(K: Any, poles: Any, t: Any) -> tuple[Any, Any]:
    """Return the points (k, 2) and derivatives (k, 2) of spans with knots K and `poles` at parameters t (k,)."""
    d = K.shape[1] // 2
    slope = d * (poles[:, 1:] - poles[:, :-1]) / (K[:, d:] - K[:, :d])[:, :, None]
    K1, K2 = K, K[:, 1:-1]
    for level in range(d, 0, -1):
        share = ((t[:, None] - K1[:, :level]) / (K1[:, level:] - K1[:, :level]))[:, :, None]
        poles = (1 - share) * poles[:, :-1] + share * poles[:, 1:]
        K1 = K1[:, 1:-1]
    for level in range(d - 1, 0, -1):
        share = ((t[:, None] - K2[:, :level]) / (K2[:, level:] - K2[:, :level]))[:, :, None]
        slope = (1 - share) * slope[:, :-1] + share * slope[:, 1:]
        K2 = K2[:, 1:-1]
    return poles[:, 0], slope[:, 0]
