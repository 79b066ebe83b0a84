"""Links from the first use of a word on a page of the site to its entry in the glossary."""

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import Files
from mkdocs.structure.pages import Page

GLOSSARY = "concepts.md"
TERMS = re.findall(
    r"^\*\*(.+)\*\*\n:", (Path(__file__).parents[1] / GLOSSARY).read_text(encoding="utf-8"), flags=re.MULTILINE
)

EVERYDAY = {"case", "keep", "sheet", "widths", "guide"}
"""Terms without links, because they are everyday words too, for example a sheet of plywood."""

PAGES = {
    *("index.md", "ten-minutes.md", "gallery.md", "case-studies.md"),
    *("surfaces.md", "supports-and-loads.md", "patterns.md", "editor.md", "files.md", "eurocode.md", "workshop.md"),
    *("many-designs.md", "report.md", "python.md", "grasshopper.md", "blender.md", "messages.md", "trust.md"),
    "paper-figures.md",
}
"""Pages with links: pages for beginners, without the theory and the tables of keys."""

NO_PROSE = re.compile(
    r"```.*?```|`[^`\n]+`|<!--.*?-->|!?\[[^]]*\]\([^)]*\)|^#.*?$|^\|.*?$|<[^>]+>|\{[^}\n]*\}",
    flags=re.DOTALL | re.MULTILINE,
)
"""Code, links, headings, tables and marks, which get no links."""


def anchor(term: str) -> str:
    """Return the anchor of a term: 'dead end' -> 'dead-end'."""
    return term.replace(" ", "-")


def linked(markdown: str) -> str:
    """Return a page with a link at the first use of each term."""
    for term in sorted(set(TERMS) - EVERYDAY, key=len, reverse=True):
        many = rf"{term[:-1]}(?:y|ies)" if term.endswith("y") and term[-2] not in "aeiou" else rf"{term}(?:es|s)?"
        word = re.compile(rf"(?<![\w-]){many}(?![\w-])", flags=re.IGNORECASE)
        end = 0
        for start, stop in [found.span() for found in NO_PROSE.finditer(markdown)] + [(len(markdown), len(markdown))]:
            if found := word.search(markdown, end, start):
                link = f"[{found[0]}]({GLOSSARY}#{anchor(term)}){{ .term }}"
                markdown = markdown[: found.start()] + link + markdown[found.end() :]
                break
            end = stop
    return markdown


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Return a page with links to the glossary, or the glossary with anchors (hook of mkdocs)."""
    if page.file.src_uri == GLOSSARY:
        for term in TERMS:
            markdown = markdown.replace(f"**{term}**\n:", f"**{term}**{{ #{anchor(term)} }}\n:")
    return linked(markdown) if page.file.src_uri in PAGES else markdown
