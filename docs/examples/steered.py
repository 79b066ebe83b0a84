"""Ribs that follow a curve: a vault with members along the stress, and the same vault with a guide."""

import io

from PIL import Image

import dsfab

guide = {"curve": [[-4.0, -2.5, 1.5], [0.0, 0.0, 3.0], [4.0, 2.5, 1.5]], "reach": 2.0, "weight": 20}
pictures = []
for more in ({}, {"pattern.guide": [guide]}):
    design = dsfab.run(dsfab.load_preset("barrel_vault", {"surface.edge": 0.5, **more}))
    pictures.append(Image.open(io.BytesIO(dsfab.inline_picture(design))))

pair = Image.new("RGB", (2 * pictures[0].width, pictures[0].height), "white")
for place, one in enumerate(pictures):
    pair.paste(one, (place * one.width, 0))
pair.save("steered.png")
