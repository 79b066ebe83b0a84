"""OCCT in a separate process, because OCCT may crash or never finish.

    python -P program.py COMMAND FILE ARGUMENTS ...

prints one line of JSON. The commands are the functions of `COMMANDS`. Without arguments, the program reads a list of
arguments from its input, as one line of JSON. Its modules import nothing from the rest of dsfab."""

import gc
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any


def _facts(path: str) -> dict[str, Any]:
    from dsfab.export.cad.step.worker.shapes import step_facts

    return step_facts(Path(path))


def _triangles(path: str, folder: str, deflection: str = "0", faces: str = "") -> dict[str, Any]:
    from dsfab.export.cad.step.worker.triangles import write_triangles

    return write_triangles(Path(path), Path(folder), float(deflection), faces)


def _use(path: str, cuts: str = "", every_cut: str = "") -> dict[str, Any]:
    from dsfab.export.cad.step.worker.use import PLANES, use_findings

    return use_findings(Path(path), int(cuts or len(PLANES)), bool(every_cut))


def _sample(path: str) -> dict[str, Any]:
    from dsfab.export.cad.step.worker.use import sample

    return sample(Path(path))


def _pieces(path: str, folder: str = "", deflection: str = "0", together: str = "") -> dict[str, Any]:
    from dsfab.export.cad.step.worker.pieces import CAN_FORK, solid_findings, whole_findings

    return {"solids": (whole_findings if together else solid_findings)(path, folder, float(deflection), CAN_FORK)}


COMMANDS: dict[str, Callable[..., Any]] = {
    "facts": _facts,
    "triangles": _triangles,
    "use": _use,
    "sample": _sample,
    "pieces": _pieces,
}


def _enter_package() -> None:
    folder, names = Path(__file__).resolve().parent, ("dsfab", "export", "cad", "step")
    for depth in range(len(names)):
        package = ModuleType(".".join(names[: depth + 1]))
        package.__path__ = [str(folder.parents[len(names) - 1 - depth])]
        sys.modules[package.__name__] = package


def _later_arguments() -> list[str]:
    import OCP.BRepMesh
    import OCP.STEPControl  # noqa: F401

    import dsfab.export.cad.step.worker.pieces  # noqa: F401

    return list(json.loads(sys.stdin.readline()))


def main() -> None:
    """Run a command and print its report."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # OpenBLAS must not use threads: a forked process does not inherit them
    gc.disable()  # OCCT loads 10 % faster without garbage collection
    command, *arguments = sys.argv[1:] or _later_arguments()
    try:
        report = COMMANDS[command](*arguments)
    except ValueError as error:
        sys.exit(str(error))  # the caller shows the error without a traceback
    sys.stdout.write(json.dumps(report) + "\n")
    sys.stdout.flush()
    os._exit(0)  # a normal exit takes a quarter of a second to free the solids


if __name__ == "__main__":
    _enter_package()
    main()
