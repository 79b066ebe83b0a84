"""What the measuring scripts share: spheres of a wanted size, compiling, matrices as C++ reads them, and time spent."""

import argparse
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from scipy.sparse import csc_array, csr_array, tril

from dsfab.preset.file import load_preset
from dsfab.preset.model import Preset

HERE = Path(__file__).resolve().parent


def sphere(vertices: int) -> Preset:
    """The preset `globe` with about this number of vertices (they grow with 1 / edge^2)."""
    path = HERE.parent.parent / "presets" / "globe.toml"
    preset = load_preset(path)
    edge = preset.surface.edge * (preset.surface.build().n / vertices) ** 0.5
    return preset.model_copy(update={"surface": preset.surface.model_copy(update={"edge": edge})})


def compiled(name: str, folder: Path) -> Path:
    """The program of `name`.cpp, for this processor."""
    if shutil.which("g++") is None:
        sys.exit("g++ is not installed")
    program = folder / name
    command = ["g++", "-O3", "-march=native", "-DNDEBUG", "-I/usr/include/eigen3", HERE / f"{name}.cpp", "-o", program]
    if subprocess.run(command, check=False).returncode:
        sys.exit("the C++ half does not compile; install libeigen3-dev and libspectra-dev")
    return program


def write_lower(path: Path, K: csr_array, *more: np.ndarray) -> None:
    """Sizes, column pointers, rows, values of the lower triangle, then further vectors, as raw numbers."""
    lower = csc_array(tril(K, format="csc"))
    lower.sort_indices()
    with path.open("wb") as file:
        np.array([K.shape[0], lower.nnz], dtype=np.int64).tofile(file)
        for values in (lower.indptr.astype(np.int32), lower.indices.astype(np.int32), lower.data, *more):
            values.tofile(file)


def sizes(text: str, default: str) -> list[int]:
    """The numbers of vertices that the command line asks for."""
    parser = argparse.ArgumentParser(description=text)
    parser.add_argument("vertices", nargs="?", default=default, help=f"numbers of vertices, default {default}")
    return [int(number) for number in parser.parse_args().vertices.split(",")]


def cpu() -> float:
    """Seconds that this process and those that it started have spent."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
