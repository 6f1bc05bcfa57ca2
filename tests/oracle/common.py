"""What the scripts of scenes share: triangles by material, meshes of Mitsuba, rays through pixel centres, means of samples, files.

`oracle.py` says how the environment is made. The scalar variant needs neither LLVM nor a GPU. Only Mitsuba's public interface is
used.
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
SHADES = [0.9, 0.15, 0.6, 0.3, 0.75]


class Geometry:
    """Triangles by material. Equal vertices are stored once."""

    def __init__(self):
        self.positions, self.normals, self.triangles, self.materials = [], [], [], []
        self.shared = {}

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

    def of(self, number):
        """The vertices of the triangles of a material, three for each."""
        return [vertex for triangle in self.triangles if triangle[3] == number for vertex in triangle[:3]]


def rgb(value):
    """A grey, or three colours, for Mitsuba."""
    return {"type": "rgb", "value": value}


def mesh(name, positions, properties, normals=None, places=None, tints=None):
    """A mesh of Mitsuba with three vertices for each triangle. `places` are texture coordinates; `tints` are the attribute
    `vertex_tint`, one number a vertex."""
    count = len(positions) // 3
    has = {"has_vertex_normals": normals is not None, "has_vertex_texcoords": places is not None}
    made = mi.Mesh(name, 3 * count, count, props=properties, **has)
    if tints is not None:
        made.add_attribute("vertex_tint", 1, np.asarray(tints, dtype=np.float32))
    values = mi.traverse(made)
    values["vertex_positions"] = positions.ravel()
    if places is not None:
        values["vertex_texcoords"] = places.ravel()
    values["faces"] = np.arange(3 * count, dtype=np.uint32)
    values.update()
    if normals is not None:
        # When positions are set, Mitsuba computes its own normals, so ours are set afterwards.
        values["vertex_normals"] = normals.ravel()
        values.update()
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


def independent(seed):
    """Random numbers for an integrator."""
    sampler = mi.load_dict({"type": "independent", "sample_count": 1})
    sampler.seed(seed)
    return sampler


def estimated(loaded, camera, shows, sample, samples):
    """For each pixel the mean of what `sample` returns for its ray, and the standard error of that mean, which is 0 for one sample.
    None where `shows` rejects what the centre of the pixel shows, or where a sample is None."""
    means, errors = [], []
    for ray in rays(camera):
        hit = loaded.ray_intersect(ray)
        ray = mi.RayDifferential3f(ray)
        values = [sample(ray) for _ in range(samples)] if hit.is_valid() and shows(hit) else [None]
        if any(value is None for value in values):
            means.append(None)
            errors.append(None)
            continue
        values = np.array(values, dtype=np.float64)
        means.append(values.mean(0))
        errors.append(values.std(0, ddof=1) / math.sqrt(samples) if samples > 1 else 0 * means[-1])
    return means, errors


def rounded(what, digits):
    """Rounds numbers, in lists or not, to `digits` significant digits; None stays."""
    if what is None:
        return None
    if isinstance(what, (list, np.ndarray)):
        return [rounded(value, digits) for value in what]
    return float(f"{what:.{digits}g}")


def write(path, what):
    """A JSON file with one key of its first level a line. Returns its size in bytes."""
    text = json.dumps(what, separators=(",", ":")).replace(',"', ',\n"') + "\n"
    path.write_text(text)
    return len(text)


def told(name, means, size):
    """One line about a scene that is made."""
    shown = [mean for mean in means if mean is not None]
    print(f"{name}: {len(shown)} pixels, mean {np.mean(shown, 0)}, {size // 1024} KiB", flush=True)


def run(scenes):
    """Makes the scenes that the command line names, or all."""
    for name in sys.argv[1:] or scenes:
        scenes[name]()
