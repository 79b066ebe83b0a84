"""Pictures: everything that draws, and nothing that knows a command."""

from dsfab.render.live_members import member_places
from dsfab.render.members import band_colours, members_picture, rated_members_picture
from dsfab.render.naming_plate import Nameplate, PlacedName, placed_names
from dsfab.render.palette import PAPER, Palette
from dsfab.render.view import up_axis

__all__ = [
    "PAPER",
    "Nameplate",
    "Palette",
    "PlacedName",
    "band_colours",
    "member_places",
    "members_picture",
    "placed_names",
    "rated_members_picture",
    "up_axis",
]
