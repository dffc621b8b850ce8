"""A garden at dusk: every kind of light that has a size, and things that throw telling shadows.

What it tests: sun with an angular size, rectangular and elliptical area lights, a soft spot, a point light with a
radius, all at once; penumbrae from thin poles, a lattice (many blockers that fuse), arches, round and long shadows.
"""

import numpy as np

from .construct import camera, collection, diffuse, glaze, light, mesh, place, principled, solid, world
from .shapes import Shape, arch, ball, box, cylinder, join, lathe, ring, tube

COLUMN = [  # (radius, height) from the foot up
    (0.0, 0.0), (0.30, 0.0), (0.30, 0.09), (0.26, 0.13), (0.28, 0.19), (0.22, 0.25), (0.20, 0.6), (0.205, 1.2),
    (0.17, 2.35), (0.17, 2.42), (0.21, 2.46), (0.27, 2.58), (0.27, 2.68), (0.0, 2.68),
]  # fmt: skip
BOWL = [(0.0, 0.0), (0.26, 0.0), (0.24, 0.06), (0.09, 0.14), (0.08, 0.55), (0.16, 0.66), (0.44, 0.82), (0.47, 0.86),
        (0.43, 0.86), (0.16, 0.72), (0.0, 0.70)]  # fmt: skip


def build() -> None:
    stone = principled("Sandstone", (0.62, 0.52, 0.40), roughness=0.85)
    pale = diffuse("Limewash", (0.74, 0.71, 0.66), roughness=0.6)
    wood = principled("Weathered Wood", (0.30, 0.20, 0.13), roughness=0.7)
    bronze = principled("Bronze", (0.55, 0.30, 0.12), roughness=0.42, metallic=1.0)
    iron = principled("Black Iron", (0.03, 0.03, 0.035), roughness=0.5)
    celadon = glaze("Celadon Glaze", (0.16, 0.36, 0.30), (0.9, 0.95, 0.9), roughness=0.25, share=0.12)
    terracotta = diffuse("Terracotta", (0.55, 0.20, 0.10))

    build_ground(stone)
    build_arcade(pale, stone)
    build_sculpture(stone, bronze)
    build_lattice(wood)
    build_poles(iron)
    build_balls(celadon, terracotta, pale)
    build_lights()
    camera((0.9, -9.4, 4.3), (0.1, 0.15, 0.95), lens=38)
    world((0.016, 0.026, 0.060), strength=1.0)


def build_ground(stone) -> None:
    into = collection("Ground")
    solid("Gravel", box(60, 60, 0.2).moved(z=-0.2), diffuse("Gravel", (0.42, 0.38, 0.33)), into=into)
    terrace = lathe([(3.5, 0.0), (3.5, 0.08), (2.9, 0.08), (2.9, 0.16), (0, 0.16)], 72)
    solid("Round Terrace", terrace, stone, smooth_below=30, location=(0, 0.3, 0), into=into)
    profile = [(0, 0), (0.42, 0.0), (0.5, 0.5), (0.46, 1.6), (0.28, 3.0), (0.1, 4.0), (0, 4.25)]
    cypress = mesh("Cypress", lathe(profile, 16), diffuse("Cypress Green", (0.035, 0.075, 0.035)), smooth_below=60)
    for i, (x, y, size) in enumerate([(-6.6, 6.2, 1.0), (-2.1, 8.2, 1.15), (1.6, 6.6, 0.95), (2.9, 7.6, 1.1),
                                      (7.2, 6.0, 1.2)]):  # fmt: skip
        place(cypress, f"Cypress {i + 1}", location=(x, y, 0), scale=(size,) * 3, into=into)


def build_arcade(pale, stone) -> None:
    into = collection("Arcade")
    wall = mesh("Arch", arch(1.9, 3.0, 1.3, 1.5, 0.42), pale, smooth_below=20)
    for i in range(4):
        place(wall, f"Arch {i + 1}", location=(-4.85 + 1.9 * i, 4.3, 0), into=into)
    solid("Coping", box(7.9, 0.62, 0.16), stone, bevel=0.02, location=(-2.0, 4.3, 3.0), into=into)
    column = mesh("Column", lathe(COLUMN, 28), pale, smooth_below=35)
    for i, (x, y, height) in enumerate([(-3.3, 1.5, 1.0), (-2.75, 2.9, 1.0), (-3.75, 0.0, 0.62)]):
        place(column, f"Column {i + 1}", location=(x, y, 0), scale=(1, 1, height), into=into)


def build_sculpture(stone, bronze) -> None:
    into = collection("Sculpture")
    plinth = box(0.95, 0.95, 0.14) + box(0.72, 0.72, 0.75).moved(z=0.14) + box(0.86, 0.86, 0.1).moved(z=0.89)
    solid("Plinth", plinth, stone, bevel=0.02, location=(0, 0.3, 0.16), rotation_degrees=(0, 0, 24), into=into)
    t = np.linspace(0, 2 * np.pi, 150, endpoint=False)
    knot = np.stack([(2 + np.cos(3 * t)) * np.cos(2 * t), np.sin(3 * t), (2 + np.cos(3 * t)) * np.sin(2 * t)], axis=1)
    solid("Knot", tube(knot * 0.255, 0.135, 14, closed=True), bronze, smooth_below=60,
          location=(0, 0.3, 2.02), rotation_degrees=(0, 0, 20), into=into)  # fmt: skip


def build_lattice(wood) -> None:
    """A fence of crossed slats with square posts, at the right, turned towards the camera."""
    width, height, step = 3.0, 1.7, 0.3
    slats = []
    for sign in (1, -1):
        for start in np.arange(-height, width, step):
            x0, x1 = max(start, 0.0), min(start + height, width)
            if x1 - x0 < 0.1:
                continue
            middle, length = (x0 + x1) / 2, (x1 - x0) * np.sqrt(2)
            slat = box(length, 0.022, 0.05).moved(z=-0.025).turned("y", -45).moved(z=middle - start)
            slats.append(slat.moved(x=middle - width / 2, y=0.012).scaled(sign, sign, 1))
    frame = [box(width + 0.1, 0.08, 0.08).moved(z=z) for z in (-0.08, height)]
    posts = [box(0.12, 0.12, 2.15).moved(x=x, z=-0.3) for x in (-width / 2 - 0.05, width / 2 + 0.05)]
    caps = [ball(0.1, 16, 8).moved(x=x, z=1.93) for x in (-width / 2 - 0.05, width / 2 + 0.05)]
    into = collection("Lattice Fence")
    where = {"location": (3.6, 1.9, 0.3), "rotation_degrees": (0, 0, -28), "into": into}
    solid("Lattice", join(slats + frame + posts), wood, **where)
    solid("Post Caps", join(caps), wood, smooth_below=60, **where)


def build_poles(iron) -> None:
    """Thin poles about a lantern: radial shadows that widen with distance."""
    into = collection("Lantern")
    poles: list[Shape] = []
    for angle in np.radians([10, 62, 118, 170, 226, 290]):
        x, y = 0.62 * np.cos(angle), 0.62 * np.sin(angle)
        path = np.array([(x, y, 0.0), (x * 1.02, y * 1.02, 0.7), (x * 0.98, y * 0.98, 1.15)])
        poles.append(tube(path, (0.02, 0.016, 0.007), 8))
    solid("Iron Poles", join(poles), iron, smooth_below=60, location=(2.15, -2.15, 0), into=into)
    foot = cylinder(0.16, 0.04, 20) + cylinder(0.022, 0.52, 10).moved(z=0.04)
    cage = foot + ring(0.15, 0.012, 28, 6).moved(z=0.56)
    solid("Lantern Stand", cage, iron, smooth_below=40, location=(2.15, -2.15, 0), into=into)


def build_balls(celadon, terracotta, pale) -> None:
    into = collection("Balls and Bowl")
    solid("Bowl", lathe(BOWL, 40), celadon, smooth_below=50, location=(-2.0, -1.9, 0), into=into)
    sphere = mesh("Ball", ball(1.0, 36, 18), terracotta, smooth_below=60)
    for i, (x, y, radius) in enumerate([(-0.85, -2.5, 0.28), (-2.55, -3.0, 0.2)]):
        place(sphere, f"Ball {i + 1}", location=(x, y, radius), scale=(radius,) * 3, into=into)
    floating = mesh("Pale Ball", ball(0.34, 36, 18), pale, smooth_below=60)
    place(floating, "Ball on Column", location=(-3.75, 0.0, 1.66 + 0.34), into=into)
    hoop = ring(0.62, 0.05, 56, 10).turned("x", 90).moved(z=0.66)
    solid("Hoop", hoop, celadon, smooth_below=60, location=(0.95, -1.9, 0), rotation_degrees=(0, 0, -35), into=into)


def build_lights() -> None:
    into = collection("Lights")
    light("Low Sun", "SUN", (-9, -0.8, 4.6), (0, 0, 0), 4.2, (1.0, 0.58, 0.30), into, angle=np.radians(4.0))
    light("Window Glow", "AREA", (6.2, 4.9, 2.6), (3.0, 0.6, 0.2), 430, (0.40, 0.62, 1.0), into,
          shape="RECTANGLE", size=0.9, size_y=0.5)  # fmt: skip
    light("Sky Disk", "AREA", (-2.6, 3.0, 5.6), (-1.6, -0.6, 0), 34, (0.70, 0.58, 1.0), into,
          shape="DISK", size=1.5)  # fmt: skip
    light("Sculpture Spot", "SPOT", (1.9, -3.6, 4.6), (0, 0.3, 1.9), 420, (1.0, 0.88, 0.68), into,
          spot_size=np.radians(34), spot_blend=0.45, shadow_soft_size=0.14)  # fmt: skip
    lantern = light("Lantern Light", "POINT", (2.15, -2.15, 0.68), None, 30, (1.0, 0.50, 0.20), into,
                    shadow_soft_size=0.09)  # fmt: skip
    lantern.visible_camera = True  # the glowing ball is seen
