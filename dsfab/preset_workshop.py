"""[workshop]: what the flat parts of a design are cut from, and how they are joined."""

from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt
from pydantic import field_validator, model_validator

from dsfab.preset_surface import Section

Route = Literal["auto", "strips", "planks", "bars", "sheet", "panels"]
StockSize = tuple[Annotated[float, Gt(0)], Annotated[float, Gt(0)]]


class Workshop(Section):
    """[workshop]: flat parts for `dsfab workshop`. The design itself is not changed by it."""

    route: Route = "auto"
    """strips: members lie flat in the surface, in bolted layers; planks: they stand upright on it, halved where they
    cross; bars: straight from node to node, on folded plates; panels: models, in one skin with tabs; sheet: a flat
    design as it is, in pieces of the size of the stock; auto: sheet where the design is flat, strips where they can be
    bent, else bars where these stay near the surface, else planks where they can be bent and put on."""
    stock: tuple[StockSize, ...] = ((2.5, 1.25),)
    """Metres; length and width of the sheets to cut from, of one size or of several."""
    prices: tuple[Annotated[float, Gt(0)], ...] = ()
    """Of a sheet of each size of the stock, in its order and in any currency: what is cheapest together is taken then.
    Without prices it is the least area."""
    thickness: Annotated[float, Ge(0)] = 0.0
    """Metres; of one layer, of planks or of bars. 0: that of [statics], shared out to the layers."""
    depth: Annotated[float, Ge(0)] = 0.0
    """planks: metres; how deep they are along the normals. 0: as deep as most members are wide."""
    layers: Literal[2, 4] = 2
    """strips: how many lie on each other where two members cross; of 2 each member is in one, of 4 in two."""
    plate: Annotated[float, Gt(0)] = 0.005
    """Metres; thickness of the plates of nodes (bars), and of those with anchors."""
    anchor: Annotated[float, Ge(0)] = 0.0
    """Metres; diameter of anchors. At supports plates go on to the ground in a folded leg with two holes for these; 0:
    without."""
    bolt: Annotated[float, Gt(0)] = 0.012
    """Metres; diameter of the bolts, and of their holes."""
    gap: Annotated[float, Ge(0)] = 0.008
    """Metres between parts on the stock, and from its edge: room for the cutter."""
    grain: bool = False
    """Grain runs along the sheets, and members lie along it: none is cut across."""
    nesting: Literal["stacked", "spyrrow"] = "stacked"
    """stacked: parts are piled up on sheets; spyrrow: that solver then tries to empty the least used of these into
    others. It takes minutes, and is to be installed: pip install "dsfab[nesting]"."""
    model: Annotated[float, Ge(0)] = 0.0
    """50: a model in card at 1:50, and all lengths of this section are the model's. 0: full size."""
    splice: Literal["cover", "scarf", "fingers", "none"] = "cover"
    """How what is longer than the stock goes on: members with a bolted cover plate, where flat sheets are butted; glued
    on a bevel of eight times the thickness (scarf); flat sheets with fingers; or all just butted."""

    @field_validator("stock", mode="before")
    @classmethod
    def _one_or_several(cls, given: Any) -> Any:
        """One size may be written without the brackets of a list."""
        if isinstance(given, list | tuple) and len(given) == 2 and all(isinstance(x, int | float) for x in given):
            return (tuple(given),)
        return given

    @field_validator("prices", mode="before")
    @classmethod
    def _price_or_several(cls, given: Any) -> Any:
        """That of one size may be written as a number."""
        return (given,) if isinstance(given, int | float) and not isinstance(given, bool) else given

    @field_validator("stock")
    @classmethod
    def _some(cls, stock: tuple[StockSize, ...]) -> tuple[StockSize, ...]:
        if not stock:
            raise ValueError("no sheet to cut from; give length and width in metres, for instance [2.5, 1.25]")
        return tuple((max(size), min(size)) for size in stock)

    @model_validator(mode="after")
    def _price_of_each(self) -> "Workshop":
        if self.prices and len(self.prices) != len(self.stock):
            sizes = f"{len(self.stock)} size{'' if len(self.stock) == 1 else 's'}"
            raise ValueError(
                f"prices for {len(self.prices)} sizes, and stock has {sizes}; give one price for each size, in the "
                "same order, or none"
            )
        return self
