"""The command `dsfab bench --preview`, which measures frames per second of the renderer."""

import json
import os
import re
import subprocess
import sys
import time
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import DsfabError
from dsfab.core.messages import table
from dsfab.core.sparse import peak_memory

if TYPE_CHECKING:
    from dsfab.render.scene import Scene
    from dsfab.render.shader import StripeShader
    from dsfab.render.view import View

SIZES = (10_000, 60_000, 300_000, 1_000_000)  # Triangle counts of the tested meshes.
PIXELS = (1024, 768)
SECONDS = 4.0  # Shortest duration of a measurement.
KINDS = ("plain", "shader", "graded", "walls")  # Kinds of pictures, see `measure`.

SOFTWARE = re.compile(r"llvmpipe|softpipe|swrast|swiftshader|software|gdi generic|basic render", re.IGNORECASE)
"""Names of renderers that use the processor instead of a graphics card."""


def wavy_torus(triangles: int) -> tuple[Floats, Ints, Floats]:
    """Return a wavy torus of about `triangles` faces: V (n, 3), F (m, 3), test values (n, 6) for the stripe shader."""
    rows = max(round((triangles / 6) ** 0.5), 3)
    columns = 3 * rows
    i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    a, b = 2 * np.pi * i.ravel() / columns, 2 * np.pi * j.ravel() / rows
    r = 0.34 + 0.04 * np.cos(5 * a) * np.sin(3 * b)
    V = np.stack([(1 + r * np.cos(b)) * np.cos(a), (1 + r * np.cos(b)) * np.sin(a), r * np.sin(b)], axis=1)
    corner, east = (i * rows + j).ravel(), ((i + 1) % columns * rows + j).ravel()
    north, northeast = (i * rows + (j + 1) % rows).ravel(), ((i + 1) % columns * rows + (j + 1) % rows).ravel()
    F = np.concatenate([np.stack([corner, east, northeast], axis=1), np.stack([corner, northeast, north], axis=1)])
    no_distance = np.full(len(V), np.inf)  # any values will do: they do not change the drawing time
    half = 0.25 + 0.1 * np.cos(a)
    return V, F, np.stack([np.sin(a), np.sin(b), half, half, no_distance, no_distance], axis=1)


def measure(triangles: int) -> dict[str, Any]:
    """Draw a mesh of about `triangles` triangles; return measured values by name.
    plain, shader, graded, walls : frames per second without stripes, with stripes, with stripes of varying width, and
        with stripes that have walls (visible thickness).
    over_clock, over_cpu : real time and processor time of a `shader` frame, divided by those of a `plain` frame.
    change_ms : milliseconds to change the stripe settings.    peak_mb : peak memory in MiB."""
    from dsfab.render.opengl import require_rendering
    from dsfab.render.scene import Body, Scene
    from dsfab.render.shader import StripeShader
    from dsfab.render.view import fit_view, named_side

    require_rendering()
    V, F, fields = wavy_torus(triangles)
    shaders = {"plain": None, "shader": StripeShader(fields), "graded": StripeShader(fields)}
    view = fit_view(V, named_side(V, np.array([0.0, 0.0, 1.0]), "20,40"), (-1.2, 1.2, -0.9, 0.9))
    colour = np.array((220, 156, 122), dtype=np.uint8)
    scenes = {
        kind: Scene([Body(V, F, colour, casts=True, shader=shader)], np.zeros(3), 1.5)
        for kind, shader in shaders.items()
    }
    try:
        scenes["plain"].frame(view, *PIXELS)  # `renderer` is known only after the first frame
        renderer = scenes["plain"].renderer
        frame_times = _frames(scenes, shaders, view)
    finally:
        for scene in scenes.values():
            scene.close()
    clock, cpu, change_times = (
        {kind: median(row[k] for row in rows[1:]) for kind, rows in frame_times.items()} for k in range(3)
    )
    return {  # the medians ignore the first frame, because its time includes compilation
        "triangles": len(F),
        "renderer": renderer,
        **{kind: 1 / seconds for kind, seconds in clock.items()},
        "over_clock": clock["shader"] / clock["plain"],
        "over_cpu": cpu["shader"] / cpu["plain"],
        "change_ms": 1000 * change_times["shader"],
        "peak_mb": peak_memory() / 2**20,
    }


def _frames(
    scenes: "dict[str, Scene]", shaders: "dict[str, StripeShader | None]", view: "View"
) -> dict[str, list[tuple[float, float, float]]]:
    frame_times: dict[str, list[tuple[float, float, float]]] = {}
    for kinds in (("plain", "shader", "graded"), ("walls",)):  # kinds of frames alternate, for a fair comparison
        start, number = time.perf_counter(), 0
        while number < 5 or time.perf_counter() - start < SECONDS:
            for kind in kinds:
                scene = "shader" if kind == "walls" else kind
                begin, worked = time.perf_counter(), time.process_time()
                if stripes := shaders[scene]:
                    _change_settings(stripes, number, kind, view.eye / 1.5)
                changed = time.perf_counter() - begin
                scenes[scene].frame(view, *PIXELS)
                now = time.perf_counter() - begin, time.process_time() - worked, changed
                frame_times.setdefault(kind, []).append(now)
            number += 1
    return frame_times


def _change_settings(stripes: "StripeShader", number: int, kind: str, eye: Floats) -> None:
    from dsfab.render.shader import BY_VERTEX, NO_REACH, StripeSettings

    if kind == "walls":
        stripes.show_walls(eye, 0.01)
        return
    half, reach = (0.2, 0.15), (NO_REACH, NO_REACH)
    if kind == "graded":
        half, reach = (BY_VERTEX, BY_VERTEX), (0.1, NO_REACH)
    stripes.set(StripeSettings((4 + 0.1 * number, 9.0), (0.0, 0.0), half, reach))


def frame_rates(sizes: tuple[int, ...] = SIZES) -> list[dict[str, Any]]:
    """Return the results of `measure` for each triangle count in `sizes`. With a graphics card on Linux, the software
    renderer is measured, too."""
    rows = [_in_own_process(triangles, {}) for triangles in sizes]
    if rows and sys.platform.startswith("linux") and not SOFTWARE.search(rows[0]["renderer"]):
        rows += [_in_own_process(triangles, {"LIBGL_ALWAYS_SOFTWARE": "1"}) for triangles in sizes]
    return rows


def _in_own_process(triangles: int, variables: dict[str, str]) -> dict[str, Any]:
    command = [sys.executable, "-m", "dsfab.app.bench_preview", str(triangles)]
    completed = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **variables})
    if completed.returncode:
        raise DsfabError((completed.stderr.strip() or f"drawing {triangles:,} triangles was killed").splitlines()[-1])
    result: dict[str, Any] = json.loads(completed.stdout)
    return result


def rates_table(rows: list[dict[str, Any]]) -> str:
    """Return results of `measure` as a text table."""
    frames = tuple(f"{kind} fps" for kind in KINDS)
    head = ("triangles", *frames, "shader/plain", "by CPU", "change ms", "peak MiB", "drawn by")
    return table(
        head,
        (
            (
                f"{row['triangles']:,}",
                *(f"{row[kind]:.1f}" for kind in KINDS),
                f"{row['over_clock']:.2f}",
                f"{row['over_cpu']:.2f}",
                f"{row['change_ms']:.3f}",
                f"{row['peak_mb']:.0f}",
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
