"""CalculiX run on a model: a finite element program that is not ours."""

import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from dsfab.export.analysis.calculix import CalculixModel, write_calculix

CCX = shutil.which("ccx")
needs_ccx = pytest.mark.skipif(CCX is None, reason="CalculiX is not installed: apt-get install calculix-ccx")

TITLE = re.compile(r"^ (displacements|total force|total internal energy) .*for set (\w+) and time +(\S+)")


@dataclass(frozen=True, eq=False)
class Found:
    """One step: u (p, 3) of all nodes, the total force (3,) by support, and the internal energy."""

    u: np.ndarray
    reaction: dict[str, np.ndarray]
    energy: float


def ccx(model: CalculixModel, folder: Path) -> list[Found]:
    """What CalculiX finds, step by step."""
    return solved(write_calculix(model, folder / "job.inp"), len(model.nodes))


def solved(path: Path, count: int) -> list[Found]:
    """Run an .inp file of so many nodes as it is, and read its .dat file."""
    done = subprocess.run([CCX, path.stem], cwd=path.parent, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout[-500:]
    assert "*WARNING" not in done.stdout, done.stdout[done.stdout.index("*WARNING") :][:300]
    tables: list[tuple[str, str, list[list[float]]]] = []
    for line in path.with_suffix(".dat").read_text().splitlines():
        if title := TITLE.match(line):
            tables.append((title[1], title[2], []))
        elif line.strip():
            tables[-1][2].append([float(word) for word in line.split()])
    steps: list[Found] = []
    u, reaction = np.full((count, 3), np.nan), {}
    for kind, name, table in tables:
        if kind == "displacements":
            rows = np.array(table)
            u, reaction = np.full((count, 3), np.nan), {}
            u[rows[:, 0].astype(int) - 1] = rows[:, 1:]
        elif kind == "total force":
            reaction[name] = np.array(table[0])
        else:  # the energy comes last
            steps.append(Found(u, reaction, table[0][0]))
    return steps
