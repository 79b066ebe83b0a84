"""Pictures of designs and of their members."""

from typing import TYPE_CHECKING, Any

from dsfab.render.lettering import PAPER, Nameplate, Palette, PlacedName, place_names
from dsfab.render.view import up_axis

__all__ = [
    "PAPER", "Nameplate", "Palette", "PlacedName", "band_colours", "member_places", "members_picture",
    "place_names", "rated_members_picture", "up_axis",
]  # fmt: skip

if TYPE_CHECKING:
    from dsfab.render.members import band_colours, member_places, members_picture, rated_members_picture


def __getattr__(name: str) -> Any:
    """Import `dsfab.render.members` on first use."""
    if name not in __all__:
        raise AttributeError(f"module 'dsfab.render' has no attribute {name!r}")
    from dsfab.render import members

    return getattr(members, name)
