"""One command for somebody's own surface, tried on many: `python -m tests.benchmarks.own_surfaces FOLDER [NAME...]`.

`dsfab build MESH` runs on the meshes in DSFAB_MESHES and on those of `tests/own_meshes.py`, each in a process of its
own, without a preset. FOLDER gets a folder for each, a contact sheet of all of them and a table: seconds, pieces, dead
ends, slits, the smallest gap and member over the thickness, or the sentence by which a mesh was refused. Names after
FOLDER choose some of them.
"""

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dsfab.core.messages import table
from dsfab.render.lettering import PAPER
from dsfab.report.contact_sheet import ContactTile, contact_sheet
from tests.own_meshes import OWN

ACROSS, WIDE, ASPECT = 5, 640, 1.0
HEAD = ("s", "pieces", "ends", "slits", "gap/t", "member/t", "STEP")


@dataclass(frozen=True)
class Attempt:
    """What one build came to. error : the last line of a refusal; facts : design.json."""

    name: str
    folder: Path
    seconds: float
    error: str = ""
    facts: dict[str, Any] = field(default_factory=dict)

    @property
    def measures(self) -> tuple[tuple[str, str], ...]:
        if self.error:
            return ()
        pattern, made = self.facts["pattern"], self.facts["fabrication"]
        thickness = self.facts["preset"]["statics"]["thickness"]
        gap, member = ((made[key] or {}).get("m", 0) / thickness for key in ("smallest_gap", "smallest_member"))
        families = [pattern[name] for name in ("major", "minor")]
        return (
            ("s", f"{self.seconds:.0f}"),
            ("pieces", str(self.facts["solid"]["pieces"])),
            ("ends", str(sum(len(family["loose_ends_at_m"]) for family in families))),
            ("slits", str(sum(family["slits"] for family in families))),
            ("gap/t", f"{gap:.2f}"),
            ("member/t", f"{member:.2f}"),
            ("STEP", "yes" if any(name.endswith(".step") for name in self.facts["files"]) else "no"),
        )

    @property
    def columns(self) -> list[str]:
        """Texts for the table."""
        return [text for _, text in self.measures] or [f"{self.seconds:.0f}", *[""] * (len(HEAD) - 1)]


def build(mesh: Path, folder: Path) -> Attempt:
    """`dsfab build MESH -o FOLDER`, as a user would type it."""
    start = time.perf_counter()
    command = [sys.executable, "-m", "dsfab.app.cli", "build", str(mesh), "-o", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    seconds = time.perf_counter() - start
    (folder.parent / f"{mesh.stem}.txt").write_text(done.stdout + done.stderr, encoding="utf-8")
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["nothing said"])[-1]
        return Attempt(mesh.stem, folder, seconds, last)
    return Attempt(mesh.stem, folder, seconds, facts=json.loads((folder / "design.json").read_text(encoding="utf-8")))


def meshes(folder: Path) -> list[Path]:
    """Those that lie in DSFAB_MESHES, and ours, written anew."""
    given = Path(os.environ.get("DSFAB_MESHES", "../shared/meshes"))
    folder.mkdir(parents=True, exist_ok=True)
    return [*sorted(given.glob("*.obj")), *(make(folder) for make in OWN.values())]


def main(folder: Path, names: list[str]) -> None:
    attempts = []
    for mesh in meshes(folder / "meshes"):
        if names and mesh.stem not in names:
            continue
        attempts.append(build(mesh, folder / mesh.stem))
        one = attempts[-1]
        print(one.name, one.error or dict(one.measures), flush=True)
    tiles = []
    for k, one in enumerate(attempts):
        picture = one.folder / "preview.png"
        png = picture.read_bytes() if not one.error and picture.is_file() else None
        tiles.append(ContactTile(k + 1, (("", one.name), *one.measures), "", png, one.error))
    line = "dsfab build MESH, without a preset"
    sheet = contact_sheet(tiles, "Surfaces of one's own", line, ACROSS, WIDE, ASPECT, PAPER)
    sheet.save(folder / "sheet.png", optimize=True)
    print(table(["mesh", *HEAD], [[one.name, *one.columns] for one in attempts]))
    for one in attempts:
        if one.error:
            print(f"{one.name}: {one.error}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
