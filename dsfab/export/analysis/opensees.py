"""OpenSees: the beam model as a Tcl script in metres, newtons and pascals."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dsfab import __version__
from dsfab.core.errors import ExportError
from dsfab.export.part import Part
from dsfab.export.readback import NUMBERS_READ_BACK, ReadBack, require_equal
from dsfab.export.writing import one_line

if TYPE_CHECKING:
    from dsfab.members.frame import Frame

SUFFIX = ".tcl"
SOLVED = """
proc solve {name} {
    global count
    constraints Transformation
    numberer RCM
    system UmfPack
    integrator LoadControl 1.0
    algorithm Linear
    analysis Static
    if {[analyze 1] != 0} { puts stderr "$name: no equilibrium"; exit 1 }
    reactions
    for {set k 1} {$k <= $count} {incr k} {
        puts "$name;$k;[join [nodeDisp $k] {;}];[join [nodeReaction $k] {;}]"
    }
    wipeAnalysis
    reset
}
puts "case;node;ux;uy;uz;rx;ry;rz;Rx;Ry;Rz;Mx;My;Mz"
"""


def encode(part: Part) -> Iterator[bytes]:
    """Yield the OpenSees script of a part's beam model, line by line."""
    for line in _lines(part.name, part.details.beam_model):
        yield f"{line}\n".encode("ascii", "replace")


def check(part: Part, path: Path) -> ReadBack:
    """Read the OpenSees script back. Raises ExportError if the beams or the nodes differ."""
    rows = [line.split() for line in path.read_text(encoding="ascii").splitlines()]
    frame = part.details.beam_model
    beams = sum(row[:2] == ["element", "ElasticTimoshenkoBeam"] for row in rows)
    require_equal(part, "beams", len(frame.ends), beams)
    points = np.array([row[2:5] for row in rows if row[:1] == ["node"]], dtype=np.float64)[: len(frame.points)]
    if not (np.abs(points - frame.points) <= NUMBERS_READ_BACK * np.abs(frame.points).max()).all():
        raise ExportError(
            f"the nodes of {part.name!r} have other coordinates when the file is read back; write saf.xlsx instead"
        )
    return ReadBack(beams, "beams")


def _lines(name: str, frame: "Frame") -> Iterator[str]:
    yield f"# {one_line(name)}: {len(frame.ends)} beams, written by dsfab {__version__}; metres, newtons, pascals"
    yield "# run the model with: OpenSees NAME.tcl > NAME.csv"
    yield "wipe"
    yield "model BasicBuilder -ndm 3 -ndf 6"
    for k, (point, word) in enumerate(zip(frame.points, frame.nodes, strict=True), 1):
        yield f"node {k} {_numbers(point)} ;# {_word(word)}"
    yield f"set count {len(frame.points)}"
    for k, fixed in enumerate(frame.fixed, 1):
        if fixed.any():
            yield f"fix {k} {' '.join('1' if is_fixed else '0' for is_fixed in fixed)}"
    yield from _springs(frame)
    yield from _beams(frame)
    yield SOLVED
    for k, (case, load) in enumerate(frame.all_loads.items(), 1):
        yield f"pattern Plain {k} Linear {{"
        for node in np.flatnonzero(load.any(axis=1)):
            yield f"    load {node + 1} {_numbers(load[node])}"
        yield f"}}\nsolve {{{_word(case)}}}\nremove loadPattern {k}"
    yield "wipe"


def _springs(frame: "Frame") -> Iterator[str]:
    n, b = len(frame.points), len(frame.ends)
    for count, k in enumerate(np.flatnonzero((frame.spring > 0).any(axis=1)), 1):
        directions = np.flatnonzero(frame.spring[k] > 0)
        yield f"node {n + count} {_numbers(frame.points[k])}"
        yield f"fix {n + count} 1 1 1 1 1 1"
        tags = [6 * count + int(direction) for direction in directions]
        for tag, direction in zip(tags, directions, strict=True):
            yield f"uniaxialMaterial Elastic {tag} {frame.spring[k, direction]:.12g}"
        mats, dirs = " ".join(map(str, tags)), " ".join(str(direction + 1) for direction in directions)
        yield f"element zeroLength {b + count} {n + count} {k + 1} -mat {mats} -dir {dirs}"


def _beams(frame: "Frame") -> Iterator[str]:
    E, G = frame.material.young, frame.material.shear
    columns = zip(
        *(frame.ends, frame.axes[:, 2], frame.area, frame.inertia, frame.shear_area, frame.beam_members), strict=True
    )
    for k, (ends, z, area, (torsion, about_y, about_z), shear, member) in enumerate(columns, 1):
        yield f"geomTransf Linear {k} {_numbers(z)}"
        section = _numbers([E, G, area, torsion, about_y, about_z, shear, shear])
        beam = f"{k} {ends[0] + 1} {ends[1] + 1} {section} {k}"
        yield f"element ElasticTimoshenkoBeam {beam} ;# {_word(member) or 'link'}"


def _word(name: str) -> str:
    return "".join(c for c in name if c.isprintable() and c not in "{}\\;").strip()


def _numbers(values: Any) -> str:
    return " ".join(f"{value + 0.0:.12g}" for value in values)
