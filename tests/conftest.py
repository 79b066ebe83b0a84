"""The order of the tests, the files that take longest first, so that no core is idle at the end; Ctrl-C; fixtures."""

import gc
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

# What tests start compiles the product once, not each process anew; before anything of it is loaded.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# One process of tests a core: threads of BLAS would take the others' time. Before numpy is loaded.
if "PYTEST_XDIST_WORKER" in os.environ:
    for pool in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(pool, "1")
# While modules are loaded nothing becomes garbage, yet looking for it takes half of the time.
gc.disable()

from tests import designs  # noqa: E402
from tests.durations import Recorder, longest_first  # noqa: E402


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--record-durations", action="store_true", help="write how long each file of tests takes")


def pytest_configure(config: pytest.Config) -> None:
    if hasattr(config, "workerinput"):
        return
    designs.begin()
    if config.getoption("record_durations"):
        config.pluginmanager.register(Recorder(), "recorder")


def pytest_unconfigure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        designs.end()


@pytest.hookimpl(trylast=True)  # of the tests that are left
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    longest_first(items)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """What has been loaded stays to the end: garbage is looked for among what tests make."""
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(10_000, 10, 10)  # as much memory at the most, and less than half of the time
        gc.enable()


# A shell lets background jobs ignore Ctrl-C, and so would all programs that the tests start and stop with it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="module")
def sharp_tab(server, tmp_path_factory):
    """One page for all tests of a file, of its own `server`, with sharp edges: each pixel is material or not."""
    from tests.app.editor_page import READY, page_of

    with page_of(server, tmp_path_factory.mktemp("editor")) as tab:
        tab.open(server.address + "&hard", READY)
        yield tab


@pytest.fixture
def inspected_pieces(monkeypatch):
    """Inspect the pieces of STEP files in this process, without a worker; gives the facts of the last file."""
    from dsfab.export.cad.step.worker import pieces, reports, triangles

    found: list = []

    def drawn(command, path, folder, deflection="0", faces="", *, seconds):
        return triangles.write_triangles(Path(path), Path(folder), float(deflection), faces)

    def said(program, path, folder, deflection, limit, look=None):
        judge = pieces.whole_findings if look else pieces.solid_findings
        found[:] = [dict(one) for one in judge(path, folder, deflection)]
        if look and (Path(folder) / "mesh.npz").exists():
            look()
        return [dict(one) for one in found]

    monkeypatch.setattr(reports, "solid_records", said)
    monkeypatch.setattr(reports, "occt_report", drawn)
    return found


@pytest.fixture
def untested_windows():
    """A process that has not tested kinds of windows; what it learns of them is forgotten."""
    from dsfab.render import opengl

    opengl.forget_windows()
    yield
    opengl.forget_windows()


@pytest.fixture
def no_pictures(monkeypatch):
    """A machine that draws no pictures of builds, because they take seconds and other tests draw them."""
    monkeypatch.setattr("dsfab.render.opengl.why_no_pictures", lambda: "not now")


@pytest.fixture
def unjudged(monkeypatch):
    """Builds in this process without the verdict on the cut sheet, which takes half of their time: other tests read it.

    As where a sheet is too large to be judged, which is a remark and no fault.
    """
    monkeypatch.setattr("dsfab.study.carrying.BUDGET", 0)


@pytest.fixture
def rough_shipped(tmp_path_factory, monkeypatch):
    """Shipped presets on coarser meshes in this process, for tests that open any of them by name."""
    from dsfab.core.toml_files import shipped_presets

    folder = designs.rough_presets(tmp_path_factory.mktemp("presets"), shipped_presets().values())
    for module in ("core.toml_files", "preset.surface_section"):
        monkeypatch.setattr(f"dsfab.{module}.PRESETS", (folder,))


@pytest.fixture
def rough_shares(monkeypatch):
    """Shares of material that are right to 2 %, for tests of other things: each step of the search cuts the sheet."""
    monkeypatch.setattr("dsfab.design.stripe_pattern.SHARE_TOLERANCE", 0.02)
    monkeypatch.setattr("dsfab.design.stripe_pattern.UNREPORTED", 0.04)


@pytest.fixture
def coarse_proposals(monkeypatch):
    """Proposed presets with few members, and with as few triangles as draw clean stripes, because numbers take time."""
    monkeypatch.setattr("dsfab.preset.proposal.sizes.MEMBERS", 8)  # across the span
    monkeypatch.setattr("dsfab.preset.proposal.sizes.TRIANGLES", 1)
