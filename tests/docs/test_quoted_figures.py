"""Figures that pages quote are where `tests.benchmarks.quoted_figures` looks for them, and what is off is told."""

import pytest

from tests.benchmarks import quoted_figures
from tests.benchmarks.quoted_figures import Quoted, agrees, figures, main

WORDS = r"The floor is ([\d.]+) times as stiff as a plain"


def test_every_figure_stands_once_on_its_page():
    found = list(figures())
    assert len({(one.page, one.what) for one in found}) == len(found) > 25
    assert all(float(one.digits) > 0 for one in found)


@pytest.mark.parametrize(
    ("digits", "found", "within", "good"),
    [
        ("5.5", 5.4501, 0.0, True),
        ("5.5", 5.56, 0.0, False),
        ("135", 135.4, 0.0, True),
        ("135", 136.4, 0.0, False),
        (".99", 0.9951, 0.0, False),
        (".99", 0.9951, 0.01, True),
        ("1.0", float("nan"), 0.5, False),
    ],
)
def test_a_value_agrees_if_it_rounds_to_the_quoted_figure(digits, found, within, good):
    assert agrees(digits, found, within) is good


@pytest.mark.parametrize(("found", "status"), [(5.9, 0), (6.5, 1)])
def test_a_quoted_figure_that_differs_is_reported(found, status, monkeypatch, capsys):
    """And what takes minutes is left out, unless it is asked for."""
    quick = Quoted(quoted_figures.CASES, "ribs", WORDS, lambda: found)
    long = Quoted(quoted_figures.CASES, "ribs, long", WORDS, lambda: 1.0 / 0.0, minutes=True)
    monkeypatch.setattr(quoted_figures, "figures", lambda: iter((quick, long)))
    monkeypatch.setattr("sys.argv", ["quoted_figures", "case"])
    assert main() == status
    assert ("off" in capsys.readouterr().out) is bool(status)


def test_a_figure_that_a_page_no_longer_quotes_is_reported_with_the_page():
    with pytest.raises(ValueError, match=r"docs/trust\.md says \[\] of ribs"):
        Quoted(quoted_figures.TRUST, "ribs", WORDS, lambda: 1.0).digits  # noqa: B018
