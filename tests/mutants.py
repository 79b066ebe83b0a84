"""Mutation testing: small mistakes planted in twenty functions one at a time, and whether their tests notice.

    python -m tests.mutants                # all; a quarter of an hour
    python -m tests.mutants wave stress    # some

A mistake is another operator, comparison, number, sign or order of arguments in one place of the function. The code of
the function is exchanged in a fork of this process, where its tests run then: no file is touched. What survives is
either the same function in other words, or a test that is missing. Linux and macOS only.
"""

import argparse
import ast
import contextlib
import copy
import importlib
import inspect
import os
import signal
import sys
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import CodeType, FunctionType

import pytest

QUIET = ("-W", "ignore::pytest.PytestAssertRewriteWarning")
"""Plugins that this process has imported before pytest are no fault of the tests."""
LONGEST = 120
"""Seconds after which the tests of a mutant hang, which is noticed too."""


@dataclass(frozen=True)
class Subject:
    """A function, by its module and name there, and the tests that should notice: a file and words of pytest's -k."""

    module: str
    name: str
    file: str
    words: str = ""

    def function(self) -> FunctionType:
        """The function itself, also a method, without what is wrapped around it."""
        found = importlib.import_module(f"dsfab.{self.module}")
        for part in self.name.split("."):
            found = inspect.getattr_static(found, part)
        return inspect.unwrap(found)


SUBJECTS = (
    Subject("surface.shapes.figures", "twisted_solid", "surface/test_figures.py", "twisted_solid"),
    Subject("surface.shapes.round_shapes", "tower", "surface/test_shapes.py", "tower or sizes"),
    Subject("surface.mesh", "_tetrahedron_volumes", "surface/test_mesh.py"),
    Subject("surface.mesh", "_face_blocks", "surface/test_mesh.py"),
    Subject("surface.files.drawings", "_loops", "surface/test_drawings.py"),
    Subject("surface.files.obj_and_off", "_add_face", "surface/test_reader.py"),
    Subject("surface.files.mesh_files", "with_shared_vertices", "surface/test_soup.py"),
    Subject("statics.model", "Material.membrane", "statics/test_statics.py"),
    Subject("statics.model", "Material.bending_stiffness", "statics/test_statics.py"),
    Subject("statics.stress", "stress", "statics/test_statics.py"),
    Subject("statics.stress", "von_mises", "statics/test_stress.py"),
    Subject("diffusion.tensors", "principal_stresses", "diffusion/test_diffusion.py"),
    Subject("diffusion.tensors", "_is_isotropic", "diffusion/test_diffusion.py"),
    Subject("diffusion.tensors", "combined_stress", "statics/test_cases.py", "combined"),
    Subject("diffusion.tensors", "diffusion_operator", "diffusion/test_diffusion.py"),
    Subject("pattern.stripes", "wave", "pattern/test_pattern.py"),
    Subject("pattern.stripes", "Stripes.levels", "pattern/test_pattern.py"),
    Subject("pattern.stripes", "Stripes.with_width_factor", "pattern/test_width.py"),
    Subject("pattern.stripes", "frequency_for", "pattern/test_spacing.py"),
    Subject("export.splines", "_parabolas", "export/test_smooth_fits.py"),
    Subject("export.cad.step.smooth.charts", "fitted_surface", "export/test_smooth_fits.py", "poles"),
)

SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult, ast.Mod: ast.Mult,
    ast.FloorDiv: ast.Mult, ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.And: ast.Or, ast.Or: ast.And, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip
"""One operator for another."""
PAIRS = (("min", "max"), ("sin", "cos"), ("floor", "ceil"), ("any", "all"), ("ones", "zeros"))
NAMES = {a: b for pair in PAIRS for a, b in (pair, pair[::-1])}
"""One function for another."""


def mutants(function: FunctionType) -> Iterator[tuple[str, CodeType]]:
    """What is changed in a function, and its code then."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    tree.body[0].decorator_list = []  # type: ignore[attr-defined]
    first = function.__code__.co_firstlineno
    body = [node for statement in tree.body[0].body for node in ast.walk(statement)]  # type: ignore[attr-defined]
    for number, node in enumerate(body):
        for words, change in _changes(node):
            other = copy.deepcopy(tree)
            same = [n for statement in other.body[0].body for n in ast.walk(statement)]  # type: ignore[attr-defined]
            before = ast.unparse(node)
            change(same[number])
            space: dict[str, object] = {}
            code = compile(ast.fix_missing_locations(other), function.__code__.co_filename, "exec")
            exec(code, function.__globals__ | {"__name__": function.__module__}, space)
            line = first + getattr(node, "lineno", 1) - 1
            (made,) = (one for one in space.values() if isinstance(one, FunctionType))
            yield f"{line}: {words or before + ' -> ' + ast.unparse(same[number])}", made.__code__


Change = Callable[[ast.AST], None]


def _changes(node: ast.AST) -> Iterator[tuple[str, Change]]:
    """The mistakes that can be made at one place of a tree."""
    match node:
        case ast.BinOp(op=op) | ast.BoolOp(op=op) if type(op) in SWAPS:
            yield "", lambda n: setattr(n, "op", SWAPS[type(n.op)]())
        case ast.Compare(ops=[op]) if type(op) in SWAPS:
            yield "", lambda n: setattr(n, "ops", [SWAPS[type(n.ops[0])]()])
        case ast.UnaryOp(op=ast.USub() | ast.Not()):
            yield (
                "",
                lambda n: (
                    setattr(n, "op", ast.UAdd() if isinstance(n.op, ast.USub) else ast.Not())
                    or (setattr(n, "operand", ast.UnaryOp(ast.Not(), n.operand)) if isinstance(n.op, ast.Not) else None)
                ),
            )
        case ast.Constant(value=bool()):
            yield "", lambda n: setattr(n, "value", not n.value)
        case ast.Constant(value=int() | float()):
            yield "", lambda n: setattr(n, "value", n.value + 1)
            if node.value not in (0, 1):
                yield "", lambda n: setattr(n, "value", n.value / 2 if isinstance(n.value, float) else n.value - 1)
        case ast.Attribute(attr=name) if name in NAMES:
            yield "", lambda n: setattr(n, "attr", NAMES[n.attr])
        case ast.Name(id=name) if name in NAMES:
            yield "", lambda n: setattr(n, "id", NAMES[n.id])
        case ast.Call(args=[_, _]):
            yield "", lambda n: n.args.reverse()


def noticed(subject: Subject, function: FunctionType, code: CodeType) -> bool:
    """Whether a test fails, or hangs, in a fork with other code in the function."""
    child = os.fork()
    if not child:
        signal.alarm(LONGEST)
        os.setsid()
        with open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), 1), os.dup2(nowhere.fileno(), 2)
        function.__code__ = code
        words = ["-k", subject.words] if subject.words else []
        how = ("-x", "-q", "-n", "0", "-p", "no:cacheprovider", *QUIET)
        os._exit(int(pytest.main([f"tests/{subject.file}", *words, *how])))
    _, status = os.waitpid(child, 0)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)  # what its tests left running
    return status != 0


def survivors(subject: Subject) -> tuple[int, list[str]]:
    """How many mutants a function has, and which of them no test notices; raises where its tests fail without any."""
    function, tests = subject.function(), f"tests.{subject.file.removesuffix('.py').replace('/', '.')}"
    importlib.import_module(tests)  # what it imports is there then, in all forks
    del sys.modules[tests]
    if noticed(subject, function, function.__code__):
        raise RuntimeError(f"the tests of {subject.name} fail without a mutant, or there is none")
    found, count = [], 0
    for words, code in mutants(function):
        count += 1
        if not noticed(subject, function, code):
            found.append(words)
    return count, found


def main() -> int:
    """0 where each function of the list could be judged."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description="plant mistakes, see who notices")
    parser.add_argument("names", nargs="*", help=f"of {', '.join(one.name for one in SUBJECTS)}")
    asked = parser.parse_args().names
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    planted = left = 0
    for subject in SUBJECTS:
        if asked and subject.name not in asked and subject.name.rpartition(".")[2] not in asked:
            continue
        count, found = survivors(subject)
        planted, left = planted + count, left + len(found)
        print(f"{subject.module}.{subject.name}: {count} planted, {len(found)} survive ({subject.file})", flush=True)
        for words in found:
            print(f"    {words}", flush=True)
    print(f"{planted} planted, {left} survive")
    return 0


if __name__ == "__main__":
    sys.exit(main())
