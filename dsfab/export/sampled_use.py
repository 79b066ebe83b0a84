"""Whether CAD programs will cut a solid: one cut of it through its middle, by OCCT, where that is bounded work.

All of `dsfab.export.network.use_check` takes minutes for a thousand faces. Of solids whose cuts fail nearly every cut
does (24 tried of smooth ones: 1 valid), so that one tells.
"""

import json
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from dsfab.export.network import use_check
from dsfab.export.part import Part
from dsfab.export.program import ProgramError, last_line
from dsfab.export.smooth.build import smooth_file
from dsfab.export.smooth.limits import Limits

MOST_FACES = 2000
"""Of a file that is cut unasked: so many take OCCT 4 seconds to cut and to ask whether the halves are valid, and 10 to
15 where the text is read again for it."""

MOST_SMOOTH = 500
"""Of a smooth file: its skins have all openings' edges, and 1400 faces took OCCT half a minute."""

SECONDS, SECONDS_PER_FACE = 30.0, 0.03
"""Of the processor: some times what was measured. Volumes of smooth halves with hundreds of edges take that long."""

BOX = 1e-2
"""Share of its diagonal that the box of a solid may be off at each side."""


@dataclass(frozen=True)
class SampledUse:
    """tried : whether the solid was cut.    fault : what went wrong, "" if nothing did."""

    tried: bool
    fault: str = ""


_TRIED: WeakKeyDictionary[Part, SampledUse] = WeakKeyDictionary()


def smooth_use(part: Part) -> SampledUse:
    """What becomes of one cut of a part's smooth file, tried once, where that is wanted of the part."""
    if part not in _TRIED:
        file = smooth_file(part)
        wanted = part.cut and file.faces <= MOST_SMOOTH
        text = file.text.encode("ascii")
        _TRIED[part] = sampled_use(part, text, file.faces, file.limits) if wanted else SampledUse(False)
    return _TRIED[part]


def sampled_use(part: Part, file: bytes, faces: int, limits: Limits, suffix: str = ".step") -> SampledUse:
    """What becomes of one cut of a part's file with so many faces, or of what OCCT keeps of it once read (`.bin`)."""
    if faces > MOST_FACES:
        return SampledUse(False)
    with _file(file, suffix) as path:
        fault, bounds = cut_fault(path, faces)
    return SampledUse(True, fault or box_fault(part, bounds, limits))


def cut_fault(path: Path, faces: int) -> tuple[str, list[float]]:
    """What is wrong with the halves that one cut leaves of a file with so many faces, "" if nothing is; and the box of
    the whole, six numbers in millimetres, if OCCT came that far."""
    seconds = SECONDS + SECONDS_PER_FACE * faces
    try:
        said = json.loads(last_line(use_check.__file__, str(path), "sample", seconds=seconds))
    except (subprocess.TimeoutExpired, ProgramError):
        return f"OCCT did not cut it within {seconds:.0f} s of the processor", []
    if not said["halves"]:
        return "a half of it is not valid once OCCT has cut it", said["box"]
    missed = said["off"] > use_check.ADDS
    return f"its halves miss {said['off']:.1e} of its volume once OCCT has cut it" if missed else "", said["box"]


def said_of_use(text: str, seconds: float) -> dict[str, Any]:
    """All that `use_check` says of a file; raises as `last_line`."""
    with _file(text.encode("ascii")) as path:
        return dict(json.loads(last_line(use_check.__file__, str(path), seconds=seconds)))


@contextmanager
def _file(content: bytes, suffix: str = ".step") -> Iterator[Path]:
    """A file with a content, for as long as it is looked at."""
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        path = Path(folder) / f"a{suffix}"
        path.write_bytes(content)
        yield path


def box_fault(part: Part, bounds: list[float], limits: Limits, share: float = BOX) -> str:
    """What is wrong with a box, six numbers in millimetres, that OCCT finds around a part's file; "" if nothing is.

    share : of the part's size that it may be off.
    """
    size = float(np.linalg.norm(np.ptp(part.box, axis=0)))
    off = float(np.abs(np.array(bounds).reshape(2, 3) - part.box).max())
    return f"OCCT's box of it is {off:.3g} mm off" if off > share * size + limits.distance + limits.usual else ""
