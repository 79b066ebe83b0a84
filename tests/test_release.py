"""A version is a tag of git; a release is made of one that the changelog knows."""

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
from versioningit import get_version

from tests.release import notes

ROOT = Path(__file__).resolve().parent.parent
WORKFLOW = ROOT / ".github" / "workflows" / "ci.yml"

CHANGELOG = """# Changelog

## 1.1.0 (unreleased)

* Not yet.

## 1.0.0 (2026-11-25)

* Domes.

## 0.9.0 (2026-10-01)

* Vaults.
"""


def test_the_notes_of_a_release_are_its_part_of_the_changelog():
    assert notes("v1.0.0", "1.0.0", CHANGELOG) == "* Domes.\n"
    assert notes("v0.9.0", "0.9.0", CHANGELOG) == "* Vaults.\n"


@pytest.mark.parametrize(
    ("tag", "version", "told"),
    [
        ("v1.0.1", "1.0.0", "the tag is v1.0.1, but what is installed is 1.0.0"),
        ("1.0.0", "1.0.0", "the tag is 1.0.0"),
        ("v1.1.0", "1.1.0", "no '## 1.1.0"),
        ("v1x0.0", "1x0.0", "no '## 1x0.0"),
    ],
)
def test_a_release_is_refused_if_tag_version_and_changelog_disagree(tag, version, told):
    with pytest.raises(ValueError, match=told):
        notes(tag, version, CHANGELOG)


@pytest.mark.skipif(not WORKFLOW.exists(), reason="not a checkout")
def test_every_python_and_system_that_is_promised_runs_the_commands_of_the_readme():
    text, readme = WORKFLOW.read_text(encoding="utf-8"), (ROOT / "README.md").read_text(encoding="utf-8")
    classifiers = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["classifiers"]
    promised = re.findall(r"Python :: (3\.\d+)", "\n".join(classifiers))
    (matrix,) = re.findall(r"python: \[(.+)\]", text)
    assert re.findall(r"3\.\d+", matrix) == promised
    assert {"ubuntu-latest", "macos-latest", "windows-latest"} <= set(re.findall(r"[a-z]+-latest", text))
    asked = set(re.findall(r"<!-- ([a-z-]+) -->", text))
    assert asked == {"build", "system-packages", "test"}
    for name in asked:
        assert re.search(rf"<!-- {name} -->\n```\w*\n\S", readme), name
    assert "bash .ci/run" in text.split("nightly:")[1]
    assert "test_packaging.py" in text.split("packages:")[1]
    assert "python -m tests.fuzz" in text.split("fuzz:")[1]
    for module in re.findall(r"python -m ((?:tests|docs)(?:\.\w+)+)", text):
        assert (at := ROOT / module.replace(".", "/")).is_dir() or at.with_suffix(".py").is_file(), module


@pytest.fixture
def copy(tmp_path):
    """A folder with what says how versions are found, which git does not know."""
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def git(folder, *words):
    own = ("-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false", "-c", "tag.gpgsign=false")
    subprocess.run(["git", *own, *words], cwd=folder, check=True, capture_output=True)


def test_the_version_comes_from_the_tag_and_counts_later_commits(copy):
    for words in (["init"], ["add", "."], ["commit", "-m", "first"]):
        git(copy, *words)
    git(copy, "commit", "--allow-empty", "-m", "before any tag")
    assert re.fullmatch(r"0\.1\.0\.dev1\+g[0-9a-f]+", get_version(copy))
    git(copy, "tag", "v1.2.3")
    git(copy, "tag", "another")
    assert get_version(copy) == "1.2.3"
    git(copy, "commit", "--allow-empty", "-m", "second")
    assert re.fullmatch(r"1\.3\.0\.dev1\+g[0-9a-f]+", get_version(copy))
    (copy / "pyproject.toml").write_text((copy / "pyproject.toml").read_text() + "# changed\n")
    assert get_version(copy).endswith(".dirty")


def test_without_git_an_sdist_has_its_version_and_a_copy_has_none(copy):
    assert get_version(copy) == "0.1.0.dev0"
    (copy / "PKG-INFO").write_text("Metadata-Version: 2.4\nName: dsfab\nVersion: 1.2.3\n", encoding="utf-8")
    assert get_version(copy) == "1.2.3"
