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

LONGEST = (
    *("test_docs.py", "test_members.py", "test_targets.py", "test_pipeline_method.py", "test_docs_pictures.py"),
    *("test_study_sweep.py", "test_study_even.py", "test_thickening_zoo.py", "test_study_sweep_folder.py"),
    *("test_app_cli.py", "test_paper_presets.py", "test_workshop_unrolling.py", "test_slicing_fillet.py"),
    *("test_fabrication.py", "test_pattern_width.py", "test_pattern_regions.py", "test_pattern_steering.py"),
    *("test_app_compliance.py", "test_app_reproduce.py", "test_app_explore.py", "test_app_editor_stripes.py"),
    *("test_pipeline.py", "test_study_calculix.py", "test_study_alternatives.py", "test_pattern_keep.py"),
    *("test_surface_remesh.py", "test_surface_figures.py"),
)
"""test_frame.py and test_proposal.py find designs that test_members.py has made: they come long after it."""


def pytest_configure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        designs.begin()


def pytest_unconfigure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        designs.end()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: LONGEST.index(item.path.name) if item.path.name in LONGEST else len(LONGEST))


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
    from tests.test_app_editor_page import READY, page_of

    with page_of(server, tmp_path_factory.mktemp("editor")) as tab:
        tab.open(server.address + "&hard", READY)
        yield tab


@pytest.fixture
def here(monkeypatch):
    """Ask OCCT in this process; gives the last findings."""
    from dsfab.export.cad.step.worker import piece_check, reports, step_triangles

    found: list = []

    def drawn(program, path, folder, *how, seconds):
        return step_triangles.written(path, folder, *how)

    def said(program, path, folder, deflection, limit, look=None):
        judge = piece_check.whole_findings if look else piece_check.solid_findings
        found[:] = [dict(one) for one in judge(path, folder, deflection)]
        if look and (Path(folder) / "mesh.npz").exists():
            look()
        return [dict(one) for one in found]

    monkeypatch.setattr(reports, "_said", said)
    monkeypatch.setattr(reports, "last_line", drawn)
    return found
