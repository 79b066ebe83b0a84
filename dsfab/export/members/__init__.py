"""Members as objects with names on layers, in the formats whose programs know such: `NAME.members.3dm` and so on.

shapes   what all of them hold, and what their readers must find again
rhino (3DM), dxf (lines), gltf (GLB), ifc   one format, one file
"""
