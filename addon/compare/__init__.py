"""The same scene by Candela and by Cycles: error per light path, and a report page.

comparison.py  `compare_scene`: from a scene to plain data
passes.py      the names of the passes, and light paths as radiance
reference.py   renders through Blender (the only module here that imports bpy)
cache.py       references on disk
content.py     the hash by which a reference is found again
exr.py         reads the multilayer files that Blender writes
metrics.py     relMSE, bias, FLIP, noise floor
report.py      `write_report`: one self-contained HTML page, of page.html and png.py
"""

from .comparison import Comparison, compare_scene
from .metrics import table
from .report import ReportError, write_report

__all__ = ["Comparison", "ReportError", "compare_scene", "table", "write_report"]
