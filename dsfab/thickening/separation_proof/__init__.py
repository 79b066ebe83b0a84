"""A proof, without looking at pairs, that most of a thickened sheet cannot meet itself.

All cells of a cut surface are thickened together, void ones too. Where the prism over every cell can be seen whole from
its middle, whichever way the diagonals of its sides run, the prisms fill space without a fold, and a point is covered
as often as the boundary of the thickened surface winds around it. In a cylinder along a direction that all faces near
by look to that number is counted on the rim of a block of faces around the cylinder:

    . . rim . . . .          Skins seen from the front wind around the cylinder as often as their rim does. Once:
    .   +-----+   .          each point of the cylinder lies below the upper skin and above the lower one at most
    .   | box |   .          once. So the prisms in the box meet no other ones of the block but in the sides they share,
    .   +-----+   .          and no other prism reaches the box at all.
    . . . . . . . .

What is proven needs no test of pairs, whatever part of the cells is kept. The rest is for `intersecting_pairs`.
"""

from dsfab.thickening.separation_proof.layer import OffsetLayer
from dsfab.thickening.separation_proof.proof import apart

__all__ = ["OffsetLayer", "apart"]
