"""What a build keeps: every format comes from the folder as it does from the design, and no stage runs again."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from dsfab.app.cli import main
from dsfab.design import design as stages
from dsfab.design import run
from dsfab.design.output.archive import LAYOUT, MADE_BY, NAME, read_archive, write_archive
from dsfab.design.output.files import deliverable
from dsfab.export import FORMATS, write
from dsfab.preset.file import load_preset
from dsfab.surface.fields import DividedField

SMALL = {"surface.edge": 0.12}
STEPS = ("surface_step", "statics_step", "diffusion_step", "pattern_stage", "slicing_step", "thickening_step")


GIVEN = {**SMALL, "statics.strength": 235e6}
"""Without a strength nothing can be said of what members bear."""


@pytest.fixture(scope="module")
def design():
    return run(load_preset("cantilever", GIVEN))


@pytest.fixture(scope="module")
def folder(design, tmp_path_factory):
    """A folder that was built."""
    made = tmp_path_factory.mktemp("archive") / "built"
    words = [word for key, value in GIVEN.items() for word in ("--set", f"{key}={value}")]
    arguments = ["build", "cantilever", *words, "--format", "stl", "--no-picture", "-q", "-o", str(made)]
    assert main(arguments) == 0
    return made


@pytest.fixture(scope="module")
def back(design, tmp_path_factory):
    """The design as its archive holds it."""
    kept = tmp_path_factory.mktemp("kept")
    write_archive(design, kept)
    return read_archive(kept, design.preset)


@pytest.fixture
def poisoned(monkeypatch):
    """No stage may run."""

    def fail(*_args, **_more):
        raise AssertionError("a stage ran")

    for name in STEPS:
        monkeypatch.setattr(stages, name, fail)
    monkeypatch.setattr(type(load_preset("cantilever").surface), "build", fail)


def same(one: object, two: object) -> None:
    if isinstance(one, DividedField):
        assert isinstance(two, DividedField)
        same(one.x, two.x)
        for ours, theirs in ((one.divided.surface, two.divided.surface), (one.divided.whole, two.divided.whole)):
            same(ours.V, theirs.V)
            same(ours.F, theirs.F)
        same(one.divided.parent, two.divided.parent)
        assert (one.divided.weights != two.divided.weights).nnz == 0
        return
    assert np.array_equal(np.asarray(one), np.asarray(two))


def test_an_archived_design_reads_back_equal(design, tmp_path):
    path = write_archive(design, tmp_path)
    back = read_archive(tmp_path, design.preset)
    assert path == tmp_path / NAME
    assert back is not None
    for ours, theirs in ((design.surface, back.surface), (design.sheet.surface, back.sheet.surface)):
        same(ours.V, theirs.V)
        same(ours.F, theirs.F)
    same(design.sheet.parent, back.sheet.parent)
    same(design.sheet.family, back.sheet.family)
    same(design.sheet.sides_on, back.sheet.sides_on)
    for ours, theirs in zip(vars(design.sheet.lines).values(), vars(back.sheet.lines).values(), strict=True):
        same(ours, theirs)
    assert (design.sheet.weights != back.sheet.weights).nnz == 0
    same(design.solid.V, back.solid.V)
    same(design.solid.F, back.solid.F)
    assert (back.solid.genus, back.solid.pieces) == (design.solid.genus, design.solid.pieces)
    assert back.solid.repairs.rung == design.solid.repairs.rung
    assert back.mass == design.mass
    for key in ("names", "factor", "frequency", "mode", "phase"):
        assert getattr(back.pattern, key) == getattr(design.pattern, key), key
    for key in ("fields", "levels", "half_widths"):
        for one, two in zip(getattr(design.pattern, key), getattr(back.pattern, key), strict=True):
            same(one, two)
    assert path.stat().st_size < 30 * (len(design.solid.F) + len(design.surface.F) + len(design.sheet.surface.F))


def test_the_same_design_gives_the_same_archive(design, tmp_path):
    (tmp_path / "a").mkdir()
    assert write_archive(design, tmp_path).read_bytes() == write_archive(design, tmp_path / "a").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [s for s in FORMATS if s not in (".stp", ".stpz", ".brep", ".ifc", ".lines.step")])
def test_an_archived_folder_exports_the_files_of_the_design(suffix, design, back, tmp_path):
    if suffix in (".step", ".3dm", ".dxf"):  # slow, or with random identifiers
        (one, how), (two, other) = (deliverable(x, suffix) for x in (design, back))
        same(one.V, two.V)
        assert how.keys() == other.keys()
        for ours, theirs in zip(how["details"].lines, other["details"].lines, strict=True):
            assert (ours.id, ours.length) == (theirs.id, theirs.length)
            same(ours.points, theirs.points)
        return
    if (
        getattr(FORMATS[suffix], "content", "") == "shapes"
    ):  # each of them writes these bodies, and takes seconds for it
        (_, one), (_, two) = (deliverable(x, suffix) for x in (design, back))
        assert len(one["details"].shapes) > 10
        for ours, theirs in zip(one["details"].shapes, two["details"].shapes, strict=True):
            assert (ours.id, ours.layer, ours.plate) == (theirs.id, theirs.layer, theirs.plate)
            for array in ("V", "F", "axis"):
                same(getattr(ours, array), getattr(theirs, array))
        return
    files = []
    for name, source in (("a", design), ("b", back)):
        thing, how = deliverable(source, suffix)
        files.append(write(thing, tmp_path / f"{name}{suffix}", name="x", **how))
    if suffix == ".vtu":
        numbers = [deliverable(source, suffix)[1]["details"].values for source in (design, back)]
        assert list(numbers[0]) == list(numbers[1])
        for name, values in numbers[0].items():
            assert numbers[1][name] == pytest.approx(values, rel=1e-6, abs=1e-30), name
        return
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.parametrize(
    "words",
    [
        ["--to", "obj"],
        ["--to", "svg"],
        ["--to", "ply", "--sheet", "uncut"],
        pytest.param(["--estimate"], marks=pytest.mark.slow),
    ],
)
def test_export_of_a_folder_runs_no_stage(words, folder, poisoned, tmp_path, capsys):
    where = [] if words == ["--estimate"] else ["-o", str(tmp_path / f"a.{words[1]}")]
    assert main(["export", str(folder), *words, *where]) == 0
    assert a_stage_ran(capsys, "export", "cantilever", "--to", "stl", "-o", str(tmp_path / "b.stl"))  # so it is poison


def a_stage_ran(capsys, *words: str) -> bool:
    """Whether a command ended with the poison, by the file of details that it names."""
    capsys.readouterr()
    assert main(words) == 70
    details = Path(capsys.readouterr().err.strip().rsplit(" ", 1)[1])
    text = details.read_text(encoding="utf-8")
    details.unlink()
    return "AssertionError: a stage ran" in text


def test_an_export_runs_stages_again_only_for_keys_of_the_design(folder, poisoned, tmp_path, capsys):
    target = ["-o", str(tmp_path / "a.obj")]
    assert main(["export", str(folder), *target, "--step", "faceted", "--max-faces", "9"]) == 0
    for change in ("statics.thickness=0.02", "pattern.major.frequency=5", "slicing.snap=0.0"):
        assert a_stage_ran(capsys, "export", str(folder), *target, "--set", change)


def spoilt(path, spoil):
    with np.load(path) as archive:
        arrays = dict(archive)
    arrays = spoil(arrays)
    np.savez(path, **arrays)


@pytest.mark.slow
@pytest.mark.parametrize(
    "spoil",
    [
        lambda path: path.unlink(),
        lambda path: path.write_bytes(path.read_bytes()[:2000]),
        lambda path: path.write_text("no archive"),
        lambda path: spoilt(path, lambda a: {k: x for k, x in a.items() if k != "solid_F"}),
        lambda path: spoilt(path, lambda a: a | {"about": np.array(changed(a["about"], layout=LAYOUT + 1))}),
    ],
    ids=["gone", "cut off", "text", "without faces", "another layout"],
)
def test_without_a_good_archive_the_design_is_made_again(spoil, folder, tmp_path):
    copy = shutil.copytree(folder, tmp_path / "copy")
    given = load_preset(copy / "preset.toml")
    assert read_archive(copy, given) is not None
    spoil(copy / NAME)
    assert read_archive(copy, given) is None
    assert main(["export", str(copy), "--to", "stl", "-q", "-o", str(tmp_path / "again.stl")]) == 0
    assert (tmp_path / "again.stl").read_bytes() == (folder / "cantilever.stl").read_bytes()


def changed(text: np.ndarray, **values: object) -> str:
    return json.dumps(json.loads(str(text)) | values)


def test_every_section_that_makes_a_design_counts():
    assert MADE_BY == ("surface", "statics", "diffusion", "pattern", "slicing", "thickening")
