"""Sentences in panels, over as many lines as their width asks for, and one that operators share."""

from __future__ import annotations

import textwrap


def wrapped(layout, context, text: str, dim=False, indent=False, icon="NONE", room: int = 0) -> None:
    """A sentence over as many lines as the panel's width asks for; `room` widgets of a line's height are left free."""
    widget = 20 * context.preferences.system.ui_scale
    letters = (context.region.width - (3 + room + (icon != "NONE") + indent) * widget) / (0.29 * widget)
    blank = "BLANK1" if indent or icon != "NONE" else "NONE"
    for number, line in enumerate(textwrap.wrap(text, max(int(letters), 16))):
        row = layout.row()
        row.active = not dim
        row.scale_y = 0.8
        row.label(text=line, icon=icon if number == 0 and icon != "NONE" else blank)


def refusal(block) -> str:
    """A sentence where a data-block is linked from another file: Blender would forget what is set. Else nothing."""
    if block.is_editable:
        return ""
    return f"'{block.name}' is linked from another file, and what is set here would not be saved: make it local first."
