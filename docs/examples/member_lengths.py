"""Lengths of the bays of a dome, from node to node, as a histogram of both families."""

import matplotlib
import matplotlib.pyplot as plt

import dsfab

matplotlib.use("agg")
design = dsfab.run(dsfab.load_preset("dome", {"surface.edge": 0.45}))
graph = design.members
families = ("major", "minor")
bays = {name: [x for one in graph.members if one.family == name for x in graph.bays(one.id)] for name in families}

figure, axes = plt.subplots(figsize=(7, 4))
axes.hist(list(bays.values()), bins=24, stacked=True, color=["#b5603c", "#4a6d8c"], label=list(bays))
axes.set_xlabel("from node to node, m")
axes.set_ylabel("how many")
axes.set_title(f"{sum(map(len, bays.values()))} bays of {len(graph.members)} members")
axes.legend(frameon=False)
axes.spines[["top", "right"]].set_visible(False)
figure.savefig("member_lengths.png", dpi=120, bbox_inches="tight")
