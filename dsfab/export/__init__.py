"""From a solid to a file: millimetres, the unit written into it, read back by another reader before it has its name."""

from dsfab.export.atomic import replacing, require_writable_file, write_chunks
from dsfab.export.estimate import Estimate
from dsfab.export.flat import FlatCircle, FlatDrawing, FlatLine, check_flat_dxf, flat_dxf, flat_svg
from dsfab.export.folder import complete, require_writable, whole_or_nothing
from dsfab.export.formats import FORMATS, Written, step_estimates, write
from dsfab.export.member_shape import MemberShape
from dsfab.export.mesh_soundness import Fault, Soundness, soundness
from dsfab.export.part import STEP_FACES, Details, StepOptions
from dsfab.export.partial import temporary_folder
from dsfab.export.program import Ahead, ProgramError, last_line, meanwhile
from dsfab.export.rhino import ready as require_rhino
from dsfab.export.rhino_json import mesh_arrays, mesh_json, polyline_json
from dsfab.export.sampled_use import cut_fault
from dsfab.export.smooth.limits import Limits, smooth_limits
from dsfab.export.step_read import read_step
from dsfab.export.step_soundness import StepTriangles, curved_soundness, step_triangles

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
