"""What numpy calls by different names in the versions that Blender bundles."""

import numpy as np

trapezoid = getattr(np, "trapezoid", None) or getattr(np, "trapz")  # noqa: B009 (the name before numpy 2.0)
