"""Presets of the tests' own, all on eigenmodes: paths, as `load_preset` and the command line take them.

Tests of what holds for any design use these, so that the shipped presets of the same surfaces may change.
"""

from pathlib import Path


def _path(name: str) -> str:
    return str(Path(__file__).with_name(f"{name}_modes.toml"))


DOME_MODES = _path("dome")
GLOBE_MODES = _path("globe")
BARREL_VAULT_MODES = _path("barrel_vault")
ROOF_MODES = _path("roof")
FIGURINE_MODES = _path("figurine")
SPHERE_GRADED_MODES = _path("sphere_graded")


def on_modes(name: str) -> str:
    """The preset of these that has the surface of the shipped one `name`; `name` where there is none."""
    path = _path(name)
    return path if Path(path).is_file() else name
