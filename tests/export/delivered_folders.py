"""A folder of files before and after a delivery."""

import json
from pathlib import Path

from dsfab.export.writing import DESIGN, atomic_folder, manifest

OLD = {"a.stl": "old a", "b.step": "old b", "preset.toml": "old"}

NEW = {"a.stl": "new a", "c.dxf": "new c", "preset.toml": "new"}

OWN = {"notes.txt": "mine", "c.3dm": "mine too"}


def write(place: Path, files: dict[str, str]) -> None:
    """Files, and a design's manifest of them."""
    for name, text in files.items():
        (place / name).write_text(text)
    (place / DESIGN).write_text(json.dumps({"files": sorted(files), "manifest": manifest(place)}))


def delivered(place: Path, files: dict[str, str]) -> None:
    with atomic_folder(place) as partial:
        write(partial, files)


def held(place: Path) -> dict[str, str]:
    """The text of every file but the manifest's."""
    return {path.name: path.read_text() for path in place.iterdir() if path.is_file() and path.name != DESIGN}
