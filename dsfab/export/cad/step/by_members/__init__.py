"""STEP of curved sheets by members: untrimmed four-sided patches on shared curves, and ruled walls.

lifting     : points of the smooth skins over points of the mesh.
creases     : where patches have to end; sides : what is different on both sides of one.
graph       : the sheet's regions, and the chains of edges between them.
fillets     : round corners of openings taken into the members beside them.
joining     : chains of an outline that are one.
bends       : regions that bend too much, divided by seams.
seams       : borders between members, ended where they meet round corners steeply.
straightening : chains between material, without those that run out and back.
curves      : the chains as cubics, one for both skins.
inner       : splines that bring curves and patches back onto the skins between their ends.
parabolas   : curves and patches of degree 2 in place of 3, where these are as near.
quads       : which regions have four sides.
line_fits   : chains in a row that become one curve; lines : these, divided where others end on them.
arcs        : round corners of openings as arcs that go on as the walls do.
stations    : where opposite sides of a region are divided.
patches     : their patches; trimmed : the surfaces of all other regions; heights : what these are;
              domains : over what; interior : near to which points; straying : how far off the mesh.
strays      : those that leave the skins where none of these points are, made anew.
parting     : trimmed regions whose surface does not meet their edges, divided; chords : where.
model       : edges, walls and faces of one solid; text : their entities.
flush       : trimmed faces on their edges at sharp corners, as far as a fillet goes; rims : rims moved onto them.
ordering    : walls in an order, edges in directions and lengths with which OCCT rounds the corners between walls.
build       : the file of a part, and what OCCT says of its use (`use_check`, a program of its own).
"""
