"""Remeshing by mesh and by edge: angles, distances, curves, plan and seconds, as `dsfab.surface.remeshed_surface`
promises.

    python tests/benchmarks/remeshing.py                   every mesh of DSFAB_MESHES, and odd ones made here
    python tests/benchmarks/remeshing.py spot gyroid       some of them
    python tests/benchmarks/remeshing.py --large           200 000 triangles, made and made fewer

Edges are an 80th and a 160th of the diagonal (`--shares` for others). Distances are in edges, the plan in mm per 16 m,
angles in degrees; `own` is the least angle between boundaries and creases where they meet in the input: no mesh avoids
a smaller angle than that. `below 20` counts faces with a smaller angle, `elsewhere` those of them that do not lie
between two boundaries or creases of the input that meet at less than 25 degrees. `crease` looks for edges of more than
18 degrees, `line` for any edge of the new mesh.
"""

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import igl
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from dsfab.surface import SHAPES, Surface, read_surface, remeshed_surface
from dsfab.surface.mesh import nearest_places
from dsfab.surface.remesh.features import design_features
from dsfab.surface.topology import euler_characteristic, manifold_faults, pieces
from tests.canopy import canopy
from tests.meshes import FOLDER
from tests.shapes import grid, jittered

BOUNDS = {"angle": 20.0, "boundary": 0.02, "crease": 0.02, "line": 0.02, "vertices": 0.01, "plan": 1.0, "elsewhere": 0}


def level_set(field: Callable, cells: int, size: float) -> Surface:
    """The part of field = 0 in a cube, by marching cubes, its tiny pieces left out."""
    t = np.linspace(-size, size, cells)
    points = np.stack(np.meshgrid(t, t, t, indexing="ij"), axis=-1).reshape(-1, 3)
    V, F, _ = igl.marching_cubes(field(*points.T), points, cells, cells, cells, 0.0)
    a, b, c = V[F].transpose(1, 0, 2)
    F = F[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-12]
    whole = Surface(V, F)
    F = F[whole.pieces[1] == 0]
    used, F = np.unique(F, return_inverse=True)
    return Surface(V[used], F.reshape(-1, 3))


def gyroid() -> Surface:
    """A patch with many slivers."""
    return level_set(lambda x, y, z: np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x), 33, 3.0)


def schwarz_p() -> Surface:
    """Six tubes that meet."""
    return level_set(lambda x, y, z: np.cos(x) + np.cos(y) + np.cos(z), 30, 3.1)


def terrain(cells: int = 90) -> Surface:
    """Hills of 60 m over a kilometre, with terraces."""
    flat = jittered(grid(cells, cells, 1000.0, 1000.0))
    x, y = flat.V[:, 0] / 150, flat.V[:, 1] / 150
    hills = 30 * np.sin(x) * np.cos(1.3 * y) + 12 * np.sin(2.7 * x + y)
    return Surface(np.c_[flat.V[:, :2], hills + 8 * np.tanh(6 * np.sin(0.8 * x + 0.3 * y))], flat.F)


def scan() -> Surface:
    """A vault of 30 000 triangles with noise of a fifth of its edges."""
    vault = SHAPES["barrel_vault"](edge=0.085)
    noise = np.random.default_rng(0).normal(size=vault.V.shape)
    return Surface(vault.V + 0.2 * 0.085 / np.sqrt(3) * noise, vault.F)


def needles() -> Surface:
    """A vault as CAD programs give it: strips of triangles as long as the vault."""
    flat = grid(60, 1, 8.0, 10.0)
    x, y, _ = flat.V.T
    return Surface(np.c_[x, y, 2.5 * np.sin(np.pi * x / 8)], flat.F)


def box() -> Surface:
    """A closed box of twelve triangles: edges and corners only."""
    V = np.array([[x, y, z] for x in (0, 4) for y in (0, 3) for z in (0, 2)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Surface(V, [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))])


OWN: dict[str, Callable[[], Surface]] = {
    "gyroid": gyroid,
    "schwarz_p": schwarz_p,
    "terrain": terrain,
    "scan": scan,
    "canopy in mm": lambda: Surface(canopy().V * 1000, canopy().F),
    "needles": needles,
    "box": box,
}


def samples(surface: Surface, edges: np.ndarray) -> np.ndarray:
    """(k, 3) nine points on each of the marked edges."""
    t = np.linspace(0, 1, 9)[:, None, None]
    a, b = surface.V[surface.edges.ends[edges]].transpose(1, 0, 2)
    return ((1 - t) * a + t * b).reshape(-1, 3)


def farthest(points: np.ndarray, surface: Surface, simplices: np.ndarray) -> float:
    """The largest distance of points from faces or edges, metres; 0 of no points."""
    return float(nearest_places(points, surface.V, simplices).distance.max()) if len(points) and len(simplices) else 0.0


def inside(surface: Surface, count: int = 60_000) -> np.ndarray:
    """(k, 3) points spread over a surface, and its vertices."""
    rng = np.random.default_rng(0)
    face = rng.choice(surface.m, count, p=surface.areas / surface.area)
    b = rng.dirichlet([1, 1, 1], count)
    return np.vstack([np.einsum("kc,kci->ki", b, surface.V[surface.F[face]]), surface.V])


def sharp(surface: Surface, degrees: float) -> np.ndarray:
    """(e,) inner edges of more than so many degrees."""
    marks = np.zeros(len(surface.edges.ends), dtype=bool)
    one, two = surface.normals[surface.edges.pairs // 3].transpose(1, 0, 2)
    marks[surface.edges.count == 2] = (one * two).sum(axis=1) < np.cos(np.radians(degrees))
    return marks


def angles(surface: Surface) -> np.ndarray:
    """(m, 3) degrees."""
    P = surface.V[surface.F]
    u, v = np.roll(P, -1, axis=1) - P, np.roll(P, 1, axis=1) - P
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(u, v), axis=2), np.einsum("mci,mci->mc", u, v)))


def own_corners(surface: Surface, marks: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles (k,) within the surface between marked edges that meet, degrees: sums of the faces' angles between; and
    the half-edges (k,) along both, the first from the corner, the second to it."""
    edges = surface.edges
    on, corner = marks[edges.of].ravel(), angles(surface).ravel()
    h0, h1 = edges.pairs.T
    twin = np.full(3 * surface.m, -1)
    twin[h0], twin[h1] = h1, h0
    at = np.flatnonzero(on)  # half-edges along features; the angle to their left is summed up to the next feature
    total = corner[at].copy()
    for _ in range(100):
        side = at - at % 3 + (at + 2) % 3
        going = ~on[side]
        if not going.any():
            break
        at = np.where(going, twin[side], at)
        total[going] += corner[at[going]]
    return total, np.flatnonzero(on), at - at % 3 + (at + 2) % 3


def wedges(surface: Surface, marks: np.ndarray, below: float = 25.0) -> np.ndarray:
    """(3 k, 3) corners of the triangles between marked edges that meet at less than so many degrees."""
    angle, first, last = own_corners(surface, marks)
    first, last = first[angle < below], last[angle < below]
    F, V = surface.F.ravel(), surface.V
    tip, one, two = F[first], F[first - first % 3 + (first + 1) % 3], F[last]
    return V[np.stack([tip, one, two], axis=1)].reshape(-1, 3)


def row(name: str, old: Surface, edge: float, **how: object) -> dict[str, object]:
    """All measures of one remeshing."""
    begun = time.perf_counter()
    new = remeshed_surface(old, edge, **how)
    seconds = time.perf_counter() - begun
    crease, border, all_edges = sharp(old, 30) & design_features(old, edge), old.edges.boundary, new.edges.ends
    least, marks = angles(new).min(axis=1), design_features(old, edge)
    bad, corners = new.centroids[least < 20], wedges(old, marks)
    triangles = np.arange(len(corners)).reshape(-1, 3)
    between = nearest_places(bad, corners, triangles).distance if len(corners) else np.full(len(bad), np.inf)
    same = (
        euler_characteristic(new.F, new.edges) == euler_characteristic(old.F, old.edges)
        and len(new.loops) == len(old.loops)
        and pieces(new.F, new.edges)[0] == pieces(old.F, old.edges)[0]
        and len(manifold_faults(new.F, new.edges, new.n)) == len(manifold_faults(old.F, old.edges, old.n))
    )
    extent = np.ptp(old.V, axis=0)
    return {
        "name": name,
        "from": old.m,
        "to": new.m,
        "s": seconds,
        "angle": least.min(),
        "own": float(own_corners(old, marks)[0].min(initial=180.0)),
        "below 20": int((least < 20).sum()),
        "elsewhere": int((between > 0.02 * edge).sum()),
        "mean": least.mean(),
        "edge": new.mean_edge / edge,
        "out": farthest(inside(new), old, old.F) / edge,
        "in": farthest(inside(old), new, new.F) / edge,
        "vertices": farthest(new.V, old, old.F) / edge,
        "boundary": max(
            farthest(samples(new, new.edges.boundary), old, old.edges.ends[border]),
            farthest(samples(old, border), new, all_edges[new.edges.boundary]),
        )
        / edge,
        "crease": farthest(samples(old, crease), new, all_edges[sharp(new, 18)]) / edge,
        "line": farthest(samples(old, crease), new, all_edges) / edge,
        "plan": np.abs(np.ptp(new.V, axis=0) - extent).max() / extent.max() * 16000,
        "topology": "same" if same else "CHANGED",
    }


def told(values: dict[str, object]) -> str:
    """A line of the table; what misses its bound has an asterisk."""
    cells = []
    for key, value in values.items():
        bound = BOUNDS.get(key)
        missed = bound is not None and bool(
            value < min(bound, values["own"] - 1e-6) if key == "angle" else value > bound
        )
        text = value if isinstance(value, str) else f"{value:d}" if isinstance(value, int) else f"{value:.3g}"
        cells.append(f"{text}{'*' * missed}".rjust(max(len(key), 7)))
    return " ".join(cells)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*")
    parser.add_argument("--shares", default="80,160")
    parser.add_argument("--large", action="store_true")
    parser.add_argument("--smooth", action="store_true")
    given = parser.parse_args()
    files = {path.stem: path for path in sorted(FOLDER.glob("*.obj"))}
    header = None
    if given.large:
        names = {"sphere": lambda: SHAPES["sphere"](edge=0.024), "canopy": lambda: canopy(0.0405)}
    else:
        names = {**{name: lambda p=path: read_surface(p) for name, path in files.items()}, **OWN}
    for name in given.names or names:
        old = names[name]()
        edges = [old.size / float(share) for share in given.shares.split(",")]
        if given.large:
            edges = [old.size / 80, float(np.sqrt(old.area / 200_000 / 0.433))]
        for edge in edges:
            values = row(name, old, edge, smooth=given.smooth)
            if header is None:
                header = " ".join(key.rjust(max(len(key), 7)) for key in values)
                print(header)
            print(told(values), flush=True)


if __name__ == "__main__":
    main()
