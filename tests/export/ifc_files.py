"""Quantities and faults of an IFC file."""

import pytest

ifcopenshell = pytest.importorskip("ifcopenshell", reason="ifcopenshell (extra ifc) is not installed")


def faults(path) -> list:
    import ifcopenshell.validate

    logger = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(str(path), logger)
    return [entry for entry in logger.statements if entry.get("level") in ("error", "warning")]


def amounts(element) -> dict[str, float]:
    """Quantities and properties by name."""
    found = {}
    for relation in element.IsDefinedBy:
        given = relation.RelatingPropertyDefinition
        if given.is_a("IfcElementQuantity"):
            found |= {one.Name: one[3] for one in given.Quantities}
        else:
            found |= {one.Name: one.NominalValue.wrappedValue for one in given.HasProperties}
    return found
