"""`dsfab blender`: an add-on for Blender, one file that a person installs there.

addon    what Blender runs: of its own libraries and of Python's alone       command  `dsfab blender` writes it
"""
