"""The report of `dsfab compare`: the same in HTML and in PDF, whole, offline, and true to results.json."""

import builtins
import json
import re
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest

from dsfab.app.cli import main
from dsfab.core.errors import DsfabError, ExportError, StaticsError
from dsfab.design import draft
from dsfab.preset.file import load_preset
from dsfab.render.lettering import PAPER, Legend, with_legend
from dsfab.render.opengl import require_rendering
from dsfab.report.compliance import figures, findings, sections, write_report
from dsfab.report.compliance.findings import Findings, percent, quantity, round_number_above, significant_digits, within
from dsfab.report.compliance.verdict_words import comparison_sentences, thinner_sheet_words, verdict_banner
from dsfab.report.html_pages import CaptionNumbers, Document, Paragraph, ReportSection, Table, document_html
from dsfab.report.pdf_pages import document_pdf
from dsfab.study import compare_at
from dsfab.study.comparison import comparison
from dsfab.study.judges import full, quick
from tests.app.pdf_text import pdf_drawings, pdf_pages, pdf_words

TIP = {"kind": "force", "at": {"pick": "ball", "center": [1, 0, 0], "radius": 0.1}}
CASES = {
    "surface.edge": 0.1,
    "surface.load": [{**TIP, "case": "down", "force": [0, -1000, 0]}, {**TIP, "case": "out", "force": [0, 0, 400]}],
    "surface.support": [{"at": {"pick": "side", "axis": "x", "end": "min"}, "hold": "xyz", "clamp": True}],
    "statics.bending": "midedge",
    "statics.thickness": 0.1,
    "slicing.snap": 0.2,
    "diffusion.follow": "down",
}

SECTIONS = (
    "Summary",
    "Checks",
    "The structure",
    "Loads and supports",
    "Compliance and its convergence",
    "Reactions and balance",
    "Other structures of the same mass",
    "Displacements and stress",
    "What was assumed",
    "What was not checked",
    "How reliable is the error bound?",
    "How to repeat the report",
)


class Reader(HTMLParser):
    """Checks that every tag is closed, and keeps text by element, addresses and tables."""

    VOID = ("meta", "img", "br", "hr", "link", "input")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []
        self.headings: list[str] = []
        self.rows: list[list[str]] = []
        self.text: list[str] = []

    def handle_starttag(self, tag, attributes):
        self.addresses += [value or "" for name, value in attributes if name in ("src", "href")]
        if tag not in self.VOID:
            self.open.append(tag)
        if tag == "h2":
            self.headings.append("")
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "style" in self.open:
            return
        self.text.append(data)
        if "h2" in self.open:
            self.headings[-1] += data
        if {"td", "th"} & set(self.open):
            self.rows[-1][-1] += data


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """A whole run by the command line, on a coarse mesh with two load cases."""
    folder = tmp_path_factory.mktemp("report")
    preset = folder / "two.toml"
    from dsfab.preset.file import preset_toml

    preset.write_text(preset_toml(load_preset("cantilever", CASES)))
    with pytest.MonkeyPatch.context() as patch:
        for name in ("SIZE", "SMALL"):
            patch.setattr(figures, name, (240, 180))
        assert main(["compare", str(preset), "--against", "thinner", "-o", str(folder / "out"), "--quiet"]) == 0
    return folder / "out"


@pytest.fixture(scope="module")
def read(told):
    reader = Reader()
    reader.feed((told / "report.html").read_text(encoding="utf-8"))
    assert reader.open == []
    return reader


@pytest.fixture(scope="module")
def drafted():
    return draft(load_preset("cantilever", {"surface.edge": 0.06}))


@pytest.fixture(scope="module")
def compared(drafted):
    return comparison((drafted), ("thinner",), full)


def test_html_has_every_section_in_order_and_fetches_nothing(read):
    assert [heading.lstrip("0123456789") for heading in read.headings] == list(SECTIONS)
    assert all(address.startswith("data:image/") for address in read.addresses)
    assert len(read.addresses) >= 6 - 5 * bool(_missing())  # design, two cases, chart, two fields


def test_loads_say_whether_a_case_was_checked(read):
    heads = [row for row in read.rows if "Pattern follows" in row]
    assert [row[-1] for row in heads] == ["Checked"]


def _missing() -> str:
    try:
        require_rendering()
    except DsfabError as error:
        return str(error)
    return ""


def test_the_report_lists_each_load_and_support_with_its_place_and_no_unset_value(read):
    table = read.rows[next(i for i, row in enumerate(read.rows) if "Where and how much" in row) :]
    said = [row[-1] for row in table if row[0].startswith(("Load", "Support"))][:3]
    assert len(said) == 3
    assert said[-1].startswith("side (axis x, end min")
    assert not any(word in text for text in said for word in ("name", "relative", "False", "None"))


def test_numbers_are_those_of_results_json(told, read):
    results = json.loads((told / "results.json").read_text())
    rows = {row["name"]: row for row in results["competitors"]}
    text = " ".join(read.text)
    design = rows["design"]
    assert within(design["compliance_J"], design["bound"], "J") in text
    table = next(row for row in read.rows if row[0] == "This design")
    scale = 1000 if design["compliance_J"] < 0.9995 else 1
    assert table[3] == f"{significant_digits(scale * design['compliance_J'])} ± {percent(design['bound'])}"
    assert float(table[4].replace(" ", "")) == pytest.approx(design["ratio_to_full"], rel=5e-3)
    assert table[7] == quantity(design["stress_99_Pa"], "Pa")
    levels = results["verdict"]["levels"]
    governing = results["verdict"]["cases"][0]["name"]
    shown = [row for row in read.rows if row[0].isdigit() and len(row) == 11]
    assert [int(row[1].replace(" ", "")) for row in shown] == [level["triangles"] for level in levels]
    for row, level in zip(shown, levels, strict=True):
        unit = 1000 if results["verdict"]["value"] < 0.9995 else 1
        assert float(row[3].replace(" ", "")) == pytest.approx(unit * level["compliance"][governing], rel=1e-4)


def test_the_governing_case_comes_first_and_reactions_of_each_case_balance(told, read):
    results = json.loads((told / "results.json").read_text())
    cases = results["verdict"]["cases"]
    assert {case["name"] for case in cases} == {"down", "out"}
    values = [case["value"] for case in cases]
    assert values == sorted(values, reverse=True)
    heads = [row for row in read.rows if row and row[0] in ("All supports", "Loads")]
    assert len(heads) == 4
    for held, load in zip(heads[::2], heads[1::2], strict=True):
        sums = [
            float(a.replace(" ", "")) + float(b.replace(" ", "")) for a, b in zip(held[1:4], load[1:4], strict=True)
        ]
        size = max(abs(float(cell.replace(" ", ""))) for cell in load[1:4])
        assert sums == pytest.approx([0, 0, 0], abs=2e-3 * size)


def test_pdf_says_the_same_as_html(told, read):
    data = (told / "report.pdf").read_bytes()
    assert data.startswith(b"%PDF-")
    pages = len(re.findall(rb"/Type /Page\b", data))
    words = pdf_words(data)
    assert pages >= 5
    assert f"{pages} / {pages}" in words
    for title in SECTIONS:
        assert title in words
    squeezed = re.sub(r"\s", "", words)
    for row in read.rows:
        if row[0] in ("This design", "Whole sheet, thinner", "Compliance", "Mass"):
            for cell in row:
                assert re.sub(r"\s", "", unescape(cell)) in squeezed


def test_sections_follow_each_other_on_pages(told):
    """Of a funicular's report pages 2, 5 and 8 of 13 held one table each."""
    pages = pdf_pages((told / "report.pdf").read_bytes())
    for table, title in (
        ("Key results", "Checks"),
        ("Load cases; the governing load case is first", "Other structures"),
    ):
        (page,) = (page for page in pages if table in page)
        assert title in page
    assert all(len(page.split()) > 60 for page in pages[:-1])


def test_letters_on_pictures_have_the_height_of_the_text_of_the_report():
    """Those of load cases beside each other were three points high."""
    from PIL import Image

    def high(size, letters):
        shade = Image.new("RGB", size, (255, 255, 255))
        with_legend(shade, Legend("", ["load"], 50.0), PAPER, letters)
        rows = np.flatnonzero((np.asarray(shade.crop((0, 0, size[0] // 2, size[1]))) < 128).any(axis=(1, 2)))
        return np.ptp(rows) + 1  # of letters with a stem

    for size, width in ((figures.SIZE, 0.86), (figures.SMALL, 0.7), (figures.SMALL, 0.5)):
        points = figures.TEXT * width / size[0]
        assert 5.0 < points * high(size, figures.letter_enlargement(size, width)) < 9.0
    assert high(figures.SMALL, 1.0) * figures.TEXT * 0.5 / figures.SMALL[0] < 4.0


class Scales(figures.FindingsPictures):
    """The colour scales of pictures, which are not drawn."""

    def _figure(self, *given):
        return given[-1]


@pytest.mark.parametrize("limit", [1.0, 1.3, 2.1, 4.4, 9.9])
def test_a_colour_scale_has_five_to_ten_bands_and_reaches_the_limit(limit):
    scale = Scales(None).band_figure("", None, None, np.array([limit]), limit * 1e6, "Pa", "stress")
    assert 5 <= len(scale.colours) <= 10
    assert float(scale.labels[-1]) >= limit


def test_two_runs_of_one_document_give_the_same_bytes():
    document = Document("Title", "Subject", [("a", "b")], [ReportSection("One", [Paragraph("words")])], "foot")
    assert document_pdf(document) == document_pdf(document)
    assert document_html(document) == document_html(document)


def test_text_and_tables_of_the_pdf_are_as_wide_as_the_line_at_its_foot():
    """18 mm from both sides of A4."""
    document = Document("Title", "Subject", [("a", "b")], [ReportSection("One", [Paragraph("word")])], "foot")
    (page,) = pdf_drawings(document_pdf(document))
    begins = {float(x) for x in re.findall(rb"1 0 0 1 (\S+) \S+ cm", page)} - {0.0}
    lines = [float(x) for x in re.findall(rb"n 0 \S+ m (\S+) \S+ l S", page)]
    assert sorted(begins) == [pytest.approx(18 / 25.4 * 72, abs=1e-3)]
    assert (lines[0], max(lines[1:])) == pytest.approx((174 / 25.4 * 72,) * 2, abs=1e-3)


def test_letters_that_are_not_western_are_set_and_markup_is_escaped():
    table = Table("t", ("Ωμέγα", "<b>n</b>"), [("Кровля", "1")])
    document = Document("Отчёт <i>", 'Δ "quoted" </style>', [], [ReportSection("a < b", [table])], "foot & all")
    assert b"DejaVu" in document_pdf(document)
    reader = Reader()
    reader.feed(document_html(document))
    assert reader.open == []
    assert "1a < b" in reader.headings


@pytest.mark.slow
def test_without_a_renderer_the_report_is_whole_and_says_so(tmp_path, capsys, monkeypatch):
    def broken() -> None:
        raise DsfabError("nothing to draw with; install it")

    monkeypatch.setattr("dsfab.render.opengl.require_rendering", broken)
    arguments = ["compare", "cantilever", "--set", "surface.edge=0.1", "--against", "", "--level", "quick"]
    assert main([*arguments, "-o", str(tmp_path / "out")]) == 0
    captured = capsys.readouterr()
    assert "no picture: nothing to draw with; install it" in captured.err
    assert "unknown: compliance" in captured.out
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "nothing to draw with" in text
    assert "To see the convergence on finer meshes" in text
    assert (tmp_path / "out" / "report.pdf").exists()


def test_without_reportlab_one_sentence_tells_and_the_rest_is_written(tmp_path, capsys, monkeypatch):
    real = builtins.__import__

    def refusing(name, *given, **named):
        if name.startswith("reportlab"):
            raise ImportError(name)
        return real(name, *given, **named)

    monkeypatch.setattr(builtins, "__import__", refusing)
    with pytest.raises(ExportError, match="needs reportlab, which is not installed"):
        document_pdf(Document("a", "b", [], [], "c"))


def test_a_stiffer_thinner_sheet_is_reported_in_plain_words(compared):
    found = Findings(compared, [], "dsfab compare cantilever")
    (told,) = comparison_sentences(found)
    assert told.startswith("Please note: a <b>whole sheet without openings, 5 mm thick</b>")
    assert found.claims[0].status == "fail"
    low, middle, high = found.stiffness_ratio(compared["thinner"])
    assert low < middle < high < 1
    assert middle == pytest.approx(compared.gain("thinner"))


@pytest.mark.slow
def test_a_stiffer_thinner_sheet_is_reported_at_all_volumes(drafted, compared):
    found = Findings(compared, [], "dsfab compare cantilever")
    at = [(share, compare_at(drafted, share, ("thinner",), full)) for share in (0.4, 0.7)]
    assert "At 40% and 70% of the material a thinner whole sheet" in thinner_sheet_words(replace(found, volumes=at))
    # one solve on the mesh of a whole sheet may be off by half: that decides nothing
    rough = [(0.7, compare_at(drafted, 0.7, ("thinner",)))]
    assert thinner_sheet_words(replace(found, volumes=rough)).startswith(
        "At 70% of the material, the error bounds of the design and of the thinner sheet overlap, so either may be "
        "stiffer."
    )
    stiff = replace(
        at[1][1], design=replace(at[1][1].design, judgement=replace(compared.design.judgement, compliance=1e-9))
    )
    assert thinner_sheet_words(replace(found, volumes=[(0.7, stiff)])).startswith("At every tried share of material")


def test_the_verdict_of_a_report_follows_its_checks(compared):
    found = Findings(compared, [], "")
    assert (found.status, verdict_banner(found).status) == ("pass", "pass")
    assert {one.name: one.status for one in found.checks}["Outline of the members"] == "note"
    judged = compared.design.judgement

    def with_case(**changes):
        cases = {name: replace(case, **changes) for name, case in judged.cases.items()}
        design = replace(compared.design, judgement=replace(judged, cases=cases))
        return Findings(replace(compared, design=design), [], "")

    assert with_case(utilisation=(1.2, 3.0)).status == "fail"
    assert with_case(utilisation=(0.8, 1.4)).status == "unknown"
    assert with_case(utilisation=(0.8, 0.9)).status == "pass"
    assert with_case(buckling=0.9).status == "fail"
    assert with_case(buckling=3.0).status == "unknown"
    assert with_case(buckling=findings.SAFE_BUCKLING_FACTOR).status == "pass"
    assert with_case(imbalance=1e-3).status == "fail"
    lost = replace(compared.design, judgement=replace(judged, verdict="fail", reason="case wind is lost"))
    assert "case wind is lost" in verdict_banner(Findings(replace(compared, design=lost), [], "")).text


def test_buckling_and_frequency_of_a_solid_are_lower_by_its_softness(compared):
    """A solid 1.25 times as soft has 20 % less buckling load and 11 % less frequency (its square root)."""
    judged = compared.design.judgement
    cases = {
        name: replace(
            case,
            buckling=1.1 * findings.SAFE_BUCKLING_FACTOR,
            buckling_bound=0.01,
            frequency=10.0,
            frequency_bound=0.01,
        )
        for name, case in judged.cases.items()
    }
    for theory, status in ((0.0, "pass"), (0.25, "unknown")):
        design = replace(compared.design, judgement=replace(judged, cases=cases, theory=theory))
        lines = {line.name: line for line in Findings(replace(compared, design=design), [], "").checks}
        assert lines["Buckling"].status == status
        assert ("about 20 % less as a solid" in lines["Buckling"].result) == bool(theory)
        assert ("about 11 % less as a solid" in lines["Lowest natural frequency"].result) == bool(theory)


def test_pictures_show_the_load_case_with_the_largest_stress_or_displacement(compared):
    """Not of the one that takes the most work, and the table says of which."""
    judged = compared.design.judgement
    most = judged.cases["load"]
    peak = replace(most.stress, quantile=2 * most.stress.quantile, away=2 * most.stress.settled)
    gust = replace(most, compliance=most.compliance / 2, stress=peak)
    sag = replace(most, compliance=most.compliance / 3, displacement=replace(most.displacement, value=1.0))
    cases = {"load": most, "gust": gust, "sag": sag}
    shown = replace(judged, check=None, cases=cases, solved={name: name for name in cases})
    found = Findings(replace(compared, design=replace(compared.design, judgement=shown)), [], "")
    assert found.cases[0] == "load"
    drawn = SimpleNamespace(displacement=lambda *given: given, stress=lambda *given: given)
    _, moved, stressed, table = sections.displacement_and_stress_section(found, drawn, CaptionNumbers()).blocks
    assert moved[:2] == ("sag", 1.0)
    assert "Displacements under sag" in moved[2]
    assert stressed[0] == "gust"
    assert "von Mises stress under gust: the largest" in stressed[1]
    assert table.rows[0][1] == quantity(peak.quantile, "Pa")
    assert "Stress under gust, on a mesh" in table.caption


def test_the_full_judge_tells_the_value_of_the_verdict_within_its_bound(drafted, compared):
    judged = compared.design.judgement
    assert judged.level == "full"
    assert judged.check.case("load").value == judged.compliance
    assert judged.bound == judged.check.bound <= 0.02
    assert judged.verdict == "pass"
    assert judged.theory == judged.check.theory
    known = replace(compared, design=replace(compared.design, judgement=replace(judged, theory=0.034)))
    told = Findings(known, [], "")
    assert "(thin-shell theory: a solid is up to 3.4 % softer than a thin sheet)" in verdict_banner(told).text
    assert {one.name: one.status for one in told.checks}["Within thin-shell theory"] == "note"
    rough = comparison((drafted), ()).design.judgement
    assert (rough.level, rough.verdict, rough.bound) == ("quick", "unknown", 0.05)
    assert rough.compliance == pytest.approx(judged.compliance, rel=0.05)


THIN = {"threshold": 0.8, "frequency": 4.0}
LOST = {"surface.edge": 0.1, "pattern": {"keep": 0.05, "major": THIN, "minor": THIN}}
"""The disc around the load touches nothing."""


def small(patch):
    for name in ("SIZE", "SMALL"):
        patch.setattr(figures, name, (240, 180))


def read_page(folder):
    reader = Reader()
    reader.feed((folder / "report.html").read_text(encoding="utf-8"))
    assert reader.open == []
    return reader, " ".join(reader.text)


def test_the_report_of_a_failing_design_gives_the_reason(tmp_path, capsys, monkeypatch):
    from dsfab.preset.file import preset_toml

    small(monkeypatch)
    (tmp_path / "lost.toml").write_text(preset_toml(load_preset("cantilever", LOST)), encoding="utf-8")
    out = tmp_path / "out"
    assert main(["compare", str(tmp_path / "lost.toml"), "--against", "thinner", "-o", str(out)]) == 5
    why = "acts on a piece of material that is not connected to a support"
    captured = capsys.readouterr().out
    assert captured.count(why) == 1
    assert "fail: the design does not carry its loads" in captured
    told = json.loads((out / "results.json").read_text(encoding="utf-8"))
    rows = {row["name"]: row for row in told["competitors"]}
    assert told["verdict"]["status"] == rows["design"]["verdict"] == "fail"
    assert why in told["verdict"]["reason"]
    assert rows["design"]["compliance_J"] is None
    assert rows["design"]["mass_kg"] == pytest.approx(rows["thinner"]["mass_kg"], rel=1e-3)
    reader, text = read_page(out)
    without = ("Compliance and its convergence", "Reactions and balance", "Displacements and stress")
    left = [title for title in SECTIONS if title not in (*without, "How reliable is the error bound?")]
    assert [heading.lstrip("0123456789") for heading in reader.headings] == left
    assert "Fail: the structure does not carry its loads" in text
    assert why in text
    assert next(row for row in reader.rows if row[0] == "This design")[3] == "carries nothing"
    assert next(row for row in reader.rows if row[0] == "Stiffer than: whole sheet, thinner")[-1] == "fail"
    assert "does not carry its loads" in pdf_words((out / "report.pdf").read_bytes())


@pytest.mark.slow
@pytest.mark.parametrize(("loose", "drawn"), [("drop", True), ("refuse", False)])
def test_a_competitor_that_is_a_mechanism_or_has_no_cut_fails_with_a_reason(tmp_path, monkeypatch, loose, drawn):
    def mechanism(task, structure, *_, **__):
        if structure.cells is not structure.sheet:
            raise StaticsError("the sheet is a mechanism: it turns about a hinge")
        return quick(task, structure)

    small(monkeypatch)
    made = draft(load_preset("cantilever", {**LOST, "slicing.loose": loose}))
    with pytest.raises(DsfabError):
        comparison(made, ("thinner",), mechanism)
    found = Findings(comparison(made, ("thinner",), mechanism, refuse=False), [], "dsfab compare x")
    assert (found.status, found.carries, found.has_structure) == ("fail", False, drawn)
    assert len(found.compared.rivals) == drawn
    write_report(found, [], tmp_path)
    _, text = read_page(tmp_path)
    assert ("The sheet is a mechanism: it turns about a hinge." in text) == drawn
    assert ("1 of 2 pieces reach no support" in text) != drawn


@pytest.mark.parametrize(
    ("value", "says"), [(0.09582, "95.8 mJ"), (12.344, "12.3 J"), (999.96, "1.00 kJ"), (0.0, "0 J"), (None, "n/a")]
)
def test_quantities_have_a_prefix_and_three_digits(value, says):
    assert quantity(value, "J") == says


def test_digits_follow_the_bound():
    assert within(59.93, 0.018, "J") == "59.9 J ± 1.8 %"
    assert within(59.93, 0.003, "J") == "59.93 J ± 0.3 %"
    assert significant_digits(5592.4) == "5 590"
    assert [round_number_above(value) for value in (0.9, 1.1, 2.2, 3.0, 6.0)] == [1.0, 2.0, 2.5, 5.0, 10.0]


def test_pictures_lose_empty_rows_only():
    paper = (255, 255, 255)
    pixels = np.full((400, 10, 3), 255, dtype=np.uint8)
    pixels[100:120] = pixels[300:310] = 0
    kept = figures.without_empty_rows(pixels, paper)
    assert (kept == 0).all(axis=(1, 2)).sum() == 30
    assert len(kept) < 120
    assert figures.without_empty_rows(pixels[:50], paper).shape == (50, 10, 3)
