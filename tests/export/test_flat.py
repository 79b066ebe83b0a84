"""Flat drawings: what is written is there, as another reader and our own check find."""

import re

import ezdxf
import numpy as np
import pytest

from dsfab.core.errors import ExportError
from dsfab.export import FlatCircle, FlatDrawing, FlatLine, check_flat_dxf, flat_dxf, flat_svg

DRAWING = FlatDrawing(
    "Blatt 1, Öffnung\u2028CIRCLE",
    (FlatLine("CUT", np.eye(2), True), FlatLine("ENGRAVE", np.zeros((3, 2)) + [[0.1], [0.2], [0.3]])),
    (FlatCircle("HOLES", (0.1, 0.2), 0.012),),
)


def test_a_drawing_is_read_by_ezdxf_and_by_its_own_check(tmp_path):
    path = tmp_path / "x.dxf"
    path.write_bytes(flat_dxf(DRAWING))
    document = ezdxf.readfile(path)
    assert [one.dxftype() for one in document.modelspace()] == ["LWPOLYLINE", "LWPOLYLINE", "CIRCLE"]
    assert document.header["$INSUNITS"] == 4
    check_flat_dxf(DRAWING, path)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"  0\nCIRCLE\n", b""),  # a lost entity
        (b"  0\nCIRCLE\n", b"  0\nLINE\n"),
        (b"$INSUNITS\n 70\n4\n", b"$INSUNITS\n 70\n1\n"),
        (b"  0\nEOF\n", b""),
        (b"  0\nEOF\n", b"  0\n"),
        (b"  0\nSECTION\n  2\nENTITIES\n", b"SECTION\n  2\nENTITIES\n"),  # codes and values change places
    ],
)
def test_a_file_that_is_not_the_drawing_is_refused(tmp_path, old, new):
    path, content = tmp_path / "x.dxf", flat_dxf(DRAWING)
    assert old in content
    path.write_bytes(content.replace(old, new, 1))
    with pytest.raises(ExportError, match="differs when the file is read back"):
        check_flat_dxf(DRAWING, path)


def test_engraved_names_can_be_read_on_a_large_sheet():
    """Of a sheet of 5 m lines are 5 mm wide, so that all of it is seen: letters of 8 mm were blots."""
    large = FlatDrawing("nest", tuple(FlatLine(one.layer, 5 * one.points, one.closed) for one in DRAWING.lines))
    text = flat_svg(large).decode()
    widths = dict(re.findall(r'id="(\w+)" style="[^"]*stroke-width: ([0-9.]+)', text))
    assert widths == {"CUT": "5.000", "ENGRAVE": "0.800"}
    assert re.findall(r'id="ENGRAVE" style="[^"]*stroke-width: ([0-9.]+)', flat_svg(large, 2e-4).decode()) == ["0.200"]
