"""Docstrings, measured: what takes or returns arrays says their shapes, and every public function has a sentence."""

import ast
import re
from collections.abc import Iterator
from functools import cache

import pytest

from tests.source import modules

ARRAYS = re.compile(r"\b(Floats|Ints|Bools|NDArray|ArrayLike|csr_array)\b")
LENGTH = r"(?:\.\.\.|\d+(?: \w+)?|(?:\d+ ?)?[A-Za-z]'{0,2})"
"""One length in a shape: n, m', 3, 3 corners, 2 n, or any (...)."""
SUM = rf"{LENGTH}(?: ?[-+*] ?{LENGTH})*"
SHAPE = re.compile(rf"\((?:\.\.\.|(?:[\w^']+, )*{SUM},(?: [\w^' +*-]+,?)*)\)|\([\w^']+, {SUM}\)")
"""(n, 3), (m,), (...), (m, 3 corners, 3), (k + 1,), (side^2, 3)."""

SHAPED, DESCRIBED = 0.95, 0.95
"""The least shares; they may only grow."""


def public(tree: ast.Module | ast.ClassDef, inside: str = "") -> Iterator[tuple[str, ast.FunctionDef]]:
    """Functions and methods that a user may call, with the names of their classes."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name.startswith("_"):
            continue
        if isinstance(node, ast.FunctionDef):
            yield inside + node.name, node
        elif isinstance(node, ast.ClassDef):
            yield from public(node, f"{inside}{node.name}.")


@cache
def functions() -> tuple[tuple[str, ast.FunctionDef], ...]:
    """All of them, as 'file:line name'."""
    return tuple((f"{file}:{node.lineno} {name}", node) for _, file, tree in modules() for name, node in public(tree))


def takes_arrays(node: ast.FunctionDef) -> bool:
    """Whether an array is annotated, of its arguments or of what it returns."""
    given = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    notes = [one.annotation for one in given if one.annotation] + ([node.returns] if node.returns else [])
    return any(ARRAYS.search(ast.unparse(note)) for note in notes)


def tells_shape(node: ast.FunctionDef) -> bool:
    """Whether its docstring has a shape in it."""
    return bool(SHAPE.search(ast.get_docstring(node) or ""))


def tells(node: ast.FunctionDef) -> bool:
    """Whether its docstring has several words and an end."""
    text = ast.get_docstring(node) or ""
    return len(text.split()) > 2 and bool(re.search(r"[.:?](\s|$)", text))


def test_functions_of_arrays_state_the_shapes():
    asked = [(name, node) for name, node in functions() if takes_arrays(node)]
    silent = [name for name, node in asked if not tells_shape(node)]
    assert len(silent) <= (1 - SHAPED) * len(asked), f"{len(silent)} of {len(asked)}:\n" + "\n".join(silent)


def test_public_functions_have_a_sentence():
    asked = functions()
    silent = [name for name, node in asked if not tells(node)]
    assert len(silent) <= (1 - DESCRIBED) * len(asked), f"{len(silent)} of {len(asked)}:\n" + "\n".join(silent)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("(n, 3) metres.", True),
        ("(m,) areas.", True),
        ("(...) lengths of vectors (..., 3).", True),
        ("(m, 3 corners, 3) stress (xx, yy, xy).", True),
        ("(side^2, 3) places.", True),
        ("(3 n, k) unknowns.", True),
        ("(n' + 1,) levels.", True),
        ("The view fills a box (left, right, bottom, top).", False),
        ("Forces (a line, say) on the picked vertices.", False),
        ("The paper (section 3.1) and (see `CELL_AREA`, `FLATNESS`).", False),
    ],
)
def test_the_shape_detector_finds_shapes_in_docstrings(text: str, found: bool) -> None:
    (node,) = ast.parse(f'def f(x: Floats) -> Ints:\n    """{text}"""').body
    assert isinstance(node, ast.FunctionDef)
    assert takes_arrays(node)
    assert tells_shape(node) == found
