"""Buckling factors and natural frequencies of a cut sheet, with error bounds."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import islice

from dsfab.core.arrays import Floats
from dsfab.core.errors import DsfabError
from dsfab.design import Progress, loads_on
from dsfab.slicing import Sheet
from dsfab.slicing.cutting.sheet import SmoothSurface, meshes
from dsfab.statics import (
    Elements,
    FactorCache,
    ModeSupports,
    ResultRequest,
    SheetMaterial,
    SpreadLoad,
    elements_of,
    equilibria,
    flat_axis,
    frequencies,
    lowest_buckling,
    mass_of_loads,
    mode_supports,
    sheet_stiffness,
)
from dsfab.statics.boundary_conditions import all_clamped
from dsfab.study.verdict import estimates
from dsfab.study.verdict.levels import memory_needed, on_mesh, shares
from dsfab.study.verdict.verdict import MOST_MESHES, LoadedSurface, attached_material
from dsfab.surface import LoadCase, Surface

MODE_ELEMENTS: Elements = elements_of("buckling")  # buckling and frequencies share a stiffness matrix


@dataclass(frozen=True)
class ModeLevel:
    """Lowest buckling factors and lowest natural frequency on one mesh.
    buckling  : lowest factor of each load case, None if it does not buckle; empty if not requested.
    hertz     : lowest frequency (Hz); None if not requested.
    local     : a note for each load case in which only a small part of the sheet buckles."""

    triangles: int
    buckling: Mapping[str, float | None]
    hertz: float | None
    local: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class ModeIntervals:
    """Lowest buckling factors and lowest natural frequency, with error bounds.
    buckling : lowest factor of each load case that buckles.
    hertz    : lowest frequency, or None.    levels : results on each mesh, coarse to fine.
    refusals : reasons why a value or a finer mesh is missing."""

    buckling: Mapping[str, estimates.ModeEstimate]
    hertz: estimates.ModeEstimate | None
    levels: tuple[ModeLevel, ...]
    assumed: str = ""
    refusals: tuple[str, ...] = ()

    @property
    def local(self) -> Mapping[str, str]:
        """A note for each load case in which only a small part of the sheet buckles."""
        return self.levels[-1].local if self.levels else {}


def mode_intervals(
    setting: LoadedSurface, material: Sheet, request: ResultRequest, budget: float, progress: Progress | None = None
) -> ModeIntervals:
    """Return the lowest buckling factor of each load case and the lowest natural frequency, with error bounds.
    material : cut sheet.    request : requested results.    budget : memory limit of each solve, bytes.
    No error is raised; the field `refusals` of the result lists the errors."""
    levels: list[ModeLevel] = []
    refusals: list[str] = []
    assumed = ""
    try:
        sheet, _, loads = attached_material(setting, material)
        permanent = setting.permanent if request.frequencies else {}
        forces, weights = shares(sheet, loads), shares(sheet, loads_on(setting.surface, sheet, permanent))
        for mesh in islice(meshes(sheet, SmoothSurface.from_surface(setting.surface)), MOST_MESHES):
            # two factorisations are stored, so assume the solver that needs the most memory
            needed = memory_needed(MODE_ELEMENTS.unknowns(mesh.surface), MODE_ELEMENTS.bending, "multifrontal")
            if levels and needed > budget:
                refusals.append(
                    f"error bounds of buckling and frequency need a finer mesh, with {needed / 1e9:.1f} GB of memory"
                )
                break
            if progress:
                progress("modes", f"{mesh.surface.m:,} triangles")
            cases, spreads = on_mesh(setting.surface, mesh, setting.loads, forces)
            standing = mode_supports(mesh.surface, next(iter(cases.values())), _is_plane(mesh.surface, cases))
            assumed = standing.told
            masses = mass_of_loads(on_mesh(setting.surface, mesh, permanent, weights)[0].values())
            levels.append(mode_level(mesh.surface, setting.made, cases, spreads, standing, request, masses))
            hertz = _hertz(levels)
            modes = [*_factors(levels).values(), *([hertz] if hertz else [])]
            if len(levels) > 1 and all(mode.bound <= estimates.WIDEST_MODE_BOUND for mode in modes):
                break
    except DsfabError as error:
        refusals.append(f"no {'finer mesh for the bound of modes' if levels else 'modes'}: {error}")
    return ModeIntervals(_factors(levels), _hertz(levels), tuple(levels), assumed, tuple(refusals))


def mode_level(
    surface: Surface,
    material: SheetMaterial,
    cases: Mapping[str, LoadCase],
    spreads: Mapping[str, SpreadLoad],
    standing: ModeSupports,
    request: ResultRequest,
    carried: Floats | None = None,
) -> ModeLevel:
    """Return the lowest buckling factor of each load case and the lowest natural frequency on a mesh, if requested.
    spreads : loads as forces per area and length.    standing : supports.    carried : (n,) masses of loads, kg.
    Raises StaticsError if a solve fails."""
    sheet, factor_cache = material.model_for(surface), FactorCache(2)
    K = sheet_stiffness(sheet, MODE_ELEMENTS)
    supports = standing.load
    factors: dict[str, float | None] = {}
    local: dict[str, str] = {}
    if request.buckling:
        plane = MODE_ELEMENTS.in_plane if _is_plane(surface, cases) else MODE_ELEMENTS
        stiffness = sheet_stiffness(sheet, plane) if plane != MODE_ELEMENTS else K
        spread_loads = list(spreads.values())
        answers = equilibria(surface, stiffness, list(cases.values()), plane, spread_loads, factor_of=factor_cache)
        for (name, load), answer in zip(cases.items(), answers, strict=True):
            supported_load = replace(load, fixed=supports.fixed, clamped=supports.clamped)
            factors[name], clause = lowest_buckling(sheet, supported_load, answer, MODE_ELEMENTS, K, factor_cache)
            local |= {name: clause} if clause else {}
    hertz = None
    if request.frequencies:
        still = replace(sheet, clamped=all_clamped(supports), carried=carried)
        hertz = float(frequencies(still, supports.fixed, 1, MODE_ELEMENTS, K, factor_cache, supports.spring).hertz[0])
    return ModeLevel(surface.m, factors, hertz, local)


def _is_plane(surface: Surface, cases: Mapping[str, LoadCase]) -> bool:
    return flat_axis(surface, *cases.values()) is not None


def _factors(levels: list[ModeLevel]) -> dict[str, estimates.ModeEstimate]:
    estimate_by_case: dict[str, estimates.ModeEstimate] = {}
    for name in levels[0].buckling if levels else ():
        values = [value for level in levels if (value := level.buckling[name]) is not None]
        if len(values) == len(levels):
            estimate_by_case[name] = estimates.mode_estimate(values)
    return estimate_by_case


def _hertz(levels: list[ModeLevel]) -> estimates.ModeEstimate | None:
    values = [level.hertz for level in levels if level.hertz is not None]
    return estimates.mode_estimate(values) if values else None
