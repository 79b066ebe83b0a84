"""`dsfab compare`: a design against others of the same mass under the same loads."""

import csv
import io
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from cyclopts import Parameter

from dsfab.app.build import Mesh, Quiet, Set, Unit, read_preset, versions
from dsfab.app.folder import whole_or_nothing
from dsfab.app.report import Reporter, length, mass, out, table
from dsfab.errors import DsfabError

if TYPE_CHECKING:
    from dsfab.preset import Preset
    from dsfab.study import Comparison
    from dsfab.study.competitors import Competitor
    from dsfab.study.judging import Judge

HEAD = ("structure", "variant", "mass", "kept", "compliance J", "over full", "over design", "moves", "pieces", "s")


def compare(
    preset: str,
    /,
    *,
    set_: Set = (),
    mesh: Mesh = None,
    unit: Unit = None,
    against: Annotated[
        str | None,
        Parameter(help="Comma list: isotropic, rotated, thinner, von_mises, grid, simp [isotropic,thinner]."),
    ] = None,
    volumes: Annotated[
        str | None, Parameter(help="LOW:HIGH:COUNT shares of the surface, such as 0.2:0.8:7: compare at each.")
    ] = None,
    buckling: Annotated[bool, Parameter(negative=(), help="Also the lowest load factor of each.")] = False,
    frequency: Annotated[bool, Parameter(negative=(), help="Also the lowest natural frequency of each.")] = False,
    output: Annotated[
        Path | None, Parameter(name=["-o", "--output"], help="Folder for the results [outputs/NAME/compliance].")
    ] = None,
    json_: Annotated[bool, Parameter(name="--json", negative=(), help="Print results.json, no table.")] = False,
    quiet: Quiet = False,
) -> int:
    """Compare a design with others of the same mass: a thinner full sheet, stripes that ignore the stress, and more.

    Each is solved on its own cut mesh under the same loads. The smaller the compliance, the stiffer. Writes results.csv
    and results.json, and with --volumes a chart of compliance over mass.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`) or a TOML file.
    """
    from dsfab.study.baselines import DEFAULT, chosen

    names = DEFAULT if against is None else tuple(word.strip() for word in against.split(",") if word.strip())
    chosen(names)
    shares = shares_of(volumes)
    given = read_preset(preset, set_, mesh, unit)
    folder = output if output is not None else Path("outputs") / given.name / "compliance"
    reporter = Reporter(quiet or json_)
    try:
        with whole_or_nothing(folder) as partial:
            found = _compared(given, names, shares, _judge(buckling, frequency), reporter)
            reporter("write", str(folder))
            document = _write(given, found, partial)
        reporter.done()
    finally:
        reporter.stop()
    if json_:
        out(document)
    elif not quiet:
        out("\n\n".join(_text(share, comparison) for share, comparison in found))
        out("one solve each on the cut mesh: fit for comparing, not a verdict on safety")
        files = ("results.csv", "results.json", *(("chart.svg", "chart.png") if len(shares) > 1 else ()))
        out("\n".join(f"  {folder / name}" for name in files))
    return 0


def shares_of(text: str | None) -> list[float]:
    """'0.2:0.8:7' -> seven shares; none for None. Raises DsfabError for anything else."""
    if text is None:
        return []
    try:
        low, high, count = text.split(":")
        shares = [round(float(share), 6) for share in np.linspace(float(low), float(high), int(count))]
    except ValueError:
        shares = []
    if not shares or not (min(shares) > 0 and max(shares) < 1):
        raise DsfabError(
            f"--volumes {text!r} is not LOW:HIGH:COUNT with shares between 0 and 1; write for instance 0.2:0.8:7"
        )
    return shares


def _judge(with_buckling: bool, with_frequency: bool) -> "Judge":
    from functools import partial

    from dsfab.statics import Ask
    from dsfab.study.judging import quick

    if not (with_buckling or with_frequency):
        return quick
    return partial(quick, ask=Ask(frequencies=int(with_frequency), buckling=int(with_buckling)))


def _compared(
    preset: "Preset", names: tuple[str, ...], shares: list[float], judge: "Judge", reporter: Reporter
) -> "list[tuple[float | None, Comparison]]":
    """The comparison at each share of the surface; without any, that of the design as it is."""
    from dsfab.pipeline import draft
    from dsfab.study import compare as compared
    from dsfab.study import compare_at
    from dsfab.study.sweeps.making import Making

    made = draft(preset, reporter)
    if not shares:
        reporter("compare", "solving the design")
        return [(None, compared(Making(made), names, judge, lambda name: reporter("compare", name)))]
    found: list[tuple[float | None, Comparison]] = []
    for share in shares:
        reporter("compare", f"{share:.0%} of the material: the design")
        told = lambda name, share=share: reporter("compare", f"{share:.0%} of the material: {name}")  # noqa: E731
        found.append((share, compare_at(made, share, names, judge, told)))
    return found


def _write(preset: "Preset", found: "list[tuple[float | None, Comparison]]", folder: Path) -> str:
    """results.csv and results.json, whose text is returned."""
    from dsfab.preset_file import preset_toml

    rows = [{"volume": share, **row} for share, one in found for row in one.record()["competitors"]]
    about = {"name": preset.name, "versions": versions(), "preset": preset_toml(preset)}
    document = json.dumps({**about, "competitors": rows}, indent=2)
    (folder / "results.json").write_text(document + "\n", encoding="utf-8")
    (folder / "results.csv").write_text(_csv(rows), encoding="utf-8", newline="")
    if len({row["volume"] for row in rows}) > 1:
        from dsfab.app.compare_chart import write_chart

        write_chart(rows, f"{preset.name}: compliance over mass", folder / "chart")
    return document


def _csv(rows: list[dict[str, Any]]) -> str:
    """A line each; points as 'x y z', reactions as JSON."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="")
    writer.writeheader()
    writer.writerows({key: _cell(value) for key, value in row.items()} for row in rows)
    return text.getvalue()


def _cell(value: Any) -> Any:
    if isinstance(value, tuple):
        return " ".join(f"{x:.9g}" for x in value)
    return json.dumps(value) if isinstance(value, dict) else value


def _text(share: float | None, result: "Comparison") -> str:
    """A table of those that carry the loads, then what is to be said in words."""
    lines = [] if share is None else [f"{share:.0%} of the material"]
    lines.append(table(HEAD, (_cells(one, result) for one in result.competitors if one.judgement)))
    for one in result.competitors:
        if one.error:
            lines.append(f"{one.name} does not carry the loads: {one.error}")
        elif one.spread:
            lines.append(_spread(one, result))
    for one in result.rivals:
        gain = result.gain(one.name)
        if one.judgement and result.design.judgement:
            best = "best " if one.spread else ""
            lines.append(f"the design is {gain:.3g} x as stiff as the {best}{one.name} structure of the same mass")
    return "\n".join(lines)


def _cells(one: "Competitor", result: "Comparison") -> tuple[str, ...]:
    gain = result.gain(one.name)
    moved = one.judgement.worst("displacement").value if one.judgement else float("nan")
    return (
        one.name,
        one.variant,
        mass(one.mass),
        f"{one.area_fraction:.1%}",
        f"{one.compliance:.4g}",
        f"{one.compliance / result.full.compliance:.2f}",
        f"{gain:.2f}" if result.design.judgement else "-",
        length(moved),
        str(one.pieces),
        f"{one.seconds:.1f}",
    )


def _spread(one: "Competitor", result: "Comparison") -> str:
    spread, full = one.spread, result.full.compliance
    assert spread is not None
    return (
        f"{one.name}: {spread.carried} of {spread.tried} variants carry the loads, from {spread.best / full:.3g} to "
        f"{spread.worst / full:.3g} x the full sheet, {spread.mean / full:.3g} x in the mean"
    )
