"""Pictures of the README and of the site: `python -m docs._build.make [NAME...]`.

A design has a picture of its solid, and a page of four: loads, principal stresses, the sheet by families, the solid.
Other pictures are pages of dsfab in a browser, options side by side, drawings of concepts, and pictures of the
examples. Bob's mesh must be in the folder DSFAB_MESHES; without it his pictures do not change.
"""

import os
import runpy
import sys
import tempfile
import time
from contextlib import chdir
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.interpolate import CubicSpline, LinearNDInterpolator

import dsfab
from docs._build.drawings import CONCEPTS
from docs._build.wires import drawn
from dsfab.app.cli import main
from dsfab.app.editor.workspace import OpenedPreset
from dsfab.core.arrays import distances_from_segments
from dsfab.results import silent
from dsfab.preset.file import with_overrides
from dsfab.render.design_picture import caption, client_picture
from dsfab.render.lettering import PAPER
from dsfab.render.opengl import require_rendering
from dsfab.render.picture import Look, picture
from dsfab.render.previewer import panels
from dsfab.render.view import up_axis
from tests.app.editor_page import READY
from tests.app.editor_server import serving
from tests.browser import opened
from tests.meshes import mesh_file

DOCS = Path(__file__).resolve().parents[1]
MEDIA = DOCS / "media"
OWN = DOCS / "examples"
SHIPPED = (
    *("dome", "globe", "barrel_vault", "tower", "snow_vault", "cantilever"),
    *("gridshell", "slab"),
)
OURS = ("canopy", "arena", "four_feet", "trumpet", "saddle", "ring", "tealight")
"""Designs of the gallery with presets in docs/examples."""

DESIGNS = {
    **{name: (name, {}) for name in SHIPPED},
    **{name: (OWN / f"{name}.toml", {}) for name in OURS},
    "my_roof": (OWN / "canopy.obj", {}),
    "figurine": ("figurine", {"surface.file": "bob.obj", "surface.unit": "m"}),
}
ALONE = ("dome", "globe", "barrel_vault", "tower", "snow_vault", "cantilever", "canopy", "figurine", "my_roof")
"""Designs with a large picture of the solid."""

PANEL = (800, 600)
WHOLE = (1600, 1200)
OPTION = (640, 480)
GUIDED = (960, 600)
WIDEST = 1280
"""Largest width of a picture in pixels, because a page is 800 wide and fine screens double the pixels."""
ROW = 1600
"""Largest width of a row of pictures in pixels, because its texts are small."""
QUALITY = 82
"""WebP quality of renderings, of 100, at which texts stay sharp."""
SETTLED = 8.0
"""Seconds until the editor shows its finest picture with software rendering."""


def write(pixels, name: str, widest: int = WIDEST) -> None:
    """Write a picture as WebP, lossless or at `QUALITY`, whichever is smaller; line drawings are smaller lossless."""
    image = Image.fromarray(np.asarray(pixels))
    image.thumbnail((widest, widest), Image.Resampling.LANCZOS)
    made = []
    for how in ({"lossless": True, "quality": 100}, {"quality": QUALITY}):
        image.save(buffer := BytesIO(), "WEBP", method=6, **how)
        made.append(buffer.getvalue())
    (MEDIA / f"{name}.webp").write_bytes(min(made, key=len))


def by_family(design):
    """Return a picture of the sheet in the colours of its families; other kept parts have a third colour."""
    names = list(design.pattern.names)
    colour = np.array([{"major": 0, "minor": 1}.get(name, 2) for name in names])
    family = design.sheet.family
    solid = design.sheet.surface
    tinted = replace(PAPER, families=PAPER.tints)
    told = f"{design.preset.name} - two families of members: major red, minor blue"
    return picture(
        solid.V, solid.F, family=colour[family], caption=told, look=Look(PANEL, palette=tinted, up=upwards(design))
    )


def upwards(design):
    return up_axis(design.surface.V, design.surface, design.load)


def draw(name: str) -> None:
    preset, changes = DESIGNS[name]
    if "surface.file" in changes:
        changes = {**changes, "surface.file": str(mesh_file(changes["surface.file"]))}
    given = dsfab.preset_for(preset) if Path(preset).suffix == ".obj" else dsfab.load_preset(preset, changes)
    design = dsfab.run(given)
    if name == "my_roof":  # the page shows preview.png
        require_rendering()
        write(client_picture(design).render(), name)
        return
    solid = design.solid

    def built(size, load):
        return picture(solid.V, solid.F, surface=design.surface, load=load, caption=caption(design), look=Look(size))

    if name in ALONE:
        write(built(WHOLE, design.load), name)
    above = panels(design, ("loads", "directions"), PANEL, silent).pixels
    bare = picture(solid.V, solid.F, caption=caption(design), look=Look(PANEL, up=upwards(design)))
    write(np.concatenate([above, np.concatenate([by_family(design), bare], axis=1)]), f"{name}_steps")


def editor() -> None:
    """Picture the editor with the dome."""
    _in_the_editor(dsfab.load_preset("dome"), "editor")


def my_roof_editor() -> None:
    """Picture the editor with the proposal of `dsfab new` for the canopy's mesh."""
    _in_the_editor(dsfab.preset_for(OWN / "canopy.obj").model_copy(update={"name": "my_roof"}), "my_roof_editor")


def _in_the_editor(preset: dsfab.Preset, name: str) -> None:
    width, height = 1440, 900
    with (
        serving(OpenedPreset(preset, (preset.name,))) as server,
        tempfile.TemporaryDirectory() as folder,
        opened(Path(folder), (width, height)) as tab,
    ):
        tab.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        tab.open(server.address, f"{READY} && dsfab.viewer.sheet.cut")
        time.sleep(SETTLED)
        tab.picture(Path(folder) / "editor.png")
        write(Image.open(Path(folder) / "editor.png").convert("RGB"), name)


def explore() -> None:
    """Picture a contact sheet of domes."""
    with tempfile.TemporaryDirectory() as folder:
        vary = ["--vary", "pattern.major.spacing=0.8,1.6", "--vary", "pattern.minor.spacing=0.5,0.8"]
        main(["explore", "dome", *vary, "-o", folder])
        write(Image.open(Path(folder) / "sheet.png").convert("RGB"), "explore")


def report() -> None:
    """Picture the first page of a report in a browser."""
    width, height = 1200, 1010
    with tempfile.TemporaryDirectory() as folder, opened(Path(folder) / "browser", (width, height)) as tab:
        main(["compare", "dome", "-o", folder])
        tab.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        tab.open((Path(folder) / "report.html").as_uri(), "document.readyState === 'complete'")
        tab.picture(Path(folder) / "report.png")
        write(Image.open(Path(folder) / "report.png").convert("RGB"), "report")


def workshop() -> None:
    """Picture the page of a gridshell's workshop with a selected member."""
    _page_of_parts(["workshop", "gridshell"], "B10", "workshop")


def card() -> None:
    """Picture the page of a dome's card model with a selected ring."""
    _page_of_parts(CARD.split(), "A03", "card")


CARD = "workshop dome --model 1:50 --stock A3 --thickness 1mm"


def _page_of_parts(command: list[str], member: str, name: str) -> None:
    width, height = 1440, 900
    with tempfile.TemporaryDirectory() as folder, opened(Path(folder) / "browser", (width, height)) as tab:
        main([*command, "-o", folder])
        tab.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        (page,) = Path(folder).rglob("index.html")
        tab.open(page.as_uri(), "document.querySelectorAll('button').length > 10")
        tab.run(f"[...document.querySelectorAll('button')].find(one => one.innerText === '{member}').click()")
        time.sleep(1.0)
        tab.picture(Path(folder) / "page.png")
        write(Image.open(Path(folder) / "page.png").convert("RGB"), name)


OPTIONS = {
    "as the preset says: pattern.major.spacing = 1.1, minor 0.55": {},
    "pattern.major.spacing = 0.7: rings nearer to each other": {"pattern.major.spacing": 0.7},
    "pattern.width.rule = 'graded': wide where the stress is large": {"pattern.width.rule": "graded"},
    "pattern.families = 'minor': one family alone": {"pattern.families": "minor"},
    "pattern.rotate = 45: both families off the stress": {"pattern.rotate": 45.0},
    "pattern.method = 'modes': the paper's stripes": {
        "pattern.method": "modes",
        "pattern.major": {"spacing": 1.1},
        "pattern.minor": {"spacing": 0.55},
    },
}


def options() -> None:
    """Picture a dome with six patterns."""
    told = []
    for words, changes in OPTIONS.items():
        design = dsfab.run(dsfab.load_preset("dome", changes))
        look = Look(OPTION, up=upwards(design))
        told.append(picture(design.solid.V, design.solid.F, caption=words, look=look))
    rows = [np.concatenate(told[k : k + 3], axis=1) for k in (0, 3)]
    write(np.concatenate(rows), "options", ROW)


CURVE = [[-5.0, -3.6], [-3.9, -2.9], [-2.5, -2.0], [-1.2, -1.35], [0.0, -1.2], [1.2, -1.5], [2.5, -2.2], [5.0, -3.8]]
"""Curve in plan over the canopy, metres."""
CANOPY = OWN / "canopy.toml"
NEAR = 0.16
"""Distance from the curve (m) that is red in the picture."""


def guides() -> None:
    """Picture a canopy without a guide, and with a member on a curve."""
    told, canopy = [], dsfab.load_preset(CANOPY)
    V = dsfab.Design.from_preset(canopy).surface.V
    plan = CubicSpline(range(len(CURVE)), CURVE)(np.linspace(0, len(CURVE) - 1, 30))
    curve = np.column_stack([plan, LinearNDInterpolator(V[:, :2], V[:, 2])(plan)]).round(3).tolist()
    member = {"curve": curve, "family": "minor", "member": True}
    start, end = (np.array(part) for part in (curve[:-1], curve[1:]))
    for words, guide in (("a curve (red) and no guide", []), ("a guide on it with member = true", [member])):
        design = dsfab.run(with_overrides(canopy, {"pattern.guide": guide}))
        V, F = design.solid.V, design.solid.F
        near = (distances_from_segments(V[F].mean(axis=1)[:, None], start, end).min(axis=1) < NEAR).astype(np.int64)
        look = Look(GUIDED, palette=replace(PAPER, families=PAPER.tints), up=upwards(design))
        told.append(picture(V, F, family=1 - near, caption=words, look=look))
    write(np.concatenate(told, axis=1), "guides", ROW)


def grasshopper() -> None:
    """Picture the component on its canvas with the structure of the canopy's mesh."""
    with tempfile.TemporaryDirectory() as folder:
        drawn(OWN / "canopy.obj").savefig(Path(folder) / "wires.png")
        write(Image.open(Path(folder) / "wires.png").convert("RGB"), "grasshopper")


PAGES = {
    "grasshopper": grasshopper,
    "options": options,
    "guides": guides,
    "workshop": workshop,
    "card": card,
    "editor": editor,
    "my_roof_editor": my_roof_editor,
    "explore": explore,
    "report": report,
}

EXAMPLES = {path.stem: path for path in sorted(OWN.glob("*.py"))}


def example(name: str) -> None:
    """Run an example and write its picture."""
    with tempfile.TemporaryDirectory() as folder:
        with chdir(folder):
            runpy.run_path(str(EXAMPLES[name]), run_name="__main__")
        write(Image.open(Path(folder) / f"{name}.png").convert("RGB"), f"examples/{name}")


def concept(name: str) -> None:
    """Write a drawing of docs/concepts.md."""
    with tempfile.TemporaryDirectory() as folder:
        CONCEPTS[name]().savefig(Path(folder) / "drawing.png")
        write(Image.open(Path(folder) / "drawing.png").convert("RGB"), f"concepts/{name}")


def files(name: str) -> tuple[str, ...]:
    """Return the files of a name in `MAKERS`, relative to docs/media."""
    if name in DESIGNS:
        return tuple(
            f"{name}{end}.webp" for end, is_drawn in (("", name in ALONE), ("_steps", name != "my_roof")) if is_drawn
        )
    folder = "examples/" if name in EXAMPLES else "concepts/" if name in CONCEPTS else ""
    return (f"{folder}{name}.webp",)


MAKERS = {
    **dict.fromkeys(DESIGNS, draw),
    **{name: lambda name: PAGES[name]() for name in PAGES},
    **dict.fromkeys(EXAMPLES, example),
    **dict.fromkeys(CONCEPTS, concept),
}
"""Functions that write the pictures of a name."""

if __name__ == "__main__":
    for name in sys.argv[1:] or MAKERS:
        if name == "figurine" and "DSFAB_MESHES" not in os.environ:
            print("  figurine: not drawn, because DSFAB_MESHES names no folder with bob.obj")
            continue
        MAKERS[name](name)
        print(*(f"  {MEDIA / file}" for file in files(name)), sep="\n")
