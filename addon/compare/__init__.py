"""The same scene by Candela and by Cycles: error per light path, and a report page.

exr.py        reads the multilayer files that Blender writes
passes.py     the names of the passes, and light paths as radiance
reference.py  renders through Blender (the only module here that imports bpy)
metrics.py    relMSE, bias, FLIP, noise floor
report.py     one self-contained HTML page
"""
