"""From a slider's event to the drawn frame in the editor, milliseconds: of it what the page computes, and all of it.

    python -m tests.benchmarks.editor_sliders [VERTICES]

The worst rules for widths are among them: graded ones with bounds, whose medians change with the factor. What is drawn
is waited for by reading a pixel; without a graphics card nearly all of it is the software that stands in for one.
"""

import json
import sys
import tempfile
import time
from pathlib import Path

from dsfab.app.editor.workspace import OpenedPreset
from dsfab.preset.file import load_preset
from tests.app.editor_server import serving
from tests.browser import opened
from tests.presets import DOME_MODES

SIZE = (1280, 800)
AREA = 163.0  # square metres of the dome
READY = "!!(window.dsfab && dsfab.done && dsfab.told)"
BOUNDED = {"pattern.width.rule": "graded", "pattern.width.min_width": 0.05}

MEASURE = """(async (id) => {
    const slider = document.getElementById(`${id}-slider`), { viewer } = dsfab, pixel = new Uint8Array(4);
    const [low, high] = [Number(slider.min), Number(slider.max)];
    const times = [];
    for (let i = -2; i < 15; i += 1) {
        const [start, frames] = [performance.now(), viewer.frames];
        slider.value = low + (high - low) * (0.3 + 0.03 * i);
        slider.dispatchEvent(new Event('input'));
        const computed = performance.now() - start;
        while (viewer.frames === frames) await new Promise((done) => requestAnimationFrame(done));
        viewer.gl.readPixels(0, 0, 1, 1, viewer.gl.RGBA, viewer.gl.UNSIGNED_BYTE, pixel);
        if (i >= 0) times.push([computed, performance.now() - start]);
    }
    slider.dispatchEvent(new Event('change'));
    return [0, 1].map((k) => times.map((pair) => pair[k]).sort((a, b) => a - b)); })"""


def main() -> None:
    """Print one line for each slider of three patterns: median and largest of 15."""
    vertices = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    edge = (2 * AREA / 3**0.5 / vertices) ** 0.5
    patterns = {
        ("stripes", "dome"): ({}, ("solid_fraction", "member")),
        ("stripes, bounded", "dome"): (BOUNDED, ("solid_fraction", "q", "min_width")),
        ("modes", DOME_MODES): ({}, ("solid_fraction",)),
    }
    print(f"{'pattern':18} {'slider':16} {'vertices':>9} {'computed, ms':>16} {'drawn, ms':>16}")
    for (name, preset), (changes, sliders) in patterns.items():
        with serving(OpenedPreset(load_preset(preset, {"surface.edge": edge, **changes}))) as server:
            server.session.ask_solve({})
            with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder, opened(Path(folder), SIZE) as tab:
                tab.open(server.address, READY)
                for key in sliders:
                    time.sleep(3)
                    computed, drawn = tab.run(f"{MEASURE}({json.dumps('pattern-width-' + key)})")
                    cells = (f"{times[len(times) // 2]:9.1f} ({times[-1]:4.0f})" for times in (computed, drawn))
                    count = tab.run("dsfab.model.arrays.V.length / 3")
                    print(f"{name:18} {key:16} {count:9d}", *cells, flush=True)


if __name__ == "__main__":
    main()
