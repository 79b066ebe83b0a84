"""Stiffness of a vault with less material: its compliance over the share of the surface that is kept."""

import matplotlib
import matplotlib.pyplot as plt

import dsfab

matplotlib.use("agg")
preset = dsfab.load_preset("barrel_vault", {"surface.edge": 0.5})
shares = [0.3, 0.4, 0.5, 0.6, 0.7]
runs = dsfab.sweep(
    preset, {"pattern.width.solid_fraction": shares}, ["kept_share", "compliance_quick", "compliance_uncut"]
)
kept = [run.metrics["kept_share"] for run in runs]
softer = [run.metrics["compliance_quick"] / run.metrics["compliance_uncut"] for run in runs]

figure, axes = plt.subplots(figsize=(7, 4.5))
axes.plot(kept, softer, "o-", color="#b5603c", label="ribs along the stress")
axes.plot(kept, [1 / share for share in kept], "--", color="#888888", label="1 / share: a thinner membrane")
axes.set_xlabel("share of the surface that is kept")
axes.set_ylabel("compliance over that of the full sheet")
axes.legend(frameon=False)
axes.spines[["top", "right"]].set_visible(False)
figure.savefig("how_much_material.png", dpi=120, bbox_inches="tight")
