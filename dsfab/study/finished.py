"""What export needs of a design that is finished, whether it was just made or read from the folder it was built in."""

from typing import Protocol

from dsfab.design import PatternResult
from dsfab.preset import Preset
from dsfab.slicing import Sheet
from dsfab.surface import Surface
from dsfab.thickening import Solid


class Finished(Protocol):
    """A preset, its uncut surface and pattern, the sheet kept of it, and the solid: a `Design` is one."""

    @property
    def preset(self) -> Preset: ...
    @property
    def surface(self) -> Surface: ...
    @property
    def pattern(self) -> PatternResult: ...
    @property
    def sheet(self) -> Sheet: ...
    @property
    def solid(self) -> Solid: ...
    @property
    def mass(self) -> float: ...
