"""The site of docs/: it builds, needs no other host, is found by search, and can be read by all."""

import importlib.util
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.browser import browser, opened

ROOT = Path(__file__).resolve().parents[2]
AUDIT = (Path(__file__).parents[1] / "page_audit.js").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site in a folder, built without a warning: links, anchors and pages are checked by mkdocs, `strict`."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "-q", "-f", str(ROOT / ".mkdocs.yml"), "-d", str(folder)]
    made = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"})
    assert made.returncode == 0, made.stderr
    assert not re.search("WARNING|ERROR", made.stderr), made.stderr
    return folder


@pytest.mark.slow
def test_the_site_asks_no_other_host_for_anything(site):
    """Fonts, scripts and pictures lie in the folder, and pictures have words for whoever does not see them."""
    pages = sorted(site.glob("*.html"))
    assert {"index.html", "ten-minutes.html", "reference-presets.html", "gallery.html"} <= {page.name for page in pages}
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"""(?:src|<link[^>]*href)=["'](?:https?:)?//""", text), page.name
        for picture in re.findall(r'<img[^>]*?src="([^"]+)"', text):
            assert (site / picture).is_file(), (page.name, picture)
        assert all('alt=""' not in image and "alt=" in image for image in re.findall(r"<img[^>]*>", text)), page.name


@pytest.fixture(scope="module")
def glossary():
    """The module that links words to the glossary."""
    spec = importlib.util.spec_from_file_location("glossary", ROOT / "docs" / "_build" / "glossary.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_first_use_of_a_term_leads_to_the_glossary(glossary):
    text = "# Mesh\n\n`mesh` ![a mesh](mesh.png) two meshes of one mesh, dead ends, boundaries: a keeper in each case\n"
    found = glossary.linked(text)
    assert re.findall(r"\[([^]]+)\]\(concepts\.md#([a-z-]+)\)", found) == [
        ("meshes", "mesh"),
        ("dead ends", "dead-end"),
        ("boundaries", "boundary"),
    ]
    assert re.sub(r"\[([^]]+)\]\(concepts\.md#[a-z-]+\)\{ \.term \}", r"\1", found) == text


def test_every_page_for_beginners_has_its_words_linked(glossary):
    """But those that are made from the code, or for engineers and contributors."""
    others = {"concepts.md", "examples.md", "theory.md", "contributing.md"}
    there = {path.name for path in (ROOT / "docs").glob("*.md")} | {"index.md"}
    assert there - others == glossary.PAGES
    assert set(glossary.TERMS) > glossary.EVERYDAY


@pytest.mark.slow
def test_contributors_see_the_architecture_and_the_benchmarks(site):
    page = (site / "contributing.html").read_text(encoding="utf-8")
    assert "──► export" in page
    assert all(f"<code>{path.stem}</code>" in page for path in (ROOT / "tests/benchmarks").glob("s*.py"))


@pytest.mark.slow
def test_links_to_the_glossary_arrive(site):
    terms = set(re.findall(r'<strong id="([a-z-]+)"', (site / "concepts.html").read_text(encoding="utf-8")))
    used = {
        term
        for page in site.glob("*.html")
        for term in re.findall(r'href="concepts\.html#([a-z-]+)"', page.read_text(encoding="utf-8"))
    }
    assert len(used) > 10
    assert used <= terms


FOUND = "document.querySelectorAll('.md-search-result__item').length"
ASK = """(() => {
  const field = document.querySelector('.md-search__input');
  field.focus(); field.value = 'halving'; field.dispatchEvent(new Event('keyup', {bubbles: true}));
})()"""


@pytest.mark.slow
def test_search_works_from_the_folder_without_a_server(site, tmp_path):
    if browser() is None:
        pytest.skip("no Chromium is installed")
    with opened(tmp_path) as tab:
        tab.open((site / "index.html").as_uri(), "!!document.querySelector('.md-search__input')")
        deadline = time.monotonic() + 30
        while not tab.run(FOUND) and time.monotonic() < deadline:
            tab.run(ASK)
            time.sleep(0.3)
        assert tab.run(FOUND) > 0
        assert [request for request in tab.requests if not request.startswith(("file:", "blob:", "data:"))] == []


STILL = """(() => {
  const sheet = document.createElement('style');
  sheet.textContent = '* { transition: none !important }';
  document.head.append(sheet);
})()"""


@pytest.mark.slow
def test_every_page_can_be_read_on_a_screen_and_on_a_telephone_by_day_and_by_night(site, tmp_path):
    """Nothing is wider than the window, headings are in order, pictures are there and have words, text has contrast."""
    if browser() is None:
        pytest.skip("no Chromium is installed")
    wrong = []
    with opened(tmp_path) as tab:
        for page in sorted(site.glob("*.html")):
            if page.name == "404.html":
                continue
            tab.open(page.as_uri(), "document.readyState === 'complete'")
            tab.run(STILL)
            for width in (1440, 390):
                tab.call(
                    "Emulation.setDeviceMetricsOverride",
                    width=width,
                    height=900,
                    deviceScaleFactor=1,
                    mobile=width < 500,
                )
                for scheme in ("default", "slate"):
                    tab.run(f"document.body.setAttribute('data-md-color-scheme', '{scheme}')")
                    wrong += [f"{page.name}, {width}, {scheme}: {what}" for what in tab.run(AUDIT)]
    assert wrong == []


def test_the_audit_of_pages_finds_planted_faults(tmp_path):
    if browser() is None:
        pytest.skip("no Chromium is installed")
    (tmp_path / "bad.html").write_text(
        "<article><h1>a</h1><h3>b</h3><p style='color: #999; background: #fff; width: 3000px'>pale</p>"
        "<img src='none.png'></article>",
        encoding="utf-8",
    )
    with opened(tmp_path) as tab:
        tab.open((tmp_path / "bad.html").as_uri(), "document.readyState === 'complete'")
        found = " ".join(tab.run(AUDIT))
    for what in ("wider than the window", "a heading is skipped", "picture", "2.85 P"):
        assert what in found
