"""The order of the tests, the files that take longest first, so that no core is idle at the end; Ctrl-C; fixtures."""

import os
import signal
import sys

import pytest

# What tests start compiles the product once, not each process anew; before anything of it is loaded.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

from tests import designs  # noqa: E402

LONGEST = (
    *("test_docs.py", "test_study_sweep.py", "test_study_even.py", "test_thickening_zoo.py"),
    *("test_study_sweep_folder.py", "test_targets.py", "test_app_cli.py", "test_paper_presets.py"),
)


def pytest_configure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        designs.begin()


def pytest_unconfigure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        designs.end()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: LONGEST.index(item.path.name) if item.path.name in LONGEST else len(LONGEST))


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
    from dsfab.export.smooth import check, occt_check

    found: list = []

    def said(program, path, folder, deflection, limit):
        found[:] = [dict(one) for one in check.solid_findings(path, folder, deflection)]
        return [dict(one) for one in found]

    monkeypatch.setattr(occt_check, "_said", said)
    return found
