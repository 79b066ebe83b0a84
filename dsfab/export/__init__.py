"""Write solids and sheets to files in millimetres; a second reader checks each file before it takes its name."""

from dsfab.export.cad.rhino import mesh_arrays, mesh_json, polyline_json
from dsfab.export.cad.rhino import ready as require_rhino
from dsfab.export.cad.step.shared.skins import Limits, smooth_limits
from dsfab.export.cad.step.soundness import StepTriangles, curved_soundness, cut_fault, step_triangles
from dsfab.export.cad.step.strategies import Estimate
from dsfab.export.cad.step.worker.reports import read_step
from dsfab.export.drawing.flat import FlatCircle, FlatDrawing, FlatLine, check_flat_dxf, flat_dxf, flat_svg
from dsfab.export.formats import FORMATS, Written, step_estimates, write
from dsfab.export.mesh.soundness import Fault, Soundness, soundness
from dsfab.export.part import STEP_FACES, Details, MemberShape, StepOptions
from dsfab.export.subprocesses import Ahead, ProgramError, last_line, meanwhile
from dsfab.export.writing import (
    complete,
    replacing,
    require_writable,
    require_writable_file,
    temporary_folder,
    whole_or_nothing,
    write_chunks,
)

__all__ = [
    "FORMATS",
    "STEP_FACES",
    "Ahead",
    "Details",
    "Estimate",
    "Fault",
    "FlatCircle",
    "FlatDrawing",
    "FlatLine",
    "Limits",
    "MemberShape",
    "ProgramError",
    "Soundness",
    "StepOptions",
    "StepTriangles",
    "Written",
    "check_flat_dxf",
    "complete",
    "curved_soundness",
    "cut_fault",
    "flat_dxf",
    "flat_svg",
    "last_line",
    "meanwhile",
    "mesh_arrays",
    "mesh_json",
    "polyline_json",
    "read_step",
    "replacing",
    "require_rhino",
    "require_writable",
    "require_writable_file",
    "smooth_limits",
    "soundness",
    "step_estimates",
    "step_triangles",
    "temporary_folder",
    "whole_or_nothing",
    "write",
    "write_chunks",
]
