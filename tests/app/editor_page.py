"""The page of the editor in a browser."""

import time
from contextlib import contextmanager

import numpy as np

from tests.browser import opened

SIZE = (900, 560)

READY = "!!(window.dsfab && dsfab.model && !document.querySelector('#picture').classList.contains('outdated'))"

SEEN = "dsfab.viewer.mask().seen.reduce((a, b) => a + b, 0)"


@contextmanager
def page_of(server, folder, more=(), size=SIZE):
    with opened(folder, size, more) as tab:
        tab.call("Emulation.setDeviceMetricsOverride", width=size[0], height=size[1], deviceScaleFactor=1, mobile=False)
        yield tab


def until(tab, expression, seconds=240):
    """The first value of an expression that is true; the limit is for what never comes, on a machine however busy."""
    end = time.monotonic() + seconds
    while not (value := tab.run(expression)):
        assert time.monotonic() < end, f"{expression} never came; errors: {tab.errors}"
        time.sleep(0.03)
    return value


def type_into(tab, identifier, text):
    tab.run(f"(() => {{ const e = document.getElementById('{identifier}'); e.focus(); e.value = '{text}'; "
            "e.dispatchEvent(new Event('change', {bubbles: true})); })()")  # fmt: skip


def solved(tab):
    """Wait until what is shown is what the server made of the newest wish."""
    tab.run("new Promise(done => setTimeout(done, 140))")
    until(tab, "dsfab.done === dsfab.work.latest.solve && " + READY)


def share_measured(tab):
    """Per cent kept of the surface as the server has measured it, once the page shows that and no estimate."""
    told = "document.getElementById('f-share').textContent"
    return float(until(tab, f"/^[0-9]/.test({told}) && {told}").split()[0])


def place_of(tab, x, y, z):
    """Pixels in the window of a place in the view's own metres."""
    script = (
        "(() => { const c = document.getElementById('canvas').getBoundingClientRect();"
        f"const p = dsfab.viewer.eye.camera.position.clone().set({x}, {y}, {z}).project(dsfab.viewer.eye.camera);"
        "return [c.left + (p.x + 1) / 2 * c.width, c.top + (1 - p.y) / 2 * c.height]; })()"
    )
    return tab.run(script)


def seen_by_both(tab, made):
    """Masks of a draft from the same eye: of WebGL in the page that shows it, and of VTK."""
    from dsfab.render.previewer import Previewer

    size = (800, 600)
    with Previewer(made, marks=False) as previewer:
        theirs = previewer.mask(size, words=False)
        view = previewer._view(size, False)
    centre = np.array(tab.run("dsfab.model.facts.centre"))
    eye, ahead = (
        (view.eye - centre).tolist(),
        (view.eye + view.forward * np.linalg.norm(view.eye - centre) - centre).tolist(),
    )
    tab.run(f"dsfab.viewer.renderer.setSize({size[0]}, {size[1]}, false); dsfab.viewer.eye.resize({size[0] / size[1]});"
            f"dsfab.viewer.eye.numbers = {[*eye, *ahead, 1, 0]}; 1")  # fmt: skip
    told = tab.run("(() => { const m = dsfab.viewer.mask(); return [m.width, m.height, m.seen.join('')]; })()")
    tab.run("dsfab.viewer.resize()")
    assert told[:2] == list(size)
    ours = (np.frombuffer(told[2].encode(), np.uint8) == ord("1")).reshape(size[1], size[0])[::-1]
    assert theirs.sum() > 30_000
    return ours, theirs


DROP = """(() => {
    const lines = [];
    for (let i = 0; i < 100; i++) {
        const [x, y] = [i % 10, Math.floor(i / 10)];
        lines.push(`v ${10 * x} ${10 * y} ${0.02 * x * (9 - x)}`);
        if (x < 9 && y < 9) lines.push(`f ${i + 1} ${i + 2} ${i + 12}`, `f ${i + 1} ${i + 12} ${i + 11}`);
    }
    const transfer = new DataTransfer();
    transfer.items.add(new File([lines.join('\\n')], 'my roof.obj'));
    const drop = new DragEvent('drop', { dataTransfer: transfer, bubbles: true, cancelable: true });
    document.getElementById('picture').dispatchEvent(drop);
})()"""
