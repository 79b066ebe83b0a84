"""From a solid to a file: millimetres, the unit written into it, read back by another reader before it has its name."""

from dsfab.export.atomic import replacing, write_chunks
from dsfab.export.estimate import Estimate
from dsfab.export.flat import FlatCircle, FlatDrawing, FlatLine, check_flat_dxf, flat_dxf, flat_svg
from dsfab.export.folder import complete, whole_or_nothing
from dsfab.export.formats import FORMATS, Written, step_estimates, write
from dsfab.export.part import STEP_FACES, Details, StepOptions
from dsfab.export.partial import temporary_folder
from dsfab.export.program import meanwhile

__all__ = [
    "FORMATS",
    "STEP_FACES",
    "Details",
    "Estimate",
    "FlatCircle",
    "FlatDrawing",
    "FlatLine",
    "StepOptions",
    "Written",
    "check_flat_dxf",
    "complete",
    "flat_dxf",
    "flat_svg",
    "meanwhile",
    "replacing",
    "step_estimates",
    "temporary_folder",
    "whole_or_nothing",
    "write",
    "write_chunks",
]
