"""`dsfab bench --preview`: pictures a second of the plain mesh and of the stripes on it, in software and hardware."""

import json
import os
import re
import subprocess
import sys
import time
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from dsfab.app.report import table
from dsfab.arrays import Floats, Ints
from dsfab.errors import DsfabError

if TYPE_CHECKING:
    from dsfab.app.shader import StripeShader

SIZES = (10_000, 60_000, 300_000, 1_000_000)
"""Triangles of the surfaces."""

PIXELS = (1024, 768)

SECONDS = 4.0
"""What one row is measured for, at least `LEAST` pictures of each kind."""

LEAST = 4

SOFTWARE = re.compile(r"llvmpipe|softpipe|swrast|swiftshader|software|gdi generic|basic render", re.IGNORECASE)
"""Names of renderers that run on the processor."""


def wavy_torus(triangles: int) -> tuple[Floats, Ints, Floats]:
    """A wavy torus of about that many triangles: V (n, 3), F (m, 3), and the fields (n, 6) of a `StripeShader`.

    What is drawn where does not matter for the time, so nothing is solved: the fields are the two angles.
    """
    rows = max(round((triangles / 6) ** 0.5), 3)
    columns = 3 * rows
    i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    a, b = 2 * np.pi * i.ravel() / columns, 2 * np.pi * j.ravel() / rows
    r = 0.34 + 0.04 * np.cos(5 * a) * np.sin(3 * b)
    V = np.stack([(1 + r * np.cos(b)) * np.cos(a), (1 + r * np.cos(b)) * np.sin(a), r * np.sin(b)], axis=1)
    here, east = (i * rows + j).ravel(), ((i + 1) % columns * rows + j).ravel()
    north, both = (i * rows + (j + 1) % rows).ravel(), ((i + 1) % columns * rows + (j + 1) % rows).ravel()
    F = np.concatenate([np.stack([here, east, both], axis=1), np.stack([here, both, north], axis=1)])
    far = np.full(len(V), np.inf)
    return V, F, np.stack([np.sin(a), np.sin(b), far, far, far, far], axis=1)


def measure(triangles: int) -> dict[str, Any]:
    """Frames a second in this process: `plain`, `shader` (its numbers changed before each frame), `walls` (the same
    with the walls of the sheet), and the milliseconds that a change of numbers takes alone."""
    from dsfab.app.gl import require_rendering
    from dsfab.app.scene import Body, Scene
    from dsfab.app.shader import StripeShader
    from dsfab.app.view import framed, named_side

    require_rendering()
    V, F, fields = wavy_torus(triangles)
    stripes = StripeShader(fields)
    view = framed(V, named_side(V, np.array([0.0, 0.0, 1.0]), "20,40"), (-1.2, 1.2, -0.9, 0.9))
    colour = np.array((220, 156, 122), dtype=np.uint8)
    found: dict[str, Any] = {"triangles": len(F)}
    scenes = {
        kind: Scene([Body(V, F, colour, casts=True, shader=shader)], np.zeros(3), 1.5)
        for kind, shader in (("plain", None), ("shader", stripes))
    }
    try:
        scenes["plain"].frame(view, *PIXELS)  # only then there is a renderer to name
        found["renderer"] = _renderer(scenes["plain"])
        change: list[float] = []
        kinds = {
            "plain": lambda number: None,
            "shader": lambda number: _changed(stripes, number),
            "walls": lambda number: stripes.look(view.eye / 1.5, 0.01),
        }
        seconds: dict[str, list[float]] = {kind: [] for kind in kinds}
        for together in (("plain", "shader"), ("walls",)):  # in turn, so that a busy machine is fair to both
            start, number = time.perf_counter(), 0
            while number < LEAST + 1 or time.perf_counter() - start < SECONDS:
                for kind in together:
                    begin = time.perf_counter()
                    kinds[kind](number)
                    change.append(time.perf_counter() - begin)
                    scenes["plain" if kind == "plain" else "shader"].frame(view, *PIXELS)
                    seconds[kind].append(time.perf_counter() - begin)
                number += 1
    finally:
        for scene in scenes.values():
            scene.close()
    found |= {kind: 1 / median(taken[1:]) for kind, taken in seconds.items()}  # the first compiles
    return found | {"change_ms": 1000 * median(change[1 : 2 * len(seconds["shader"]) : 2])}


def _changed(stripes: "StripeShader", number: int) -> None:
    from dsfab.app.shader import Settings

    stripes.set(Settings((4 + 0.1 * number, 9.0), (0.0, 0.0), (0.2, 0.15)))


def _renderer(scene: Any) -> str:
    """What VTK draws with, by its own words."""
    said = re.search(r"OpenGL renderer string:\s*(.+)", scene.window.window.ReportCapabilities())
    return said.group(1).strip() if said else "unknown"


def frame_rates(sizes: tuple[int, ...] = SIZES) -> list[dict[str, Any]]:
    """`measure` for each size, each in a process of its own; where hardware draws, in software as well."""
    rows = [_in_own_process(triangles, {}) for triangles in sizes]
    if rows and sys.platform.startswith("linux") and not SOFTWARE.search(rows[0]["renderer"]):
        rows += [_in_own_process(triangles, {"LIBGL_ALWAYS_SOFTWARE": "1"}) for triangles in sizes]
    return rows


def _in_own_process(triangles: int, more: dict[str, str]) -> dict[str, Any]:
    command = [sys.executable, "-m", "dsfab.app.bench_preview", str(triangles)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **more})
    if done.returncode:
        raise DsfabError((done.stderr.strip() or f"drawing {triangles:,} triangles was killed").splitlines()[-1])
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def rates_table(rows: list[dict[str, Any]]) -> str:
    """The rows as text, with what drew them and whether that is hardware."""
    head = ("triangles", "plain fps", "shader fps", "with walls fps", "change ms", "drawn by")
    return table(
        head,
        (
            (
                f"{row['triangles']:,}",
                *(f"{row[kind]:.1f}" for kind in ("plain", "shader", "walls")),
                f"{row['change_ms']:.3f}",
                f"{'software' if SOFTWARE.search(row['renderer']) else 'hardware'}: {row['renderer']}",
            )
            for row in rows
        ),
    )


if __name__ == "__main__":
    try:
        sys.stdout.write(json.dumps(measure(int(sys.argv[1]))))
    except DsfabError as _error:
        sys.exit(str(_error))
