"""`dsfab presets` and `dsfab inspect`: what there is, and what a mesh file is."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from dsfab.app.report import length, out

if TYPE_CHECKING:
    from dsfab.surface import MeshFacts


def presets() -> int:
    """List the presets that come with dsfab."""
    from dsfab.preset_file import headline, shipped

    found = shipped()
    width = max(map(len, found), default=0)
    for name, path in found.items():
        out(f"{name:<{width}}  {headline(path)}")
    return 0


def inspect(
    file: Path,
    /,
    *,
    unit: Annotated[str | None, Parameter(help="Unit of the file's numbers: mm, cm, m, in, ft.")] = None,
) -> int:
    """Say what a mesh file is: size, pieces, boundary, whether it is manifold or why not, and its likely unit.

    Parameters
    ----------
    file
        OBJ, PLY, STL, OFF, GLB or 3MF.
    """
    from dsfab.surface import describe

    facts = describe(file, unit)
    out(str(file))
    rows = [(label, value) for label, value in _lines(facts) if value]
    width = max(len(label) for label, _ in rows)
    for label, value in rows:
        out(f"  {label:<{width}}  {value}")
    return 0


def _lines(facts: "MeshFacts") -> list[tuple[str, str]]:
    """Facts as labels and texts, in the order in which a person asks; empty texts are left out."""
    loops = facts.boundary_lengths
    counted = f"{len(loops)} {'loop' if len(loops) == 1 else 'loops'}: {', '.join(length(x) for x in loops[:6])}"
    return [
        ("size", " x ".join(length(side) for side in facts.box) + f" (read as {facts.unit})"),
        ("likely unit", facts.unit_guess),
        (
            "mesh",
            f"{facts.vertices:,} vertices, {facts.faces:,} triangles, edges of {length(facts.mean_edge)} on average",
        ),
        ("polygons", f"{facts.polygons:,} in the file, cut into triangles" if facts.polygons < facts.faces else ""),
        ("area", f"{facts.area:.4g} m2"),
        ("volume", "" if facts.volume is None else f"{facts.volume:.4g} m3"),
        ("pieces", f"{facts.pieces:,}"),
        ("boundary", "none: the surface is closed" if facts.closed else counted + (" ..." if len(loops) > 6 else "")),
        ("genus", "" if facts.genus is None else str(facts.genus)),
        ("sharpest", f"{facts.smallest_angle:.1f} degrees is the smallest angle"),
        ("manifold", "yes, and oriented" if facts.manifold else "no"),
        *(("because", fault) for fault in facts.faults),
    ]
