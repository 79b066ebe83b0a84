"""Frames solved by PyNite (MIT), which is not ours: beams of Euler and Bernoulli."""

from typing import NamedTuple

import numpy as np

from dsfab.members.frame import Frame

AXES = ("DX", "DY", "DZ", "RX", "RY", "RZ")
FORCES = ("FX", "FY", "FZ", "MX", "MY", "MZ")


class Found(NamedTuple):
    """u, reaction : (n, 6)."""

    u: np.ndarray
    reaction: np.ndarray


def solved(frame: Frame) -> dict[str, Found]:
    """Displacements and reactions of every case and combination."""
    from Pynite import FEModel3D

    model = FEModel3D()
    model.add_material("m", frame.material.young, frame.material.shear, frame.material.poisson, 0.0)
    for k, point in enumerate(frame.points.tolist()):
        model.add_node(f"{k}", *point)
        model.def_support(f"{k}", *(bool(held) for held in frame.fixed[k]))
    for k, (i, j) in enumerate(frame.ends.tolist()):
        J, about_y, about_z = frame.inertia[k].tolist()
        model.add_section(f"{k}", float(frame.area[k]), about_y, about_z, J)
        model.add_member(f"{k}", f"{i}", f"{j}", "m", f"{k}", rotation=rotation(frame.axes[k]))
    for case, rows in frame.loads.items():
        for k, axis in np.argwhere(rows):
            model.add_node_load(f"{k}", FORCES[axis], float(rows[k, axis]), case=case)
    sums = {case: {case: 1.0} for case in frame.loads} | dict(frame.combinations)
    for name, factors in sums.items():
        model.add_load_combo(name, dict(factors))
    model.analyze_linear()
    nodes = [model.nodes[f"{k}"] for k in range(len(frame.points))]
    return {
        name: Found(
            np.array([[getattr(node, axis)[name] for axis in AXES] for node in nodes]),
            np.array([[getattr(node, f"Rxn{force}")[name] for force in FORCES] for node in nodes]),
        )
        for name in sums
    }


def rotation(axes: np.ndarray) -> float:
    """Degrees that PyNite's own axes of a member (3, 3) are turned by about its x, to become these."""
    x = axes[0]
    if np.hypot(x[0], x[2]) < 1e-9:  # upright: its y points along -x or x
        y = np.array([-np.sign(x[1]), 0.0, 0.0])
        z = np.array([0.0, 0.0, 1.0])
    else:
        z = np.cross(x, [0.0, 1.0, 0.0])
        z /= np.linalg.norm(z)
        y = np.cross(z, x)
    return float(np.degrees(np.arctan2(axes[1] @ z, axes[1] @ y)))


def solved_from(book: dict[str, list[dict]]) -> dict[str, dict[str, Found]]:
    """By case and combination, by node, what PyNite finds of a workbook in Structural Analysis Format (`tests.saf`):
    of nothing but what stands there. Springs are left out."""
    from Pynite import FEModel3D

    from tests.saf import sums

    model = FEModel3D()
    for row in book["StructuralMaterial"]:
        E, G = row["E modulus [MPa]"] * 1e6, row["G modulus [MPa]"] * 1e6
        model.add_material(row["Name"], E, G, row["Poisson Coefficient"], 0.0)
    place = {}
    for row in book["StructuralPointConnection"]:
        place[row["Name"]] = np.array([row[f"Coordinate {axis} [m]"] for axis in "XYZ"])
        model.add_node(row["Name"], *place[row["Name"]].tolist())
    material = {}
    for row in book["StructuralCrossSection"]:
        H, B = (float(word) / 1e3 for word in row["Parameters [mm]"].split("; "))
        material[row["Name"]] = row["Material"]
        model.add_section(row["Name"], B * H, B * H**3 / 12, H * B**3 / 12, row["It [m4]"])
    for row in book["StructuralCurveMember"]:
        i, j = row["Nodes"].split("; ")
        x = (place[j] - place[i]) / np.linalg.norm(place[j] - place[i])
        z = np.array([row[f"Coordinate {axis} [m]"] for axis in "XYZ"])  # of local z, in the plane of z and x
        y = np.cross(z, x) / np.linalg.norm(np.cross(z, x))
        turn = rotation(np.stack([x, y, np.cross(x, y)]))
        section = row["Cross section"]
        model.add_member(row["Name"], i, j, material[section], section, rotation=turn)
    for row in book["StructuralPointSupport"]:
        model.def_support(row["Node"], *(row[word] == "Rigid" for word in ("ux", "uy", "uz", "fix", "fiy", "fiz")))
    for row in (*book["StructuralPointAction"], *book.get("StructuralPointMoment", ())):
        name = f"F{row['Direction']}" if "Value [kN]" in row else row["Direction"].upper()
        value = row["Value [kN]"] if "Value [kN]" in row else row["Value [kNm]"]
        model.add_node_load(row["Reference node"], name, 1e3 * value, case=row["Load case"])
    factors = {row["Name"]: {row["Name"]: 1.0} for row in book["StructuralLoadCase"]}
    factors |= {row["Name"]: sums(row) for row in book.get("StructuralLoadCombination", ())}
    for name, each in factors.items():
        model.add_load_combo(name, each)
    model.analyze_linear(check_stability=False, sparse=True)  # that check takes most of the time
    return {
        name: {
            node.name: Found(
                np.array([getattr(node, axis)[name] for axis in AXES]),
                np.array([getattr(node, f"Rxn{force}")[name] for force in FORCES]),
            )
            for node in model.nodes.values()
        }
        for name in factors
    }
