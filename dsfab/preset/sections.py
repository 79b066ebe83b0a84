"""The sections [workshop] and [eurocode]."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt, Le
from pydantic import Field, field_validator, model_validator

from dsfab.preset.surface_section import Section
from dsfab.surface import Load

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


Duration = Literal["permanent", "long", "medium", "short", "instantaneous"]


class Eurocode(Section):
    """[eurocode]: how members are checked, by EN 1993-1-1 those of steel, by EN 1995-1-1 those of timber. The design
    itself is not changed by it."""

    service_class: Literal[1, 2, 3] = 2
    """Timber: 1 heated rooms, 2 under a roof, 3 in the open."""
    duration: dict[str, Duration] = Field(default_factory=dict)
    """Timber, by case: how long its loads act; left out: weight permanent, stores long, wind and maintenance short, all
    others medium."""
    gamma_m: Annotated[float, Gt(0)] | None = None
    """Timber: partial factor; left out: 1.3 for solid timber, 1.25 for glulam, 1.2 for LVL."""
    gamma_m0: Annotated[float, Gt(0)] = 1.0
    """Steel: partial factor of sections."""
    gamma_m1: Annotated[float, Gt(0)] = 1.0
    """Steel: partial factor of members that may buckle."""
    curve: Literal["a0", "a", "b", "c", "d"] = "c"
    """Steel: the buckling curve; c for solid sections."""
    buckling_length: Annotated[float, Gt(0), Le(10)] = 1.0
    """Times the distance of nodes along the member."""
    bent_in: bool = False
    """Timber: whether members are layers that are bent into shape from straight ones (`workshop.thickness`, or that of
    [statics] over `workshop.layers`): the stress of that is added."""

    def case_mistakes(self, loads: Sequence[Load]) -> Iterator[str]:
        """Cases that no load has, as 'key = value: what is allowed'."""
        cases = list(dict.fromkeys(load.case for load in loads)) or ["load"]
        for case in self.duration:
            if case not in cases:
                yield f"eurocode.duration.{case}: no load has this case (there are: {', '.join(cases)})"
