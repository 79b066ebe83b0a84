"""Whether finer meshes come to the same stripes, as stiff: `python -m tests.benchmarks.stripes_convergence`.

Botanic.obj (needs DSFAB_MESHES) with the preset that dsfab proposes for it, its triangles divided in four twice and
three times: 17,393 and 69,217 vertices. Names choose other meshes. Asked is that the compliance moves by 5 % at most.
Each cut sheet is judged by one solve on its own mesh:

    J      by the elements that compliances are told by, hybrid + hhj
    over   the same over that of the uncut sheet
    quick  by those that rank candidates, constant + midedge; they are too stiff where members are one triangle wide,
           so that what they say moves with the mesh, whatever the stripes do
    P95/P5 of the spacing, of the major and of the minor family
    s      of the processor, to the cut sheet and for all
"""

import argparse
import os
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dsfab.core.messages import table
from dsfab.design import Design, sheet_loads
from dsfab.preset.file import with_overrides
from dsfab.preset.proposal import preset_for
from dsfab.statics import solve_for
from dsfab.study.comparison import comparison
from dsfab.surface import Surface, refined_surface

ROOT = Path(__file__).parents[2]
MESHES = Path(os.environ.get("DSFAB_MESHES", ROOT / "../shared/meshes")).resolve()
DIVIDED = (2, 3)
ASKED = 0.05
HEAD = ("design", "points", "J", "over", "quick", "P95/P5", "s")


def lengths(surface: Surface) -> Iterator[float]:
    """Lengths of edges, m, at which all triangles are divided in four as often as `DIVIDED` says."""
    for times in range(1, max(DIVIDED) + 1):
        longest = float(surface.edge_lengths.max())
        surface = refined_surface(surface, 0.999 * longest, smooth=True)
        if times in DIVIDED:
            yield 1.01 * float(surface.edge_lengths.max())


def row(name: str, file: Path, edge: float) -> tuple[tuple[str, ...], float, float]:
    """The texts of one mesh, its compliance by better and by quick elements, J."""
    start = time.process_time()
    preset = preset_for(file)
    finer = {"surface.edge": 0.0, "surface.refine": edge, "surface.smooth": True}
    design = Design.from_preset(with_overrides(preset, finer)).until("slicing")
    cut = time.process_time() - start
    both = comparison(design, against=())
    better, whole = both.design.compliance, both.full.compliance
    cells, sheet = design.slicing.cells, design.sheet
    given = design.statics.loads(design.preset.followed_weights)
    loads = sheet_loads(design.surface, cells, sheet, given)
    model = design.preset.statics.sheet(design.preset.statics.thickness).model_for(sheet.surface)
    answers = solve_for(model, loads, "ranking")
    quick = sum(weight * answers[key].compliance for key, weight in design.preset.followed_weights.items())
    even = " ".join(f"{one.spacing[2] / one.spacing[0]:.2f}" for _, one in design.quality().families)
    seconds = f"{cut:.0f} {time.process_time() - start:.0f}"
    numbers = f"{better:.4g}", f"{better / whole:.3f}", f"{quick:.4g}"
    return (name, f"{design.surface.n:,}", *numbers, even, seconds), better, quick


def main() -> None:
    """Print the rows as they come, then by how much the compliances move."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=["Botanic"])
    rows = []
    for name in parser.parse_args().names:
        file = MESHES / f"{name}.obj"
        preset = preset_for(file)
        found = []
        for edge in lengths(with_overrides(preset, {"surface.edge": 0.0}).surface.base_surface()):
            texts, *judged = row(name, file, edge)
            print(*texts, sep=" | ", flush=True)
            rows.append(texts)
            found.append(judged)
        better, quick = np.abs(np.diff(np.log(np.array(found)), axis=0)).max(axis=0)
        print(f"{name}: moves by {better:.1%} ({quick:.1%} by quick elements), asked {ASKED:.0%}: {better <= ASKED}")
    print(table(HEAD, rows))


if __name__ == "__main__":
    main()
