"""Designs that tests of several files look at: each is made once in a run, by whichever process comes first."""

import os
import pickle
import re
import shutil
import tempfile
from collections.abc import Iterable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

from dsfab.core.errors import DsfabError
from dsfab.core.toml_files import shipped_presets
from dsfab.design import Design
from dsfab.preset.file import load_preset
from dsfab.preset.model import Preset

FOLDER = "DSFAB_TEST_DESIGNS"
"""Environment variable: the folder of a run, which its processes inherit."""


def untried(*_: object, **__: object) -> None:
    """Refuse, in place of a trial of a search, which takes seconds."""
    raise DsfabError("not tried")


def begin() -> None:
    """Make the folder of a run."""
    os.environ[FOLDER] = tempfile.mkdtemp(prefix="dsfab-designs-")


def end() -> None:
    """Remove it."""
    shutil.rmtree(os.environ.pop(FOLDER), ignore_errors=True)


COARSER = {
    "barrel_vault": 0.3,
    "bridge": 0.6,
    "globe": 0.1,
    "gridshell": 0.16,
    "pirate": 0.032,
    "slab": 0.3,
    "snow_vault": 0.4,
    "sphere_graded": 0.09,
    "tower": 0.8,
    "turkey": 0.02,
    "twisty_tower": 1.0,
}
"""Metres, of the triangles' edges of presets that would take long."""

PAPER = 2.2
"""Times the edges of the paper's other presets: a fifth of the vertices."""


ROUGHER = 2.0
"""Times the edges of the triangles of presets, where a test asks whether a command runs."""


def rough_presets(folder: Path, paths: Iterable[Path], apart: float = 1.0, rougher: float = ROUGHER) -> Path:
    """Presets on coarser meshes, of which STEP files hold triangles: for commands as pages write them.

    apart : times the distance of evenly spaced members; what is cut and written has this squared as fewer faces.
    rougher : times the edges of the triangles.
    """
    times = {"edge": rougher, "refine": rougher, "spacing": apart}
    for path in paths:
        text = re.sub(
            r"^(edge|refine|spacing) = ([\d.]+)",
            lambda own: f"{own[1]} = {times[own[1]] * float(own[2]):g}",
            path.read_text(encoding="utf-8"),
            flags=re.M,
        )
        head, export, rest = text.partition("[export]\n")
        quick = f'{head}{export or "[export]"}\nstep = "tessellated"\n{rest}'  # OCCT judges no faces then
        (folder / path.name).write_text(quick, encoding="utf-8")
    return folder


def coarse_design(name: str) -> Design:
    """The design of a shipped preset, cut, on a mesh that takes seconds, without round corners."""
    if name in COARSER or shipped_presets()[name].parent.name != "paper":
        coarser = {"surface.edge": COARSER[name]} if name in COARSER else {}
        return sliced(load_preset(name, {"pattern.fillet": 0.0, **coarser}))
    return paper_design(name)


def paper_design(name: str) -> Design:
    """The design of a preset of the paper, cut, on a coarser mesh."""
    return sliced(load_preset(name, {"surface.edge": PAPER * load_preset(name).surface.edge}))


def sliced(preset: Preset) -> Design:
    """The design of a preset, cut."""
    path = Path(os.environ[FOLDER], sha256(preset.model_dump_json().encode()).hexdigest())
    if not path.exists():
        made = Design.from_preset(preset).until("slicing")
        partial = path.with_suffix(f".{os.getpid()}")
        partial.write_bytes(pickle.dumps(made, protocol=5))
        partial.replace(path)
    return replace(pickle.loads(path.read_bytes()), preset=preset)
