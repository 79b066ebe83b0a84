"""The page of `dsfab verify --page`: complete, offline, and the same every time."""

import re
from html.parser import HTMLParser
from xml.etree import ElementTree

import pytest

from dsfab.app.cli import main
from dsfab.verification import TESTS, verify
from dsfab.verification.page import page

NAMES = ("cook", "patch_shear", "bent_strip_1000")


@pytest.fixture(scope="module")
def text() -> str:
    tests = [TESTS[name] for name in NAMES]
    return page(tests, list(verify(tests)))


class Tags(HTMLParser):
    """Start and end tags must match; `meta` and `path` style ones may be empty."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.external: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.external += [f"{k}={v}" for k, v in attrs if k in ("src", "href") and not v.startswith("#")]
        if tag != "meta":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_the_page_is_whole_and_needs_no_net(text):
    tags = Tags()
    tags.feed(text.removeprefix("<!doctype html>"))
    assert tags.open == []
    assert tags.external == []
    assert "prefers-color-scheme: dark" in text
    assert "@media print" in text
    assert not re.search(r"20\d\d-\d\d-\d\dT|<script|@import|url\(http", text)


def test_every_test_has_its_section_drawing_plot_and_numbers(text):
    sections = text.split("<section")[1:]
    assert [re.match(r' id="(\w+)"', section)[1] for section in sections] == list(NAMES)
    drawn = [re.findall(r"<svg.*?</svg>", section, flags=re.DOTALL) for section in sections]
    assert [len(pictures) for pictures in drawn] == [2, 1, 2]
    for picture in (picture for pictures in drawn for picture in pictures):
        ElementTree.fromstring(picture.replace("xlink:", ""))
        assert "currentColor" in picture
        assert "#010203" not in picture
    assert ">0.9924<" in sections[0]
    assert ">0.1<" in drawn[0][1]
    assert "constant strain triangle" in sections[0]
    assert "falls short" in sections[0]
    assert ">1.5 % met<" in sections[2]


def test_the_page_is_the_same_every_time(text):
    tests = [TESTS[name] for name in NAMES]
    assert page(tests, list(verify(tests))) == text


def test_the_command_writes_the_page_into_a_folder(tmp_path, capsys):
    assert main(["verify", "patch_shear", "--page", "-o", str(tmp_path / "sub")]) == 0
    assert 'id="patch_shear"' in (tmp_path / "sub" / "index.html").read_text()
    assert "patch_shear" in capsys.readouterr().out
    (tmp_path / "file").write_text("")
    assert main(["verify", "patch_shear", "--page", "-o", str(tmp_path / "file")]) == 1
    assert "cannot write to" in capsys.readouterr().err
