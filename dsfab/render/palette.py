"""Colours of pictures, as an architect would choose them for paper."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dsfab.render.scene import Bytes, Colour

MarkName = Literal["load", "support", "reaction", "person", "tension", "compression", "gradient"]


@dataclass(frozen=True)
class Palette:
    """Red green blue in 0..255.

    families : of the members by family (major, minor, kept), for those who want them told apart.
    tints    : of the same in a picture that is about them.
    ink      : how much darker edges are drawn, 0..1.
    """

    paper: Colour = (253, 252, 249)
    shadow: Colour = (118, 112, 110)
    members: Colour = (220, 156, 122)
    families: tuple[Colour, ...] = ((220, 156, 122), (236, 196, 140), (176, 110, 92))
    load: Colour = (32, 84, 168)
    support: Colour = (58, 74, 70)
    reaction: Colour = (134, 62, 140)
    plain: Colour = (232, 227, 218)
    person: Colour = (146, 145, 148)
    tension: Colour = (200, 48, 40)
    compression: Colour = (28, 92, 176)
    gradient: Colour = (20, 112, 44)
    tints: tuple[Colour, Colour, Colour] = ((208, 104, 76), (78, 128, 172), (196, 188, 176))
    text: Colour = (56, 54, 52)
    ink: float = 0.45

    def of(self, name: MarkName) -> Bytes:
        """A colour by its name, as bytes."""
        return np.array(getattr(self, name), dtype=np.uint8)


PAPER = Palette()
"""Terracotta on white paper; blue loads and slate supports, told apart without red and green."""
