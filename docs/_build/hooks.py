"""Pages of the site that mkdocs generates from the code, so that every option on them exists.

on_files          adds the home page, the tables of keys and commands, the Python names, the examples
on_page_markdown  changes links of the repository to links of the site
"""

import ast
import contextlib
import inspect
import io
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

import dsfab
from dsfab.app.cli import app, main
from dsfab.preset import model as preset
from dsfab.preset import sections, surface_section

ROOT = Path(__file__).resolve().parents[2]
SECTIONS = {
    "surface": surface_section.OwnSurface,
    "statics": preset.Statics,
    "diffusion": preset.Diffusion,
    "pattern": preset.Pattern,
    "pattern.major": preset.Family,
    "pattern.width": preset.Width,
    "slicing": preset.Slicing,
    "thickening": preset.Thickening,
    "fabrication": preset.Fabrication,
    "sizing": sections.Sizing,
    "export": preset.Export,
    "workshop": sections.Workshop,
    "eurocode": sections.Eurocode,
}
"""Sections of a preset with tables of keys; pages show supports, loads, guides and regions by examples."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages to the files of the site (hook of mkdocs)."""
    made = {
        "reference-presets.md": preset_keys(),
        "reference-commands.md": commands(),
        "reference-python.md": python_names(),
        "examples.md": examples(),
        "index.md": (ROOT / "README.md").read_text(encoding="utf-8"),
    }
    for page, text in made.items():
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Return a page with formulas, inserted tables and links of the site (hook of mkdocs)."""
    text = markdown
    if page.file.src_uri == "contributing.md":
        text = re.sub("<!-- drawing: [^>]*-->", lambda _: architecture(), text)
        text = re.sub("<!-- benchmarks: [^>]*-->", lambda _: benchmarks(), text)
    if page.meta.get("math"):
        text = re.sub(r"\$\$(.+?)\$\$", lambda found: formula(found[1], "block"), text, flags=re.DOTALL)
        text = re.sub(r"\$([^$\n]+)\$", lambda found: formula(found[1], "inline"), text)
    return re.sub(r"\]\(docs/", "](", text)


def architecture() -> str:
    """Return the drawing of the rooms in the docstring of tests/test_architecture.py."""
    told = ast.get_docstring(
        ast.parse((ROOT / "tests" / "test_architecture.py").read_text(encoding="utf-8")), clean=False
    )
    return f"```text\n{(told or '').split(chr(10) * 2)[1]}\n```"


def benchmarks() -> str:
    """Return a table of the scripts of tests/benchmarks with the first line of each docstring."""
    rows = []
    for path in sorted((ROOT / "tests" / "benchmarks").glob("*.py")):
        told = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        if path.stem not in ("__init__", "common"):
            rows.append(f"| `{path.stem}` | {told.splitlines()[0]} |")
    return "| script | what it measures |\n|---|---|\n" + "\n".join(rows)


def formula(latex: str, display: str) -> str:
    """Convert LaTeX to MathML, which browsers draw without a script."""
    drawn = convert(latex.strip(), display=display)
    return f'<div class="formula">{drawn}</div>' if display == "block" else f"<span>{drawn}</span>"


def examples() -> str:
    """Return the page of examples: docstring, picture and code of each script of docs/examples."""
    parts = ["# Examples", "These scripts of `docs/examples/` run without changes: `python cloud_roof.py`."]
    for path in sorted((ROOT / "docs" / "examples").glob("*.py")):
        text = path.read_text(encoding="utf-8")
        about = ast.get_docstring(ast.parse(text)) or ""
        name = path.stem.replace("_", " ").capitalize()
        picture = f"![{name}](media/examples/{path.stem}.webp){{ width=560 }}"
        parts += [f"## {name}", about, picture, f"```python\n{text.partition(chr(10))[2].strip()}\n```"]
    return "\n\n".join(parts) + "\n"


def preset_keys() -> str:
    """Return a table for each section of a preset: key, allowed values, default, meaning."""
    parts = [
        "# Preset keys",
        "Units are metres, newtons and pascals. A command changes a key by `--set key=value`.",
    ]
    for name, model in SECTIONS.items():
        also = " and [pattern.minor]" if name == "pattern.major" else ""
        parts += [
            f"## [{name}]{also}",
            "| key | allowed values | default | meaning |\n|---|---|---|---|\n" + "\n".join(_rows(model)),
        ]
    return "\n\n".join(parts) + "\n"


def _rows(model: type[BaseModel]) -> list[str]:
    words = {
        name: text for kind in reversed(model.__mro__) if issubclass(kind, BaseModel) for name, text in _said(kind)
    }
    return [
        f"| `{key}` | {_allowed(field)} | {_default(field)} | {words.get(key, '')} |"
        for key, field in model.model_fields.items()
        if not isinstance(field.annotation, type) or not issubclass(field.annotation, BaseModel)
    ]


def _said(model: type[BaseModel]) -> list[tuple[str, str]]:
    """Return the fields of a class with the text below each field."""
    if model is BaseModel:
        return []
    body = ast.parse(inspect.cleandoc("\n" + inspect.getsource(model))).body[0].body  # type: ignore[attr-defined]
    return [
        (field.target.id, " ".join(text.value.value.split()))
        for field, text in pairwise(body)
        if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
    ]


def _allowed(field: Any) -> str:
    """Return type and limits in words: 'number, at least 0, at most 1' or 'modes, stripes, auto'."""
    limits = [re.sub(r"^(\w+)\(\w+=(.*)\)$", r"\1 \2", repr(x)) for x in field.metadata]
    signs = {"Ge": "at least", "Gt": "over", "Le": "at most", "Lt": "under"}
    told = [f"{signs[sign]} {value}" for sign, _, value in (x.partition(" ") for x in limits) if sign in signs]
    choices = getattr(field.annotation, "__args__", ())
    if choices and all(isinstance(x, str) for x in choices):
        return ", ".join(f"`{x}`" for x in choices)
    names = {float: "number", int: "whole number", bool: "`true`, `false`", str: "text"}
    kind = names.get(field.annotation, "")
    return ", ".join(x for x in (kind, *told) if x)


def _default(field: Any) -> str:
    value = field.get_default(call_default_factory=True)
    if value is PydanticUndefined:
        return "must be given"
    if value is None or value in ("", (), {}) or isinstance(value, BaseModel):
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple):
        value = [list(x) if isinstance(x, tuple) else x for x in value]
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"


def commands() -> str:
    """Return the page of commands with the help of each command."""
    names = sorted(name for name in app if not name.startswith("-"))
    parts = ["# Commands", "Every command, as `dsfab COMMAND --help` shows it."]
    for name in names:
        shown = io.StringIO()
        with contextlib.redirect_stdout(shown):
            main([name, "--help"])
        parts += [f"## dsfab {name}", f"```text\n{shown.getvalue().rstrip()}\n```"]
    return "\n\n".join(parts) + "\n"


def python_names() -> str:
    """Return the page of public names with their docstrings."""
    things = [thing for thing in (getattr(dsfab, name) for name in dsfab.__all__) if callable(thing)]
    parts = ["# Python", "Names of `import dsfab`. Units are metres, newtons and pascals."]
    return "\n\n".join([*parts, *(_named(thing) for thing in things)])


def _named(thing: Any) -> str:
    """Return the mkdocstrings directive of a public name."""
    name = f"dsfab.{thing.__name__}"
    return (
        f"::: {thing.__module__}.{thing.__qualname__}\n    options: {{ heading: {name}, toc_label: {thing.__name__} }}"
    )


SHIM = ("https://unpkg.com/iframe-worker/shim", "vendor/iframe-worker.js")
"""Script for the search without a server (MIT, licence beside it), and its local copy."""


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Replace the remote script by the local copy (hook of mkdocs)."""
    return output.replace(*SHIM)


def on_post_template(output_content: str, template_name: str, config: MkDocsConfig) -> str:
    """Replace the remote script in the page for unknown addresses (hook of mkdocs)."""
    return output_content.replace(*SHIM)
