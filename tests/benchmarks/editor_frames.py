"""Frames of the editor against those of the plain mesh, in one page, drawn in turns: milliseconds and their ratio.

    python -m tests.benchmarks.editor_frames [TRIANGLES ...] [--gpu]

The plain mesh is three's MeshLambertMaterial under a sky and a lamp, on both sides, at the same size and smoothness;
`bare` is the editor's own shader without stripes, lit at its vertices: as little as a mesh can cost.
"""

import sys
import tempfile
import time
from pathlib import Path

from dsfab.app.editor.workspace import OpenedPreset
from dsfab.preset.file import load_preset
from tests.app.editor_server import serving
from tests.browser import opened

SIZE = (1100, 800)
AREA = 163.0  # square metres of the dome
NAMES = ("plain", "bare", "stripes", "plainAll", "stripesAll")
READY = "!!(window.dsfab && dsfab.done)"

MEASURE = """(async () => {
    const THREE = await import('three');
    const { viewer } = dsfab, { renderer, scene, sheet, gl } = viewer;
    const pixel = new Uint8Array(4);
    sheet.uncut(); // live stripes, whatever was cut of them
    const own = sheet.material, bare = sheet.made({ ...sheet.flags, WHOLE: true, SOFT: false });
    const plain = new THREE.MeshLambertMaterial({ color: 0xe2a07c, side: THREE.DoubleSide });
    const lights = [new THREE.HemisphereLight(0xffffff, 0x888888, 1), new THREE.DirectionalLight(0xffffff, 2)];
    lights[1].position.copy(viewer.eye.camera.position);
    lights.forEach((light) => scene.add(light));
    const others = [viewer.ground.plane, viewer.marks.group];
    const frame = (material, all) => {
        sheet.material = material;
        others.forEach((thing) => (thing.visible = all));
        const start = performance.now();
        renderer.clear();
        renderer.render(scene, viewer.eye.camera);
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
        return performance.now() - start;
    };
    const kinds = {
        plain: [plain, false], bare: [bare, false], stripes: [own, false],
        plainAll: [plain, true], stripesAll: [own, true],
    };
    const times = Object.fromEntries(Object.keys(kinds).map((name) => [name, []]));
    for (let round = -2; round < ROUNDS; round += 1)
        for (const [name, [material, all]] of Object.entries(kinds)) {
            const took = frame(material, all);
            if (round >= 0) times[name].push(took);
        }
    sheet.material = own;
    lights.forEach((light) => scene.remove(light));
    others.forEach((thing) => (thing.visible = true));
    const middle = (list) => list.sort((a, b) => a - b)[Math.floor(list.length / 2)];
    const told = Object.fromEntries(Object.entries(times).map(([name, list]) => [name, [middle(list), list[0]]]));
    return { triangles: dsfab.model.facts.triangles, ...told };
})()"""


def main() -> None:
    """Print one line for each size."""
    sizes = [int(word) for word in sys.argv[1:] if word.isdigit()] or [10_000, 60_000, 300_000]
    more = ("--use-gl=angle", "--use-angle=gl-egl", "--ignore-gpu-blocklist") if "--gpu" in sys.argv else ()
    print("milliseconds, median (least); all: with ground and marks, as a person sees it")
    print(" ".join(f"{word:>16}" for word in ("triangles", *NAMES, "stripes / plain", "all / all")))
    for count in sizes:
        edge = (4 * AREA / 3**0.5 / count) ** 0.5
        with serving(OpenedPreset(load_preset("dome", {"surface.edge": edge}), ("dome",))) as server:
            job = server.session.ask_solve({})
            while server.session.jobs.job(job).state != "done":
                time.sleep(0.1)
            with (
                tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder,
                opened(Path(folder), SIZE, more) as tab,
            ):
                tab.open(server.address, READY)
                tab.run("new Promise(done => setTimeout(done, 1500))")
                told = tab.run(MEASURE.replace("ROUNDS", str(20 if count < 100_000 else 8)))
        ratios = (
            [told[a][k] / told[b][k] for k in (0, 1)] for a, b in (("stripes", "plain"), ("stripesAll", "plainAll"))
        )
        cells = [f"{told['triangles']:16d}", *(f"{told[name][0]:8.1f} ({told[name][1]:5.1f})" for name in NAMES)]
        print(" ".join([*cells, *(f"{middle:9.2f} ({least:.2f})" for middle, least in ratios)]), flush=True)


if __name__ == "__main__":
    main()
