"""Renders small scenes with Mitsuba 3 and stores them, with their description, for `tests/frames/oracle.rs`.

    python3 -m venv /tmp/oracle && /tmp/oracle/bin/pip install -r tests/oracle/requirements.txt \
        && /tmp/oracle/bin/python tests/oracle/oracle.py

Each file holds the scene (positions, normals, triangles, materials, camera), the program of ours that is to agree, and
for each pixel the mean of the samples and the standard error of that mean, or null where the pixel shows nothing that is
compared. Rays go through pixel centres, as ours do; the scalar variant needs neither LLVM nor a GPU. Only Mitsuba's public
interface is used.
"""

import json
import math
import pathlib
import sys

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")

FOLDER = pathlib.Path(__file__).parent
SIDE = 24


class Scene:
    """Triangles by material; `radiance` of a material makes it an emitter on the side of its normals."""

    def __init__(self):
        self.positions, self.normals, self.triangles, self.materials = [], [], [], []
        self.shared = {}

    def material(self, diffuse, glass=False, factor=None):
        """`factor` times the ambient colour of our programs, 0.3 * diffuse, is what Mitsuba's emitter sends out."""
        self.materials.append({"diffuse": diffuse, "glass": glass, "factor": factor})
        return len(self.materials) - 1

    def triangle(self, material, corners, normals=None):
        corners = np.asarray(corners, dtype=np.float32)
        if normals is None:
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            normals = [normal / np.linalg.norm(normal)] * 3
        self.triangles.append([self.vertex(*v) for v in zip(corners, np.asarray(normals, dtype=np.float32))] + [material])

    def vertex(self, position, normal):
        key = (*position.tolist(), *normal.tolist())
        if key not in self.shared:
            self.shared[key] = len(self.positions)
            self.positions.append(position.tolist())
            self.normals.append(normal.tolist())
        return self.shared[key]

    def quad(self, material, center, x, y):
        center, x, y = (np.asarray(v, dtype=np.float64) for v in (center, x, y))
        a, b, c, d = center - x - y, center + x - y, center + x + y, center - x + y
        self.triangle(material, [a, b, d])
        self.triangle(material, [c, d, b])

    def checker(self, center, x, y, cells, factor, shades):
        """A wall of `cells` by `cells` quads whose diffuse colours change from cell to cell."""
        center, x, y = (np.asarray(v, dtype=np.float64) for v in (center, x, y))
        materials = [self.material(shade, factor=factor) for shade in shades]
        for i in range(cells):
            for j in range(cells):
                at = [2 * (k + 0.5) / cells - 1 for k in (i, j)]
                material = materials[(i + 2 * j + i * j) % len(shades)]
                self.quad(material, center + x * at[0] + y * at[1], x / cells, y / cells)

    def sphere(self, material, center, radius, levels, smooth):
        """A subdivided icosahedron."""
        g = (1 + math.sqrt(5)) / 2
        points = []
        for a, b in [(1, g), (-1, g), (1, -g), (-1, -g)]:
            points += [(0, a, b), (a, b, 0), (b, 0, a)]
        points = [np.array(p, dtype=np.float64) / math.sqrt(1 + g * g) for p in points]
        near = lambda p, q: np.linalg.norm(points[p] - points[q]) < 1.1
        faces = [
            (i, j, k)
            for i in range(12)
            for j in range(i + 1, 12)
            for k in range(j + 1, 12)
            if near(i, j) and near(j, k) and near(i, k)
        ]
        triangles = [[points[i] for i in face] for face in faces]
        for _ in range(levels):
            unit = lambda p, q: (p + q) / np.linalg.norm(p + q)
            finer = []
            for a, b, c in triangles:
                ab, bc, ca = unit(a, b), unit(b, c), unit(c, a)
                finer += [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            triangles = finer
        for corners in triangles:
            if np.dot(np.cross(corners[1] - corners[0], corners[2] - corners[0]), corners[0]) < 0:
                corners = [corners[0], corners[2], corners[1]]
            placed = [np.asarray(center) + radius * corner for corner in corners]
            self.triangle(material, placed, corners if smooth else None)

    def meshes(self, index):
        """One Mitsuba mesh a material."""
        made = {}
        for number, material in enumerate(self.materials):
            used = [t[:3] for t in self.triangles if t[3] == number]
            if not used:
                continue
            vertices = np.array([self.positions[v] for t in used for v in t], dtype=np.float32)
            normals = np.array([self.normals[v] for t in used for v in t], dtype=np.float32)
            if material["glass"]:
                bsdf = {"type": "dielectric", "int_ior": index, "ext_ior": 1.0}
            else:
                reflectance = 0.0 if material["factor"] is not None else material["diffuse"]
                bsdf = {"type": "twosided", "nested": {"type": "diffuse", "reflectance": {"type": "rgb", "value": reflectance}}}
            properties = mi.Properties()
            properties["bsdf"] = mi.load_dict(bsdf)
            if material["factor"] is not None:
                radiance = 0.3 * material["diffuse"] * material["factor"]
                properties["emitter"] = mi.load_dict({"type": "area", "radiance": {"type": "rgb", "value": radiance}})
            count = len(used)
            mesh = mi.Mesh(f"material{number}", 3 * count, count, has_vertex_normals=True, props=properties)
            values = mi.traverse(mesh)
            values["vertex_positions"] = vertices.ravel()
            values["faces"] = np.arange(3 * count, dtype=np.uint32)
            values.update()
            # New positions make it compute normals of its own, so ours come after them.
            values["vertex_normals"] = normals.ravel()
            values.update()
            made[f"material{number}"] = mesh
        return made


def rays(camera):
    """Rays through the centres of the pixels, top row first."""
    eye, target, up = (np.asarray(camera[k], dtype=np.float64) for k in ("eye", "target", "up"))
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    above = np.cross(right, forward)
    extent = math.tan(math.radians(camera["fov_y"]) / 2)
    for row in range(camera["height"]):
        for column in range(camera["width"]):
            x = (2 * (column + 0.5) / camera["width"] - 1) * extent * camera["width"] / camera["height"]
            y = (1 - 2 * (row + 0.5) / camera["height"]) * extent
            direction = forward + x * right + y * above
            direction /= np.linalg.norm(direction)
            yield mi.Ray3f(mi.Point3f(*eye), mi.Vector3f(*direction))


def render(name, about, scene, camera, program, params, integrator, samples, emitters=None, extra=None, only_glass=False):
    """Renders and stores one scene."""
    camera = {"width": SIDE, "height": SIDE, "up": [0, 1, 0], **camera}
    meshes = scene.meshes(params.get("index", 1.5))
    description = {"type": "scene", **meshes, **(emitters or {}), **(extra or {})}
    loaded = mi.load_dict(description)
    integrator = mi.load_dict(integrator) if isinstance(integrator, dict) else integrator
    sampler = mi.load_dict({"type": "independent", "sample_count": 1})
    sampler.seed(7)
    glass = {f"material{i}" for i, m in enumerate(scene.materials) if m["glass"]} | set(extra or {})
    means, errors = [], []
    for ray in rays(camera):
        hit = loaded.ray_intersect(ray)
        seen = hit.is_valid() and (not only_glass or hit.shape.id() in glass or hit.shape.id() == "ball")
        if not seen:
            means.append(None)
            errors.append(None)
            continue
        ray = mi.RayDifferential3f(ray)
        values = np.array([integrator.sample(loaded, sampler, ray)[0][0] for _ in range(samples)], dtype=np.float64)
        means.append(float(f"{values.mean():.6g}"))
        errors.append(float(f"{values.std(ddof=1) / math.sqrt(samples):.3g}") if samples > 1 else 0.0)
    shorten = lambda rows: [[float(f"{v:.9g}") for v in row] for row in rows]
    result = {
        "about": about,
        "made_by": f"Mitsuba {mi.__version__}, {mi.variant()}, {samples} samples a pixel",
        "program": program,
        "params": params,
        "camera": camera,
        "positions": shorten(scene.positions),
        "normals": shorten(scene.normals),
        "triangles": scene.triangles,
        "materials": [{"diffuse": m["diffuse"], "glass": m["glass"]} for m in scene.materials],
        "mean": means,
        "error": errors,
    }
    if emitters and "sun" in emitters:
        result["sun"] = emitters["sun"]["direction"]
    if extra and "ball" in extra:
        result["sphere"] = {"center": extra["ball"]["center"], "radius": extra["ball"]["radius"]}
    text = json.dumps(result, separators=(",", ":")).replace(',"', ',\n"')
    (FOLDER / f"{name}.json").write_text(text + "\n")
    shown = [m for m in means if m is not None]
    print(f"{name}: {len(shown)} pixels, mean {np.mean(shown):.5f}, {len(text) // 1024} KiB", flush=True)


def yard():
    """A floor, a tilted board over it and a ball on it."""
    scene = Scene()
    paint = scene.material(0.8)
    scene.quad(paint, (0, 0, 0), (0, 0, 4), (4, 0, 0))
    scene.quad(paint, (-0.9, 0.7, -0.2), (0.1, 0.15, 0.7), (0.6, 0.2, 0))
    scene.quad(paint, (0.2, 0.4, -1.2), (1.3, 0, 0), (0, 0.4, 0))
    return scene, paint


SHADES = [0.9, 0.15, 0.6, 0.3, 0.75]


def shadow():
    scene, paint = yard()
    scene.sphere(paint, (0.7, 0.45, 0.3), 0.45, 1, True)
    direction = [0.43, -0.8, -0.37]
    length = math.sqrt(sum(v * v for v in direction))
    direction = [v / length for v in direction]
    sun = {"type": "directional", "direction": direction, "irradiance": {"type": "rgb", "value": 1.0}}
    render(
        "hard_shadow",
        "Radiance of a diffuse scene (reflectance 0.8) in a directional light of irradiance 1; a smooth-shaded ball.",
        scene,
        {"eye": [0.3, 2.4, 3.1], "target": [0, 0.2, -0.1], "fov_y": 42},
        "deferredShadows",
        {},
        {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
        1,
        emitters={"sun": sun},
    )


def ambient():
    scene, paint = yard()
    scene.sphere(paint, (0.7, 0.45, 0.3), 0.45, 1, False)
    for material in scene.materials:
        material["diffuse"] = 1.0
    white = {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}}
    render(
        "ambient_occlusion",
        "Radiance of a white diffuse scene in a white environment of radiance 1, direct light only: the open share.",
        scene,
        {"eye": [0.3, 2.4, 3.1], "target": [0, 0.2, -0.1], "fov_y": 42},
        "ssao",
        {"radius": 10000.0, "samples": 256},
        {"type": "direct", "emitter_samples": 0, "bsdf_samples": 1},
        4096,
        emitters={"sky": white},
    )


class Near:
    """The share of directions, by their cosines, in which nothing is within `radius`."""

    def __init__(self, radius):
        self.radius, self.ray = radius, None

    def sample(self, scene, sampler, ray):
        if self.ray is not ray:
            self.ray, self.hit = ray, scene.ray_intersect(ray)
            self.frame = mi.Frame3f(self.hit.n if np.dot(self.hit.n, ray.d) < 0 else -self.hit.n)
        direction = self.frame.to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d()))
        away = self.hit.spawn_ray(direction)
        away.maxt = self.radius
        return [0.0 if scene.ray_test(away) else 1.0], None


def ambient_near():
    scene, paint = yard()
    scene.sphere(paint, (0.7, 0.45, 0.3), 0.45, 1, False)
    radius = 0.5
    render(
        "ambient_near",
        "The share of directions, by their cosines, in which nothing is within half a unit.",
        scene,
        {"eye": [0.3, 2.4, 3.1], "target": [0, 0.2, -0.1], "fov_y": 42},
        "ssao",
        {"radius": radius, "samples": 256},
        Near(radius),
        4096,
    )


def walls(scene, behind):
    """A wall in front of the panes and one behind, each turned to them. A factor scales what Mitsuba's emitter sends."""
    scene.checker((0, 0, 9), (14, 0, 0), (0, -14, 0), 7, 1.0, SHADES)
    scene.checker((0, 0, -4), (14, 0, 0), (0, 14, 0), 14, behind, SHADES[::-1])


PANE_CAMERA = {"eye": [-2.2, 0.4, 2.6], "target": [0, 0, 0], "fov_y": 34}


def pane(index):
    scene = Scene()
    scene.quad(scene.material(1.0, glass=True), (0, 0, 0), (9, 0, 0), (0, 9, 0))
    # What is seen in the medium is brighter by the square of its index, which our programs, like the report, leave out.
    walls(scene, index * index)
    render(
        f"pane_{str(index).replace('.', '_')}",
        f"One smooth dielectric interface of index {index} between two walls of emitters; the wall behind is in the medium.",
        scene,
        PANE_CAMERA,
        "refraction",
        {"index": index, "depth": 5},
        {"type": "path", "max_depth": 2, "rr_depth": 100},
        4096,
        only_glass=True,
    )


def two_panes():
    index = 1.3
    scene = Scene()
    glass = scene.material(1.0, glass=True)
    scene.quad(glass, (0, 0, 0), (9, 0, 0), (0, 9, 0))
    scene.quad(glass, (0, 0, -1), (9, 0, 0), (0, 9, 0))
    # Two crossings; 0.99 is what the report's programs leave of a secondary bounce on glass.
    walls(scene, 0.99 * index**4)
    render(
        "two_panes",
        "Two interfaces that both face the viewer, each of index 1.3 to what lies before it: two of the report's panes.",
        scene,
        PANE_CAMERA,
        "refraction",
        {"index": index, "depth": 1},
        {"type": "path", "max_depth": 3, "rr_depth": 100},
        4096,
        only_glass=True,
    )


def solid_slab():
    index = 1.5
    scene = Scene()
    glass = scene.material(1.0, glass=True)
    scene.quad(glass, (0, 0, 0), (9, 0, 0), (0, 9, 0))
    scene.quad(glass, (0, 0, -1), (9, 0, 0), (0, -9, 0))
    walls(scene, 1.0)
    render(
        "solid_slab",
        "A slab of glass of index 1.5 with air on both sides, up to 12 interfaces a path.",
        scene,
        PANE_CAMERA,
        "refraction",
        {"index": index, "depth": 10},
        {"type": "path", "max_depth": 13, "rr_depth": 100},
        4096,
        only_glass=True,
    )


def room(scene):
    """Six walls of emitters, turned inward."""
    for axis in range(3):
        for sign in (1, -1):
            normal, x = np.zeros(3), np.zeros(3)
            normal[axis] = -sign
            x[(axis + 1) % 3] = 6
            y = np.cross(normal, x / 6) * 6
            scene.checker(-6 * normal, x, y, 4, 1.0, SHADES)


def mirror_mesh():
    scene = Scene()
    scene.sphere(scene.material(1.0, glass=True), (0, 0, 0), 1, 1, True)
    room(scene)
    render(
        "mesh",
        "What a smooth-shaded glass mesh of 80 triangles and index 1.5 mirrors of a room of emitters.",
        scene,
        {"eye": [0.8, 0.9, 3.0], "target": [0, 0, 0], "fov_y": 30},
        "refraction",
        {"index": 1.5, "depth": 0},
        {"type": "path", "max_depth": 2, "rr_depth": 100},
        4096,
        only_glass=True,
    )


def mirror_sphere():
    scene = Scene()
    room(scene)
    ball = {"type": "sphere", "center": [0, 0, 0], "radius": 1.0, "bsdf": {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0}}
    render(
        "sphere",
        "What an exact glass sphere of index 1.5 mirrors of a room of emitters; ours is a mesh of 20,480 triangles.",
        scene,
        {"eye": [0.8, 0.9, 3.0], "target": [0, 0, 0], "fov_y": 30},
        "refraction",
        {"index": 1.5, "depth": 0},
        {"type": "path", "max_depth": 2, "rr_depth": 100},
        4096,
        extra={"ball": ball},
        only_glass=True,
    )


SCENES = {
    "hard_shadow": shadow,
    "ambient_occlusion": ambient,
    "ambient_near": ambient_near,
    "pane_1_1": lambda: pane(1.1),
    "pane_1_5": lambda: pane(1.5),
    "two_panes": two_panes,
    "solid_slab": solid_slab,
    "mesh": mirror_mesh,
    "sphere": mirror_sphere,
}

if __name__ == "__main__":
    for name in sys.argv[1:] or SCENES:
        SCENES[name]()
