"""Wheel and sdist: they hold all that dsfab needs and nothing else, and the wheel works where there is no checkout."""

import json
import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
import trimesh

ROOT = Path(__file__).parents[1]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """Wheel and sdist of what git tracks, made as `python -m build` makes them, without a download."""
    source, made = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("packages")
    tracked = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in tracked.split("\0")[:-1]:
        if (ROOT / name).exists():  # a file that was removed and is not committed yet
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
    build = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(made), str(source)]
    ended = subprocess.run(build, capture_output=True, text=True, timeout=300)
    assert ended.returncode == 0, ended.stderr
    return next(made.glob("*.whl")), next(made.glob("*.tar.gz"))


def product_files():
    """Every file of the package as git tracks it, by its name in the wheel."""
    tracked = subprocess.run(["git", "ls-files", "dsfab", "presets"], cwd=ROOT, capture_output=True, text=True).stdout
    names = [name for name in tracked.splitlines() if (ROOT / name).exists()]
    return {f"dsfab/{name}" if name.startswith("presets/") else name for name in names}


def test_the_wheel_holds_the_product_and_nothing_else(packages):
    with zipfile.ZipFile(packages[0]) as wheel:
        names = {name for name in wheel.namelist() if not name.endswith("/")}
    inside = {name for name in names if ".dist-info/" not in name}
    assert inside == {name for name in product_files() if not name.endswith(".md")}
    assert {Path(name).name for name in names - inside} >= {"METADATA", "entry_points.txt", "LICENSE", "LICENSE.three"}


def test_the_sdist_makes_the_same_wheel(packages, tmp_path):
    """`python -m build` makes the wheel from the sdist: it holds the package, and beside it what explains it."""
    with tarfile.open(packages[1]) as sdist:
        names = {name.split("/", 1)[1] for name in sdist.getnames() if "/" in name}
    assert names >= {"pyproject.toml", "README.md", "LICENSE", "dsfab/__init__.py", "presets/dome.toml"}
    assert not [name for name in names if name.startswith(("outputs/", ".venv/", ".git/"))]


def test_the_wheel_works_alone(packages, tmp_path):
    """Unpacked where nothing of the checkout is: its presets are listed, one is built, the editor's page is there."""
    site, work = tmp_path / "site", tmp_path / "work"
    work.mkdir()
    with zipfile.ZipFile(packages[0]) as wheel:
        wheel.extractall(site)
    environment = {**os.environ, "PYTHONPATH": str(site)}

    def ran(*command):
        ended = subprocess.run(
            [sys.executable, *command], cwd=work, env=environment, capture_output=True, text=True, timeout=300
        )
        assert ended.returncode == 0, ended.stderr
        return ended.stdout

    assert Path(ran("-c", "import dsfab; print(dsfab.__file__)").strip()).is_relative_to(site)
    assert ran("-m", "dsfab", "--version").strip() == packages[0].name.split("-")[1] == "0.1.0.dev0"
    assert {path.stem for path in (ROOT / "presets").rglob("*.toml")} <= set(ran("-m", "dsfab", "presets").split())
    ran("-m", "dsfab", "build", "barrel_vault", "--set", "export.formats=['stl']", "-o", "vault")
    design = json.loads((work / "vault/design.json").read_text())
    assert trimesh.load(work / "vault/barrel_vault.stl").is_watertight
    assert design["manifest"]
    assert (site / "dsfab/app/editor/static/index.html").is_file()
