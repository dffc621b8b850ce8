"""What programs declare that draw geometry by the rows of any projection, as from a light."""

from __future__ import annotations

from .geometry import SHADOW_FLAG

ROWS = (("VEC4", "row_x"), ("VEC4", "row_y"), ("VEC4", "row_w"), ("VEC4", "row_q"), ("FLOAT", "near"))
PROJECTION_CONSTANTS = (*ROWS, ("INT", "first_instance"))
PROJECTION_DEFINES = (("PROJECTION", "row_x, row_y, row_w, row_q, near"), ("VISIBILITY_FLAG", str(SHADOW_FLAG)))
