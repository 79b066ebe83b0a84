"""Each limit that two parts apply stands once: what a stage accepts, its report passes."""

import ast
from types import SimpleNamespace

import pytest

from dsfab.core import limits
from dsfab.core.errors import StaticsError
from dsfab.core.limits import BALANCE, RESIDUAL, worst_status
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


@pytest.mark.parametrize("off", [0.5, 1.0, 1.5])
@pytest.mark.parametrize(("imbalance", "residual"), [(BALANCE, 0.0), (0.0, RESIDUAL), (BALANCE, RESIDUAL)])
def test_report_and_solver_accept_the_same_residuals(imbalance, residual, off):
    case = SimpleNamespace(imbalance=off * imbalance, residual=off * residual)
    found = SimpleNamespace(judgement=SimpleNamespace(cases={"load": case}, check=None))
    assert (Findings.balance_check(found).status == "pass") == accepted(case.imbalance, case.residual) == (off <= 1)


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
