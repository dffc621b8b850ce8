"""Passes of light groups, and the picture as the sum of those that its groups light (snapshot/light_groups.py)."""

from __future__ import annotations

import bpy
import numpy as np

from ..film.resolve import COMBINED
from ..frame.light_paths import DIRECT, INDIRECT, LIGHT_PATHS
from ..snapshot.light_groups import Part
from ..snapshot.scene import Film

ORDERS = (DIRECT, INDIRECT)
GLARE = "film.lens"
NOISY = "film.noisy"
_SHARE = "light group "  # names of images of a group's share of the picture begin so


def share_image(group: str, order: str = "") -> str:
    """Name of the image of a light group's share of the picture: of all its light, DIRECT or INDIRECT."""
    return f"{_SHARE}{order} {group}"


def frame_images(sources: set[str]) -> set[str]:
    """The images of a frame that must be read where passes are made from these."""
    read = {name for name in sources if not name.startswith(_SHARE)}
    if any(name.startswith(f"{_SHARE}{order} ") for name in sources for order in ORDERS):
        read |= {path.image for path in LIGHT_PATHS}
    return read


def rows(layer: bpy.types.ViewLayer, split: bool) -> list[tuple[str, str]]:
    """(name, image) of each pass: a group's share of Combined and, if `split`, of direct and of indirect light."""
    orders = ("", *ORDERS) if split else ("",)
    return [
        (f"Combined_{group.name}{f' {order.capitalize()}' if order else ''}", share_image(group.name, order))
        for group in layer.lightgroups
        for order in orders
    ]


class Sum:
    """The mean images of a picture that is drawn in parts: light is added up, all else is that of the first part."""

    def __init__(self, film: Film):
        self._film = film
        self.images: dict[str, np.ndarray] = {}

    def add(self, part: Part, images: dict[str, np.ndarray]) -> None:
        """Take in the mean images of a part. They may be changed."""
        if part.group:
            self.images |= self._shares(part.group, images)
        for name, pixels in images.items():
            if name not in self.images:
                self.images[name] = pixels.copy() if self._film.light_groups else pixels
            elif name.startswith(("radiance.", COMBINED, GLARE, NOISY)):
                self.images[name][..., :3] += pixels[..., :3]
                if part.world:  # glass lets through what of the world is there
                    self.images[name][..., 3:] = pixels[..., 3:]

    def _shares(self, group: str, images: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        found = {share_image(group): images[COMBINED]}
        if all(path.image in images for path in LIGHT_PATHS):
            for order in ORDERS:
                paths = [path for path in LIGHT_PATHS if path.order == order]
                if self._film.transparent:
                    paths = [path for path in paths if path.name != "environment"]
                light = np.sum([images[path.image][..., :3] for path in paths], axis=0, dtype=np.float32)
                found[share_image(group, order)] = self._film.exposure * light
        return found

    def finished(self, sources: set[str]) -> dict[str, np.ndarray]:
        """All images; groups in which nothing shines are black."""
        black = np.zeros_like(self.images[COMBINED])
        return {name: black for name in sources if name.startswith(_SHARE)} | self.images
