"""Passes of light groups (film/takes.py)."""

from __future__ import annotations

import bpy

from ..film.takes import ORDERS, share_image


def rows(layer: bpy.types.ViewLayer, split: bool) -> list[tuple[str, str]]:
    """(name, image) of each pass: a group's share of Combined and, if `split`, of direct and of indirect light."""
    orders = ("", *ORDERS) if split else ("",)
    return [
        (f"Combined_{group.name}{f' {order.capitalize()}' if order else ''}", share_image(group.name, order))
        for group in layer.lightgroups
        for order in orders
    ]
