"""What build123d (OCCT) finds in a STEP file: a program of its own, because the check of a shape may not end.

    python -P step_check.py FILE

prints one line of JSON: {"solids": 1, "faces": 6, "valid": true, "volume": 1000.0}, the volume in cubic millimetres.
It imports nothing from dsfab, so that it is a second opinion, and can be started from anywhere.
"""

import json
import sys
from pathlib import Path
from typing import Any


def inspected(path: Path) -> dict[str, Any]:
    """Number of solids and faces, OCCT's validity check, and the volume of all solids together."""
    from build123d import import_step
    from OCP.Message import Message

    Message.DefaultMessenger_s().ChangePrinters().Clear()
    shape = import_step(path)
    solids = shape.solids()
    return {
        "solids": len(solids),
        "faces": len(shape.faces()),
        "valid": bool(solids) and all(solid.is_valid for solid in solids),
        "volume": sum(_volume(solid.wrapped) for solid in solids),
    }


def _volume(shape: Any) -> float:
    """Volume with an error under 1e-5: the plain call is wrong by up to 1 % on faces with many holes."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, 1e-5, False, False)
    return float(properties.Mass())


if __name__ == "__main__":
    sys.stdout.write(json.dumps(inspected(Path(sys.argv[1]))) + "\n")
