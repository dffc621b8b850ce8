"""Cameras: the scene's and the viewport's, both as a rigid matrix and a frustum one unit before the eye.

The frustum comes from lens and sensor in double precision. `Object.calc_matrix_camera` gives the same one, but its
float32 matrix loses it when the clip distances are extreme (1e-9 to 1e12), so it only serves the tests as truth.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .errors import UnsupportedScene
from .panorama import Panorama, panorama_of
from .scene import Aperture, Camera, Note

OBLIQUE = 0.005  # cosine between two axes of a camera from which on its shear is told of


def camera_of_scene(
    scene, depsgraph, width: int, height: int, camera=None, placed: np.ndarray | None = None,
    shift: float | None = None, eye: str = "",
) -> Camera:  # fmt: skip
    """The view of `camera`, or of the scene's active camera, on a picture of `width` x `height` pixels.

    `placed`, `shift`: matrix and horizontal shift other than its own, of an eye of a stereoscopic pair; `eye`: "left"
    or "right" of a spherical one, whose place depends on where it looks.
    Raises UnsupportedScene when there is no camera, or when it is of a kind that is not drawn.
    """
    camera = camera or scene.camera
    if camera is None:
        raise UnsupportedScene(f"Scene '{scene.name}' has no camera: add one, or choose one in the Scene properties.")
    if camera.type != "CAMERA":
        raise UnsupportedScene(f"Object '{camera.name}' is the scene's camera but no camera object: choose another.")
    camera = camera.evaluated_get(depsgraph)
    data = camera.data
    if data.type not in ("PERSP", "ORTHO", "PANO"):
        raise UnsupportedScene(
            f"Camera '{camera.name}': lens type {data.type.title()} is not supported, since it is a program in OSL,"
            " which only Cycles runs; choose Perspective, Orthographic or Panoramic in the camera's Lens panel."
        )
    if placed is None:
        placed = np.array(camera.matrix_world, np.float64)
    if not np.isfinite(placed).all():
        text = "has a position that is not a finite number; check its drivers and constraints."
        raise UnsupportedScene(f"Camera '{camera.name}' {text}")
    aspect = (scene.render.pixel_aspect_x, scene.render.pixel_aspect_y)
    if data.type == "PANO":
        return _panoramic(camera, placed, width * aspect[0], height * aspect[1], eye)
    return Camera(
        matrix=_rigid(placed),
        kind="PERSPECTIVE" if data.type == "PERSP" else "ORTHOGRAPHIC",
        frame=_frame(data, width, height, aspect, data.shift_x if shift is None else shift),
        clip_start=data.clip_start,
        clip_end=data.clip_end,
        name=camera.name,
        aperture=_aperture(camera),
    )


def camera_of_view(region_data, space=None, camera=None) -> Camera:
    """The view of a 3D viewport.

    `region_data`: RegionView3D, or anything with its view_matrix, window_matrix and is_perspective. `space`: the
    SpaceView3D, whose clip distances are exact where the window matrix has rounded them away. `camera`: the camera
    object looked through, if any; its clip distances win then.
    """
    view = np.array(region_data.view_matrix, np.float64)
    window = np.array(region_data.window_matrix, np.float64)
    matrix = _rigid(np.linalg.inv(view))
    # Inverting the projection row by row: a point at tangent t projects to (P00 t - P02), or to P00 x + P03.
    if region_data.is_perspective:
        frame = tuple(float((side + window[axis, 2]) / window[axis, axis]) for axis in (0, 1) for side in (-1, 1))
        near = window[2, 3] / (window[2, 2] - 1.0)
        far = window[2, 3] / (window[2, 2] + 1.0) if window[2, 2] < -1.0 else np.inf
        lens = camera.data if camera is not None else space
        if lens is not None:
            near, far = lens.clip_start, lens.clip_end
        elif not np.isfinite(far):
            far = 1e7 * near  # where float32 rounds the far plane away
        aperture = _aperture(camera) if camera is not None else None
        return Camera(matrix, "PERSPECTIVE", frame, float(near), float(far), name="", aperture=aperture)
    frame = tuple(float((side - window[axis, 3]) / window[axis, axis]) for axis in (0, 1) for side in (-1, 1))
    near = (window[2, 3] + 1.0) / window[2, 2]
    far = (window[2, 3] - 1.0) / window[2, 2]
    if near < 0.0:
        # Blender's orthographic viewport also shows what lies behind the eye. Stepping back changes nothing in
        # the picture, and nobody below has to know of negative distances.
        matrix[:3, 3] -= matrix[:3, 2] * near
        near, far = 0.0, far - near
    return Camera(matrix, "ORTHOGRAPHIC", frame, float(near), float(far), name="")


def _frame(
    data, width: int, height: int, aspect: tuple[float, float], shift: float
) -> tuple[float, float, float, float]:
    """(left, right, bottom, top) as in scene.Camera, by Blender's rules of sensor fit and lens shift.

    One side of the picture is fitted: it spans sensor/lens (or ortho_scale), and shifts count in its length.
    """
    pixel_height = aspect[1] / aspect[0]
    fit = data.sensor_fit
    if fit == "AUTO":
        fit = "HORIZONTAL" if aspect[0] * width >= aspect[1] * height else "VERTICAL"
    fitted = width if fit == "HORIZONTAL" else pixel_height * height
    # With AUTO the sensor's width is meant, whichever side is fitted.
    sensor = data.sensor_height if data.sensor_fit == "VERTICAL" else data.sensor_width
    span = data.ortho_scale if data.type == "ORTHO" else sensor / data.lens
    per_pixel = span / fitted
    middle_x, middle_y = shift * span, data.shift_y * span
    half_x, half_y = 0.5 * width * per_pixel, 0.5 * height * pixel_height * per_pixel
    return middle_x - half_x, middle_x + half_x, middle_y - half_y, middle_y + half_y


def framed(scene, depsgraph, camera) -> tuple[float, float, float, float]:
    """Left, right, bottom, top of the picture that a camera renders, one unit before the eye, in a viewport that looks
    through it: panoramic ones are shown as perspective."""
    render, data = scene.render, camera.evaluated_get(depsgraph).data
    aspect = render.pixel_aspect_x, render.pixel_aspect_y
    return _frame(data, render.resolution_x, render.resolution_y, aspect, data.shift_x)


def panoramic_view(view: Camera, scene, depsgraph, camera, size: tuple[int, int]) -> Camera:
    """A viewport's perspective `view` through a panoramic camera as the panorama, which fills the camera's frame."""
    render, camera = scene.render, camera.evaluated_get(depsgraph)
    left, right, bottom, top = framed(scene, depsgraph, camera)
    window = (
        (view.frame[0] - left) / (right - left), (view.frame[2] - bottom) / (top - bottom),
        (view.frame[1] - left) / (right - left), (view.frame[3] - bottom) / (top - bottom),
    )  # fmt: skip
    width, height = render.resolution_x * render.pixel_aspect_x, render.resolution_y * render.pixel_aspect_y
    seen = _panoramic(camera, np.array(camera.matrix_world, np.float64), width, height, "")
    # As many pixels as the frame has in the region show the film.
    scale = np.array(size) * mean_angle(
        seen.panorama, size[0] / (window[2] - window[0]), size[1] / (window[3] - window[1])
    )
    frame = (-0.5 * scale[0], 0.5 * scale[0], -0.5 * scale[1], 0.5 * scale[1])
    return replace(seen, frame=frame, name="", panorama=replace(seen.panorama, window=window))


def _panoramic(camera, placed: np.ndarray, width: float, height: float, eye: str) -> Camera:
    """The view of an evaluated panoramic camera; `width` and `height` of the picture in square pixels."""
    data = camera.data
    try:
        panorama = panorama_of(data, width, height, eye)
    except ValueError as refused:
        raise UnsupportedScene(f"Camera '{camera.name}': {refused}") from refused
    half_x, half_y = (0.5 * side * mean_angle(panorama, width, height) for side in (width, height))
    return Camera(
        _rigid(placed), "PANORAMIC", (-half_x, half_x, -half_y, half_y), data.clip_start, data.clip_end, camera.name,
        _aperture(camera), panorama,
    )  # fmt: skip


def mean_angle(panorama: Panorama, width: float, height: float) -> float:
    """The side of a square of the solid angle that a pixel shows, radians: the median over the picture."""
    columns, rows = min(int(width), 128), min(int(height), 128)
    seen = panorama.directions(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1)[:, None])
    across, along = seen[:-1, 1:] - seen[:-1, :-1], seen[1:, :-1] - seen[:-1, :-1]
    there = (np.abs(seen).sum(axis=-1) > 0.0)[:-1, :-1] & (np.linalg.norm(across, axis=-1) < 1.0)
    areas = np.linalg.norm(np.cross(across, along), axis=-1)[there]
    areas = areas[areas > 0.0]
    typical = float(np.sqrt(np.median(areas))) if len(areas) else 1.0
    return typical * np.sqrt(columns * rows / (width * height))


def _aperture(camera) -> Aperture | None:
    """The lens of an evaluated camera object; None where depth of field is off or would change nothing."""
    dof = camera.data.dof
    if not dof.use_dof or camera.data.type not in ("PERSP", "ORTHO", "PANO"):
        return None
    focus = dof.focus_distance
    if dof.focus_object is not None:
        placed = np.array(camera.matrix_world, np.float64)
        towards = np.array(_focus_point(dof), np.float64) - placed[:3, 3]
        focus = abs(float(towards @ _rigid(placed)[:3, 2]))
    # An orthographic camera has no focal length; as in Cycles its aperture is that of one of a metre.
    length = 0.001 * camera.data.lens if camera.data.type != "ORTHO" else 1.0
    radius = length / (2.0 * max(dof.aperture_fstop, 1e-5))
    # What is in focus at the eye itself is in focus nowhere; as in Cycles the picture stays sharp then.
    if not (np.isfinite(focus) and np.isfinite(radius) and focus > 1e-6 and radius > 0.0):
        return None
    return Aperture(radius, focus, dof.aperture_blades, dof.aperture_rotation, max(dof.aperture_ratio, 1e-5))


def _focus_point(dof):
    """Where the focus object stands, or the bone of it that is meant."""
    target = dof.focus_object
    if target.type == "ARMATURE" and dof.focus_subtarget:
        bone = target.pose.bones.get(dof.focus_subtarget)
        if bone is not None:
            return (target.matrix_world @ bone.matrix).translation
    return target.matrix_world.translation


def shear_note(camera) -> Note | None:
    """What is to be said of a camera whose parents' uneven scale and turns have made its axes oblique."""
    axes = np.array(camera.matrix_world, np.float64)[:3, :3]
    axes = axes / np.maximum(np.linalg.norm(axes, axis=0), 1e-30)
    if np.abs(axes.T @ axes - np.eye(3)).max() < OBLIQUE:
        return None
    text = (
        "its parents' uneven scale shears it, and Blender its picture, which is drawn unsheared: clear the parents' "
        "scale, or parent the camera to an object that is scaled evenly."
    )
    return Note(f"Camera '{camera.name}'", text)


def _rigid(matrix: np.ndarray) -> np.ndarray:
    """The matrix without scale and shear, keeping the view direction; a mirroring stays, as in Blender.

    A camera scaled to nothing looks along -Z: a picture that can be understood instead of one of NaN.
    """
    rigid = np.eye(4)
    rigid[:3, 3] = matrix[:3, 3]
    axes = matrix[:3, :3]
    length = np.linalg.norm(axes, axis=0)
    if not np.all(length > 0.0):
        return rigid
    right, up, back = (axes / length).T
    right = right - back * (right @ back)
    up = up - back * (up @ back)
    if np.linalg.norm(right) < 1e-6 or np.linalg.norm(up) < 1e-6:
        return rigid
    right /= np.linalg.norm(right)
    up = up - right * (up @ right)
    if np.linalg.norm(up) < 1e-6:
        return rigid
    rigid[:3, :3] = np.stack([right, up / np.linalg.norm(up), back], axis=1)
    return rigid
