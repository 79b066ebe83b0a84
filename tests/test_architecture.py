"""The architecture as a table: who may import whom, where heavy libraries live, and what the packaging must list.

    core
      └── surface
            ├── statics  diffusion  pattern  slicing  thickening
            └── preset ── results ── members ── export ── design ── workshop
                                                            └── study ── render ── report ── app
                                                                 verification  reproduction ┘

The docstring of each `__init__` says what its room holds. A room stands on the rooms before it and knows no later one.
"""

import ast
import os
import re
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from importlib import import_module, metadata
from pkgutil import walk_packages

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

import dsfab
from tests.source import PACKAGE, ROOT, modules, nodes

GROUND = {"core"}
STAGES = {"statics", "diffusion", "pattern", "slicing", "thickening"}
ALLOWED: dict[str, set[str]] = {
    "__main__": {"app"},
    "__init__": GROUND | {"surface", "preset", "design", "export", "study", "render", "report", "app"} | STAGES,
    "presets": set(),  # a name for setuptools, without code
    "core": set(),
    "surface": GROUND,
    **{stage: GROUND | {"surface"} for stage in STAGES},
    "export": GROUND | {"surface", "statics", "thickening", "members"},
    "preset": GROUND | {"surface"} | STAGES,
    "results": GROUND | {"surface", "preset"} | STAGES,
    "members": GROUND | {"surface", "statics", "slicing", "results"},
    "design": GROUND | {"surface", "preset", "results", "members", "export"} | STAGES,
    "workshop": GROUND | {"surface", "slicing", "preset", "members", "export", "design"},
    "study": GROUND | {"surface", "preset", "results", "members", "design", "export"} | STAGES,
    "render": GROUND | {"surface", "preset", "results", "members", "design", "export", "study"} | STAGES,
    "report": GROUND
    | {"surface", "preset", "results", "members", "design", "export", "study", "render", "workshop"}
    | STAGES,
    "verification": GROUND | {"surface", "export", "study", "report"} | STAGES,
    "reproduction": GROUND | {"surface", "preset", "results", "design", "export", "study", "render", "report"} | STAGES,
    "app": GROUND
    | {"surface", "preset", "results", "design", "export", "study", "render", "report", "workshop"}
    | {"verification", "reproduction"}
    | STAGES,
}
"""Each part of dsfab, and the parts it may import besides itself."""

METHODS_FOR_USERS = {
    ("dsfab.design.design", "dsfab.design.output"),
    ("dsfab.design.design", "dsfab.report.design.save"),
    ("dsfab.design.design", "dsfab.render.design_picture"),
    ("dsfab.thickening.solid", "dsfab.design.output"),
}
"""Imports inside methods that users expect on a value (`design.save(...)`) though a later room does the work."""

HOME = {
    "manifold3d": {"slicing", "thickening"},  # slicing offsets flat outlines of openings with it
    "build123d": {"design", "export"},
    "OCP": {"export", "surface"},  # reads STEP and BREP as surfaces
    "lib3mf": {"export", "surface"},
    "ezdxf": {"export", "surface"},
    "rhino3dm": {"export", "surface"},
    "ifcopenshell": {"export", "surface"},
    "pyvista": {"surface"},
    "vtk": {"render"},
    "vtkmodules": {"render"},
    "trimesh": {"surface", "export"},
    "pydantic": {"preset", "study", "surface"},
    "gmsh": {"study"},
    "spyrrow": {"workshop"},
    "skfem": {"study"},
    "compas": {"surface", "members"},
    "cyclopts": {"app"},
    "bpy": {"app"},
    "mathutils": {"app"},
    "rich": {"app"},
    "PIL": {"app", "render", "report", "reproduction"},
    "matplotlib": {"report", "verification", "reproduction"},
    "reportlab": {"report"},
    "xlsxwriter": {"workshop", "export"},
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
    "spyrrow",
    "compas",
    "xlsxwriter",
}
"""Slow to import: never at the top of a module."""


def imports(among: Iterable[ast.AST]) -> Iterator[tuple[str, int]]:
    """Module names that these nodes import, and their lines."""
    for node in among:
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                yield "relative", node.lineno
            elif node.module in ("dsfab", "importlib"):
                yield from ((f"{node.module}.{alias.name}", node.lineno) for alias in node.names)
            elif node.module:
                yield node.module, node.lineno
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "dsfab":
            if node.attr.startswith("__"):
                continue  # where it lies and which version it is
            yield f"dsfab.{_home(node.attr)}", node.lineno  # `import dsfab`, then `dsfab.run`
        elif getattr(node, "id", "") == "__import__" or (
            getattr(node, "attr", "") == "import_module" and ast.unparse(node) == "importlib.import_module"
        ):
            yield "importlib.import_module", node.lineno


def _home(name: str) -> str:
    """The part that the facade takes a public name from; other names are their own."""
    return dsfab._HOME.get(name, f"dsfab.{name}").split(".")[1]


def is_for_types(node: ast.AST) -> bool:
    """`if TYPE_CHECKING:`, where a signature may name the type of a library that this part does not load."""
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def violations(files: Iterable[tuple[str, str, ast.Module]]) -> list[str]:
    """Every broken rule as 'file:line: what'."""
    found = []
    for part, file, tree in files:
        if part not in ALLOWED:
            found.append(f"{file}: {part} is not in the table; decide where it belongs")
            continue
        top_level = {
            line for _, line in imports(node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom))
        }
        typed = {line for node in nodes(tree) if is_for_types(node) for _, line in imports(ast.walk(node))}
        for name, line in imports(nodes(tree)):
            root, _, rest = name.partition(".")
            target = rest.partition(".")[0]
            if root == "relative" or (root == "dsfab" and target.startswith("__") and target != "__version__"):
                found.append(f"{file}:{line}: write absolute imports")
            elif (f"dsfab.{file[:-3].replace('/', '.')}", name) in METHODS_FOR_USERS and line not in top_level:
                continue
            elif root == "dsfab" and target not in ALLOWED[part] | {part, "", "__version__"}:
                found.append(f"{file}:{line}: {part} may not import {target}")
            elif name in ("importlib.import_module", "importlib.__import__") and part != "__init__":
                found.append(f"{file}:{line}: write an import that this test can see")
            elif root in HOME and part not in HOME[root] and line not in typed:
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
        ("design", "from dsfab.app.cli import main"),
        ("design", "from dsfab import app"),
        ("export", "from dsfab.design import run"),
        ("statics", "import manifold3d"),
        ("design", "def f():\n    import pyvista"),
        ("export", "from build123d import Solid"),
        ("render", "import vtkmodules"),
        ("report", "from matplotlib.figure import Figure"),
        ("study", "def f():\n    import matplotlib"),
        ("diffusion", "from . import tensors"),
        ("newpart", "import numpy"),
        ("slicing", "import dsfab\n\n\ndef f():\n    return dsfab.run"),
        ("results", "import dsfab\n\n\ndef f():\n    return dsfab.inline_picture"),
        ("statics", "from importlib import import_module"),
        ("study", "import importlib\n\n\ndef f():\n    importlib.import_module('dsfab.app')"),
        ("render", "def f():\n    return __import__('dsfab.app')"),
    ],
)
def test_the_check_catches_a_planted_violation(part, line):
    assert len(violations([(part, f"{part}/planted.py", ast.parse(line))])) == 1


@cache
def dependencies() -> dict[str, set[str]]:
    """Every module of dsfab and the modules of dsfab that it imports, wherever it does."""
    trees = {}
    for _, file, tree in modules():
        trees[f"dsfab/{file}".removesuffix(".py").removesuffix("/__init__").replace("/", ".")] = tree

    def module(name: str) -> str:
        while name not in trees:
            name = name.rpartition(".")[0]
        return name

    found: dict[str, set[str]] = {}
    for name, tree in trees.items():
        given = [node for node in nodes(tree) if isinstance(node, ast.ImportFrom)]
        names = [f"{node.module}.{alias.name}" for node in given for alias in node.names]
        found[name] = {module(each) for each in names if each.startswith("dsfab.")} - {name, "dsfab"}
        found[name] -= {each for module_name, each in METHODS_FOR_USERS if module_name == name}
    return found


def cycles(graph: dict[str, set[str]]) -> list[set[str]]:
    """Groups of modules that need each other, in one step or in several."""
    names = sorted(graph)
    rows, columns = zip(
        *((i, names.index(other)) for i, name in enumerate(names) for other in graph[name]), strict=True
    )
    links = csr_array((np.ones(len(rows)), (rows, columns)), shape=(len(names), len(names)))
    count, label = connected_components(links, connection="strong")
    groups = [{names[i] for i in np.flatnonzero(label == k)} for k in range(count)]
    return [group for group in groups if len(group) > 1]


IN_CYCLES = [
    ("dsfab.design.buildability", "dsfab.design.regions_and_loads", "dsfab.design.surface_and_statics"),
    ("dsfab.render.scene", "dsfab.render.shader"),
    (
        "dsfab.surface.clean.overlaps",
        "dsfab.surface.clean.repair",
        "dsfab.surface.edge_changes",
        "dsfab.surface.files.gltf",
        "dsfab.surface.files.mesh_files",
        "dsfab.surface.files.other_libraries",
        "dsfab.surface.files.reader",
        "dsfab.surface.mesh",
        "dsfab.surface.orientation",
    ),
]
"""Modules that need each other, by imports inside functions; the list may only shrink."""

PAST_A_FRONT = 495
"""How many imports reach past the front (`__init__`) of another part into one of its modules; it may only shrink."""


def test_modules_in_cycles_only_shrink():
    assert sorted(tuple(sorted(group)) for group in cycles(dependencies())) == IN_CYCLES


def test_a_planted_cycle_is_found():
    assert cycles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [{"a", "b", "c"}]


def test_imports_past_a_parts_front_only_shrink():
    fronts = {part for part, file, tree in modules() if file == f"{part}/__init__.py" and any(imports(nodes(tree)))}
    past = []
    for name, others in dependencies().items():
        for other in others - {"dsfab"}:
            part = other.split(".")[1]
            if part in fronts and other != f"dsfab.{part}" and not name.startswith(f"dsfab.{part}"):
                past.append(f"{name} -> {other}")
    assert len(past) <= PAST_A_FRONT, "one more import past a front: let the front offer it"


def test_parts_form_no_cycle():
    remaining = {part: {p for p in allowed if p in ALLOWED and p not in GROUND} for part, allowed in ALLOWED.items()}
    remaining.pop("__init__")
    while remaining:
        free = [part for part, needs in remaining.items() if not needs & set(remaining) - {part}]
        assert free, f"cycle among {sorted(remaining)}"
        for part in free:
            del remaining[part]


STEP = "dsfab.export.cad.step"
STEP_ROOMS = {"smooth": {"shared", "worker"}, "by_members": {"shared", "worker"}, "shared": set(), "worker": set()}
"""Rooms of STEP files, and the rooms that each may import. The two kinds of curved solids share `shared` alone."""


def forbidden_step_imports(graph: dict[str, set[str]]) -> list[str]:
    """Imports from one room of STEP files to another that the table does not allow."""
    return [
        f"{name} -> {other}"
        for room, allowed in STEP_ROOMS.items()
        for name, others in graph.items()
        for other in others
        if name.startswith(f"{STEP}.{room}.")
        and any(other.startswith(f"{STEP}.{each}.") for each in STEP_ROOMS.keys() - {room, *allowed})
    ]


def test_smooth_solids_and_solids_by_members_share_one_room_only():
    assert forbidden_step_imports(dependencies()) == []
    planted = {f"{STEP}.by_members.draft": {f"{STEP}.smooth.solid", f"{STEP}.shared.plan"}}
    assert forbidden_step_imports(planted) == [f"{STEP}.by_members.draft -> {STEP}.smooth.solid"]


def test_importing_dsfab_loads_no_heavy_library():
    code = (
        "import sys, dsfab; from dsfab import load_preset, run, revise, write, read_surface; "
        f"print([name for name in {sorted(LAZY)} if name in sys.modules])"
    )
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"
    )


def test_threads_of_blas_that_wait_are_told_to_sleep_before_numpy_is_loaded():
    """Else they keep a core busy for 20 ms after each product of long vectors. What a person sets stays."""
    code = "import sys, os, dsfab; print('numpy' in sys.modules, os.environ['OPENBLAS_THREAD_TIMEOUT'])"
    for own, told in ((None, "20"), ("4", "4")):
        given = {key: value for key, value in os.environ.items() if key != "OPENBLAS_THREAD_TIMEOUT"}
        given |= {"OPENBLAS_THREAD_TIMEOUT": own} if own else {}
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=given)
        assert done.stdout.split() == ["False", told]


def test_listing_presets_imports_no_numeric_library():
    """`dsfab presets` takes a tenth of the second that the models of presets take, and what these import."""
    code = (
        "import contextlib, sys\n"
        "from dsfab.app.cli import main\n"
        "for command in ('presets', 'materials', '--version', '--help'):\n"
        "    with contextlib.suppress(SystemExit):\n"
        "        main([command])\n"
        "    print([command, *sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    told = [ast.literal_eval(line) for line in done.stdout.splitlines() if line.startswith("['")]
    assert [command for command, *_ in told] == ["presets", "materials", "--version", "--help"]
    for command, *loaded in told:
        assert "dsfab.app.cli" in loaded
        assert {*loaded} & {
            "numpy",
            "scipy",
            "igl",
            "pydantic",
            "dsfab.preset.model",
            "dsfab.surface",
            *LAZY,
        } == set(), command


def test_a_build_begins_without_half_of_scipy():
    """scipy.interpolate takes half a second, optimize with it, and only curves of some files need them."""
    slow = {"scipy.interpolate", "scipy.optimize", "scipy.stats"}
    code = "import sys, importlib, dsfab.design, dsfab.export\n" + "".join(
        f"importlib.import_module('dsfab.{module}'); print({module!r}, *({slow!r} & set(sys.modules)))\n"
        for module in ("export", "app.build", "app.preview", "render.previewer")
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["export", "app.build", "app.preview", "render.previewer"]


def test_all_public_names_exist():
    import dsfab

    packages = [
        dsfab,
        *(import_module(module.name) for module in walk_packages(dsfab.__path__, "dsfab.") if module.ispkg),
    ]
    promised = [(package, name) for package in packages for name in getattr(package, "__all__", ())]
    assert [f"{package.__name__}.{name}" for package, name in promised if not hasattr(package, name)] == []
    with pytest.raises(AttributeError, match="no_such_thing"):
        _ = dsfab.no_such_thing


def test_packaging_finds_every_folder_of_code():
    """setuptools takes folders with an `__init__.py`; tests/test_packaging.py compares the wheel with tracked files."""
    given = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    assert given["packages"]["find"] == {"include": ["dsfab*"], "namespaces": False}
    assert {path.parent for path in PACKAGE.rglob("*.py")} == {path.parent for path in PACKAGE.rglob("__init__.py")}


def test_one_version():
    """Of the tag in git (see test_release.py); the package asks for what it was installed as."""
    given = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert "version" not in given["project"]
    assert given["project"]["dynamic"] == ["version"]
    assert dsfab.__version__ == metadata.version("dsfab")


AT_THE_TOP = {
    *(".ci", ".github", ".gitignore", ".mkdocs.yml", ".pre-commit-config.yaml"),
    *("CHANGELOG.md", "LICENSE", "README.md", "pyproject.toml"),
    "CITATION.cff",  # GitHub, Zenodo and reference managers look for it here alone
    *("docs", "dsfab", "findings", "outputs", "presets", "tests"),
}
"""All that a visitor of the repository sees first; whatever else there is has a folder."""


def test_the_top_level_stays_small():
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert {line.split("/")[0] for line in tracked.splitlines()} == AT_THE_TOP


def test_the_outputs_folder_tracks_only_its_readme():
    tracked = subprocess.run(["git", "ls-files", "outputs"], cwd=ROOT, capture_output=True, text=True, check=True)
    assert tracked.stdout.split() == ["outputs/README.md"]


# --- what tests know


PLAIN = {"_replace", "_fields", "_asdict", "_exit", "_repr_png_"}
"""Names of the standard library and of notebooks that are public in spite of their first letter."""


def is_private(name: object) -> bool:
    """Whether a name is of no concern to others."""
    return isinstance(name, str) and name.startswith("_") and not name.startswith("__") and name not in PLAIN


def root(node: ast.AST) -> str:
    """`a` of `a.b.c`, and nothing of what is no such chain of names."""
    while isinstance(node, ast.Attribute):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""


def imported(among: Iterable[ast.AST]) -> set[str]:
    """Names by which a module knows what it has of dsfab."""
    given = [one for one in among if isinstance(one, ast.Import | ast.ImportFrom)]
    return {
        (alias.asname or alias.name).split(".")[0]
        for one in given
        for alias in one.names
        if (one.module or "" if isinstance(one, ast.ImportFrom) else alias.name).split(".")[0] == "dsfab"
    }


def private_uses(among: Sequence[ast.AST]) -> Iterator[str]:
    """Private names that a test imports from dsfab, reads there, or replaces there."""
    known = imported(among)
    for node in among:
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "dsfab":
            yield from (alias.name for alias in node.names if is_private(alias.name))
        elif isinstance(node, ast.Attribute) and is_private(node.attr) and root(node) in known:
            yield ast.unparse(node)
        elif isinstance(node, ast.Call) and len(node.args) > 1 and root(node.args[0]) in known:
            yield from (one.value for one in node.args[1:2] if isinstance(one, ast.Constant) and is_private(one.value))
        elif isinstance(node, ast.Constant) and re.fullmatch(r"dsfab(\.\w+)*\._[A-Za-z]\w*(\.\w+)*", str(node.value)):
            yield str(node.value)


def private_attributes(among: Sequence[ast.AST]) -> Iterator[str]:
    """Private attributes of objects that a test has made, of which some are foreign."""
    known = imported(among) | {"self", "cls"}
    chains = (node for node in among if isinstance(node, ast.Attribute) and is_private(node.attr))
    return (ast.unparse(node) for node in chains if root(node) not in known)


USED = {"dsfab._HOME", "dsfab.workshop.strips._StripLayer._part"}
"""The table of the facade, which is looked at above, and a method whose seconds a benchmark counts."""

ATTRIBUTES = 42
"""How many private attributes of objects the tests read; it may only shrink, since the inside is to be rebuilt."""


def test_tests_use_public_functions_only():
    texts = [path.read_text(encoding="utf-8") for path in sorted((ROOT / "tests").rglob("*.py"))]
    found = [tuple(ast.walk(ast.parse(text))) for text in texts if re.search(r"\b_[A-Za-z]", text)]
    assert {name for among in found for name in private_uses(among)} <= USED
    attributes = [name for among in found for name in private_attributes(among)]
    assert len(attributes) <= ATTRIBUTES, sorted(attributes)


@pytest.mark.parametrize(
    ("text", "uses"),
    [
        ("from dsfab.a import _b, c", ["_b"]),
        ("from dsfab import a\na.c._b(a.__name__)", ["a.c._b"]),
        ("from dsfab.a import C\npatch.setattr(C, '_b', 1)", ["_b"]),
        ("patch.setattr('dsfab.a._b', 1)", ["dsfab.a." + "_b"]),
        ("from numpy import _b\nimport scipy\nscipy._b\nprint('_b', self._b)", []),
    ],
)
def test_a_planted_private_name_is_found(text, uses):
    assert list(private_uses(tuple(ast.walk(ast.parse(text))))) == uses


# --- sizes and names


def definitions(kind: type) -> Iterator[tuple[str, ast.AST]]:
    """Module and node of every class or function of the product."""
    for _, file, tree in modules():
        for node in nodes(tree):
            if isinstance(node, kind):
                yield file, node


def test_a_class_name_has_one_home():
    homes = Counter(node.name for _, node in definitions(ast.ClassDef) if not node.name.startswith("_"))
    assert [name for name, count in homes.items() if count > 1] == []


def parameters(node: ast.FunctionDef) -> list[str]:
    """Names, without the object or the class itself."""
    given = node.args
    return [one.arg for one in (*given.posonlyargs, *given.args, *given.kwonlyargs) if one.arg not in ("self", "cls")]


def test_no_public_function_takes_over_seven_parameters():
    many = [
        f"{where}: {node.name}"
        for where, node in definitions(ast.FunctionDef)
        if len(parameters(node)) > 7 and not node.name.startswith("_")
    ]
    assert many == []


LONG = 1
"""How many functions are longer than 45 lines, their docstrings left out; it may only shrink."""


def test_functions_are_short():
    lengths = []
    for where, node in definitions(ast.FunctionDef):
        told = ast.get_docstring(node, clean=False)
        lengths.append((node.end_lineno - node.lineno + 1 - (told.count("\n") + 1 if told else 0), where, node.name))
    assert sum(length > 45 for length, *_ in lengths) <= LONG, sorted(lengths)[-LONG - 1 :]
    assert sorted(lengths)[len(lengths) * 9 // 10][0] <= 18
