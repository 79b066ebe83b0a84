"""Ten surfaces as people bring them: odd units, odd axes, polygons, noise, several pieces. None has a preset.

python -m tests.own_meshes FOLDER writes them all.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import igl
import numpy as np
import pyvista
import trimesh
from scipy.spatial import Delaunay, cKDTree

from tests.canopy import canopy


def _obj(path: Path, V, faces) -> None:
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in V]
    lines += ["f " + " ".join(str(k + 1) for k in face) for face in faces]
    path.write_text("\n".join(lines) + "\n")


def _triangles(mesh: pyvista.PolyData):
    """Vertices and faces of a pyvista mesh, equal places made one."""
    mesh = mesh.extract_surface(algorithm="dataset_surface").triangulate().clean(tolerance=1e-7)
    V, F = np.asarray(mesh.points, float), mesh.faces.reshape(-1, 4)[:, 1:]
    area = np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1)
    return V, F[area > 1e-10 * np.ptp(V, axis=0).max() ** 2]


def _grid(nx, ny):
    """Triangles of a grid of nx x ny vertices."""
    k = np.arange(nx * ny).reshape(nx, ny)
    a, b, c, d = k[:-1, :-1].ravel(), k[1:, :-1].ravel(), k[1:, 1:].ravel(), k[:-1, 1:].ravel()
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def canopy_mm(folder: Path) -> Path:
    """A canopy on four feet with two openings, in millimetres, as Rhino exports it."""
    surface = canopy(0.5)
    _obj(folder / "canopy_mm.obj", surface.V * 1000, surface.F)
    return folder / "canopy_mm.obj"


def sail_yup(folder: Path) -> Path:
    """A groined roof on three points with y up, as web tools export."""
    n = 28
    a = np.array([[np.cos(t), np.sin(t)] for t in np.radians([90, 210, 330])]) * 7
    u, v = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing="ij")
    inside = u + v <= 1 + 1e-9
    plan = a[0] + u[..., None] * (a[1] - a[0]) + v[..., None] * (a[2] - a[0])
    w = np.stack([1 - u - v, u, v], axis=-1)
    middle = 1 - (w**2).sum(axis=-1)  # 0 at the corners, 2/3 in the middle
    towards = plan - plan[inside].mean(axis=0)
    edge = 27 * (w[..., 0] * w[..., 1] + w[..., 1] * w[..., 2] + w[..., 2] * w[..., 0]) / 27
    plan = plan - 0.18 * towards * (edge * 3 / 1)[..., None] * (1 - 27 * w.prod(axis=-1))[..., None]
    number = np.cumsum(inside.ravel()).reshape(n, n) - 1
    faces = []
    for i in range(n - 1):
        for j in range(n - 1 - i):
            faces.append([number[i, j], number[i + 1, j], number[i, j + 1]])
            if j < n - 2 - i:
                faces.append([number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]])
    x, y, height = plan[..., 0][inside], plan[..., 1][inside], (6.3 * middle)[inside]
    _obj(folder / "sail_yup.obj", np.stack([x, height, -y], axis=1), faces)
    return folder / "sail_yup.obj"


def terrain(folder: Path) -> Path:
    """A landscape roof of 60 x 40 m: hills and dips, and an edge that goes up and down."""
    nx, ny = 91, 61
    x, y = np.meshgrid(np.linspace(0, 60, nx), np.linspace(0, 40, ny), indexing="ij")
    z = 3 * np.sin(x / 9) * np.cos(y / 11) + 1.6 * np.sin((x + 2 * y) / 7) + 0.9 * np.cos((2 * x - y) / 5)
    trimesh.Trimesh(np.stack([x, y, z], -1).reshape(-1, 3), _grid(nx, ny), process=False).export(folder / "terrain.ply")
    return folder / "terrain.ply"


def gyroid(folder: Path) -> Path:
    """A gyroid in a cube of 6 m, cut by its walls: many free edges, one piece."""
    n = 45
    axis = np.linspace(0, 1, n)
    grid = pyvista.ImageData(dimensions=(n, n, n), spacing=(6 / (n - 1),) * 3)
    x, y, z = (2 * np.pi * a.ravel(order="F") for a in np.meshgrid(axis, axis, axis, indexing="ij"))
    field = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
    grid.point_data["f"] = field + 1e-4  # no vertex exactly on it
    V, F = _triangles(grid.contour([0.0], scalars="f"))
    trimesh.Trimesh(V, F, process=False).export(folder / "gyroid.stl")
    return folder / "gyroid.stl"


def voronoi_shell(folder: Path) -> Path:
    """A dome of 10 m with seven rounded cells cut out of it: slivers along the cuts, as mesh booleans leave them."""
    sphere = pyvista.Icosphere(radius=5.0, nsub=5)
    V, F = _triangles(sphere.clip(normal=(0, 0, 1), origin=(0, 0, 0.8), invert=False))
    seeds = np.array([[np.cos(k), np.sin(k), 0.75 + 0.25 * (k % 2)] for k in range(6)] + [[0.05, 0.0, 1.4]])
    seeds = 5 * seeds / np.linalg.norm(seeds, axis=1)[:, None]
    others = 5 * np.array([[np.cos(k + 0.5), np.sin(k + 0.5), 0.0] for k in range(6)])
    away = np.sort(cKDTree(np.vstack([seeds, others])).query(V, k=3)[0], axis=1)
    nearest = cKDTree(np.vstack([seeds, others])).query(V)[1]
    cell = np.where(nearest < len(seeds), away[:, 1] - away[:, 0], -1.0)
    mesh = pyvista.PolyData(V, np.c_[np.full(len(F), 3), F].ravel())
    mesh.point_data["cell"] = cell
    V, F = _triangles(mesh.clip_scalar(scalars="cell", value=0.8, invert=True))
    _obj(folder / "voronoi_shell.obj", V, F)
    return folder / "voronoi_shell.obj"


def ngon_dome(folder: Path) -> Path:
    """A dome of 12 m in hexagons and pentagons, no triangle in the file."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=6.0)
    V, F = np.asarray(ball.vertices), np.asarray(ball.faces)
    centres = V[F].mean(axis=1)
    centres *= 6 / np.linalg.norm(centres, axis=1)[:, None]
    around: list[list[int]] = [[] for _ in V]
    for f, corners in enumerate(F):
        for corner in corners:
            around[corner].append(f)
    faces = []
    for v, fs in enumerate(around):
        if centres[fs][:, 2].min() < 0.5:
            continue
        n = V[v] / np.linalg.norm(V[v])
        e = np.cross(n, [1.0, 0.31, 0.17])
        e /= np.linalg.norm(e)
        d = centres[fs] - V[v]
        faces.append([fs[k] for k in np.argsort(np.arctan2(d @ np.cross(n, e), d @ e))])
    used, flat = np.unique(np.concatenate(faces), return_inverse=True)
    ends = np.cumsum([len(f) for f in faces])[:-1]
    _obj(folder / "ngon_dome.obj", centres[used], np.split(flat, ends))
    return folder / "ngon_dome.obj"


def scan(folder: Path) -> Path:
    """A vault as a scanner sees it: 30 000 points, 4 mm of noise, a frayed edge, a few small holes; in millimetres."""
    rng = np.random.default_rng(7)
    points = rng.uniform((-4, -6), (4, 6), (17_000, 2))
    plan = np.vstack([points, [(-4, -6), (4, -6), (4, 6), (-4, 6)]])
    F = Delaunay(plan).simplices
    z = 2.4 * (1 - (plan[:, 0] / 4) ** 2) * (1 + 0.08 * np.cos(plan[:, 1] / 2))
    V = np.column_stack([plan, z]) + rng.normal(0, 0.002, (len(plan), 3))
    P = V[F]
    sides = np.linalg.norm(P - np.roll(P, 1, axis=1), axis=2).max(axis=1)
    middle = plan[F].mean(axis=1)
    holes = rng.uniform((-3, -5), (3, 5), (6, 2))
    keep = (sides < 0.45) & (cKDTree(holes).query(middle)[0] > 0.16)
    F = F[keep]
    piece = np.ravel(igl.facet_components(F)[1])
    F = F[piece == np.bincount(piece).argmax()]
    used, G = np.unique(F, return_inverse=True)
    mesh = trimesh.Trimesh(1000 * V[used], G.reshape(-1, 3), process=False)
    mesh.export(folder / "scan.ply")
    return folder / "scan.ply"


def two_sheets(folder: Path) -> Path:
    """Two separate roofs in one file: hypars of different size side by side, in quads."""
    V, faces = [], []
    for x0, side, rise, n in ((0.0, 8.0, 3.0, 20), (9.5, 6.0, 2.2, 16)):
        t = np.linspace(-1, 1, n)
        a, b = np.meshgrid(t, t, indexing="ij")
        start = sum(len(v) for v in V)
        V.append(np.stack([x0 + side / 2 * a, side / 2 * b, rise / 2 * (a * b + 1)], -1).reshape(-1, 3))
        k = start + np.arange(n * n).reshape(n, n)
        faces += np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], -1).reshape(-1, 4).tolist()
    _obj(folder / "two_sheets.obj", np.vstack(V), faces)
    return folder / "two_sheets.obj"


def figure(folder: Path) -> Path:
    """A closed figure of 1.8 m that stands on two legs, in GLB (y up)."""
    limbs = [  # two ends and a radius
        ((0, 0.28, 0.05), (0, 0.2, 0.85), 0.13),
        ((0, -0.28, 0.05), (0, -0.2, 0.85), 0.13),
        ((0, 0, 0.9), (0, 0, 1.35), 0.27),
        ((0.25, 0.3, 1.0), (0, 0.2, 1.4), 0.10),
        ((0.25, -0.3, 1.0), (0, -0.2, 1.4), 0.10),
        ((0.03, 0, 1.66), (0.03, 0, 1.7), 0.17),
    ]
    low, high, n = np.array([-0.5, -0.6, -0.2]), np.array([0.6, 0.6, 2.1]), np.array([45, 49, 93])
    grid = pyvista.ImageData(dimensions=n, origin=low, spacing=(high - low) / (n - 1))
    P = np.asarray(grid.points)
    field = np.zeros(len(P))
    for a, b, r in limbs:
        a, b = np.array(a), np.array(b)
        t = np.clip((P - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        field += np.exp(-4 * (np.linalg.norm(P - a - t[:, None] * (b - a), axis=1) / r) ** 2 + 4)
    grid.point_data["f"] = field
    V, F = _triangles(grid.contour([1.0], scalars="f"))
    V[:, 2] -= V[:, 2].min()
    trimesh.Trimesh(np.stack([V[:, 0], V[:, 2], -V[:, 1]], 1), F, process=False).export(folder / "figure.glb")
    return folder / "figure.glb"


def mushroom_slab(folder: Path) -> Path:
    """A flat slab of 9 x 5 m on two columns, which widen into it like mushrooms."""
    columns = np.array([[-2.4, 0.0], [2.4, 0.0]])
    t = np.linspace(0, 2 * np.pi, 28, endpoint=False)
    heads = np.stack([np.cos(t), np.sin(t)], axis=1)
    x, y = np.meshgrid(np.linspace(-4.5, 4.5, 46), np.linspace(-2.5, 2.5, 26), indexing="ij")
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    away = cKDTree(columns).query(points)[0]
    rings = [c + r * heads for c in columns for r in (0.9, 0.72, 0.56, 0.43, 0.33, 0.26, 0.22)]
    plan = np.vstack([points[away > 1.0], *rings])
    F = Delaunay(plan).simplices
    d = cKDTree(columns).query(plan)[0]
    F = F[~np.isclose(d, 0.22)[F].all(axis=1)]  # the insides of the shafts
    s = np.clip((0.9 - d) / (0.9 - 0.22), 0, 1)
    V = np.column_stack([plan, 3.0 - 0.9 * s**2.2])
    below = np.flatnonzero(np.isclose(d, 0.22))
    parts, faces = [V], [F]
    for c in columns:  # the shafts, down to the floor
        ring = below[np.linalg.norm(plan[below] - c, axis=1) < 0.3]
        ring = ring[np.argsort(np.arctan2(*(plan[ring] - c).T[::-1]))]
        last = ring
        for z in np.linspace(2.1, 0, 22)[1:]:
            now = sum(len(p) for p in parts) + np.arange(len(ring))
            parts.append(np.column_stack([plan[ring], np.full(len(ring), z)]))
            a, b, c2, d2 = last, np.roll(last, -1), now, np.roll(now, -1)
            faces += [np.stack([a, b, d2], 1), np.stack([a, d2, c2], 1)]
            last = now
    _obj(folder / "mushroom_slab.obj", np.vstack(parts), np.vstack(faces))
    return folder / "mushroom_slab.obj"


OWN: dict[str, Callable[[Path], Path]] = {
    make.__name__: make
    for make in (
        canopy_mm, sail_yup, terrain, gyroid, voronoi_shell, ngon_dome, scan, two_sheets, figure, mushroom_slab,
    )
}  # fmt: skip
"""Writers by name: each makes its file in a folder and returns its path."""

if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.mkdir(parents=True, exist_ok=True)
    for make in OWN.values():
        make(target)
