"""`design.json`: what a built design is, in numbers with SI units."""

import platform
from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import version
from typing import Any

from dsfab import __version__
from dsfab.pipeline.design import Design
from dsfab.report.design.acting import acting_facts
from dsfab.report.design.answers import answer_facts, mode_facts
from dsfab.report.design.balance import case_facts, cut_load_facts, equilibrium_facts
from dsfab.report.design.choice import attempt_facts, choice_facts


def facts(
    design: Design, seconds: dict[str, float], files: list[str], refused: list[str], told: Sequence[str] = ()
) -> dict[str, Any]:
    """What `design.json` holds: sizes and results in SI units, seconds per stage, notes, versions."""
    sheet, uncut = design.sheet.surface, design.surface
    return {
        "name": design.preset.name,
        "preset": design.settled.model_dump(mode="json", exclude_none=True),
        "surface": {"vertices": uncut.n, "triangles": uncut.m, "area_m2": uncut.area, "mean_edge_m": uncut.mean_edge},
        **({"file": asdict(design.file)} if design.file else {}),
        **acting_facts(design),
        "statics": {
            "of": "the uncut sheet",
            **equilibrium_facts(design, design.statics.load, design.statics.equilibrium),
            **answer_facts(design, design.statics),
            **mode_facts(design),
            "cases": case_facts(design),
            "followed": design.preset.followed,
        },
        "modes": {"major": design.diffusion.major.lam.tolist(), "minor": design.diffusion.minor.lam.tolist()},
        **attempt_facts(design.pattern.attempts),
        **choice_facts(design.pattern.choice),
        "sheet": {
            "vertices": sheet.n,
            "triangles": sheet.m,
            "area_m2": sheet.area,
            "kept_share": sheet.area / uncut.area,
            **cut_load_facts(design),
            "pinches": design.slicing.pinches,
            "pieces": [piece._asdict() for piece in design.slicing.pieces],
        },
        "solid": _solid_facts(design),
        "thickening": {"side": design.preset.thickening.side, **asdict(design.solid.repairs)},
        "files": files,
        "refused": refused,
        "warnings": [*(f"{note.stage}: {note.text}" for note in design.notes), *(f"export: {text}" for text in told)],
        "seconds": {row: round(value, 4) for row, value in seconds.items()},
        "versions": versions(),
    }


def _solid_facts(design: Design) -> dict[str, Any]:
    solid = design.solid
    return {
        "vertices": len(solid.V),
        "triangles": len(solid.F),
        "volume_m3": solid.volume,
        "mass_kg": design.mass,
        "genus": solid.genus,
        "pieces": solid.pieces,
        "box_m": (solid.V.min(axis=0).tolist(), solid.V.max(axis=0).tolist()),
    }


def versions() -> dict[str, str]:
    """dsfab, Python and the libraries that a result depends on."""
    from dsfab.sparse import solver_name

    libraries = ("numpy", "scipy", "libigl", "manifold3d", "trimesh", "build123d", "pyvista", "vtk")
    found = {name: version(name) for name in libraries}
    return {"dsfab": __version__, "python": platform.python_version(), "solver": solver_name(), **found}
