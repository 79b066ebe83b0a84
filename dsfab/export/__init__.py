"""Write solids and sheets to files in millimetres."""

from dsfab.export.cad.rhino import mesh_json, polyline_json
from dsfab.export.cad.rhino import require_rhino3dm as require_rhino
from dsfab.export.cad.step.shared.skins import SmoothLimits, smooth_limits
from dsfab.export.cad.step.soundness import StepTriangles, curved_soundness, cut_fault, step_triangles
from dsfab.export.cad.step.strategies import Estimate
from dsfab.export.cad.step.worker.reports import read_step
from dsfab.export.drawing.flat import FlatCircle, FlatDrawing, FlatLine, check_flat_dxf, flat_dxf, flat_svg
from dsfab.export.formats import FORMATS, Written, step_estimates, write
from dsfab.export.mesh.soundness import Fault, Soundness, soundness
from dsfab.export.part import STEP_FACES, Details, MemberShape, StepOptions
from dsfab.export.subprocesses import PreparedProgram, ProgramError, last_line, work_while_waiting
from dsfab.export.writing import (
    atomic_file,
    atomic_folder,
    complete_folder,
    require_writable,
    require_writable_file,
    temporary_folder,
    write_chunks,
)

__all__ = [
    "FORMATS", "STEP_FACES", "Details", "Estimate", "Fault", "FlatCircle", "FlatDrawing", "FlatLine", "MemberShape",
    "PreparedProgram", "ProgramError", "SmoothLimits", "Soundness", "StepOptions", "StepTriangles", "Written",
    "atomic_file", "atomic_folder", "check_flat_dxf", "complete_folder", "curved_soundness", "cut_fault", "flat_dxf",
    "flat_svg", "last_line", "mesh_json", "polyline_json", "read_step", "require_rhino",
    "require_writable", "require_writable_file", "smooth_limits", "soundness", "step_estimates", "step_triangles",
    "temporary_folder", "work_while_waiting", "write", "write_chunks",
]  # fmt: skip
