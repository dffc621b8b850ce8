"""Pictures as Blender's images, so that the Image Editor can show them."""

from __future__ import annotations

import bpy
import numpy as np

OWN = "made_by_candela"  # under which name: an artist's image of that name is left as it is


def write(name: str, picture: np.ndarray):
    """The image of this name with the content of `picture`, (H, W, 1 to 4) scene-linear; made if it is not there."""
    height, width = picture.shape[:2]
    image = written(name)
    if image is None:
        image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=True)
        image[OWN] = name
    elif tuple(image.size) != (width, height):
        image.scale(width, height)
    pixels = np.ones((height, width, 4), np.float32)
    channels = picture.shape[2]
    if channels < 3:
        pixels[..., :3] = picture[..., :1]
    else:
        pixels[..., :channels] = picture
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    return image


def written(name: str):
    """What was written under this name, which ends in a number where the artist has another image so named."""
    alike = (image for image in bpy.data.images if image.name == name or image.name.startswith(f"{name}."))
    return next((image for image in alike if image.is_float and image.get(OWN) == name), None)


def editor_of(context) -> int:
    """The address of the Image Editor in which an operator was clicked; 0 where it was elsewhere."""
    area = context.area
    return area.as_pointer() if area is not None and area.type == "IMAGE_EDITOR" else 0


def show(context, name: str, picture: np.ndarray, editor: int = 0):
    """Write the image and show it in every Image Editor of the window that shows nothing else of the artist's, and in
    the `editor` of this address whatever it shows.

    A new image is a step of its own for undo, since it may come long after the operator that wanted it has been called.
    A data-block that no step knows of would be freed by the next undo under those that point to it.
    """
    made = written(name) is None
    image = write(name, picture)
    if made:
        bpy.ops.ed.undo_push(message=f"Show {name}")
    window = context.window
    for area in window.screen.areas if window is not None else ():
        space = area.spaces.active
        if area.type != "IMAGE_EDITOR":
            continue
        if area.as_pointer() == editor or space.image is None or space.image.name.startswith("Candela "):
            space.image = image
            area.tag_redraw()
    return image
