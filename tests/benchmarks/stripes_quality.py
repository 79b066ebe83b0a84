"""What evenly spaced stripes are like, beside what was asked of them: `python -m tests.benchmarks.stripes_quality`.

One row for each shipped preset that has them, each design of the gallery and, with DSFAB_MESHES, each mesh there: by
the preset `roof` (`figurine` where it is closed) on the mesh as it is, at the default spacing. Names choose some.

    P95/P5     of the spacing, of the major and of the minor family
    ends, slits    that stop in the air, and that are narrower than the members beside them; of the cut sheet
    deviation  degrees from the stress, in the mean by its size, of the worse family; > 30: the share that is so far off
    symmetry   per cent of the area that differs from its images; - without a symmetry
    s          of the processor, to the cut sheet
"""

import argparse
import os
import time
from collections.abc import Iterator
from pathlib import Path

from dsfab.core.errors import DsfabError
from dsfab.core.messages import table
from dsfab.design import Design
from dsfab.preset.file import load_preset
from dsfab.preset.model import Preset

ROOT = Path(__file__).parents[2]
MESHES = Path(os.environ.get("DSFAB_MESHES", ROOT / "../shared/meshes")).resolve()

ASKED = {
    "dome": (1.1, 2.2),
    "globe": (1.1, 2.1),
    "barrel_vault": (1.1, 1.1),
    "hypar.obj": (1.15, 1.15),
    "Botanic.obj": (2.2, 3.5),
}
"""P95/P5 of the major and the minor spacing at most."""

STRAIGHT = ("dome", "barrel_vault", "snow_vault", "hypar.obj")
"""Designs that deviate from the stress by `DEVIATION` degrees at most, and by over 30 on the share `OFF` of it."""
DEVIATION, OFF = 2.5, 0.005
SYMMETRY = 0.002
"""Of the area, where the mesh is not as symmetric as its surface."""

HEAD = ("design", "points", "P95/P5", "asked", "ends", "slits", "deviation", "> 30", "symmetry", "s", "missed")


def presets(names: list[str]) -> Iterator[tuple[str, Preset]]:
    """Names and presets, of those named or of all."""
    files = [*sorted((ROOT / "presets").rglob("*.toml")), *sorted((ROOT / "docs" / "examples").glob("*.toml"))]
    known = {file.stem: file for file in files} | {file.name: file for file in sorted(MESHES.glob("*.obj"))}
    for name in names or known:
        mesh = known[name].suffix == ".obj"
        try:
            preset = on_mesh(known[name]) if mesh else load_preset(known[name])
        except DsfabError as error:  # a mesh of its own is missing, or cannot be used
            if names or mesh:
                print(f"{name}: {error}")
            continue
        if preset.pattern.method == "stripes":
            yield name, preset


def on_mesh(file: Path) -> Preset:
    """The preset that suits a mesh by its being open or closed."""
    roof, figurine = (load_preset(ROOT / "presets" / f"{name}.toml", mesh=file) for name in ("roof", "figurine"))
    return figurine if roof.surface.build().is_closed else roof


def row(name: str, preset: Preset) -> tuple[str, ...]:
    """The texts of one design."""
    start = time.process_time()
    try:
        design = Design.from_preset(preset).until("slicing")
        found = design.quality()
    except DsfabError as error:
        return (name, *[""] * (len(HEAD) - 2), f"refused: {error}"[:60])
    seconds = time.process_time() - start
    families = [family for _, family in found.families if family.drawn]
    even = [family.spacing[2] / family.spacing[0] for family in families]
    asked = ASKED.get(name, ())
    deviation, off = max(family.deviation for family in families), max(family.off for family in families)
    error = found.symmetry_error
    missed = {
        "P95/P5": any(one > most for one, most in zip(even, asked, strict=False)),
        "ends": found.dead_ends > 0,
        "slits": found.slits > 0,
        "deviation": name in STRAIGHT and (deviation > DEVIATION or off > OFF),
        "symmetry": error is not None and error > SYMMETRY,
    }
    return (
        *(name, f"{design.surface.n:,}", " ".join(f"{one:.2f}" for one in even), " ".join(f"{one:g}" for one in asked)),
        *(str(found.dead_ends), str(found.slits), f"{deviation:.1f}", f"{off:.2%}"),
        *(
            "-" if error is None else f"{error:.2%}",
            f"{seconds:.1f}",
            ", ".join(key for key, bad in missed.items() if bad),
        ),
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*")
    given = parser.parse_args()
    rows = []
    for name, preset in presets(given.names):
        rows.append(row(name, preset))
        print(*rows[-1], sep=" | ", flush=True)
    print(table(HEAD, rows))


if __name__ == "__main__":
    main()
