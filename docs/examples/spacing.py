"""A dome with three spacings: `dsfab.revise` keeps the statics and computes the pattern again."""

import io

from PIL import Image

import dsfab

design, pictures = None, []
for spacing in (0.7, 1.1, 1.8):
    changes = {"pattern.major.spacing": spacing, "pattern.minor.spacing": spacing}
    preset = dsfab.load_preset("dome", {"surface.edge": 0.55, **changes})
    design = dsfab.run(preset) if design is None else dsfab.revise(design, preset)
    pictures.append(Image.open(io.BytesIO(dsfab.inline_picture(design))))
    print(spacing, design)

row = Image.new("RGB", (sum(one.width for one in pictures), pictures[0].height), "white")
for place, one in enumerate(pictures):
    row.paste(one, (place * one.width, 0))
row.resize((row.width // 2, row.height // 2)).save("spacing.png")
