"""Any bytes as a file: an error of ours, or what the file says. The seeds each time, the fuzzer in the slow part."""

from pathlib import Path

import pytest

from tests.fuzz import corpus, oracles
from tests.fuzz.__main__ import run
from tests.hangs import ended_if_it_hangs

SECONDS = 10
"""For each target in the slow part: `python -m tests.fuzz` takes as long as one likes."""
FILES = 31
"""At most, always the same ones: a machine that is faster than another must not find what has nothing to do with a
change, or nobody could land one."""
SEEDS = sorted(corpus.SEEDS.glob("*/*"))


@pytest.mark.parametrize("file", SEEDS, ids=lambda file: f"{file.parent.name}-{file.name}")
def test_files_that_once_broke_a_reader_no_longer_do(file, tmp_path):
    with ended_if_it_hangs():
        oracles.judge(file.parent.name, file.read_bytes(), tmp_path)


@pytest.mark.parametrize("target", oracles.TARGETS)
def test_the_fuzzer_begins_with_good_files(target, tmp_path):
    """Some first file of each target is read, so that its mutations are near to what is read."""
    read = []
    bad = {file.read_bytes() for file in SEEDS}
    for data in [data for data in corpus.beginnings(target) if data not in bad][:3]:
        oracles.judge(target, data, tmp_path)
        read += tmp_path.glob("again.*")
    if target == "3dm":
        pytest.importorskip("rhino3dm")
    assert read


def test_an_oracle_notices_another_surface(tmp_path, monkeypatch):
    """A reader that moves what it reads by a little is found out, by trimesh and by its own second reading."""
    from dataclasses import replace

    from dsfab.surface import surface_in_file

    def moved(path, *words, **more):
        found = surface_in_file(path, *words, **more)
        return replace(found, surface=type(found.surface)(found.surface.V * 1.001, found.surface.F))

    good = next(corpus.beginnings("stl"))
    oracles.judge("stl", good, tmp_path)
    monkeypatch.setattr(oracles, "surface_in_file", moved)
    with pytest.raises(AssertionError):
        oracles.judge("stl", good, tmp_path)


def test_random_fuzzing_finds_a_planted_fault(tmp_path, monkeypatch):
    """The stand-in for atheris keeps the file that breaks a reader, and ends with 1."""
    from tests.fuzz import target

    def judge(name: str, data: bytes, folder: Path) -> None:
        assert b"ff" not in data

    monkeypatch.setattr(oracles, "judge", judge)
    assert target.fuzz_by_chance("obj", 20, tmp_path) == 1
    (kept,) = tmp_path.glob("crash-*")
    assert b"ff" in kept.read_bytes()


@pytest.mark.slow
def test_fuzzed_for_a_while(tmp_path):
    """In one process, which instruments once what all targets import."""
    for found in run(list(oracles.TARGETS), SECONDS, tmp_path, FILES):
        few = 5 if found.target == "3dm" else 30  # a 3dm is read in a process of its own
        again = (
            [] if found.broken or found.tried > few else run([found.target], 12 * SECONDS, tmp_path / "busy", 2 * few)
        )
        for one in (found, *again):  # a busy machine tries few in the time
            assert not one.broken, one.broken
        assert max(one.tried for one in (found, *again)) > few, found.target
