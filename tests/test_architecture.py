"""The architecture as a table: who may import whom, where heavy libraries live, and what the packaging must list.

    errors   units   arrays   sparse          the ground floor
       └──────┴───┬─────┴───────┘
               surface
   ┌─────────┬────┴────┬─────────┬──────────┐
statics  diffusion  pattern   slicing   thickening ──► export
   └─────────┴────┬────┴─────────┴──────────┘            │
               preset ─► preset_errors ─► preset_file     │
                  ▼                                       │
               pipeline ──► study ──► app ◄───────────────┘
"""

import ast
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "dsfab"

GROUND = {"errors", "units", "arrays", "sparse", "__init__"}
STAGES = {"statics", "diffusion", "pattern", "slicing", "thickening"}
ALLOWED: dict[str, set[str]] = {
    "__init__": {"app", "design", "errors", "export", "pipeline", "preset", "preset_file"}
    | {"study", "surface"}
    | STAGES,
    "errors": set(),
    "units": {"errors"},
    "arrays": {"errors"},
    "sparse": {"arrays", "errors"},
    "surface": GROUND,
    **{stage: GROUND | {"surface"} for stage in STAGES},
    "export": GROUND | {"surface", "thickening"},
    "preset_cases": GROUND | {"surface"},
    "preset_surface": GROUND | {"surface"},
    "preset": GROUND | {"surface", "preset_cases", "preset_surface"} | STAGES,
    "preset_errors": GROUND | {"pattern", "preset", "preset_surface", "surface", "thickening"},
    "preset_file": GROUND | {"preset", "preset_errors", "preset_surface"},
    "design": GROUND | {"surface", "preset"} | STAGES,
    "pipeline": GROUND | {"surface", "preset", "design"} | STAGES,
    "study": GROUND | {"surface", "preset", "preset_surface", "preset_file", "design", "pipeline", "export"} | STAGES,
    "app": GROUND | {"surface", "preset", "preset_file", "design", "pipeline", "study", "export"} | STAGES,
}
"""Each part of dsfab, and the parts it may import besides itself."""

HOME = {
    "manifold3d": {"thickening"},
    "build123d": {"export"},
    "OCP": {"export"},
    "lib3mf": {"export", "surface"},
    "ezdxf": {"export"},
    "rhino3dm": {"export"},
    "ifcopenshell": {"export"},
    "pyvista": {"app"},
    "vtk": {"app"},
    "vtkmodules": {"app"},
    "trimesh": {"surface", "export"},
    "pydantic": {"preset", "preset_surface", "preset_errors", "preset_file", "study", "surface"},
    "gmsh": {"study"},
    "skfem": {"study"},
    "cyclopts": {"app"},
    "rich": {"app"},
    "PIL": {"app"},
    "matplotlib": {"app"},
    "reportlab": {"app"},
}
"""Libraries that may be imported in these parts only."""

LAZY = {
    "build123d",
    "OCP",
    "lib3mf",
    "ezdxf",
    "rhino3dm",
    "ifcopenshell",
    "pyvista",
    "vtk",
    "vtkmodules",
    "trimesh",
    "PIL",
    "matplotlib",
    "gmsh",
    "skfem",
}
"""Slow to import: never at the top of a module."""


def modules() -> Iterator[tuple[str, str, ast.Module]]:
    """Part, file and syntax tree of every module."""
    for path in sorted(PACKAGE.rglob("*.py")):
        relative = path.relative_to(PACKAGE)
        part = relative.parts[0].removesuffix(".py")
        yield part, str(relative), ast.parse(path.read_text(encoding="utf-8"))


def imports(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Imported module names and their lines, wherever they stand."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                yield "relative", node.lineno
            elif node.module == "dsfab":
                yield from ((f"dsfab.{alias.name}", node.lineno) for alias in node.names)
            elif node.module:
                yield node.module, node.lineno


def violations(files: Iterator[tuple[str, str, ast.Module]]) -> list[str]:
    """Every broken rule as 'file:line: what'."""
    found = []
    for part, file, tree in files:
        if part not in ALLOWED:
            found.append(f"{file}: {part} is not in the table; decide where it belongs")
            continue
        top_level = {
            line for node in tree.body for _, line in imports(node) if isinstance(node, ast.Import | ast.ImportFrom)
        }
        for name, line in imports(tree):
            root, _, rest = name.partition(".")
            target = rest.partition(".")[0]
            if root == "relative" or (root == "dsfab" and target.startswith("__") and target != "__version__"):
                found.append(f"{file}:{line}: write absolute imports")
            elif root == "dsfab" and target not in ALLOWED[part] | {part, "", "__version__"}:
                found.append(f"{file}:{line}: {part} may not import {target}")
            elif root in HOME and part not in HOME[root]:
                found.append(f"{file}:{line}: {root} lives in {', '.join(sorted(HOME[root]))}, not in {part}")
            elif root in LAZY and line in top_level:
                found.append(f"{file}:{line}: import {root} inside the function that uses it")
    return found


def test_every_import_is_in_the_table():
    assert violations(modules()) == []


@pytest.mark.parametrize(
    ("part", "line"),
    [
        ("surface", "from dsfab.statics import solve_statics"),
        ("statics", "from dsfab.diffusion import diffusion_modes"),
        ("slicing", "import dsfab.pattern.stripes"),
        ("thickening", "from dsfab.export import write"),
        ("pipeline", "from dsfab.app.cli import main"),
        ("pipeline", "from dsfab import app"),
        ("export", "from dsfab.pipeline import run"),
        ("statics", "import manifold3d"),
        ("pipeline", "def f():\n    import pyvista"),
        ("export", "from build123d import Solid"),
        ("app", "import pyvista"),
        ("app", "from matplotlib.figure import Figure"),
        ("study", "def f():\n    import matplotlib"),
        ("diffusion", "from . import tensors"),
        ("newpart", "import numpy"),
    ],
)
def test_the_check_catches_a_planted_violation(part, line):
    assert len(violations(iter([(part, f"{part}/planted.py", ast.parse(line))]))) == 1


def test_parts_form_no_cycle():
    remaining = {part: {p for p in allowed if p in ALLOWED and p not in GROUND} for part, allowed in ALLOWED.items()}
    remaining.pop("__init__")
    while remaining:
        free = [part for part, needs in remaining.items() if not needs & set(remaining) - {part}]
        assert free, f"cycle among {sorted(remaining)}"
        for part in free:
            del remaining[part]


def test_importing_dsfab_loads_no_heavy_library():
    code = (
        "import sys, dsfab; from dsfab import load_preset, run, revise, write, read_surface; "
        f"print([name for name in {sorted(LAZY)} if name in sys.modules])"
    )
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"
    )


def test_every_public_name_is_there():
    import dsfab

    assert [name for name in dsfab.__all__ if not hasattr(dsfab, name)] == []
    with pytest.raises(AttributeError, match="no_such_thing"):
        _ = dsfab.no_such_thing


def test_packaging_lists_every_package_of_the_source_tree():
    listed = set(tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"])
    there = {".".join(path.parent.relative_to(ROOT).parts) for path in PACKAGE.rglob("__init__.py")}
    assert listed == there | {"dsfab.presets"}


def test_one_version():
    import dsfab

    assert tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"] == dsfab.__version__
