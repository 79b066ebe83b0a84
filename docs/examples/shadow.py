"""The shadow of a dome at three in the afternoon: its sheet, projected along the sunlight onto the ground."""

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection

import dsfab

matplotlib.use("agg")
sheet = dsfab.run(dsfab.load_preset("dome", {"surface.edge": 0.45})).sheet.surface
sun = np.array([-0.6, -0.35, -1.0])  # direction of the light
ground = sheet.V - sheet.V[:, 2:] / sun[2] * sun

figure, axes = plt.subplots(figsize=(7, 5.5))
axes.add_collection(PolyCollection(ground[sheet.F][:, :, :2], color="#4a4a55", linewidths=0))
axes.autoscale()
axes.set_aspect("equal")
axes.axis("off")
figure.savefig("shadow.png", dpi=120, bbox_inches="tight", facecolor="#f6efe2")
