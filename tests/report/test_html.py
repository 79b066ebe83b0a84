"""The kit of all pages: one frame, one style, and colours that can be read."""

from types import SimpleNamespace

import numpy as np
import pytest

from dsfab.report.compliance.tables import reactions_table
from dsfab.report.html_pages import (
    COLOURS,
    CaptionNumbers,
    Document,
    ReportSection,
    Table,
    document_html,
    html_page,
    image_tag,
    page_style,
    reason_paragraph,
)
from tests.browser import browser, opened


def luminance(colour):
    """Relative luminance of sRGB [WCAG 2.2]."""
    parts = [c / 255 for c in colour]
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


@pytest.mark.parametrize("name", ["text", "quiet", "blue", "good", "bad", "open"])
@pytest.mark.parametrize("under", ["paper", "tint"])
def test_words_stand_out_from_the_paper(name, under):
    """At least 4.5 : 1, which WCAG asks of small text (level AA)."""
    light, dark = luminance(COLOURS[under]), luminance(COLOURS[name])
    assert (light + 0.05) / (dark + 0.05) >= 4.5


def test_a_page_is_one_file_with_the_common_style_before_its_own():
    text = html_page("a < b", "<p>body</p>", "p { margin: 0; }")
    assert "<title>a &lt; b</title>" in text
    assert f"<style>{page_style()}p {{ margin: 0; }}</style>" in text
    assert "<p>body</p>" in text
    assert "http" not in text
    assert all(f"--{name}: rgb{colour};" in text for name, colour in COLOURS.items())


def test_captions_and_alternative_texts_are_escaped():
    assert image_tag("a.png", 'wide "vault" <b>', (3, 2)) == (
        '<img src="a.png" alt="wide &quot;vault&quot; &lt;b&gt;" width="3" height="2" loading="lazy">'
    )
    assert reason_paragraph("no <mesh>") == '<p class="why">no &lt;mesh&gt;</p>'


@pytest.mark.skipif(browser() is None, reason="no Chromium is installed")
def test_a_table_with_long_heads_fits_a_telephone(tmp_path):
    """And its caption is broken where the screen ends, also of one that has to be scrolled."""
    heads = ["Stress", "on 99 % of the area", "away from corners by a rib's width", "what this mesh shows"]
    tables = [
        Table("Largest principal stress of the top, the middle and the bottom of the sheet.", heads, [cells])
        for cells in (
            ["von Mises", "1.72 MPa", "4.01 MPa", "7.15 MPa"],
            ["tension", *["1,000 by 1,000 by 1,000 mm"] * 3],
        )
    ]
    path = tmp_path / "report.html"
    path.write_text(
        document_html(Document("Report", "Leaf", [], [ReportSection("Stress", tables)], "")), encoding="utf-8"
    )
    with opened(tmp_path) as tab:
        tab.call("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=1, mobile=True)
        tab.open(path.as_uri(), "document.readyState === 'complete'")
        found = tab.run(
            "[...document.querySelectorAll('.table')].map((t) => "
            "[t.scrollWidth > t.clientWidth, t.querySelector('caption').getBoundingClientRect().right < innerWidth])"
        )
    assert found == [[False, True], [True, True]]


@pytest.mark.skipif(browser() is None, reason="no Chromium is installed")
def test_heads_are_broken_before_columns_are_cut_off_on_a_sheet_of_paper(tmp_path):
    numbers = {"Mass": "62.3 t", "Kept": "100.0 %", "Compliance, J": "77.9 J ± 50 %", "/ whole sheet": "0.756"}
    numbers |= {"/ design": "0.581", "Moves": "0.478 mm", "99 % stress": "11.8 MPa", "Level": "quick"}
    heads, cells = ["Structure", *numbers], ["Thinner", *numbers.values()]
    table = Table("Others of the same mass.", heads, [cells])
    path = tmp_path / "report.html"
    path.write_text(
        document_html(Document("Report", "Leaf", [], [ReportSection("Others", [table])], "")), encoding="utf-8"
    )
    with opened(tmp_path, (1280, 900)) as tab:
        tab.open(path.as_uri(), "document.readyState === 'complete'")
        assert tab.run("[...document.querySelectorAll('.table')].every((t) => t.scrollWidth <= t.clientWidth)")


def test_reactions_far_below_the_loads_are_reported_as_zero():
    """Of a canopy whose supports carry 346 kN, all together were said to push by 0.0002756 kN."""
    case = SimpleNamespace(reactions=[[133e3, 2.2, 346e3], [-133e3, -2.0, 0]], imbalance=2e-6, residual=7e-9)
    supports = [SimpleNamespace(name="foot 1"), SimpleNamespace(name="")]
    found = SimpleNamespace(
        judgement=SimpleNamespace(cases={"load": case}),
        fields={"load": SimpleNamespace(load=SimpleNamespace(force=np.array([[0, 0, -346e3]])))},
        cases=["load"],
        task=SimpleNamespace(preset=SimpleNamespace(surface=SimpleNamespace(support=supports))),
    )
    rows = reactions_table(found, "load", CaptionNumbers()).rows
    assert [row[1:4] for row in rows[:3]] == [("133.0", "0", "346.0"), ("-133.0", "0", "0"), ("0", "0", "346.0")]
    assert [row[4:] for row in rows] == [("133.0", "0"), ("133.0", "-180"), ("0", "-"), ("0", "-")]
    assert rows[3][:4] == ("Loads", "0", "0", "-346.0")
