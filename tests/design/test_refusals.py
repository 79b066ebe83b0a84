"""Bad input of every kind, typed as a user would type it: one sentence, exit code 1, no traceback, nothing left behind.

The list below is the place to look for what dsfab refuses; each entry is a file or an option and words of its sentence.
"""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from dsfab import load_preset
from dsfab.app.cli import main
from dsfab.core.errors import StaticsError
from dsfab.design import draft
from dsfab.statics import factorisation, solve
from dsfab.surface import Surface
from tests.presets import DOME_MODES, ROOF_MODES
from tests.shapes import grid, sphere

OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def obj(surface: Surface, scale: float = 1.0) -> str:
    """A surface as the text of an OBJ file."""
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in (surface.V * scale).tolist())
    return vertices + "".join(f"f {a} {b} {c}\n" for a, b, c in (surface.F + 1).tolist())


def plate_and_ball() -> str:
    """A plate and a closed ball beside it, which has no boundary to stand on."""
    plate, ball = grid(6, 6, 1.0, 1.0), sphere(1)
    return obj(Surface(np.concatenate([plate.V, ball.V + [3, 0, 0]]), np.concatenate([plate.F, ball.F + plate.n])))


def truncated_stl(path: Path) -> None:
    trimesh.creation.box().export(path)
    path.write_bytes(path.read_bytes()[:200])


MESHES: dict[str, tuple[str, str | Callable[[Path], None], str]] = {
    "missing file": ("gone.obj", lambda path: None, "gone.obj"),
    "cut off": ("half.stl", truncated_stl, "half.stl"),
    "not a number": ("nan.obj", OBJ.replace("v 1 1 0", "v nan 1 0") + "f 1 2 3 4\n", "finite"),
    "all in one point": ("point.obj", "v 0 0 0\n" * 3 + "f 1 2 3\n", "area"),
    "three faces on an edge": ("fan.obj", OBJ + "v 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 2 5\n", "edge"),
    "two pieces, one unsupported": ("pieces.obj", plate_and_ball(), "1 of 2 pieces of the surface touch no support"),
    "closed, so no boundary to stand on": ("ball.obj", obj(sphere(2)), "boundary"),
    "too few vertices": ("few.obj", OBJ + "v .5 .5 0\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n", "refine the mesh"),
    "swapped units, too large": ("mm.obj", obj(grid(8, 8, 1.0, 1.0), 1e5), "check surface.unit"),
    "swapped units, too small": ("metres.obj", obj(grid(8, 8, 1.0, 1.0), 1e-2), "check surface.unit"),
    "a flat sheet held all around, nothing to carry": ("plate.obj", obj(grid(1, 9, 1.0, 9.0)), "carries nothing"),
}
"""What is wrong -> file name, its content or how it is made, and words of the sentence."""

OPTIONS: dict[str, tuple[list[str], str]] = {
    "negative thickness": (["--set", "statics.thickness=-0.1"], "greater than 0"),
    "infinite frequency": (["--set", "pattern.major.frequency=inf"], "pattern.major.frequency"),
    "no material at all": (
        ["--set", "pattern.width={}", "--set", "pattern.keep=0", "--set", "pattern.major.threshold=1"]
        + ["--set", "pattern.minor.threshold=1"],
        "leaves no material",
    ),
    "more material than there is": (["--set", "pattern.width.solid_fraction=1.5"], "solid_fraction"),
    "a mode that was not computed": (["--set", "pattern.minor.mode=9"], "pattern.minor.mode = 9"),
    "a support that picks nothing": (
        ["--set", "surface.support.0.at={pick='box', min=[9,9,9], max=[10,10,10]}"],
        "box",
    ),
    "no support": (["--set", "surface.support=[]"], "add a [[surface.support]]"),
    "no load": (["--set", "surface.load=[]"], "add a [[surface.load]]"),
    "a load on nothing": (
        ["--set", "surface.load.1={kind='pressure', pressure=10, at={pick='nearest', points=[[0, 0, 4]]}}"],
        "is on no face",
    ),
    "a load on what is held": (
        ["--set", "surface.load=[{kind='force', at={pick='boundary'}, force=[0, 0, -1]}]"],
        "so the surface carries nothing",
    ),
    "a spring that pushes": (["--set", "surface.support.0={at={pick='boundary'}, spring=[0, 0, -9]}"], "spring = ["),
    "a support that holds nothing": (["--set", "surface.support.0.hold=''"], "the support holds nothing"),
    "clamped hinges": (["--set", "surface.support.0.clamp=true"], 'choose bending = "midedge" or "hhj"'),
    "a case that no load has": (["--set", "diffusion.follow=laod"], "did you mean load?"),
    "a factor for a case that no load has": (
        ["--set", "surface.combination=[{name='uls', factors={dead=1.35}}]"],
        "surface.combination.0.factors.dead = 1.35",
    ),
    "a case with nothing to carry": (
        ["--set", "surface.load.1={kind='force', at={pick='boundary'}, force=[0, 0, -1], case='crane'}"],
        "case crane: all loads act on fixed vertices",
    ),
    "supports that let it slide": (["--set", "surface.support.0.hold=z"], "move along"),
    "a mesh of a billion triangles": (["--set", "surface.edge=0.0001"], "edge"),
    "a guide in the air": (
        ["--set", "pattern.method=stripes", "--set", "pattern.guide=[{curve=[[0, 0, 9], [1, 0, 9]]}]"],
        "pattern.guide.0: the curve is 5 m from the nearest vertex",
    ),
    "a guide of one point": (["--set", "pattern.guide=[{curve=[[0, 0, 4]]}]"], "two different points"),
    "a guide for modes": (
        ["--set", "pattern.guide=[{at={pick='all'}, direction=[1, 0, 0]}]"],
        "guide has no effect on method = 'modes'",
    ),
    "turned modes": (["--set", "pattern.rotate=45"], "rotate has no effect on method = 'modes'"),
    "a third family": (["--set", "pattern.families=third"], "'both', 'major' or 'minor'"),
    "STEP over its budget": (
        ["--format", "step", "--set", "export.step_faces=10", "--set", "export.step=faceted"]
        + [word for family in ("major", "minor") for word in ("--set", f"pattern.{family}.frequency=2")],
        "more than step_faces = 10",
    ),
}
"""What is wrong -> options after `dsfab build dome`, and words of the sentence."""


def sentence(capsys) -> str:
    """The refusal, after checking that it is a single line without a traceback."""
    err = capsys.readouterr().err
    assert "Traceback" not in err
    last = err.strip().splitlines()[-1]
    assert last.startswith("dsfab: ")
    assert len(last) < 500
    return last


@pytest.mark.parametrize("what", MESHES)
def test_bad_meshes_are_refused(what, tmp_path, monkeypatch, capsys):
    name, content, says = MESHES[what]
    monkeypatch.chdir(tmp_path)
    if callable(content):
        content(Path(name))
    else:
        Path(name).write_text(content)
    before = sorted(tmp_path.rglob("*"))
    assert main(["build", ROOF_MODES, "--mesh", name, "--no-picture", "--format", "stl"]) == 1
    assert says in sentence(capsys)
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    "what", [pytest.param(what, marks=[pytest.mark.slow] * what.startswith("STEP")) for what in OPTIONS]
)
def test_bad_options_are_refused(what, tmp_path, monkeypatch, capsys):
    options, says = OPTIONS[what]
    monkeypatch.chdir(tmp_path)
    command = options if options[0] == "build" else ["build", DOME_MODES, "--set", "surface.edge=0.8", *options]
    assert main([*command, "--no-picture"]) == (4 if "STEP" in what else 1)
    assert says in sentence(capsys)
    if "STEP" not in what:  # there the other files are whole, and are kept
        assert list(tmp_path.iterdir()) == []


def test_a_mechanism_is_named_with_its_piece_and_its_motion(tmp_path, monkeypatch, capsys):
    """Two plates; the second is held along one line, about which it can turn."""
    monkeypatch.chdir(tmp_path)
    one = grid(4, 4, 1.0, 1.0)
    both = Surface(np.concatenate([one.V, one.V + [3, 0, 0]]), np.concatenate([one.F, one.F + one.n]))
    Path("two.obj").write_text(obj(both))
    supports = "[{at={pick='box', min=[0,0,0], max=[0.3,1,0]}}, {at={pick='side', axis='x', end='max'}}]"
    command = ["build", ROOF_MODES, "--mesh", "two.obj", "--no-picture", "--set", f"surface.support={supports}"]
    assert main(command) == 1
    assert "piece 2 of 2 can turn about y" in sentence(capsys)


def drafted(surface: Surface, path: Path, **changes: object) -> str:
    """The notes of the statics of a plate that is held along its boundary."""
    path.write_text(obj(surface))
    return " | ".join(
        n.text
        for n in draft(load_preset(ROOF_MODES, {"pattern.width": {}, **changes}, path)).notes
        if n.stage == "statics"
    )


def with_needles(height: float) -> Surface:
    """A plate with a row of triangles `height` high on edges of 0.2, and one pair of them lower still."""
    plate = grid(10, 10, 2.0, 2.0)
    V = plate.V.copy()
    column = np.abs(V[:, 0] - 0.4) < 1e-9
    V[column, 0] = 0.6 - height
    V[column & (V[:, 1] == 1.0), 0] = 0.6 - height / 2
    return Surface(V, plate.F)


def test_needles_are_counted_and_the_worst_is_shown(tmp_path, monkeypatch):
    assert "needle" not in drafted(grid(10, 10, 2.0, 2.0), tmp_path / "plate.obj")
    assert "needle" not in drafted(with_needles(0.01), tmp_path / "flat.obj")
    told = drafted(with_needles(0.002), tmp_path / "needles.obj")
    assert "20 of 200 triangles are needles" in told
    worst = re.search(r"the thinnest triangle, with 0\.005 times, is around \[(\d\.\d+), (\d\.\d+), 0\.0\] m", told)
    assert worst
    assert abs(float(worst[1]) - 0.6) < 0.003
    assert abs(float(worst[2]) - 1.0) < 0.21
    monkeypatch.setattr(factorisation, "REFINEMENTS", 0)  # longer numbers would solve even these
    with pytest.raises(StaticsError, match=r"relative residual .*20 of 200 triangles are needles"):
        drafted(with_needles(0.0001), tmp_path / "needles.obj")


def test_a_thick_sheet_gives_a_note(tmp_path):
    plate = grid(10, 10, 2.0, 2.0)
    assert "is 2.83 m large and the sheet 300 mm thick" in drafted(
        plate, tmp_path / "thick.obj", **{"statics.thickness": 0.3}
    )
    assert "thick" not in drafted(plate, tmp_path / "thin.obj", **{"statics.thickness": 0.27})


@pytest.mark.parametrize(("share", "says"), [(1 - 4e-8, "relative error of 4.0e-08"), (1 - 4e-9, "")])
def test_a_rough_solution_gives_a_note_with_its_case_and_a_poor_one_is_refused(share, says, tmp_path, monkeypatch):
    """A solver that is off by d leaves an error of d on a machine that has no longer numbers to refine with."""
    factorise = factorisation.factorise
    monkeypatch.setattr(factorisation, "REFINEMENTS", 0)

    def careless(*args, **more):
        exact = factorise(*args, **more)
        return lambda b: share * exact(b)

    monkeypatch.setattr(factorisation, "factorise", careless)
    snow = {"kind": "snow", "pressure": 500.0, "case": "snow"}
    told = drafted(grid(6, 6, 2.0, 2.0), tmp_path / "plate.obj", **{"surface.load": [{"kind": "self_weight"}, snow]})
    assert (says in told) if says else "relative error of" not in told
    assert ("under load" in told or "under snow" in told) == bool(says)
    monkeypatch.setattr(factorisation, "factorise", lambda *args, **more: lambda b: 0.99 * factorise(*args, **more)(b))
    monkeypatch.setattr(solve, "BALANCE", 1.0)
    with pytest.raises(StaticsError, match=r"relative residual of the solution is 1\.0e-02"):
        drafted(grid(6, 6, 2.0, 2.0), tmp_path / "plate.obj")


def test_there_are_more_than_twenty_kinds():
    assert len(MESHES) + len(OPTIONS) > 30
