"""The paper's figures as presets: Table 1 to the letter, and what each gives on a coarser mesh."""

import numpy as np
import pytest

import dsfab
from dsfab.core.toml_files import preset_headline, shipped_presets
from dsfab.reproduction.published import FIGURES
from tests.designs import paper_design

RECORDED: dict[str, tuple[float, int, int, float, float]] = {
    "pavilion": (0.831, 2, 43, 107.54, 181.68),
    "hanging_bar": (0.801, 1, 49, 16.89, 16.89),
    "corner_held": (0.775, 1, 106, 84.092, 23.072),
    "rollers": (0.720, 1, 88, 23.39, 91.833),
    "bridge": (0.751, 1, 1631, 23.69, 24.731),
    "camel_none": (0.723, 1, 52, 12.241, 12.241),
    "camel_head": (0.748, 1, 107, 127.42, 106.34),
    "camel_nose": (0.748, 5, 50, 123.81, 117.21),
    "camel_ears": (0.720, 1, 184, 88.498, 176.47),
    "pirate": (0.729, 1, 412, 114.82, 116.5),
    "climbing_hold": (0.734, 1, 245, 71.226, 147.57),
    "bob": (0.795, 1, 472, 148.42, 103.32),
    "mouse": (0.779, 1, 75, 80.344, 85.391),
    "boys_surface": (0.778, 1, 626, 81.08, 158.85),
    "twisty_tower": (0.824, 1, 152, 15.197, 70.797),
    "sphere": (0.757, 1, 157, 25.161, 184.34),
    "turkey": (0.769, 2, 769, 116.48, 183.29),
}
"""Share kept, pieces, genus of the solid, first eigenvalue of both families times the area."""

LONG = ("boys_surface", "bridge", "camel_ears", "camel_nose", "pirate", "turkey", "twisty_tower")
"""They take longest, by their many members or a surface that crosses itself."""


@pytest.mark.parametrize("figure", [f for f in FIGURES if f.row], ids=lambda f: f.preset)
def test_presets_hold_the_row_of_table_1(figure):
    preset, row = dsfab.load_preset(figure.preset), figure.row
    pair = (preset.pattern.major, preset.pattern.minor)
    assert (preset.diffusion.gamma, preset.diffusion.r) == (row.gamma, row.r)
    assert tuple(f.mode for f in pair) == row.modes
    assert tuple(f.frequency for f in pair) == row.frequencies
    assert tuple(f.phase for f in pair) == row.phases
    assert tuple(f.threshold for f in pair) == row.thresholds
    assert preset.pattern.width.rule == "plain"


def test_table_1_has_sixteen_rows_and_every_figure_its_preset():
    assert sum(f.row is not None for f in FIGURES) == 16
    assert len({f.preset for f in FIGURES}) == len(FIGURES) == 17
    assert {name for name, path in shipped_presets().items() if path.parent.name == "paper"} == {
        f.preset for f in FIGURES
    }
    assert len({f.timings for f in FIGURES}) == 12


@pytest.mark.parametrize("figure", [f for f in FIGURES if "mesh" in f.stand_in], ids=lambda f: f.preset)
def test_a_stand_in_says_so_in_the_preset(figure):
    file = shipped_presets()[figure.preset]
    assert "stand-in" in preset_headline(file)
    assert f"({figure.timings.vertices})" in file.read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize(
    "figure", [pytest.param(f, marks=[pytest.mark.slow] * (f.preset in LONG), id=f.preset) for f in FIGURES]
)
def test_figures_keep_their_recorded_numbers_on_a_coarser_mesh(figure):
    name = figure.preset
    design = paper_design(name)
    surface, load = design.surface, design.load
    kept, pieces, genus, major, minor = RECORDED[name]
    assert design.statics.equilibrium.imbalance < 1e-8
    assert design.sheet.surface.area / surface.area == pytest.approx(kept, abs=0.03)
    assert len(design.slicing.pieces) == pieces
    assert design.solid.genus == pytest.approx(genus, rel=0.15, abs=4)
    lam = design.diffusion.major.lam[0] * surface.area, design.diffusion.minor.lam[0] * surface.area
    assert lam == pytest.approx((major, minor), rel=0.05)
    carried = [piece.loaded for piece in design.slicing.pieces if piece.held]
    assert any(carried) == load.loaded.any()
    assert np.isfinite(design.solid.V).all()
