"""The sections [sizing], [workshop] and [eurocode]."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt, Le
from pydantic import Field, field_validator, model_validator

from dsfab.preset.surface_section import Section
from dsfab.surface import Load


class Sizing(Section):
    """[sizing]: targets of the cut structure for `statics.thickness = "auto"` and for `dsfab size`."""

    utilisation: Annotated[float, Gt(0), Le(1)] = 0.8
    """Largest utilisation of a member: by Eurocode for steel and timber grades, else stress divided by strength."""
    movement: Annotated[float, Gt(0)] = 300.0
    """Smallest ratio of the span to the largest movement: 300 allows 10 mm on a span of 3 m."""
    buckling: Annotated[float, Ge(0)] = 4.0
    """Smallest buckling factor. Real shells buckle below the computed factor. 0: no target."""
    thicknesses: tuple[Annotated[float, Gt(0), Le(10)], ...] = ()
    """Thicknesses to choose from, metres. Default: the thicknesses in which the material is sold or made."""
    first: Annotated[float, Ge(0), Le(10)] = 0.0
    """First guess of the thickness, metres: sizing tries a third to six times this. 0: dsfab guesses from the size."""


Route = Literal["auto", "strips", "planks", "bars", "sheet", "panels"]
StockSize = tuple[Annotated[float, Gt(0)], Annotated[float, Gt(0)]]


class Workshop(Section):
    """[workshop]: flat parts for `dsfab workshop`. These keys do not change the design."""

    route: Route = "auto"
    """strips: members lie flat in the surface, in bolted layers. planks: members stand upright on the surface, with
    slots at crossings. bars: straight members from node to node, with folded plates. panels: a model of flat faces with
    tabs. sheet: a flat design in pieces of the stock's size. auto: sheet for a flat design; else the first that is
    possible: strips, bars (if near the surface), planks."""
    stock: tuple[StockSize, ...] = ((2.5, 1.25),)
    """Length and width of the sheets to cut from, metres; one size or several."""
    prices: tuple[Annotated[float, Gt(0)], ...] = ()
    """Price of a sheet for each size of the stock, in any currency; the cheapest combination is used. Without prices,
    the combination with the smallest area is used."""
    thickness: Annotated[float, Ge(0)] = 0.0
    """Thickness of one layer, plank or bar, metres. 0: the thickness in [statics], divided by the number of layers."""
    depth: Annotated[float, Ge(0)] = 0.0
    """planks: height along the surface's normals, metres. 0: the usual width of members."""
    layers: Literal[2, 4] = 2
    """strips: number of layers where two members cross. With 2, a member has one layer; with 4, it has two layers."""
    plate: Annotated[float, Gt(0)] = 0.005
    """Thickness of plates at anchors and of plates that join bars, metres."""
    anchor: Annotated[float, Ge(0)] = 0.0
    """Diameter of anchors, metres. Plates of supports have a leg with two anchor holes. 0: no anchors."""
    bolt: Annotated[float, Gt(0)] = 0.012
    """Diameter of the bolts and of the bolt holes, metres."""
    gap: Annotated[float, Ge(0)] = 0.008
    """Distance (m) between parts on the stock, and from the edge of the stock: space for the cutting tool."""
    grain: bool = False
    """True if the sheets have a grain along their length. Members then lie along the grain."""
    nesting: Literal["stacked", "spyrrow"] = "stacked"
    """stacked: parts are stacked on sheets. spyrrow: after stacking, a solver tries to clear the emptiest sheet. The
    solver takes minutes and needs: pip install "dsfab[nesting]"."""
    model: Annotated[float, Ge(0)] = 0.0
    """Scale of a card model: 50 means 1:50; all lengths of this section are lengths of the model. 0: full size."""
    alike: Annotated[float, Ge(0), Le(0.05)] = 0.0
    """strips: parts are made equal if their outlines differ by at most this distance (m), and their holes by half a
    millimetre. 0: no change."""
    splice: Literal["cover", "scarf", "fingers", "none"] = "cover"
    """Joint of parts longer than the stock. cover: bolted cover plate for members, butt joint for flat sheets. scarf:
    glued slope, eight thicknesses long. fingers: finger joints for flat sheets. none: butt joints."""

    @field_validator("stock", mode="before")
    @classmethod
    def _one_or_several(cls, value: Any) -> Any:
        if isinstance(value, list | tuple) and len(value) == 2 and all(isinstance(x, int | float) for x in value):
            return (tuple(value),)
        return value

    @field_validator("prices", mode="before")
    @classmethod
    def _price_or_several(cls, value: Any) -> Any:
        return (value,) if isinstance(value, int | float) and not isinstance(value, bool) else value

    @field_validator("stock")
    @classmethod
    def _check_stock(cls, stock: tuple[StockSize, ...]) -> tuple[StockSize, ...]:
        if not stock:
            raise ValueError("stock is an empty list; give length and width of a sheet in metres, such as [2.5, 1.25]")
        return tuple((max(size), min(size)) for size in stock)

    @model_validator(mode="after")
    def _price_of_each(self) -> "Workshop":
        if self.prices and len(self.prices) != len(self.stock):
            sizes = f"{len(self.stock)} size{'' if len(self.stock) == 1 else 's'}"
            raise ValueError(
                f"prices has {len(self.prices)} entries, but stock has {sizes}; give a price for each size of sheet, "
                f"or no prices"
            )
        return self


Duration = Literal["permanent", "long", "medium", "short", "instantaneous"]


class Eurocode(Section):
    """[eurocode]: checks of members by EN 1993-1-1 (steel) or EN 1995-1-1 (timber), without change of the design."""

    service_class: Literal[1, 2, 3] = 2
    """Timber: 1 heated rooms, 2 under a roof, 3 in the open."""
    duration: dict[str, Duration] = Field(default_factory=dict)
    """Timber: duration of loads by case. Default: permanent for weight, long for storage, short for wind and
    maintenance, medium for all other loads."""
    gamma_m: Annotated[float, Gt(0)] | None = None
    """Timber: partial factor; default: 1.3 for solid timber, 1.25 for glulam, 1.2 for LVL."""
    gamma_m0: Annotated[float, Gt(0)] = 1.0
    """Steel: partial factor of sections."""
    gamma_m1: Annotated[float, Gt(0)] = 1.0
    """Steel: partial factor of members that may buckle."""
    curve: Literal["a0", "a", "b", "c", "d"] = "c"
    """Steel: buckling curve; c for solid sections."""
    buckling_length: Annotated[float, Gt(0), Le(10)] = 1.0
    """Buckling length, divided by the distance between nodes along the member."""
    bent_in: bool = False
    """Timber: members consist of straight layers that are bent into shape; the check adds the stress of this bending.
    Layer thickness: the value in [workshop], or the thickness in [statics] divided by `workshop.layers`."""

    def case_mistakes(self, loads: Sequence[Load]) -> Iterator[str]:
        """Yield an error message for each case in `duration` without a load."""
        cases = list(dict.fromkeys(load.case for load in loads)) or ["load"]
        for case in self.duration:
            if case not in cases:
                yield f"eurocode.duration.{case}: no load has this case (there are: {', '.join(cases)})"
