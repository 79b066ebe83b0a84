"""Snow all over a vault, or on one half: thrust and bending of the cut structure in each load case."""

import matplotlib
import matplotlib.pyplot as plt
import numpy as np

import dsfab

matplotlib.use("agg")
design = dsfab.run(dsfab.load_preset("snow_vault", {"surface.edge": 0.8}))
forces = design.section_forces  # by case and by combination
thrust = [np.percentile(np.abs(one.n).max(axis=1), 99) / 1e3 for one in forces.values()]
bending = [np.percentile(np.abs(one.m).max(axis=1), 99) / 1e3 for one in forces.values()]

figure, both = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True)
for axes, values, what in zip(both, (thrust, bending), ("force, kN/m", "moment, kNm/m"), strict=True):
    axes.barh([name.replace("_", " ") for name in forces], values, color="#b5603c")
    axes.set_xlabel(f"{what}: 99 % of the structure stay below")
    axes.spines[["top", "right"]].set_visible(False)
both[0].invert_yaxis()
figure.savefig("load_cases.png", dpi=120, bbox_inches="tight")
