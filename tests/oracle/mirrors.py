"""Renders small scenes of perfect mirrors with Mitsuba 3 and stores them for `tests/frames/oracle/mirrors.rs`.

    /tmp/oracle/bin/python tests/oracle/mirrors.py [NAME …]

`oracle.py` says how the environment is made and what the files hold. The walls' radiance is interpolated between vertices, so that
the value of a pixel tells where its path ends.
"""

import math

import mitsuba as mi
import numpy as np

from common import rgb, run
from oracle import Scene, render

MIRROR = {"type": "twosided", "nested": {"type": "conductor", "material": "none"}}


class Mirrored:
    """Follows paths over at most `mirrors` mirrors to a surface that is not a mirror. Hits, interpolated normals, mirrors and light are
    Mitsuba's. Only the origins of rays are chosen here: Mitsuba's integrator `path` starts rays a ten-thousandth or more off a surface,
    which these pictures would show. Apart from that, `path` must give the same values. A sample is None where an interpolated normal
    mirrors into the body."""

    # Offset of ray origins from the surface, per (1 + greatest coordinate): a few times the rounding of positions.
    OFF = 5e-7

    def __init__(self, mirrors, segments):
        """`segments` is the number of path segments from the last mirror to the light: 1, or 2 by way of a diffuse surface."""
        self.mirrors = mirrors
        path = lambda most: mi.load_dict({"type": "path", "max_depth": most, "rr_depth": 100})
        self.path, self.end = path(mirrors + segments), path(segments)
        self.compared = self.apart = 0

    def sample(self, scene, sampler, ray):
        value = self.value(scene, sampler, ray)
        if value is not None:
            self.compared += 1
            self.apart += abs(self.path.sample(scene, sampler, ray)[0][0] - value) > 2e-3 * value
        return None if value is None else [value], None

    def value(self, scene, sampler, ray):
        for _ in range(self.mirrors + 1):
            hit = scene.ray_intersect(ray)
            if not hit.is_valid() or hit.emitter(scene) is not None:
                return self.end.sample(scene, sampler, mi.RayDifferential3f(ray))[0][0]
            taken, weight = hit.bsdf().sample(mi.BSDFContext(), hit, sampler.next_1d(), sampler.next_2d())
            direction = hit.to_world(taken.wo)
            away, came = np.dot(hit.n, direction), -np.dot(hit.n, ray.d)
            if away * came <= 0 or min(weight) < 1:
                return None
            off = self.OFF * math.copysign(1 + max(abs(hit.p)), away)
            ray = mi.Ray3f(hit.p + off * hit.n, direction)
        return 0.0


def mirrored(name, about, scene, camera, depth, emitters=None, segments=1):
    """Renders with exact paths. Our `depth` counts the mirrors after the first."""
    paths = Mirrored(depth + 1, segments)
    render(name, about, scene, camera, "reflection", {"depth": depth}, paths, 1, emitters, glass=MIRROR)
    print(f"  Mitsuba's path differs by more than 0.2 % in {paths.apart} of {paths.compared} pixels", flush=True)
    assert paths.apart < 0.03 * paths.compared


def waves(x, y, z):
    """A tint that differs from vertex to vertex, and that varies differently along each axis."""
    return 0.6 + 0.3 * math.sin(1.1 * x + 0.4 * z) * math.cos(0.8 * y - 0.3 * x + 0.5) + 0.1 * math.sin(1.7 * z + 0.9 * y)


def wall(scene, material, center, x, y, cells):
    """A wall of `cells` by `cells` quads of one material."""
    center, x, y = (np.asarray(v, dtype=np.float64) for v in (center, x, y))
    for i in range(cells):
        for j in range(cells):
            at = [2 * (k + 0.5) / cells - 1 for k in (i, j)]
            scene.quad(material, center + x * at[0] + y * at[1], x / cells, y / cells)


def tinted(sides):
    """A scene with these walls of a room, each an axis and a sign, turned inward."""
    scene = Scene(tint=waves)
    material = scene.material(1.0, factor=1.0)
    for axis, sign in sides:
        normal, x = np.zeros(3), np.zeros(3)
        normal[axis] = -sign
        x[(axis + 1) % 3] = 6
        wall(scene, material, -6 * normal, x, np.cross(normal, x / 6) * 6, 5)
    return scene


ROOM = [(axis, sign) for axis in range(3) for sign in (1, -1)]


def flat():
    scene = tinted(ROOM)
    scene.quad(scene.material(1.0, glass=True), (0, 0, 0), (2.5, 0, 0.4), (0.2, 2.5, -0.3))
    camera = {"eye": [-3.4, 0.7, 1.9], "target": [-0.1, 0.1, 0], "fov_y": 36}
    mirrored("mirror", "One flat mirror between walls of emitters, seen obliquely.", scene, camera, 0)


def facing():
    """Three mirrors about the line of sight."""
    scene = tinted(ROOM)
    glass = scene.material(1.0, glass=True)
    for turn in (0.1, 2.2, 4.3):
        out = np.array([math.cos(turn), math.sin(turn), 0.05])
        along, across = np.array([-0.05 * math.cos(turn), -0.05 * math.sin(turn), 1.0]), np.array([-math.sin(turn), math.cos(turn), 0])
        scene.quad(glass, 0.5 * out, 2.5 * along, 0.85 * across)
    camera = {"eye": [0.12, 0.05, 2.3], "target": [0.5, 0.3, 1.6], "fov_y": 60}
    mirrored("mirrors", "Three mirrors that see one another, up to six on a path; what is seen in more is black.", scene, camera, 5)


def ball():
    scene = tinted([side for side in ROOM if side != (1, 1)])
    glass = scene.material(1.0, glass=True)
    scene.sphere(glass, (0, 0.1, 0), 0.9, 1, True)
    scene.quad(glass, (0, -1, 0), (0, 0, 2.2), (2.2, 0, 0))
    camera = {"eye": [0.8, 0.9, 3.6], "target": [0, -0.25, 0], "fov_y": 36}
    about = "A smooth-shaded ball of 80 triangles over a mirror, up to three on a path, and a background of 0.12 in the place of a ceiling."
    mirrored("mirror_ball", about, scene, camera, 2, {"sky": {"type": "constant", "radiance": rgb(0.12)}})


def lit():
    """A wall in the sun, whose normals are bent. Nothing but the mirror and the wall, so no light comes from elsewhere."""
    scene = Scene()
    material = scene.material(0.9, factor=1.0, reflects=True)
    cells, half = 6, 6.5
    place = lambda i, j: np.array([4.5 + half * (2 * i / cells - 1), 0.5 + half * (2 * j / cells - 1), -2.0])
    bent = lambda p: np.array([0.35 * math.sin(1.3 * p[0] + 0.4), 0.35 * math.cos(1.1 * p[1] + 0.6 * p[0]), 1.0])
    unit = lambda v: v / np.linalg.norm(v)
    for i in range(cells):
        for j in range(cells):
            a, b, c, d = (place(i + k, j + m) for k, m in ((0, 0), (1, 0), (1, 1), (0, 1)))
            for corners in ([a, b, d], [c, d, b]):
                scene.triangle(material, corners, [unit(bent(corner)) for corner in corners])
    scene.quad(scene.material(1.0, glass=True), (0, 0, 1.5), (2, 0.2, 0.4), (0, -2, 0.2))
    direction = np.array([-0.75, -0.35, -0.6])
    # In our units the sun adds its colour times the cosine; Mitsuba's diffuse surfaces divide by pi.
    sun = {"type": "directional", "direction": unit(direction).tolist(), "irradiance": rgb(math.pi)}
    camera = {"eye": [-1.6, 0.6, -1.2], "target": [0.2, 0, 1.5], "fov_y": 44}
    about = "A flat mirror that shows a wall in the sun, with interpolated normals: its diffuse and its ambient light."
    mirrored("mirror_lit", about, scene, camera, 0, {"sun": sun}, segments=2)


SCENES = {"mirror": flat, "mirrors": facing, "mirror_ball": ball, "mirror_lit": lit}

if __name__ == "__main__":
    run(SCENES)
