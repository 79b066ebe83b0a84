"""The kit of all pages: the frame of an HTML file that fetches nothing, one style, and what stands in most of them."""

from collections.abc import Mapping
from html import escape

from dsfab.render import PAPER

COLOURS: Mapping[str, tuple[int, int, int]] = {
    "paper": PAPER.paper,
    "text": PAPER.text,
    "quiet": (112, 107, 102),
    "hair": (219, 216, 212),
    "tint": (245, 242, 237),
    "blue": PAPER.load,
    "clay": (184, 92, 56),
    "good": (28, 110, 66),
    "bad": (168, 50, 26),
    "open": (138, 90, 0),
}
"""Red green blue in 0..255: of pages by the names of their styles' variables, and of what is printed beside them."""

_STYLE = """
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 3.5rem 2.5rem 4rem; background: var(--paper); color: var(--text);
  font: 16px/1.5 var(--sans); }
h1 { margin: 0; font-size: 2.1rem; font-weight: 600; letter-spacing: -0.02em; line-height: 1.2; }
h2 { margin: 0; font-size: 1.45rem; font-weight: 600; letter-spacing: -0.01em; line-height: 1.25; }
a { border-radius: 4px; } :focus-visible { outline: 3px solid var(--blue); outline-offset: 3px; }
figure { margin: 0; } img { display: block; width: 100%; height: auto; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding: .2rem 0; }
th, td { text-align: right; padding: .15rem .6rem; border-bottom: 1px solid var(--hair); white-space: nowrap; }
th { font-weight: 600; }
dt { color: var(--quiet); } dd { margin: 0; }
code { font: 12.5px/1.55 var(--mono); background: var(--tint); padding: .15rem .45rem; border-radius: 4px; }
.quiet { color: var(--quiet); }
.why { margin: 0; aspect-ratio: 4 / 3; display: grid; place-content: center; text-align: center; padding: 0 12%;
  border: 1px solid var(--hair); border-radius: 4px; color: var(--quiet); font-size: .9rem; }
@media (max-width: 60rem) { body { padding: 1.5rem 1rem; } }
@media print { body { margin: 0; padding: 0; max-width: none; background: none; font-size: 10pt; }
  figure, tr { break-inside: avoid; } }
"""


def style() -> str:
    """What every page looks like, in CSS: its variables, and rules that its own style may come after."""
    colours = " ".join(f"--{name}: rgb{colour};" for name, colour in COLOURS.items())
    fonts = (
        '--sans: system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; '
        '--mono: ui-monospace, SFMono-Regular, Menlo, Consolas, "Liberation Mono", monospace;'
    )
    return f"\n:root {{ color-scheme: light; {colours}\n  {fonts} }}{_STYLE}"


def html_page(title: str, body: str, own: str = "") -> str:
    """A whole file: plain `title`, marked-up `body`, and the rules that are its own, in CSS."""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{style()}{own}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def image(source: str, alt: str, size: tuple[int, int], lazy: bool = True) -> str:
    """A picture of so many pixels; `alt` is plain text."""
    wide, high = size
    loading = ' loading="lazy"' if lazy else ""
    return f'<img src="{source}" alt="{escape(alt, quote=True)}" width="{wide}" height="{high}"{loading}>'


def why(text: str) -> str:
    """In the place of a picture that there is not, why."""
    return f'<p class="why">{escape(text)}</p>'
