"""The file of smooth pieces, and of the rest of the part as planar faces."""

from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Ints
from dsfab.errors import ExportError
from dsfab.export.part import Part, without_collapsed
from dsfab.export.planar import Polyhedron, polyhedron
from dsfab.export.plate_text import Entities
from dsfab.export.shells import solids_of
from dsfab.export.simplify import simplified_part, usual_tolerance
from dsfab.export.smooth.limits import Limits
from dsfab.export.smooth.solid import SmoothModel
from dsfab.export.smooth.text import SmoothText
from dsfab.export.step_pieces import closing
from dsfab.export.step_text import DIGITS, header, planar_faces

SKINS = "curved solid with spline skins"
"""What the file says about itself."""


@dataclass(frozen=True, eq=False)
class SmoothPieceFile:
    """The smooth pieces of a part and the text of the file.

    pieces  : of the sheet; smooth counts those that were accepted.
    gap     : widest among these, millimetres; there and back : the largest distance of a piece from the mesh, and of
              the mesh from a piece.
    volume  : of all smooth solids, as OCCT finds it, cubic millimetres.
    refused : why others were not, or ''.
    """

    text: str
    pieces: int
    smooth: int
    faces: int
    gap: float
    there: float
    back: float
    limits: Limits
    volume: float
    refused: str

    @property
    def told(self) -> str:
        """How the file was made."""
        some = "" if self.smooth == self.pieces else f"{self.smooth} of {self.pieces} pieces, the rest faceted, "
        why = f" ({self.refused})" if self.refused else ""
        return (
            f"{some}at most {self.there:.2g} mm off the mesh and the mesh {self.back:.2g} mm off it "
            f"({self.limits.told}); gaps under {self.gap:.2g} mm{why}"
        )


def file_text(part: Part, which: list[tuple[SmoothModel, int]], rest: Part | None = None) -> str:
    """The file of some pieces of layouts, named like the part, and of the triangles of `rest` as planar faces."""
    new = Entities()
    writers = {id(model): SmoothText(new, model) for model, _ in which}
    faces, shells = list[int](), list[int]()
    for i, (model, k) in enumerate(which):
        added = writers[id(model)].piece(model.pieces[k])
        faces += added
        shells += [i] * len(added)
    name, solids = part.name, [[i] for i in range(len(which))]
    if rest is None:
        head = header(name, SKINS, len(solids))
        return "".join([head, *new.text, *closing(np.array(shells), solids, np.array(faces), new.free, name)])
    shape, others = _planar(rest)
    texts, numbers, free = planar_faces(shape, new.free)
    solids += [[i + len(which) for i in one] for one in others]
    end = closing(np.r_[shells, shape.shell + len(which)], solids, np.r_[faces, numbers], free, name)
    return "".join([header(name, SKINS, len(solids)), *new.text, *texts, *end])


def rest_of(part: Part, F: Ints) -> Part:
    """Some triangles (m, 3) of a part, simplified where that is possible."""
    used, local = np.unique(F, return_inverse=True)
    some = replace(part, V=part.V[used], F=local.reshape(F.shape))
    try:
        simple = simplified_part(some, usual_tolerance(some))
        return without_collapsed(simple, np.round(simple.V, DIGITS) + 0.0, f"a STEP file with {DIGITS} decimals")
    except ExportError:
        return some


def _planar(part: Part) -> tuple[Polyhedron, list[list[int]]]:
    """A part as planar faces, and the shells of its solids."""
    shell, solids = solids_of(part)
    inward = np.isin(shell, [i for _, *inner in solids for i in inner])
    return polyhedron(part.V, np.where(inward[:, None], part.F[:, ::-1], part.F), shell), solids
