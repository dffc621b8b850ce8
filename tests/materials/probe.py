"""A compute program that evaluates a compiled material at chosen surface points and stores its closures."""

from dataclasses import dataclass

import numpy as np

from addon.gfx.library import Program
from addon.gfx.struct import Struct
from addon.scene.materials import MATERIAL_SCENE

# What the probe writes, one texel each, as (name, components).
FIELDS = (
    ("diffuse", 3),
    ("diffuse_roughness", 1),
    ("diffuse_normal", 3),
    ("emission", 3),
    ("transparency", 3),
    ("holdout", 1),
    ("kind", 1),
    ("glossy_weight", 3),
    ("glossy_tint", 3),
    ("glossy_edge", 3),
    ("glossy_ior", 1),
    ("glossy_roughness", 1),
    ("glossy_anisotropy", 1),
    ("glossy_tangent", 3),
    ("glossy_normal", 3),
    ("glossy_albedo", 3),
)

PROBE = """
#include "generated/material.glsl"
#include "lib/energy.glsl"

void main()
{
  int row = int(gl_GlobalInvocationID.y);
  SurfacePoint point;
  point.position = vec3(0.0);
  point.normal = texelFetch(points, ivec2(0, row), 0).xyz;
  point.mesh_normal = point.normal;
  point.geometric_normal = texelFetch(points, ivec2(1, row), 0).xyz;
  point.incoming = texelFetch(points, ivec2(2, row), 0).xyz;
  point.backfacing = texelFetch(points, ivec2(3, row), 0).x > 0.5;
  point.ray = RAY_CAMERA;
  point.refracts = false;
  point.object_row0 = vec4(1.0, 0.0, 0.0, 0.0);
  point.object_row1 = vec4(0.0, 1.0, 0.0, 0.0);
  point.object_row2 = vec4(0.0, 0.0, 1.0, 0.0);
  point.object_color = vec4(1.0);
  point.object_random = 0.25;
  point.object_index = 0.0;
  point.instancer_generated = vec3(0.0);
  point.instancer_uv = vec2(0.0);
  orthonormal_basis(point.geometric_normal, point.position_dx, point.position_dy);
  for (int i = 0; i < 8; i++) {
    point.attributes[i] = texelFetch(points, ivec2(4 + i, row), 0);
    point.attributes_dx[i] = vec4(0.0);
    point.attributes_dy[i] = vec4(0.0);
  }
  Closures c = closures_begin(point.normal, texelFetch(points, ivec2(3, row), 0).y, 0.0);
  evaluate_material(point, c);
  closures_end(c);
  float mu = clamp(dot(c.glossy_normal, point.incoming), 0.0, 1.0);
  vec3 glossy_albedo_value = c.glossy_weight * glossy_albedo(c.kind, c.glossy_tint, c.glossy_edge, c.glossy_ior,
                                                             c.glossy_roughness, mu);
STORES}
"""


@dataclass
class Points:
    """Surface points, all (N, 3) except `attributes` (N, 8, 4), `backfacing` and `random` (N,)."""

    normal: np.ndarray
    incoming: np.ndarray
    geometric_normal: np.ndarray
    attributes: np.ndarray
    backfacing: np.ndarray
    random: np.ndarray


def points(count=1, normal=(0, 0, 1), incoming=(0, 0, 1), attributes=None, backfacing=0.0, random=0.5, geometric=None):
    """Points that share what is given once; arrays of shape (count, …) vary along the points."""

    def fill(value, shape):
        return np.array(np.broadcast_to(np.asarray(value, np.float32), (count, *shape)))

    given = np.zeros((count, 8, 4), np.float32)
    for index, value in enumerate(attributes or ()):
        given[:, index] = value
    return Points(
        fill(normal, (3,)), fill(incoming, (3,)), fill(normal if geometric is None else geometric, (3,)), given,
        fill(backfacing, ()), fill(random, ()),
    )  # fmt: skip


def material_program(material, name="material probe"):
    """The compute program that probes a compiled material, and its uniform struct."""
    stores = ""
    for column, (field, components) in enumerate(FIELDS):
        source = "glossy_albedo_value" if field == "glossy_albedo" else f"c.{field}"
        value = {1: f"vec4(float({source}))", 3: f"vec4({source}, 0.0)"}[components]
        stores += f"  imageStore(result, ivec2({column}, row), {value});\n"
    values = Struct("MaterialValues", ("vec4", f"value[{len(material.values)}]"))
    samplers = tuple(("FLOAT_2D", f"material_image{k}") for k in range(len(material.images)))
    program = Program(
        name=name,
        compute="generated/probe.glsl",
        textures=(("FLOAT_2D", "points"), ("FLOAT_2D", "energy_table"), *samplers),
        images=(("result", "RGBA32F", "FLOAT_2D", "WRITE"),),
        blocks=((values, "material_values"), (MATERIAL_SCENE, "material_scene")),
        snippets=(
            ("generated/material.glsl", material.glsl),
            ("generated/probe.glsl", PROBE.replace("STORES", stores)),
        ),
        group=(1, 1, 1),
    )
    return program, values
