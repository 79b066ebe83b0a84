"""The material of [statics]: values that its name stands for, and numbers that are plainly in another unit."""

from collections.abc import Mapping
from typing import Any

from dsfab.errors import PresetError
from dsfab.materials import KEYS, MATERIALS, NO_STRENGTH, material_named

SOFTEST, LIGHTEST, WEAKEST = 1e6, 10.0, 1e3
"""Pa, kg/m3, Pa: no sheet that carries has a smaller modulus, no solid a smaller density or strength."""


def with_material(values: Any) -> Any:
    """The table [statics] with what its material gives, where it does not say otherwise; unknown names are left."""
    name = values.get("material") if isinstance(values, Mapping) else None
    if not isinstance(name, str):
        return values
    try:
        return {**material_named(name).values, **values}
    except PresetError:  # told by the field itself, beside all other mistakes
        return values


def known_name(name: str | None) -> str | None:
    """The name as it is written in the list of materials. Raises ValueError for one that is not there."""
    try:
        return None if name is None else material_named(name).name
    except PresetError as error:
        raise ValueError(str(error)) from None


def own_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Of a complete [statics], those keys of a material whose values are not that of the named one."""
    given = MATERIALS[values["material"]].values if values.get("material") else {}
    return {key: values[key] for key in KEYS if values[key] != given.get(key)}


def replaced(values: Any, changes: Mapping[str, Any]) -> None:
    """Takes what the old material gave out of the table [statics] where `changes` (dotted keys) name another one."""
    if "statics.material" in changes and isinstance(values, dict):
        for key in KEYS:
            if f"statics.{key}" not in changes:
                values.pop(key, None)


def modulus(value: float) -> float:
    """The modulus, Pa; raises ValueError for one that is plainly in GPa or MPa."""
    if 0 < value < 1000:
        raise ValueError(f"{value:g} Pa is no stiffness: pascals are asked, write {value:g}e9 for {value:g} GPa")
    if 0 < value < SOFTEST:
        raise ValueError(f"{value:g} Pa is no stiffness: pascals are asked, write {value:g}e6 for {value:g} MPa")
    return value


def specific_mass(value: float) -> float:
    """The density, kg/m3; raises ValueError for one that is plainly in t/m3 or g/cm3. 0 has no weight."""
    if 0 < value < LIGHTEST:
        raise ValueError(f"{value:g} kg/m3 is no solid: write {1000 * value:g} for {value:g} t/m3 or g/cm3")
    return value


def resistance(value: float) -> float:
    """The strength, Pa; raises ValueError for one that is plainly in MPa. 0 compares nothing."""
    if 0 < value < WEAKEST:
        raise ValueError(f"{value:g} Pa is no strength: pascals are asked, write {value:g}e6 for {value:g} MPa")
    return value


def require_strength(material: str | None, strength: float) -> None:
    """Raises PresetError where it is not known what members can bear."""
    if not material and not strength:
        raise PresetError(NO_STRENGTH)
