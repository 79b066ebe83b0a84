"""Each limit that two parts apply stands once: what a stage accepts, its report passes."""

import ast
from types import SimpleNamespace

import pytest

from dsfab.core import limits
from dsfab.core.errors import ExportError, StaticsError
from dsfab.core.limits import worst_status
from dsfab.export.readback import check_measure
from dsfab.preset.file import load_preset
from dsfab.report.compliance.findings import Findings
from dsfab.statics.solve import require_solved
from tests.shapes import grid
from tests.source import modules, nodes


def accepted(imbalance: float, residual: float) -> bool:
    try:
        require_solved(grid(2, 2, 1.0, 1.0), imbalance, residual)
    except StaticsError:
        return False
    return True


@pytest.mark.parametrize(
    ("imbalance", "residual", "passes"),
    [(0.8e-4, 0.8e-6, True), (1.25e-4, 0.0, False), (0.0, 1.25e-6, False), (1.25e-4, 1.25e-6, False)],
)
def test_report_and_solver_accept_the_same_residuals(imbalance, residual, passes):
    case = SimpleNamespace(imbalance=imbalance, residual=residual)
    found = SimpleNamespace(judgement=SimpleNamespace(cases={"load": case}, check=None))
    assert (Findings.balance_check(found).status == "pass") == accepted(imbalance, residual) == passes


@pytest.mark.parametrize(("facets", "mark"), [(0.17, "pass"), (0.24, "note")])
def test_a_report_notes_flat_faces_that_are_too_coarse_for_a_curved_surface(facets, mark):
    found = SimpleNamespace(judgement=SimpleNamespace(check=SimpleNamespace(facets=facets)))
    assert Findings.facet_check(found).status == mark


@pytest.mark.parametrize(("measure", "passes"), [(1000.8, True), (1001.25, False), (998.75, False)])
def test_a_written_solid_reads_back_with_its_volume_to_a_thousandth(measure, passes):
    part = SimpleNamespace(name="solid", is_solid=True, volume=1000.0)
    if passes:
        assert check_measure(part, measure) == pytest.approx(measure / 1000 - 1)
        return
    with pytest.raises(ExportError, match="reads back with volume"):
        check_measure(part, measure)


def test_a_square_metre_of_steel_of_ten_millimetres_weighs_770_newtons():
    preset = load_preset("dome", {"statics": {"thickness": 0.01, "material": "S355"}})
    assert preset.statics.area_weight == pytest.approx(7850 * 0.01 * 9.80665, rel=1e-9)


def test_the_worst_of_several_counts():
    assert worst_status(["pass", "unknown", "fail"]) == "fail"
    assert worst_status(["pass", "unknown"]) == "unknown"
    assert worst_status([]) == "pass"


def named(tree: ast.Module) -> set[str]:
    """Constants that a module sets at its top."""
    targets = (target for node in tree.body if isinstance(node, ast.Assign) for target in node.targets)
    return {target.id for target in targets if isinstance(target, ast.Name)}


def test_no_other_module_has_a_limit_or_a_status_of_its_own():
    own = {name for name, value in vars(limits).items() if name.isupper() and isinstance(value, float)}
    for _, file, tree in modules():
        if file == "core/limits.py":
            continue
        assert not named(tree) & own, file
        literals = [ast.unparse(node) for node in nodes(tree) if isinstance(node, ast.Subscript)]
        assert not any(text.startswith("Literal['pass', 'fail'") for text in literals), file
