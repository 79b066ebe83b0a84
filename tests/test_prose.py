"""The prose of the product is plain English, and its names say what they hold; see docs/contributing.md.

Each rule counts what breaks it. A count may only fall: whoever lowers it lowers the number here.
"""

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.source import modules, nodes

ROOT = Path(__file__).resolve().parent.parent

LONGEST_SENTENCE = 25
"""Words; a longer sentence has to be read twice."""

RIDDLES = frozenset(
    "what where of as on how whether who which whose all those when that it these this".split()  # noqa: SIM905
)
"""First words of docstrings that make no sense without the code."""

VAGUE = frozenset(
    """some one done found here there way made both told said ask asks asked given drawn known kept held own mine each
    other others same more most best good new old first last next off on at of whole all plain wanted left close far
    near beside""".split()  # noqa: SIM905
)
"""Names of variables that do not say what they hold."""

PREPOSITIONS = frozenset(
    """one some those here there what of at on as within where whose again both near apart along across beyond beside
    around alone alike together how who same other others which most told ask asked known through over under off so
    """.split()  # noqa: SIM905
)
PARTICIPLE = re.compile(
    r"_?[a-z]+(ed|wn|en|ken|ght)|_?(told|made|drawn|found|kept|held|left|met|sought|said|given|known)"
)

ALLOWED = {"first words": 0, "long sentences": 13, "vague names": 47, "prepositions": 2, "participles": 25}


def sentences(text: str) -> Iterator[str]:
    """Sentences of a text; code, tables and lists of arguments end a sentence, too."""
    text = re.sub(r"`[^`]*`", "x", text)
    for paragraph in re.split(r"\n\s*\n|\n(?=\s*[\w, ]{1,30}\s+: )|\n(?=\s*[-*] )|\n(?=    )", text):
        yield from re.split(r"(?<=[.!?;:])\s+", " ".join(paragraph.split()))


@cache
def texts() -> tuple[tuple[str, str, bool], ...]:
    """Place, text, and whether it is a docstring, of every docstring and comment of the product."""
    collected = []
    for _, file, tree in modules():
        for node in nodes(tree):
            if (
                isinstance(node, ast.Expr)
                and isinstance(node.value, ast.Constant)
                and isinstance(node.value.value, str)
            ):
                collected.append((f"{file}:{node.lineno}", node.value.value.strip(), True))
        source = io.StringIO((ROOT / "dsfab" / file).read_text(encoding="utf-8"))
        for token in tokenize.generate_tokens(source.readline):
            if token.type == tokenize.COMMENT and not re.match(r"# (type|noqa|fmt|ruff)", token.string):
                collected.append((f"{file}:{token.start[0]}", token.string.lstrip("# "), False))
    return tuple(collected)


def riddles(among: tuple[tuple[str, str, bool], ...]) -> list[str]:
    return [place for place, text, is_docstring in among if is_docstring and text.split()[0].lower() in RIDDLES]


def long_sentences(among: tuple[tuple[str, str, bool], ...]) -> list[str]:
    return [
        f"{place}: {sentence[:60]}"
        for place, text, _ in among
        for sentence in sentences(text)
        if len(re.findall(r"[A-Za-z][A-Za-z'-]*", sentence)) > LONGEST_SENTENCE
    ]


def functions() -> Iterator[tuple[str, ast.FunctionDef]]:
    for _, file, tree in modules():
        yield from ((file, node) for node in nodes(tree) if isinstance(node, ast.FunctionDef))


def names_of(function: ast.FunctionDef) -> set[str]:
    """Names that a function binds: its parameters, and the variables that it assigns."""
    arguments = function.args
    parameters = {x.arg for x in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)} - {"self", "cls"}
    stored = (x.id for x in ast.walk(function) if isinstance(x, ast.Name) and isinstance(x.ctx, ast.Store))
    return parameters.union(stored)


def counted(rule: str) -> list[str]:
    """Every place that breaks a rule."""
    if rule == "first words":
        return riddles(texts())
    if rule == "long sentences":
        return long_sentences(texts())
    if rule == "vague names":
        return [f"{file}: {f.name}: {name}" for file, f in functions() for name in sorted(names_of(f) & VAGUE)]
    if rule == "prepositions":
        return [f"{file}: {f.name}" for file, f in functions() if f.name.lstrip("_") in PREPOSITIONS]
    return [f"{file}: {f.name}" for file, f in functions() if PARTICIPLE.fullmatch(f.name)]


@pytest.mark.parametrize("rule", ALLOWED)
def test_the_count_of_each_rule_may_only_fall(rule):
    places = counted(rule)
    assert len(places) <= ALLOWED[rule], "\n".join(places)


def test_each_rule_finds_a_planted_violation():
    planted = (("a.py:1", "What of it", True), ("a.py:2", "word " * 26 + ".", False), ("a.py:3", "Return it.", True))
    assert riddles(planted) == ["a.py:1"]
    assert [place.partition(": ")[0] for place in long_sentences(planted)] == ["a.py:2"]
    (function,) = ast.parse("def told(one, width):\n    found = width\n    return found").body
    assert isinstance(function, ast.FunctionDef)
    assert names_of(function) & VAGUE == {"one", "found"}
    assert PARTICIPLE.fullmatch(function.name)
