"""Renders small scenes with Mitsuba 3 and stores them, with their description, for `tests/frames/oracle.rs`.

    python3 -m venv /tmp/oracle && /tmp/oracle/bin/pip install -r tests/oracle/requirements.txt \
        && /tmp/oracle/bin/python tests/oracle/oracle.py

Each file holds the scene (positions, normals, triangles, materials, camera), the program of ours that is to agree, and
for each pixel the mean of the samples and the standard error of that mean, or null where the pixel shows nothing that is
compared. Rays go through pixel centres, as ours do; the scalar variant needs neither LLVM nor a GPU. Only Mitsuba's public
interface is used.
"""

import math

import mitsuba as mi
import numpy as np

from common import FOLDER, SHADES, SIDE, Geometry, estimated, independent, mesh, rgb, rounded, run, told, write


class Scene(Geometry):
    """Triangles by material. `tint`, if given, is a function of the position that scales at each vertex what its material emits. Mitsuba
    cannot sample points of such emitters, so they get the material of a black mirror, for which Mitsuba samples no emitter."""

    def __init__(self, tint=None):
        super().__init__()
        self.tint = tint

    def material(self, diffuse, glass=False, factor=None, reflects=False):
        """In Mitsuba the material emits `factor` times the ambient colour of our programs, 0.3 * diffuse; with None it emits nothing. An
        emitter reflects no light unless `reflects` is set. An emitter that reflects must not shine on anything."""
        self.materials.append({"diffuse": diffuse, "glass": glass, "factor": factor, "reflects": reflects or factor is None})
        return len(self.materials) - 1

    def checker(self, center, x, y, cells, factor, shades):
        """A wall of `cells` by `cells` quads whose diffuse colours change from cell to cell."""
        center, x, y = (np.asarray(v, dtype=np.float64) for v in (center, x, y))
        materials = [self.material(shade, factor=factor) for shade in shades]
        for i in range(cells):
            for j in range(cells):
                at = [2 * (k + 0.5) / cells - 1 for k in (i, j)]
                material = materials[(i + 2 * j + i * j) % len(shades)]
                self.quad(material, center + x * at[0] + y * at[1], x / cells, y / cells)

    def tints(self):
        """The tint of each vertex."""
        return [float(np.float32(self.tint(*position))) for position in self.positions]

    def meshes(self, glass):
        """One Mitsuba mesh for each material; glass of ours has the material `glass`."""
        made = {}
        for number, material in enumerate(self.materials):
            used = self.of(number)
            if not used:
                continue
            properties = mi.Properties()
            if material["glass"]:
                properties["bsdf"] = mi.load_dict(glass)
            elif self.tint:
                properties["bsdf"] = mi.load_dict({"type": "conductor", "specular_reflectance": rgb(0.0)})
            else:
                reflectance = material["diffuse"] if material["reflects"] else 0.0
                nested = {"type": "diffuse", "reflectance": rgb(reflectance)}
                properties["bsdf"] = mi.load_dict({"type": "twosided", "nested": nested})
            if material["factor"] is not None:
                radiance = 0.3 * material["diffuse"] * material["factor"]
                tinted = {"type": "mesh_attribute", "name": "vertex_tint", "scale": radiance}
                emitter = {"type": "area", "radiance": tinted if self.tint else rgb(radiance)}
                # Without this, a flat wall would light itself in Mitsuba, because points on it are sampled with their bent normals.
                weight = {"sampling_weight": 0.0} if material["reflects"] else {}
                properties["emitter"] = mi.load_dict({**emitter, **weight})
            positions, normals = (np.array([rows[v] for v in used], dtype=np.float32) for rows in (self.positions, self.normals))
            tints = np.array(self.tints(), dtype=np.float32)[used] if self.tint else None
            made[f"material{number}"] = mesh(f"material{number}", positions, properties, normals, tints=tints)
        return made


def dielectric(index):
    """Smooth glass."""
    return {"type": "dielectric", "int_ior": index, "ext_ior": 1.0}


def render(name, about, scene, camera, program, params, integrator, samples, emitters=None, extra=None, glass=None):
    """Renders and stores one scene. With `glass`, the material of our glass, only pixels that show it are compared."""
    camera = {"width": SIDE, "height": SIDE, "up": [0, 1, 0], **camera}
    meshes = scene.meshes(glass)
    loaded = mi.load_dict({"type": "scene", **meshes, **(emitters or {}), **(extra or {})})
    integrator = mi.load_dict(integrator) if isinstance(integrator, dict) else integrator
    sampler = independent(7)
    compared = {f"material{i}" for i, m in enumerate(scene.materials) if m["glass"] or not glass} | set(extra or {})

    def sample(ray):
        radiance = integrator.sample(loaded, sampler, ray)[0]
        return None if radiance is None else radiance[0]

    means, errors = estimated(loaded, camera, lambda hit: hit.shape.id() in compared, sample, samples)
    result = {
        "about": about,
        "made_by": f"Mitsuba {mi.__version__}, {mi.variant()}, {samples} samples a pixel",
        "program": program,
        "params": params,
        "camera": camera,
        "positions": rounded(scene.positions, 9),
        "normals": rounded(scene.normals, 9),
        **({"tints": rounded(scene.tints(), 9)} if scene.tint else {}),
        "triangles": scene.triangles,
        "materials": [{"diffuse": m["diffuse"], "glass": m["glass"]} for m in scene.materials],
        "mean": rounded(means, 6),
        "error": rounded(errors, 3),
    }
    if emitters and "sun" in emitters:
        result["sun"] = emitters["sun"]["direction"]
    if emitters and "sky" in emitters and program == "reflection":
        result["beyond"] = emitters["sky"]["radiance"]["value"]
    if extra and "ball" in extra:
        result["sphere"] = {"center": extra["ball"]["center"], "radius": extra["ball"]["radius"]}
    told(name, means, write(FOLDER / f"{name}.json", result))


def yard():
    """A floor, a tilted board over it and a ball on it."""
    scene = Scene()
    paint = scene.material(0.8)
    scene.quad(paint, (0, 0, 0), (0, 0, 4), (4, 0, 0))
    scene.quad(paint, (-0.9, 0.7, -0.2), (0.1, 0.15, 0.7), (0.6, 0.2, 0))
    scene.quad(paint, (0.2, 0.4, -1.2), (1.3, 0, 0), (0, 0.4, 0))
    return scene, paint


def shadow():
    scene, paint = yard()
    scene.sphere(paint, (0.7, 0.45, 0.3), 0.45, 1, True)
    direction = [0.43, -0.8, -0.37]
    length = math.sqrt(sum(v * v for v in direction))
    direction = [v / length for v in direction]
    sun = {"type": "directional", "direction": direction, "irradiance": rgb(1.0)}
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
    white = {"type": "constant", "radiance": rgb(1.0)}
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
    """The share of directions, weighted by their cosines, in which nothing is within `radius`."""

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
    """A wall in front of the panes and one behind, each turned to them. `behind` scales what the wall behind emits in Mitsuba."""
    scene.checker((0, 0, 9), (14, 0, 0), (0, -14, 0), 7, 1.0, SHADES)
    scene.checker((0, 0, -4), (14, 0, 0), (0, 14, 0), 14, behind, SHADES[::-1])


PANE_CAMERA = {"eye": [-2.2, 0.4, 2.6], "target": [0, 0, 0], "fov_y": 34}


def pane(index):
    scene = Scene()
    scene.quad(scene.material(1.0, glass=True), (0, 0, 0), (9, 0, 0), (0, 9, 0))
    # Radiance in the medium is greater by the square of its index; our programs, like the report, leave this factor out.
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
        glass=dielectric(index),
    )


def two_panes():
    index = 1.3
    scene = Scene()
    glass = scene.material(1.0, glass=True)
    scene.quad(glass, (0, 0, 0), (9, 0, 0), (0, 9, 0))
    scene.quad(glass, (0, 0, -1), (9, 0, 0), (0, 9, 0))
    # The light crosses two interfaces; 0.99 is the factor that the report's programs apply to a secondary bounce on glass.
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
        glass=dielectric(index),
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
        glass=dielectric(index),
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
        glass=dielectric(1.5),
    )


def mirror_sphere():
    scene = Scene()
    room(scene)
    ball = {"type": "sphere", "center": [0, 0, 0], "radius": 1.0, "bsdf": dielectric(1.5)}
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
        glass=dielectric(1.5),
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
    run(SCENES)
