"""Real surfaces for tests: they are not part of the repository."""

import os
from pathlib import Path

import pytest

FOLDER = Path(os.environ.get("DSFAB_MESHES", Path(__file__).resolve().parents[2] / "shared" / "meshes"))


def mesh_file(name: str) -> Path:
    """A file of the mesh folder; the test is skipped, with the reason printed, where it is not."""
    path = FOLDER / name
    if not path.is_file():
        pytest.skip(f"{name} is not in {FOLDER} (set DSFAB_MESHES)")
    return path
