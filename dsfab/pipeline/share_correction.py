"""Stripes are a little narrower than asked, for round corners and filled openings add to what they keep."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from dsfab.preset import Width
from dsfab.results import PatternResult

SHARE_TOLERANCE = 4e-4
"""How closely pattern.width.solid_fraction is reached, as a share of the surface."""

UNSAID = 2 * SHARE_TOLERANCE
"""What it is missed by so little is not worth a word."""

CORRECTIONS = 3
"""Rounds at most in which it is corrected by what round corners and filled openings add."""

HALVINGS, SOME = 8, 3
"""Rounds at most in which it is looked for where that leads astray, since openings close: while it is not allowed, and
while it is worth a word."""


class _Try(NamedTuple):
    """Stripes that were to keep `aim` of the surface, what is added to it, what both are, and they themselves."""

    aim: float
    added: float
    total: float
    result: PatternResult


def corrected(
    width: Width,
    made: Callable[[float, float], PatternResult],
    nearest: Callable[[float], float],
    added: Callable[[PatternResult], float],
    bridged: Callable[[], float],
) -> tuple[PatternResult, float]:
    """Stripes that keep what is asked together with round corners and filled openings, and the share that this is.

    made    : the stripes for a share that is added to them, and a guess of their factor, 0 for none.
    nearest : the share that the last ones keep, near one.    added : what is added to them.
    bridged : what bridges add to the last ones besides. That takes long, and is mostly nothing: it is asked once those
              without it are known, and ever after where it is something.

    What is added changes little with the widths, so it is taken off what the stripes are to keep. Where it jumps,
    since openings close, that leads astray: then the answer is looked for between one that keeps less and one that
    keeps more.
    """
    wanted, allowed = width.solid_fraction, width.solid_fraction_tolerance
    tries = list[_Try]()
    bridges = 0.0

    def attempt(taken: float, guess: float = 0.0) -> _Try:
        result = made(taken, guess)
        more = added(result) + (bridged() if bridges else 0.0)
        tries.append(_Try(wanted - taken, more, nearest(wanted - taken) + more, result))
        return tries[-1]

    def settled(last: _Try) -> _Try:
        for _ in range(CORRECTIONS):
            if any(abs(one.aim + last.added - wanted) < SHARE_TOLERANCE for one in tries):
                break  # it is known what the next would be: where a bridge comes and goes, that of the last but one
            last = attempt(last.added, last.result.factor)
        return last

    last = settled(attempt(0.0))
    if (bridges := bridged()) > SHARE_TOLERANCE:
        last = tries[-1] = last._replace(added=last.added + bridges, total=last.total + bridges)
        tries[:-1] = []  # nothing is known of their bridges
        last = settled(last)
    for k in range(HALVINGS):
        near = max(allowed, UNSAID) if k >= SOME else UNSAID
        if min(abs(one.total - wanted) for one in tries) <= near or not (between := _between(tries, wanted)):
            break
        last = attempt(wanted - between, last.result.factor)
    if abs(last.total - wanted) > UNSAID:
        last = min(tries, key=lambda one: abs(one.total - wanted))
    return last.result, last.total if abs(last.total - wanted) > UNSAID else wanted


def _between(tries: Sequence[_Try], wanted: float) -> float:
    """What to aim at next: the middle of the nearest two tries of which one keeps too little and one too much.

    0 where there are none, or nothing new lies between them.
    """
    pairs = [(abs(a.aim - b.aim), (a.aim + b.aim) / 2) for a in tries for b in tries if a.total < wanted < b.total]
    gap, middle = min(pairs, default=(0.0, 0.0))
    return middle if gap > SHARE_TOLERANCE / 16 else 0.0
