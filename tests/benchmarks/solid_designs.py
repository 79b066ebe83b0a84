"""Random designs for `solid_truth`: kinds of surfaces with their supports and loads, and draws of each."""

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import dsfab
from dsfab.design.design import Design
from dsfab.study.verdict.calibration import KINDS, WIDTHS, Kind
from tests.meshes import FOLDER

_EDGES = {"at": {"pick": "boundary"}, "hold": "xyz"}
_FOOT = {"at": {"pick": "side", "axis": "z", "end": "min"}, "hold": "xyz"}
_SNOW = {"kind": "snow", "pressure": 800.0}
_CLAMPED = {"at": {"pick": "side", "axis": "x", "end": "min"}, "hold": "xyz", "clamp": True}
_DOWN = {"kind": "force", "at": {"pick": "side", "axis": "x", "end": "max"}, "force": [0.0, 0.0, -1e3]}
_TOP = {"kind": "line", "at": {"pick": "side", "axis": "z", "end": "max"}, "per_metre": [800.0, 0.0, -3000.0]}


_SECTOR = {"pick": "box", "min": [2.0, -0.8, 1.0], "max": [4.0, 0.8, 2.0]}
_ON_THE_TORUS = {"kind": "force", "at": _SECTOR, "force": [0, 0, -5e4]}


def _dome(surface: dict[str, Any], keep: float, **more: Any) -> Kind:
    changes = {"surface": surface, "pattern.keep": keep, "pattern.rim": 0.8 * keep, **more}
    return Kind("dome", changes, (2.0, 4.0))


COARSER = 1.5
"""Edges of the kinds of `dsfab verify --calibration`, times this: three meshes of a solid are to be solved."""

FEWER = 0.65
"""And their frequencies times this."""

FITTED: dict[str, Kind] = {
    **{
        name: replace(kind, changes=kind.changes | {"surface.edge": COARSER * kind.changes["surface.edge"]})
        for name, kind in KINDS.items()
    },
    "hypar": _dome(
        {"shape": "hypar", "side": 8.0, "rise": 3.0, "edge": 0.5, "support": [_EDGES], "load": [_SNOW]}, 0.3
    ),
    "catenoid": _dome(
        {"shape": "catenoid", "waist": 1.5, "rim": 4.0, "edge": 0.6, "support": [_FOOT], "load": [_SNOW]}, 0.3
    ),
    "cylinder": _dome(
        {"shape": "cylinder", "radius": 2.0, "height": 4.0, "edge": 0.4, "support": [_FOOT], "load": [_TOP]}, 0.25
    ),
    "torus": Kind(
        "globe",
        {
            "surface": {
                "shape": "torus",
                "major": 3.0,
                "minor": 1.2,
                "edge": 0.55,
                "support": [{"at": {"pick": "side", "axis": "z", "end": "min", "depth": 0.1}, "hold": "xyz"}],
                "load": [_ON_THE_TORUS],
            },
            "pattern.keep": 0.4,
        },
        (2.0, 4.0),
    ),
    "tower": Kind("tower", {"surface.edge": 1.2, "pattern.keep": 0.6}, (2.5, 5.0)),
    "bracket": Kind(
        "cantilever",
        {
            "surface.edge": 0.12,
            "statics.bending": "hhj",
            "statics.membrane": "quadratic",
            "surface.support": [_CLAMPED],
            "surface.load": [_DOWN],
            "pattern.rim": 0.06,
        },
        (2.5, 4.5),
    ),
}
"""The kinds of `dsfab verify --calibration` with fewer triangles, a bent plate that is built in, and shells. The
factors of `theory.py` were chosen on draws of these."""

_COLUMNS = [
    {"at": {"pick": "ball", "center": [x, y, 0.0], "radius": 0.8}, "hold": "xyz"}
    for x in (-4.0, 4.0)
    for y in (-4.0, 4.0)
]
_CORNERS = [
    {"at": {"pick": "ball", "center": [x, y, 0.0], "radius": 0.9}, "hold": "xyz"} for x, y in ((4.0, -4.0), (-4.0, 4.0))
]
_FOUR_FEET = [
    {"at": {"pick": "ball", "center": [x, y, 0.0], "radius": 1.2}, "hold": "xyz"}
    for x in (-6.0, 6.0)
    for y in (-4.0, 4.0)
]
_LEFT = {"pick": "side", "axis": "x", "end": "min"}
_NEAR = {"pick": "side", "axis": "y", "end": "min"}
_ONE_SIDE = {"pick": "box", "min": [-100.0, 0.0, -100.0], "max": [100.0, 100.0, 100.0]}
_FLOOR = {"kind": "pressure", "pressure": 4000.0}
_WIND = {"kind": "pressure", "at": {"pick": "facing", "direction": [-1.0, 0.0, 0.0], "angle": 60.0}, "pressure": 900.0}
_RIM = {"kind": "line", "at": {"pick": "ball", "center": [0.0, 0.0, 4.0], "radius": 1.4}, "per_metre": [0.0, 0.0, -8e3]}
_IN_THE_MIDDLE = {"kind": "force", "at": {"pick": "ball", "center": [0, 0, 1.5], "radius": 0.9}, "force": [0, 0, -4e4]}
_TURNS: dict[str, Any] = {"statics.bending": "hhj", "statics.membrane": "quadratic"}
_SIDEWAYS = {"kind": "force", "at": {"pick": "side", "axis": "z", "end": "max"}, "force": [3e4, 1e4, 0.0]}

LATER: dict[str, Kind] = {
    "slab": Kind("slab", {"surface.edge": 0.6, "surface.support": _COLUMNS, "surface.load": [_FLOOR]}, (2.5, 4.5)),
    "balcony": Kind(
        "cantilever",
        {
            "surface.edge": 0.11,
            "surface.support": [
                {"at": _LEFT, "hold": "xyz", "clamp": True},
                {"at": _NEAR, "hold": "xyz", "clamp": True},
            ],
            "surface.load": [_FLOOR],
            "pattern.rim": 0.05,
            **_TURNS,
        },
        (2.5, 4.5),
    ),
    "saddle": _dome(
        {"shape": "hypar", "side": 8.0, "rise": 3.0, "edge": 0.42, "support": _CORNERS, "load": [_IN_THE_MIDDLE]}, 0.5
    ),
    "half_sphere": _dome(
        {"shape": "dome", "span": 8.0, "rise": 4.0, "oculus": 1.2, "edge": 0.5, "support": [_FOOT], "load": [_RIM]},
        0.35,
    ),
    "four_feet": _dome({"shape": "elliptic_paraboloid", "edge": 0.55, "support": _FOUR_FEET, "load": [_SNOW]}, 0.5),
    "pavilion": Kind("pavilion", {"surface.edge": 0.6, "pattern.rim": 0.3}, (2.5, 5.0)),
    "drift": Kind(
        "snow_vault",
        {
            "surface.edge": 0.6,
            "surface.support": [{"at": {"pick": "side", "axis": "z", "end": "min"}, "hold": "xyz", "clamp": True}],
            "surface.load": [{"kind": "snow", "pressure": 1800.0, "at": _ONE_SIDE}],
            "surface.combination": [],
            **_TURNS,
        },
        (2.5, 5.0),
    ),
    "tube": _dome(
        {
            "shape": "cylinder",
            "radius": 1.0,
            "height": 5.0,
            "edge": 0.3,
            "support": [{**_FOOT, "clamp": True}],
            "load": [_SIDEWAYS],
        },
        0.25,
        **_TURNS,
    ),
    "hoop": _dome(
        {"shape": "catenoid", "waist": 2.0, "rim": 3.5, "edge": 0.4, "support": [_FOOT], "load": [_WIND]}, 0.3
    ),
    "oculus": _dome(
        {
            "shape": "dome",
            "span": 10.0,
            "rise": 2.0,
            "oculus": 2.0,
            "edge": 0.6,
            "support": [{"at": {"pick": "side", "axis": "z", "end": "min"}, "hold": "xyz", "clamp": True}],
            "load": [_WIND, _SNOW],
        },
        0.35,
        **_TURNS,
    ),
}
"""Other surfaces and other supports: the factors of `theory.py` were not chosen on draws of these, which test them."""

DRAWN = FITTED | LATER

_SELF = {"kind": "self_weight"}
_CONCRETE = {"statics.young": 30e9, "statics.density": 2500.0}


def _named(preset: str, surface: dict[str, Any], thickness: float, share: float, often: float, **more: Any) -> Kind:
    """A design whose numbers are all given. often : the frequency of both families."""
    family = {"mode": 1, "frequency": often, "phase": 0.0, "threshold": 0.0}
    width = {"rule": more.pop("rule", "constant"), "solid_fraction": share}
    changes = {"surface": surface, "statics.thickness": thickness, "pattern.width": width}
    return Kind(preset, changes | {"pattern.major": family, "pattern.minor": family} | more, (often, often))


def _tower(thickness: float, share: float, often: float, edge: float) -> Kind:
    pressed = {"kind": "force", "at": {"pick": "side", "axis": "z", "end": "max"}, "force": [0.0, 0.0, -2e6]}
    blown = {"kind": "pressure", "at": {"pick": "facing", "direction": [-1.0, -0.5, 0.0], "angle": 60.0}}
    loads = [pressed, _SELF, blown | {"pressure": 1200.0}]
    given = {"shape": "tower", "width": 9.0, "height": 30.0, "taper": 0.55, "twist": 90.0, "edge": edge}
    return _named("tower", given | {"support": [_FOOT], "load": loads}, thickness, share, often)


NAMED: dict[str, Kind] = {
    "hypar under snow": _named(
        "dome",
        {"shape": "hypar", "side": 8.0, "rise": 3.0, "edge": 0.26, "support": [_EDGES], "load": [_SELF, _SNOW]},
        0.12,
        0.45,
        1.6,
        **{"statics.young": 11e9, "statics.density": 480.0, "pattern.keep": 0.2},
    ),
    "torus on its ring": _named(
        "globe",
        {
            "shape": "torus",
            "major": 3.0,
            "minor": 1.2,
            "edge": 0.36,
            "support": [{"at": {"pick": "side", "axis": "z", "end": "min", "depth": 0.05}, "hold": "xyz"}],
            "load": [_ON_THE_TORUS],
        },
        0.03,
        0.5,
        1.6,
        **{"pattern.keep": 0.25},
    ),
    "tower, thick": _tower(0.5, 0.7, 1.6, 1.2),
    "tower, thin": _tower(0.05, 0.5, 2.0, 0.85),
    "segment of a torus": _named(
        "roof",
        {"file": "segment.obj", "support": [_FOOT], "load": [{"kind": "snow", "pressure": 1200.0}]},
        0.15,
        0.3,
        1.2,
        **{"statics.young": 30e9, "pattern.keep": 0.3, "pattern.rim": 0.3},
    ),
    "catenoid under snow": _named(
        "dome",
        {
            "shape": "catenoid",
            "waist": 1.5,
            "rim": 5.0,
            "edge": 0.36,
            "support": [_FOOT],
            "load": [_SELF, {"kind": "snow", "pressure": 1000.0}],
        },
        0.08,
        0.7,
        1.2,
        **{"pattern.keep": 0.2, "pattern.rim": 0.25},
    ),
    "half-sphere, load on its rim": _named(
        "dome",
        {
            "shape": "dome",
            "span": 8.0,
            "rise": 4.0,
            "oculus": 1.2,
            "edge": 0.32,
            "support": [_FOOT],
            "load": [_RIM, {"kind": "snow", "pressure": 500.0}],
        },
        0.1,
        0.4,
        1.6,
        **{"statics.young": 30e9, "pattern.keep": 0.3, "rule": "stressed"},
    ),
    "cylinder, load on its rim": _named(
        "dome",
        {"shape": "cylinder", "radius": 2.0, "height": 4.0, "edge": 0.24, "support": [_FOOT], "load": [_TOP]},
        0.02,
        0.55,
        1.6,
        **{"statics.young": 70e9, "pattern.keep": 0.2},
    ),
    "Botanic in the wind": _named(
        "roof",
        {
            "file": "Botanic.obj",
            "support": [_EDGES],
            "load": [_SELF, {"kind": "wind", "pressure": 900.0, "direction": [1.0, 0.0, 0.0]}],
        },
        0.15,
        0.35,
        1.2,
        **{"pattern.keep": 0.6, "pattern.rim": 0.5},
    ),
    "roof with an opening": _named(
        "roof",
        {"file": "roof_with_opening.obj", "refine": 0.6, "smooth": True, "support": [_EDGES], "load": [_SELF]},
        0.05,
        0.5,
        2.0,
        **{"pattern.keep": 0.12},
    ),
    "pavilion on five feet": _named(
        "pavilion",
        {"shape": "pavilion", "span": 14.0, "rise": 4.5, "opening": 2.8, "feet": 5, "foot": 1.6, "edge": 0.34}
        | {"support": [_FOOT], "load": [_SELF]},
        0.12,
        0.5,
        1.2,
    ),
}
"""Designs of real roofs and of shapes that nobody tuned for; Botanic and the roof need the folder of real meshes."""


def segment(path: Path) -> None:
    """Writes half of a tube of radius 2.5 m that turns through 150 degrees at a radius of 6 m, as OBJ."""
    i, j = np.meshgrid(np.arange(45), np.arange(27))
    u, v = np.radians(150) * (i / 44 - 0.5), np.pi * j / 26
    out = 6 + 2.5 * np.cos(v)
    V = np.stack([out * np.cos(u), out * np.sin(u), np.where(j % 26, 2.5 * np.sin(v), 0.0)], axis=-1).reshape(-1, 3)
    a = (45 * j + i)[:-1, :-1]
    odd = ((i + j) % 2 == 1)[:-1, :-1, None, None]
    b, c, d = a + 1, a + 46, a + 45
    halves = [[[a, b, c], [a, c, d]], [[a, b, d], [b, c, d]]]
    one, other = (np.stack([np.stack(face, axis=-1) for face in two], axis=-2) for two in halves)
    F = np.where(odd, one, other).reshape(-1, 3) + 1
    lines = [*("v {:.9f} {:.9f} {:.9f}".format(*p) for p in V), *("f {} {} {}".format(*f) for f in F)]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def named_design(name: str) -> Design:
    """Raises DsfabError where its mesh is not in `DSFAB_MESHES`, or the design cannot be made."""
    given = NAMED[name]
    surface = dict(given.changes["surface"])
    with tempfile.TemporaryDirectory() as folder:
        if surface.get("file") == "segment.obj":
            segment(Path(folder) / "segment.obj")
            surface["file"] = str(Path(folder) / "segment.obj")
        elif "file" in surface:
            surface["file"] = str(FOLDER / surface["file"])
        changes = {**given.changes, "surface": surface, "pattern.method": "modes", "pattern.fillet": 0.0}
        return dsfab.run(dsfab.load_preset(given.preset, changes))


RATIOS = (1.5, 15.0)
"""Widths of ribs over the thickness."""


def drawn_design(kind: str, seed: int) -> tuple[Design, float]:
    """A design of that kind, and the ratio of its ribs' width to the thickness that it is to have."""
    rng, given = np.random.default_rng([seed, list(DRAWN).index(kind), 7]), DRAWN[kind]
    changes: dict[str, Any] = {**given.changes, "pattern.method": "modes", "pattern.fillet": 0.0}
    for family in ("major", "minor"):
        frequency, phase = FEWER * float(rng.uniform(*given.frequency)), float(rng.uniform(0, 1))
        drawn = {"mode": int(rng.integers(1, 4)), "frequency": round(frequency, 2), "phase": round(phase, 3)}
        changes |= {f"pattern.{family}": drawn | {"threshold": round(float(rng.uniform(-0.3, 0.2)), 2)}}
    rule = WIDTHS[int(rng.integers(1, len(WIDTHS)))]
    share = round(float(rng.uniform(0.25, 0.6)), 2)
    ratio = float(np.exp(rng.uniform(*np.log(RATIOS))))
    return dsfab.run(
        dsfab.load_preset(given.preset, changes | {"pattern.width": {"rule": rule, "solid_fraction": share}})
    ), ratio
