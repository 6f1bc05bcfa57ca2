"""Renders small scenes of glass bodies with Mitsuba 3 and stores them beside their glTF files, for `tests/frames/oracle/bodies.rs`.

    /tmp/oracle/bin/python tests/oracle/bodies.py [NAME …]

`oracle.py` says how the environment is made. A scene is a glTF file, which our program opens as it opens any, and a JSON file: the
camera, our settings, and for each pixel that is compared the mean and the standard error of red, green and blue. Walls emit light
and reflect none. Paths of Mitsuba meet up to 40 surfaces.
"""

import base64
import math
import struct
import zlib

import mitsuba as mi
import numpy as np

from common import FOLDER, SHADES, SIDE, Geometry, estimated, independent, mesh, rays, rgb, rounded, run, told, write

SURFACES = 40
CAMERA = {"eye": [0.8, 0.9, 3.0], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y": 30, "width": SIDE, "height": SIDE}


def wall(radiance, factor=1.0):
    """Emits on the side of its normals: a radiance, or rows of sRGB codes. Mitsuba's emits `factor` times the radiance."""
    return {"emits": radiance, "factor": factor}


def lattice(rows):
    """Black, with holes where a row has a 0."""
    return {"holes": rows}


def paint(diffuse):
    """Neither emits nor is glass."""
    return {"diffuse": diffuse}


def glass(index, extinction=(0, 0, 0), alpha=0.0, around=1.0, dispersion=0.0):
    """A body. `around` is the index of what surrounds it, which Mitsuba is told; ours finds it. `dispersion` is 20 over Abbe's number."""
    return {"index": index, "extinction": extinction, "alpha": alpha, "around": around, "dispersion": dispersion}


def decode(code):
    """sRGB to linear."""
    value = code / 255
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def texture(rows):
    """Numbers as a texture of Mitsuba that shows the nearest. The first row is at v = 0."""
    bitmap = mi.Bitmap(np.asarray(rows, dtype=np.float32)[:, :, None])
    return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "nearest", "wrap_mode": "clamp"}


def png(rows):
    """A file of rows of grey codes, each with an alpha. The first row is at v = 0 of glTF, too."""
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    header = struct.pack(">IIBBBBB", len(rows[0]), len(rows), 8, 4, 0, 0, 0)
    lines = b"".join(b"\0" + bytes(value for pixel in row for value in pixel) for row in rows)
    file = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(lines)) + chunk(b"IEND", b"")
    return "data:image/png;base64," + base64.b64encode(file).decode()


class Bodies(Geometry):
    """Triangles by material; materials are the dictionaries above."""

    def material(self, made):
        self.materials.append(made)
        return len(self.materials) - 1

    def room(self, shades=SHADES, half=6.0, cells=4, factor=1.0):
        """Six walls, turned inward, whose radiance changes from cell to cell."""
        materials = [self.material(wall(shade, factor)) for shade in shades]
        for axis in range(3):
            for sign in (1, -1):
                center, x, y = self.side(axis, -sign, half)
                for i in range(cells):
                    for j in range(cells):
                        at = [2 * (k + 0.5) / cells - 1 for k in (i, j)]
                        material = materials[(i + 2 * j + i * j + axis) % len(shades)]
                        self.quad(material, -center + x * at[0] + y * at[1], x / cells, y / cells)

    def box(self, material, half, middle=(0, 0, 0)):
        """A closed box."""
        for axis in range(3):
            for sign in (1, -1):
                center, x, y = self.side(axis, sign, 1.0)
                self.quad(material, np.array(middle) + center * half, x * half, y * half)

    @staticmethod
    def side(axis, sign, half):
        """The centre of a side of a cube, and the halves of its edges, whose cross product points outwards."""
        center, x, y = np.zeros(3), np.zeros(3), np.zeros(3)
        center[axis], x[(axis + 1) % 3], y[(axis + 2) % 3] = sign * half, half, sign * half
        return center, x, y

    def corners(self, number):
        """Positions and texture coordinates of the triangles of a material. Two triangles are a quad where coordinates count."""
        used = self.of(number)
        halves = [[(0, 0), (1, 0), (0, 1)], [(1, 1), (0, 1), (1, 0)]]
        positions = [self.positions[vertex] for vertex in used]
        places = [place for index in range(len(used) // 3) for place in halves[index % 2]]
        return np.array(positions, dtype=np.float32), np.array(places, dtype=np.float32)

    def meshes(self):
        """One Mitsuba mesh for each material."""
        made = {}
        for number, material in enumerate(self.materials):
            positions, places = self.corners(number)
            properties = mi.Properties()
            properties["bsdf"] = mi.load_dict(bsdf(material))
            if any(material.get("extinction", ())):
                # Colours are limited to 1 here, so the extinction is divided by its largest component, and `scale` multiplies it back.
                most = max(material["extinction"])
                extinction = rgb([value / most for value in material["extinction"]])
                inside = {"type": "homogeneous", "sigma_t": extinction, "scale": most, "albedo": rgb([0.0] * 3)}
                properties["interior"] = mi.load_dict(inside)
            if "emits" in material:
                emits = material["emits"]
                if isinstance(emits, list):
                    radiance = texture([[decode(code) for code in row] for row in emits])
                else:
                    radiance = rgb(emits * material["factor"])
                properties["emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
            made[f"material{number}"] = mesh(f"material{number}", positions, properties, places=places)
        return made

    def gltf(self):
        """The scene as a file for ours."""
        data, views, accessors, primitives, images = b"", [], [], [], []

        def accessor(array, kind, bounds):
            nonlocal data
            views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
            data += array.tobytes()
            made = {"bufferView": len(views) - 1, "componentType": 5126, "count": len(array), "type": kind}
            accessors.append({**made, **({"min": array.min(0).tolist(), "max": array.max(0).tolist()} if bounds else {})})
            return len(accessors) - 1

        materials = [described(number, material, images) for number, material in enumerate(self.materials)]
        for number, material in enumerate(self.materials):
            positions, places = self.corners(number)
            attributes = {"POSITION": accessor(positions, "VEC3", True)}
            if "holes" in material or isinstance(material.get("emits"), list):
                attributes["TEXCOORD_0"] = accessor(places, "VEC2", False)
            primitives.append({"attributes": attributes, "material": number})
        file = {
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": primitives}],
            "materials": materials,
            "accessors": accessors,
            "bufferViews": views,
            "buffers": [{"byteLength": len(data), "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}],
            "extensionsUsed": sorted({name for material in materials for name in material.get("extensions", ())}),
        }
        if images:
            file["images"] = [{"uri": uri} for uri in images]
            file["samplers"] = [{"magFilter": 9728, "minFilter": 9728, "wrapS": 33071, "wrapT": 33071}]
            file["textures"] = [{"source": number, "sampler": 0} for number in range(len(images))]
        return file


def bsdf(material):
    """What a surface does, for Mitsuba."""
    black = {"type": "diffuse", "reflectance": rgb(0.0)}
    if "emits" in material or "diffuse" in material:
        return black
    if "holes" in material:
        return {"type": "mask", "opacity": texture(material["holes"]), "nested": {"type": "twosided", "nested": black}}
    sides = {"int_ior": material["index"], "ext_ior": material["around"]}
    if material["alpha"] > 0:
        return {"type": "roughdielectric", "distribution": "ggx", "alpha": material["alpha"], **sides}
    return {"type": "dielectric", **sides}


def described(number, material, images):
    """The material for a glTF file. Adds the pictures that the material names to `images`."""
    plain = {"name": f"material {number}", "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0}}
    if "emits" in material:
        emits = material["emits"]
        if isinstance(emits, list):
            images.append(png([[(code, 255) for code in row] for row in emits]))
            return {**plain, "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": len(images) - 1}}
        return {**plain, "emissiveFactor": [emits] * 3}
    if "holes" in material:
        images.append(png([[(0, 255 * there) for there in row] for row in material["holes"]]))
        look = {"baseColorTexture": {"index": len(images) - 1}, "metallicFactor": 0}
        return {**plain, "pbrMetallicRoughness": look, "alphaMode": "MASK", "doubleSided": True}
    if "diffuse" in material:
        plain["pbrMetallicRoughness"]["baseColorFactor"] = [material["diffuse"]] * 3 + [1]
        return plain
    volume = {"thicknessFactor": 1, "attenuationDistance": 1.0}
    volume["attenuationColor"] = [math.exp(-extinction) for extinction in material["extinction"]]
    extensions = {"transmission": {"transmissionFactor": 1}, "ior": {"ior": material["index"]}, "volume": volume}
    if material["dispersion"] > 0:
        extensions["dispersion"] = {"dispersion": material["dispersion"]}
    look = {"metallicFactor": 0, "roughnessFactor": math.sqrt(material["alpha"])}
    extensions = {f"KHR_materials_{name}": value for name, value in extensions.items()}
    return {**plain, "pbrMetallicRoughness": look, "extensions": extensions}


def store(name, about, scene, set, samples, mean, error, camera=CAMERA, sun=None, unseen=None):
    """Writes both files. `set` holds the settings of our ray pass. `unseen` is an error that the standard errors miss."""
    result = {
        "about": about,
        "made_by": f"Mitsuba {mi.__version__}, {mi.variant()}",
        "samples": samples,
        # An event that occurs in no sample may have a share of about 1 / samples.
        "unseen": unseen or 1 / samples,
        "set": set,
        "camera": camera,
        **({"sun": sun} if sun else {}),
        "mean": rounded(mean, 5),
        "error": rounded(error, 2),
    }
    write(FOLDER / f"{name}.gltf", scene.gltf())
    told(name, mean, write(FOLDER / f"{name}.json", result))


def render(name, about, scene, set=(), samples=2048, camera=CAMERA, around=None):
    """Renders the pixels whose centres show glass, and stores them."""
    store(name, about, scene, list(set), samples, *seen(scene, samples, camera, around=around), camera)


def seen(scene, samples, camera, seed=7, around=None):
    """Means and standard errors of the pixels whose centres show glass, and None for other pixels. With `around`, the number of the body
    that contains the camera, all pixels that show a surface are included."""
    loaded = mi.load_dict({"type": "scene", **scene.meshes()})
    absorbs = any(any(material.get("extinction", ())) for material in scene.materials)
    kind = "volpathmis" if absorbs else "path"
    integrator = mi.load_dict({"type": kind, "max_depth": SURFACES, "rr_depth": SURFACES + 1})
    sampler = independent(seed)
    bodies = {f"material{number}" for number, material in enumerate(scene.materials) if "index" in material}
    of_eye = [shape.interior_medium() for shape in loaded.shapes() if shape.id() == f"material{around}"]
    sample = lambda ray: integrator.sample(loaded, sampler, ray, *of_eye)[0]
    return estimated(loaded, camera, lambda hit: around is not None or hit.shape.id() in bodies, sample, samples)


DEEP = "pass2.depth=12"


def slab():
    scene = Bodies()
    scene.box(scene.material(glass(1.5)), np.array([0.9, 0.9, 0.3]))
    scene.room()
    render("body_slab", "A box of clear glass of index 1.5, 0.6 thick, in a room of emitters.", scene, [DEEP])


def ball():
    scene = Bodies()
    scene.sphere(scene.material(glass(1.5)), (0, 0, 0), 0.8, 1, False)
    scene.room()
    render("body_ball", "A body of 80 flat faces and index 1.5 in a room of emitters.", scene, [DEEP])


def dyed():
    scene = Bodies()
    scene.sphere(scene.material(glass(1.5, (0.1, 0.5, 1.0))), (0, 0, 0), 0.8, 1, False)
    scene.room()
    about = "The same with extinctions of 0.1, 0.5 and 1 for red, green and blue."
    render("body_dyed", about, scene, [DEEP], samples=4096)


def filled():
    scene = Bodies()
    scene.sphere(scene.material(glass(1.5)), (0, 0, 0), 0.8, 1, False)
    scene.sphere(scene.material(glass(1.33, (0.2, 0.8, 1.6), around=1.5)), (0.05, -0.1, 0), 0.5, 0, False)
    scene.room()
    about = "A body of index 1.5 with one of index 1.33 and extinctions of 0.2, 0.8 and 1.6 in it."
    render("body_filled", about, scene, [DEEP], samples=4096)


def inside():
    """In Mitsuba, light that enters a body has a radiance greater by the square of the index; our programs leave this factor out."""
    scene, index = Bodies(), 1.5
    body = scene.material(glass(index, (0.1, 0.5, 1.0)))
    scene.sphere(body, (0, 0, 0), 2.0, 1, False)
    scene.box(scene.material(wall(0.9)), np.array([0.3, 0.5, 0.2]))
    for radiance, middle in [(0.6, (-0.8, 0.3, -0.9)), (0.35, (0.7, -0.5, -0.5))]:
        scene.box(scene.material(wall(radiance)), np.array([0.35, 0.45, 0.1]), middle)
    scene.room(factor=1 / index**2)
    camera = {**CAMERA, "eye": [0.2, 0.3, 1.3], "target": [0, 0, -0.4], "fov_y": 62}
    about = "The camera in a body of 80 flat faces, index 1.5 and extinctions of 0.1, 0.5 and 1, with emitters in the body and around it."
    render("body_inside", about, scene, [DEEP], samples=1024, camera=camera, around=body)


def rough():
    scene = Bodies()
    scene.box(scene.material(glass(1.5, alpha=0.1)), np.array([0.9, 0.9, 0.3]))
    scene.room()
    about = "A box of rough glass: GGX of alpha 0.1, index 1.5, single scattering."
    render("body_rough", about, scene, ["pass2.depth=4", "pass2.paths=16"], samples=4096)


def spectral_weights(wavelengths):
    """What each wavelength of white light adds to red, green and blue; each colour's sum is 1."""
    to_srgb = np.array([[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]])
    weights = np.array([mi.cie_d65(nm) * to_srgb @ np.array(mi.cie1931_xyz(nm)) for nm in wavelengths])
    return weights / weights.sum(0)


def prism():
    """One render for each of 128 wavelengths, each with an index of its own; their weighted sum is the picture."""
    dispersion, index, count, samples = 1.0, 1.5, 128, 16
    wavelengths = 380 + 400 * (np.arange(count) + 0.5) / count

    def scene_of(index):
        scene = Bodies()
        scene.sphere(scene.material(glass(index, dispersion=dispersion)), (0, 0, 0), 0.8, 1, False)
        scene.room()
        return scene

    mean = variance = 0
    for number, (nm, weight) in enumerate(zip(wavelengths, spectral_weights(wavelengths))):
        bent = index + (index - 1) * dispersion / 20 * (523655 / nm**2 - 1.5168)
        means, errors = seen(scene_of(float(bent)), samples, CAMERA, seed=number)
        shown = np.array([row is not None for row in means])
        mean = mean + weight * np.array([row for row in means if row is not None])
        variance = variance + (weight * np.array([row for row in errors if row is not None])) ** 2
    rows = lambda values: [values[place] if there else None for there, place in zip(shown, np.cumsum(shown) - 1)]
    # `unseen`: a border between two cells moves by a part of a stratum of wavelengths, which has up to a fortieth of a colour.
    about = "A body of 80 flat faces, index 1.5 and Abbe's number 20, wavelength by wavelength."
    set = ["pass2.depth=5", f"pass2.wavelengths={count}"]
    store("body_prism", about, scene_of(index), set, count * samples, rows(mean), rows(np.sqrt(variance)), unseen=2e-3)


def seen_through():
    scene = Bodies()
    scene.box(scene.material(glass(1.5)), np.array([0.9, 0.9, 0.2]))
    rng = np.random.default_rng(5)
    codes = rng.integers(0, 256, (8, 8)).tolist()
    picture, holes = scene.material(wall(codes)), scene.material(lattice(rng.integers(0, 2, (8, 8)).tolist()))
    scene.quad(picture, (0, 0, -5), (4, 0, 0), (0, 4, 0))
    scene.quad(holes, (-0.3, -0.2, -2), (1.2, 0, 0), (0, 1.2, 0))
    scene.room()
    about = "A wall with a texture and a lattice cut out by another, seen in and through a box of glass; the nearest texel counts."
    render("body_texture", about, scene, [DEEP, "pass2.texturelod=zero"])


def reflected(cosine, index):
    """Fresnel's share from air onto `index`, without polarisation."""
    inside = math.sqrt(1 - (1 - cosine * cosine) / (index * index))
    across = (cosine - index * inside) / (cosine + index * inside)
    along = (index * cosine - inside) / (index * cosine + inside)
    return (across * across + along * along) / 2


def shadow():
    """What a body leaves of light that goes straight on: only the places where a ray meets it are Mitsuba's."""
    scene = Bodies()
    floor, material = scene.material(paint(0.8)), glass(1.5, (0.1, 0.5, 1.0))
    scene.quad(floor, (0, 0, 0), (0, 0, 4), (4, 0, 0))
    scene.sphere(scene.material(material), (0, 0.9, 0), 0.6, 2, False)
    camera = {**CAMERA, "eye": [-2.6, 2.6, -1.8], "target": [-0.5, 0, -0.4], "fov_y": 34}
    sun = np.array([0.5, 1.0, 0.4])
    sun /= np.linalg.norm(sun)
    loaded = mi.load_dict({"type": "scene", **scene.meshes()})
    shares = []
    for ray in rays(camera):
        hit = loaded.ray_intersect(ray)
        if not hit.is_valid() or hit.shape.id() != f"material{floor}":
            shares.append(None)
            continue
        kept, inside, at = 1.0, 0.0, np.array(hit.p)
        while (hit := loaded.ray_intersect(mi.Ray3f(mi.Point3f(*(at + 1e-5 * sun)), mi.Vector3f(*sun)))).is_valid():
            cosine = np.dot(np.array(hit.n), sun)
            kept *= 1 - reflected(abs(cosine), material["index"])
            at, before = np.array(hit.p), at
            inside += np.linalg.norm(at - before) if cosine > 0 else 0
        shares.append([kept * math.exp(-extinction * inside) for extinction in material["extinction"]])
    about = "The share of a directional light that a body of 320 flat faces, index 1.5 and extinctions of 0.1, 0.5 and 1 leaves on a floor."
    errors = [None if share is None else [0.0] * 3 for share in shares]
    store("body_shadow", about, scene, [], 1, shares, errors, camera, sun.tolist())


SCENES = {
    "body_shadow": shadow,
    "body_slab": slab,
    "body_ball": ball,
    "body_dyed": dyed,
    "body_filled": filled,
    "body_inside": inside,
    "body_rough": rough,
    "body_prism": prism,
    "body_texture": seen_through,
}

if __name__ == "__main__":
    run(SCENES)
