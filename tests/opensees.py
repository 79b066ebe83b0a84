"""OpenSees scripts: read by a reader of ours and solved by PyNite, and run by OpenSees where that is installed."""

import csv
import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.pynite import AXES, FORCES, Found, rotation

needs_opensees = pytest.mark.skipif(
    importlib.util.find_spec("opensees") is None,
    reason="OpenSees is not installed: pip install --no-deps opensees (it is free for research, not for resale)",
)


def run(path: Path) -> dict[str, Found]:
    """What OpenSees prints of a script, by case: u and reactions (n, 6) of its nodes."""
    done = subprocess.run([sys.executable, "-m", "opensees", str(path)], capture_output=True, text=True, check=False)
    rows: dict[str, list[list[float]]] = {}
    for row in csv.reader(done.stdout.splitlines()[1:], delimiter=";"):
        rows.setdefault(row[0], []).append([float(word) for word in row[2:]])
    return {case: Found(np.array(table)[:, :6], np.array(table)[:, 6:]) for case, table in rows.items()}


def solved_script(path: Path) -> dict[str, Found]:
    """What PyNite finds of nothing but the words of a script: beams without shear, springs between two nodes."""
    from Pynite import FEModel3D

    lines = [line.split(";#")[0].split() for line in path.read_text(encoding="ascii").splitlines()]
    count = int(next(words[2] for words in lines if words[:2] == ["set", "count"]))
    model = FEModel3D()
    place, vector, stiffness, material, cases = {}, {}, {}, None, []
    for words in lines:
        if words[:1] == ["node"]:
            place[words[1]] = np.array(words[2:5], dtype=float)
            model.add_node(words[1], *place[words[1]].tolist())
        elif words[:1] == ["fix"]:
            model.def_support(words[1], *(word == "1" for word in words[2:]))
        elif words[:2] == ["uniaxialMaterial", "Elastic"]:
            stiffness[words[2]] = float(words[3])
        elif words[:2] == ["geomTransf", "Linear"]:
            vector[words[2]] = np.array(words[3:], dtype=float)
        elif words[:2] == ["element", "ElasticTimoshenkoBeam"]:
            tag, i, j = words[2:5]
            E, G, A, J, about_y, about_z = map(float, words[5:11])
            if material is None:
                material = "m"
                model.add_material(material, E, G, E / G / 2 - 1, 0.0)
            x = place[j] - place[i]
            y = np.cross(vector[words[13]], x)
            axes = np.array([x / np.linalg.norm(x), y / np.linalg.norm(y)])
            model.add_section(tag, A, about_y, about_z, J)
            model.add_member(tag, i, j, material, tag, rotation=rotation(np.array([*axes, np.cross(*axes)])))
        elif words[:2] == ["element", "zeroLength"]:
            mats, ways = words[words.index("-mat") + 1 : words.index("-dir")], words[words.index("-dir") + 1 :]
            for mat, way in zip(mats, ways, strict=True):
                model.def_support_spring(words[4], AXES[int(way) - 1], stiffness[mat])
        elif words[:2] == ["pattern", "Plain"]:
            case = words[2]
        elif words[:1] == ["load"]:
            for force, value in zip(FORCES, words[2:], strict=True):
                model.add_node_load(words[1], force, float(value), case=case)
        elif words[:1] == ["solve"]:
            cases.append(" ".join(words[1:]).strip("{}"))
            model.add_load_combo(cases[-1], {case: 1.0})
    model.analyze_linear(sparse=True)
    nodes = [model.nodes[f"{k}"] for k in range(1, count + 1)]
    return {
        name: Found(
            np.array([[getattr(node, axis)[name] for axis in AXES] for node in nodes]),
            np.array([[getattr(node, f"Rxn{force}")[name] for force in FORCES] for node in nodes]),
        )
        for name in cases
    }
