"""From the editor's first paint to the first structure on the page, seconds, for the presets that come with dsfab.

    python -m tests.benchmarks.editor_first [PRESET ...]

Each preset is opened by `dsfab edit` in a process of its own. `at once`: a browser that runs already opens the page in
the moment in which the command prints its address, so that the page waits for what is still being solved; `solved`: the
same page is opened again when all of that is there, as where a browser needs a while to begin. Beside them stand the
seconds from the command to its address, and those that the draft takes by itself, of the processor.
"""

import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from dsfab.core.toml_files import shipped_presets
from dsfab.design import draft
from dsfab.preset.file import load_preset
from tests.browser import Tab, opened

SIZE = (1280, 800)
WATCH = """(() => {
    const look = () => {
        const { viewer, model } = window.dsfab ?? {};
        if (model && viewer?.frames > 0) window.structureAt = performance.now(); else requestAnimationFrame(look);
    };
    requestAnimationFrame(look);
})()"""
PAINTED = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime"


def shown(tab: Tab, address: str) -> tuple[float, float]:
    """Seconds from going to an address to its first paint, and from that to the first frame with a structure."""
    tab.open(address, f"window.structureAt > 0 && {PAINTED} > 0")
    paint, structure = tab.run(PAINTED), tab.run("window.structureAt")
    return paint / 1000, (structure - paint) / 1000


def measured(name: str, tab: Tab) -> list[float]:
    """Seconds to the address; to the first paint and on to the structure, at once and solved."""
    words = [sys.executable, "-m", "dsfab.app.cli", "edit", name, "--no-open"]
    begun = time.monotonic()
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as editor:
        assert editor.stdout is not None
        try:
            address = editor.stdout.readline().split(": ", 1)[1].strip()
            found = [time.monotonic() - begun, *shown(tab, address)]
            time.sleep(3)
            tab.open("about:blank", "true")
            return [*found, *shown(tab, address)]
        finally:
            editor.send_signal(signal.SIGINT)


def main() -> None:
    """Print one line for each preset."""
    names = sys.argv[1:] or [name for name in shipped_presets() if name not in ("roof", "figurine")]
    print(f"{'preset':18} {'address':>8} {'paint':>7} {'at once':>8} {'paint':>7} {'solved':>7} {'draft, CPU':>11}")
    for name in names:
        begun = time.process_time()
        _ = draft(load_preset(name)).pattern
        alone = time.process_time() - begun
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder, opened(Path(folder), SIZE) as tab:
            tab.call("Page.addScriptToEvaluateOnNewDocument", source=WATCH)
            address, paint, late, again, solved = measured(name, tab)
            print(
                f"{name:18} {address:8.2f} {paint:7.2f} {late:8.2f} {again:7.2f} {solved:7.2f} {alone:11.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
