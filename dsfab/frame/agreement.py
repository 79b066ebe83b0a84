"""How far a beam model answers as the sheet does that it stands for."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dsfab.frame.model import Frame
from dsfab.frame.solve import FrameAnswer
from dsfab.statics import Equilibrium

STOUT = 0.35
"""Bays of members that are wider than this share of their length are no beams: joints are half of them."""
FEW = 0.15
"""Up to this share of the elastic energy may be in such bays and in links; more, and the model is no model of beams."""
WITHIN = 0.1
"""What beams of slender members are off by at most."""
TWIST = 1.02
"""A sheet whose ribs twist as bars, that is so much softer than a thin one, is told."""


@dataclass(frozen=True, eq=False)
class FrameAgreement:
    """The answers of a frame and of its sheet to one case, both over the sheet's, whose ribs twist as the bars that
    they are: a thin sheet gives ribs that are deeper than wide many times the torsion of a bar.

    compliance, displacement : 1 where both are alike; of displacements the largest.
    stout : share of the elastic energy of the beams in links and in bays whose members are wider than .35 of their
            length or graze others; or of the sheet's in what is no member along an axis, if that is more.
    twist : what the sheet moves at most over what it would if its ribs twisted as a thin sheet.
    """

    case: str
    compliance: float
    displacement: float
    stout: float
    twist: float = 1.0

    @property
    def slender(self) -> bool:
        """Whether nearly all of the structure is of slender bays: then the beams should be within 10 %."""
        return self.stout <= FEW

    @property
    def told(self) -> str:
        """A sentence."""
        said = (
            f"beams against the sheet, {self.case}: {self.compliance:.2f} of its compliance, {self.displacement:.2f} "
            "of its largest displacement"
        )
        if self.twist > TWIST:
            said += f", which is {self.twist:.2f} times that of a thin sheet, since ribs twist as bars"
        if abs(self.compliance - 1) <= WITHIN and abs(self.displacement - 1) <= WITHIN:
            return said
        where = (
            f"{self.stout:.0%} of the energy is in discs, links, bays wider than {STOUT:g} of their length and where "
            "members graze"
        )
        why = "though its bays are slender" if self.slender else f"{where}, where beams are a rough model"
        return f"{said}: {why}; take displacements from the sheet"


def agreement(
    frame: Frame,
    answers: Mapping[str, FrameAnswer],
    sheet: Mapping[str, Equilibrium],
    beside: Mapping[str, float],
    twist: Mapping[str, float],
) -> list[FrameAgreement]:
    """Of each case and combination that both were solved for; answers of the frame, and of the sheet.

    beside : by case, the share of the sheet's elastic energy in what is no member along an axis.
    twist  : by case, see `FrameAgreement`.
    """
    stout = (frame.member < 0) | (frame.stout > STOUT)
    found = []
    for name in (name for name in answers if name in sheet):
        ours, theirs = answers[name], sheet[name]
        moved = float(np.linalg.norm(ours.u[:, :3], axis=1).max())
        energy = ours.energy[stout].sum() / ours.energy.sum()
        found.append(
            FrameAgreement(
                name,
                ours.compliance / theirs.compliance,
                moved / theirs.largest_displacement,
                max(float(energy), beside[name]),
                twist[name],
            )
        )
    return found
