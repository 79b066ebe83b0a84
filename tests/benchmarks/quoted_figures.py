"""Figures that pages quote, beside what the code gives now: `python -m tests.benchmarks.quoted_figures [PAGE ...]`.

A figure is read from its page by the words around it, so that page and table cannot differ, and is made again as the
page says. It agrees where it rounds to what is quoted, or is within the share that is named. PAGE is a part of a
page's name. `--full` makes what takes minutes too. Exit status 1 where a figure is off.

Other figures are held by tests: lines that case studies and lesson print (docs/test_docs.py), the canopy beside modes
(study/test_canopy.py), the table of solids (study/test_theory.py), the cantilever's targets (design/test_targets.py).
"""

import argparse
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import dsfab
from dsfab.core.messages import table
from dsfab.design import Design
from dsfab.study.comparison import Comparison
from tests.benchmarks import against_simp

ROOT = Path(__file__).resolve().parents[2]
CASES, TRUST, PYTHON, PATTERNS = (f"docs/{name}.md" for name in ("case-studies", "trust", "python", "patterns"))
HEAD = ("page", "figure", "quoted", "found", "")


@dataclass(frozen=True)
class Quoted:
    """A figure.

    page  : below the repository.          words : what stands around it, its digits as one group.
    what  : in words.                      found : makes it again, in the page's unit.
    within: share by which it may be off, beside half of the last digit that is quoted.   minutes : only with --full.
    """

    page: str
    what: str
    words: str
    found: Callable[[], float]
    within: float = 0.0
    minutes: bool = False

    @property
    def digits(self) -> str:
        """As the page has it. Raises ValueError where it does not say so once."""
        text = " ".join((ROOT / self.page).read_text(encoding="utf-8").split())
        said = re.findall(self.words, text)
        if len(set(said)) != 1:
            raise ValueError(f"{self.page} says {said} of {self.what}, not one figure; look at its words here")
        return str(said[0])

    def agrees(self, found: float) -> bool:
        """Whether a value is what the page says."""
        return agrees(self.digits, found, self.within)


def agrees(digits: str, found: float, within: float = 0.0) -> bool:
    """Whether a value rounds to digits that are quoted, or is off by no more than a share of them."""
    last = 10.0 ** -len(digits.partition(".")[2])
    return abs(found - float(digits)) <= max(0.5 * last * (1 + 1e-9), within * abs(float(digits)))


@cache
def design(name: str) -> Design:
    """As far as it is asked for."""
    return Design.from_preset(dsfab.load_preset(name))


@cache
def quick(name: str) -> Comparison:
    """By one solve."""
    return dsfab.compare(design(name), level="quick")


@cache
def full(name: str) -> Comparison:
    """With bounds: minutes."""
    return dsfab.compare(design(name))


def gain(made: Callable[[str], Comparison], name: str, rival: str) -> Callable[[], float]:
    """How much softer a competitor is."""
    return lambda: made(name).gain(rival)


def tonnes(name: str, uncut: bool = False) -> Callable[[], float]:
    """Of the design, or of the sheet that it is cut from."""
    return lambda: (quick(name).full if uncut else quick(name).design).mass / 1000


def uncut(name: str) -> Callable[[], float]:
    """Compliance of the whole surface as the pattern follows it, joules."""
    return lambda: quick(name).full.compliance


def beams(name: str) -> Callable[[], float]:
    """Compliance of the beam model over that of the sheet: the largest of all cases."""
    return lambda: max((one.compliance for one in design(name).frame_agreement()), key=lambda ratio: abs(ratio - 1))


def over_simp(name: str, share: float) -> Callable[[], float]:
    """Compliance of what `method = "auto"` finds over that of topology optimisation."""
    return lambda: float(tuple(against_simp.row(name, share, None))[against_simp.HEAD.index("ratio")])


def beam_table() -> Iterator[Quoted]:
    """The row of `docs/trust.md`."""
    names = re.findall(r"^\| (tower \|.*) \|$", (ROOT / TRUST).read_text(encoding="utf-8"), flags=re.M)
    before = r"\| tower [a-z_ |]+\|[-|]+ \| "
    for name in (cell.strip() for cell in names[0].split("|")):
        yield Quoted(TRUST, f"beams of {name} over its sheet", before + r"([\d.]+) \|", beams(name), 0.005)
        before += r"[\d.]+ \| "


def figures() -> Iterator[Quoted]:
    """All that is made again."""
    yield Quoted(CASES, "slab, tonnes", r"floors of the same mass, ([\d.]+) t", tonnes("slab"))
    yield Quoted(
        CASES, "slab over thinner", r"The floor is ([\d.]+) times as stiff as a plain", gain(quick, "slab", "thinner")
    )
    yield Quoted(
        CASES,
        "slab, thinner, mm",
        r"plain slab of ([\d.]+) mm",
        lambda: 1000 * quick("slab")["thinner"].structure.thickness,
    )
    yield Quoted(
        CASES,
        "grid over slab",
        r"best of four straight grids has ([\d.]+) times",
        lambda: dsfab.compare(design("slab"), ("grid",), level="quick").gain("grid"),
    )
    yield Quoted(CASES, "dome's sheet, t", r"The uncut sheet weighs ([\d.]+) t", tonnes("dome", uncut=True))
    yield Quoted(CASES, "dome's sheet, J", r"t and has a compliance of ([\d.]+) J", uncut("dome"))
    yield Quoted(CASES, "dome, t", r"0\.62 %, ([\d.]+) t; converged", tonnes("dome"))
    yield Quoted(
        CASES,
        "dome, J, with a bound",
        r"pass: compliance ([\d.]+) J",
        lambda: full("dome").design.compliance,
        0.0,
        True,
    )
    words = r"the design is ([\d.]+) x as stiff as the thinner"
    yield Quoted(CASES, "dome over thinner", words, gain(full, "dome", "thinner"), 0.0, True)
    yield Quoted(CASES, "dome over thinner, one solve", words, gain(quick, "dome", "thinner"), 0.06)
    words = r"best of nine such patterns is about ([\d.]+) times as soft"
    yield Quoted(CASES, "dome over isotropic, one solve", words, gain(quick, "dome", "isotropic"))
    yield Quoted(PYTHON, "beams of pavilion", r"For `pavilion` the beam model has ([\d.]+)", beams("pavilion"), 0.005)
    yield from beam_table()
    yield Quoted(
        "docs/eurocode.md",
        "gridshell, % of what laths bear",
        r"uses about (\d+) % of their",
        lambda: 100 * max(design("gridshell").member_utilisation.by_member.values()),
        0.01,
    )
    for name, share, words in (
        ("bracket", 0.5, r"is ([\d.]+) \(L-bracket\)"),
        ("bracket", 0.3, r"at 30 % they are ([\d.]+),"),
        ("hole", 0.5, r"([\d.]+) \(plate with a hole\)"),
        ("hole", 0.3, r"they are [\d.]+, ([\d.]+) and"),
        ("arch", 0.5, r"([\d.]+) \(wall over an arch\)"),
        ("arch", 0.3, r"they are [\d.]+, [\d.]+ and (\d+\.\d+)"),
    ):
        yield Quoted(PATTERNS, f"{name} at {share:.0%} over SIMP", words, over_simp(name, share), 0.02, True)


def rows(pages: list[str], every: bool) -> Iterator[tuple[str, ...]]:
    """Of the table, each as soon as it is known."""
    for one in figures():
        if (every or not one.minutes) and (not pages or any(page in one.page for page in pages)):
            value = one.found()
            yield one.page, one.what, one.digits, f"{value:.4g}", "" if one.agrees(value) else "off"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pages", nargs="*", metavar="PAGE", help="all when left out")
    parser.add_argument("--full", action="store_true", help="with what takes minutes")
    given = parser.parse_args()
    made = list[tuple[str, ...]]()
    try:
        for row in rows(given.pages, given.full):
            made.append(row)
            print(*row, flush=True)
    except ValueError as error:
        sys.exit(str(error))
    print(table(HEAD, made))
    return int(any(row[-1] for row in made))


if __name__ == "__main__":
    sys.exit(main())
