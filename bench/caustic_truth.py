"""Light tracing of caustics with Mitsuba 3's rays, for `python -m bench caustics`.

Photons leave the lamps towards the casters and are followed over specular surfaces alone; those that end on a diffuse
one after at least one of them, where the camera above sees it, are counted by pixel. Run as a program by an
interpreter that has Mitsuba (dependency group `truth`): `caustic_truth.py SCENE.npz RESULT.npz PHOTONS`.

SCENE.npz: arrays `vertices_K`, `normals_K`, `faces_K` for mesh K; by mesh `kinds` (0 diffuse, 1 glass, 2 mirror),
`iors` and `smooth`; `lamps` (N, 12), see `emit`; `centre`, `span`, `size` of the picture.
"""

from __future__ import annotations

import sys
import time

import numpy as np

DEPTH = 24
CHUNK = 1 << 20


def trace(scene_file: str, result_file: str, photons: int) -> None:
    import drjit as dr
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    data = np.load(scene_file)
    shapes = {"type": "scene"}
    for number, smooth in enumerate(data["smooth"]):
        vertices, faces = data[f"vertices_{number}"], data[f"faces_{number}"]
        mesh = mi.Mesh(f"mesh{number}", len(vertices), len(faces), has_vertex_normals=bool(smooth))
        values = mi.traverse(mesh)
        values["vertex_positions"] = vertices.astype(np.float32).ravel()
        values["faces"] = faces.astype(np.uint32).ravel()
        if smooth:
            values["vertex_normals"] = data[f"normals_{number}"].astype(np.float32).ravel()
        values.update()
        shapes[f"mesh{number}"] = mesh
    scene = mi.load_dict(shapes)
    opaque = mi.load_dict(
        {"type": "scene", **{k: v for (k, v), kind in zip(list(shapes.items())[1:], data["kinds"]) if kind == 0}}
    )
    # What a hit shape is, by its number in Dr.Jit's registry.
    numbers = {int(np.array(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shapes[f"mesh{k}"])))[0]): k
               for k in range(len(data["kinds"]))}  # fmt: skip
    kind_of, ior_of = np.full(max(numbers) + 1, -1), np.ones(max(numbers) + 1)
    for number, k in numbers.items():
        kind_of[number], ior_of[number] = data["kinds"][k], data["iors"][k]
    size, span, centre = int(data["size"]), float(data["span"]), data["centre"]
    casters = [data[f"vertices_{k}"] for k, kind in enumerate(data["kinds"]) if kind]
    low, high = np.min([v.min(0) for v in casters], axis=0), np.max([v.max(0) for v in casters], axis=0)
    middle, radius = (low + high) / 2, np.linalg.norm(high - low) / 2 * 1.001
    image = np.zeros((size, size, 3))
    rng = np.random.default_rng(1)
    started = time.time()
    for lamp in data["lamps"]:
        done = 0
        while done < photons:
            count = min(CHUNK, photons - done)
            origin, direction, flux = emit(lamp, middle, radius, rng, count)
            p, kept, w = follow(mi, scene, kind_of, ior_of, origin, direction, rng)
            up = mi.Ray3f(mi.Point3f(*np.float32(p + [[0], [0], [1e-4]])), mi.Vector3f(0, 0, 1))
            kept &= ~np.array(opaque.ray_test(up))
            x = ((p[0] - centre[0]) / span + 0.5) * size
            y = ((p[1] - centre[1]) / span + 0.5) * size
            inside = kept & (x >= 0) & (x < size) & (y >= 0) & (y < size)
            share = w[inside, None] * flux[inside] / photons
            np.add.at(image, (y[inside].astype(int), x[inside].astype(int)), share)
            done += count
    image /= (span / size) ** 2
    np.savez_compressed(result_file, irradiance=image.astype(np.float32), seconds=time.time() - started)


def follow(mi, scene, kind_of, ior_of, origin, direction, rng):
    """Where photons end, (3, N), whether on a diffuse surface after specular ones, and what of each is left:
    mirrors keep all, and glass mirrors or bends in proportion to Fresnel's reflectance. In water it is 1 / n^2 of the
    power: radiance that leaves it is smaller by that, which the engines leave to the light below (Cycles as well)."""
    import drjit as dr

    count = len(origin)
    origin, direction = np.ascontiguousarray(origin.T), np.ascontiguousarray(direction.T)
    alive, met, landed = np.ones(count, bool), np.zeros(count, bool), np.zeros(count, bool)
    left = np.ones(count)
    place = np.zeros((3, count))
    for _ in range(DEPTH):
        some = np.flatnonzero(alive)
        if not len(some):
            break
        o, d = origin[:, some], direction[:, some]
        ray = mi.Ray3f(mi.Point3f(*np.float32(o)), mi.Vector3f(*np.float32(d)))
        si = scene.ray_intersect(ray)
        valid = np.array(si.is_valid())
        t = np.where(valid, np.array(si.t), 0.0)
        shape = np.where(valid, np.array(dr.reinterpret_array(mi.UInt32, si.shape)), 0)
        outward, shading = np.array(si.n).reshape(3, -1), np.array(si.sh_frame.n).reshape(3, -1)
        p = o + t * d
        kind = np.where(valid, kind_of[shape], -1)
        ends = kind == 0
        place[:, some[ends]] = p[:, ends]
        landed[some[ends]] = met[some[ends]]
        alive[some[kind <= 0]] = False
        on = np.flatnonzero(kind > 0)
        p, d, n, ng = p[:, on], d[:, on], shading[:, on], outward[:, on]
        kind, ior = kind[on], ior_of[shape[on]]
        enters = (d * ng).sum(0) < 0
        n, ng = np.where(enters, n, -n), np.where(enters, ng, -ng)
        cosine = np.clip(-(d * n).sum(0), 1e-6, 1.0)
        eta = np.where(enters, 1.0 / ior, ior)
        squared = 1.0 - eta**2 * (1.0 - cosine**2)
        other = np.sqrt(np.maximum(squared, 0.0))
        s, q = (eta * cosine - other) / (eta * cosine + other), (eta * other - cosine) / (eta * other + cosine)
        mirrored = np.where((squared <= 0) | (kind == 2), 1.0, 0.5 * (s**2 + q**2))
        bends = rng.random(len(on)) >= mirrored
        onward = np.where(bends, eta * d + (eta * cosine - other) * n, d + 2 * cosine * n)
        onward /= np.linalg.norm(onward, axis=0)
        lost = ((onward * ng).sum(0) > 0) == bends
        index = some[on]
        left[index] *= np.where(bends, eta**2, 1.0)
        origin[:, index] = p + 1e-4 * np.where(bends, -ng, ng)
        direction[:, index] = onward
        met[index] = True
        alive[index[lost]] = False
    return place, landed, left


def emit(lamp: np.ndarray, middle, radius: float, rng, count: int):
    """Origins, directions (count, 3) and fluxes: (count, 3), W times the number of photons. `lamp`: kind (0 sun,
    1 spot), place, direction of emission, strength (W/m2; W/sr), half angle or radius, cosine of the cone."""
    kind, place, axis, strength, extent, cone = lamp[0], lamp[1:4], lamp[4:7], lamp[7:10], lamp[10], lamp[11]
    u, v = frame(axis if kind == 0 else unit(middle - place))
    turn, share = 2 * np.pi * rng.random(count), rng.random(count)
    if kind == 0:
        across = radius * np.sqrt(share)
        cosine = 1.0 - rng.random(count) * (1.0 - np.cos(extent))
        other = 2 * np.pi * rng.random(count)
        sine = np.sqrt(1 - cosine**2)
        direction = cosine[:, None] * axis + sine[:, None] * (np.cos(other)[:, None] * u + np.sin(other)[:, None] * v)
        start = middle + (across * np.cos(turn))[:, None] * u + (across * np.sin(turn))[:, None] * v
        # The disc lies across the mean direction: light at an angle crosses it by its cosine.
        flux = np.broadcast_to(strength * np.pi * radius**2, (count, 3)) * cosine[:, None]
        return start - 4 * radius * direction, direction, flux
    forward = unit(middle - place)
    least = np.sqrt(max(1.0 - ((radius + extent) / np.linalg.norm(middle - place)) ** 2, 0.0))
    cosine = 1.0 - share * (1.0 - least)
    sine = np.sqrt(1 - cosine**2)
    direction = cosine[:, None] * forward + sine[:, None] * (np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v)
    inside = direction @ axis >= cone
    a = np.cross(direction, u)
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b = np.cross(direction, a)
    disc, spin = extent * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    start = place + (disc * np.cos(spin))[:, None] * a + (disc * np.sin(spin))[:, None] * b
    flux = inside[:, None] * strength * (2 * np.pi * (1.0 - least))
    return start, direction, flux


def unit(v):
    return v / np.linalg.norm(v)


def frame(n):
    helper = np.array([1.0, 0, 0]) if abs(n[0]) < 0.9 else np.array([0, 1.0, 0])
    u = unit(np.cross(helper, n))
    return u, np.cross(n, u)


if __name__ == "__main__":
    trace(sys.argv[1], sys.argv[2], int(sys.argv[3]))
