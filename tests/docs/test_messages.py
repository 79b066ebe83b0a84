"""The page of messages is true: each of them comes, word by word, from the command that its reader would have typed."""

import re
from pathlib import Path

import ezdxf
import pytest

from dsfab.app.cli import main

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "messages.md").read_text(encoding="utf-8")
MISTAKES, _, NOTES = PAGE.partition("## Notes")

NAIL = 'surface.support=[{at={pick="nearest",points=[[0,0,4]]},hold="xyz"}]'
FAR = 'surface.support=[{at={pick="ball",center=[50,0,0],radius=1},hold="xyz"}]'
COMMANDS = {
    "has the suffix": "build roof.dwg",
    "does not exist": "build kirchendach.obj",
    "is empty": "build empty.obj",
    "no visible part": "build miles.dxf --only Rof",
    "and no faces": "build points.obj",
    "is in miles": "build miles.dxf",
    "has steps of": "build far.off",
    "parts touch in a point inside the surface": "build corner.obj",
    "would move": "build dome --set statics.young=1e7",
    "which is impossible": "build dome --set statics.thickness=60",
    "touch no support": "build two.obj --set surface.support=[{at={pick='boundary',loop=0},hold='xyz'}]",
    "would give about": "build dome --set surface.edge=0.001",
    "not found": "build domme",
    "is not valid TOML": "build unquoted.toml",
    "unknown key": "build dome --set pattern.spaceing=3",
    "should be greater": "build dome --set statics.thickness=0",
    "should be 'modes'": "build dome --set pattern.method=mode",
    "is not KEY=VALUE": "build dome --set spacing",
    "is not known; use one of S235": "build dome --set statics.material=steel",
    "has no support": "build dome --set surface.support=[]",
    "has no load": "build dome --set surface.load=[]",
    "picks no vertex": f"build dome --set {FAR}",
    "can turn about": f"build dome --set {NAIL}",
    "is too fine": "build dome --set pattern.major.spacing=0.01",
    "cannot keep": "build dome --set pattern.width.solid_fraction=0.01",
    "cannot write": "build dome -o empty.obj",
    "Unknown option": "build dome --to step",
    "does not write": "build dome --format dwg",
    "is not a scale": "workshop dome --model 1-50",
    "fits on the stock": "workshop dome --set workshop.stock=[0.2,0.1]",
}
"""Of what each message says, and the command that brings it."""

SLOW = ("fits on the stock", "cannot keep")


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """A folder with files that are broken in the usual ways."""
    two = "".join(f"v {x} {y} 0\n" for x, y in ((0, 0), (1, 0), (0, 1), (5, 5), (6, 5), (5, 6))) + "f 1 2 3\nf 4 5 6\n"
    corners = "0 0 0", "1 0 0", "0 1 0", "0 0 1", "-1 0 0", "0 -1 0", "0 0 -1"
    faces = "1 3 2", "1 2 4", "1 4 3", "2 3 4", "1 5 6", "1 7 5", "1 6 7", "5 7 6"
    texts = {
        "far.off": "OFF\n3 1 0\n691234 0 0.1\n691235 0 0.1\n691234 1 0.1\n3 0 1 2\n",
        "corner.obj": "".join([*(f"v {point}\n" for point in corners), *(f"f {face}\n" for face in faces)]),
        "roof.dwg": "AC1032",
        "empty.obj": "",
        "points.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\n",
        "two.obj": two,
        "unquoted.toml": "name = dome\n",
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    drawing = ezdxf.new(units=3)
    drawing.modelspace().add_3dface([(0, 0), (1, 0), (1, 1)])
    drawing.saveas(tmp_path / "miles.dxf")
    monkeypatch.chdir(tmp_path)
    return {*texts, "miles.dxf"}


def listed(part: str) -> list[str]:
    """The messages of a part of the page."""
    return re.findall(r"^`([^`]+)`\n:", part, flags=re.MULTILINE)


def test_there_is_a_command_for_each_message():
    found = [[text for text in listed(MISTAKES) if words in text] for words in COMMANDS]
    assert [len(one) for one in found] == [1] * len(COMMANDS)
    assert len(listed(MISTAKES)) == len(COMMANDS)


@pytest.mark.parametrize(
    "words", [pytest.param(words, marks=[pytest.mark.slow] * (words in SLOW)) for words in COMMANDS]
)
def test_each_message_comes_word_by_word(words, desk, capsys):
    (told,) = [text for text in listed(MISTAKES) if words in text]
    command, *rest = COMMANDS[words].split(" ")
    assert main([command, *rest]) != 0
    err = capsys.readouterr().err
    assert re.search(".*".join(re.escape(part.strip()) for part in told.split("…")), err), err
    assert {path.name for path in Path().iterdir()} - {"outputs"} == desk, "something was left behind"


def test_each_note_is_one_that_the_code_can_write():
    code = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "dsfab").rglob("*.py"))
    code = re.sub(r'"\s*\n\s*f?"', "", code)  # sentences over several lines
    code = re.sub(r"\{[^{}]*\}", "…", code)
    for told in listed(NOTES):
        for part in told.split("…"):
            assert part.strip() in code, told
