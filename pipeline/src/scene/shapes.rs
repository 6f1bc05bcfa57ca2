//! The primitives of `<geometry>`: boxes, squares, spheres and grids, tessellated as in the report's engine; exact spheres; and axes.

use super::error::SceneError;
use super::{Group, Material, Mesh, Object, PlacedSphere, Scene};
use glam::{Mat4, Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::path::Path;

/// A primitive placed in a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Name of the object that it becomes.
    pub name: String,
    /// Name of the material. A material of that name in the scene is used; otherwise a light grey one is made.
    pub material: String,
    /// Kind and parameters.
    pub kind: ShapeKind,
    /// Model to scene.
    pub place: Placement,
}

/// Placement of a scene or a primitive: the product of a translation, a rotation and a scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Translation.
    pub translation: Vec3,
    /// Rotation axis, of any length; length 0 means no rotation.
    pub axis: Vec3,
    /// Rotation angle in degrees, counter-clockwise for a viewer towards whom the axis points.
    pub degrees: f32,
    /// Scale factors along the axes.
    pub scale: Vec3,
    /// The factors of the product from the left, as the format names them: one of [`Placement::ORDERS`].
    pub order: &'static str,
}

impl Default for Placement {
    fn default() -> Self {
        let (translation, axis, scale) = (Vec3::ZERO, Vec3::Z, Vec3::ONE);
        Self { translation, axis, degrees: 0.0, scale, order: Self::ORDERS[0] }
    }
}

impl Placement {
    /// The orders of the factors T(ranslation), R(otation), S(caling); the first is the default.
    pub const ORDERS: [&'static str; 6] = ["T_R_S", "T_S_R", "R_T_S", "R_S_T", "S_R_T", "S_T_R"];

    /// The matrix of the product.
    #[must_use]
    pub fn matrix(&self) -> Mat4 {
        let axis = self.axis.as_dvec3().try_normalize().map(|unit| unit.as_vec3());
        let turned = axis.filter(|_| self.degrees != 0.0);
        self.order.split('_').fold(Mat4::IDENTITY, |product, factor| match factor {
            "T" => product * Mat4::from_translation(self.translation),
            "S" => product * Mat4::from_scale(self.scale),
            _ => turned.map_or(product, |axis| product * Mat4::from_axis_angle(axis, self.degrees.to_radians())),
        })
    }
}

/// The kind of a primitive, in model space. Faces are counter-clockwise seen from outside or above.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ShapeKind {
    /// A cube from -1 to 1; each face has four vertices and the whole texture.
    Box,
    /// A square from -1 to 1 on x and z, at y = 0, facing up.
    Square,
    /// A tessellated sphere of radius 1 about the origin, with the poles on the y axis.
    Sphere {
        /// Divisions around the y axis, 3 to [`ShapeKind::MOST`].
        slices: u32,
        /// Divisions from pole to pole, 2 to [`ShapeKind::MOST`].
        stacks: u32,
    },
    /// A sphere of radius 1 about the origin without a mesh: rays and pixels are intersected with the sphere itself.
    ExactSphere,
    /// The coordinate axes from -1 to 1, lines without a mesh: passes that draw triangles draw them for their camera.
    Axis,
    /// A square grid on x and z about the origin, facing up.
    Grid {
        /// Divisions along each side, 1 to [`ShapeKind::MOST`].
        divisions: u32,
        /// Length of a side.
        length: f32,
    },
}

impl ShapeKind {
    /// Greatest number of slices, stacks or divisions.
    pub const MOST: u32 = 4096;

    /// Approximate size of the mesh in bytes; for kinds without a mesh, the size of a [`PlacedSphere`].
    fn bytes(self) -> u64 {
        let Some((columns, rows)) = self.cells() else { return size_of::<PlacedSphere>() as u64 };
        let (columns, rows) = (u64::from(columns), u64::from(rows));
        32 * (columns + 1) * (rows + 1) + 24 * columns * rows
    }

    /// Numbers of columns and rows of its quads; `None` without a mesh.
    fn cells(self) -> Option<(u32, u32)> {
        match self {
            Self::Box => Some((6, 1)),
            Self::Square => Some((1, 1)),
            Self::Sphere { slices, stacks } => Some((slices, stacks)),
            Self::ExactSphere | Self::Axis => None,
            Self::Grid { divisions, .. } => Some((divisions, divisions)),
        }
    }

    /// The mesh; the material of its group is 0. `None` for exact spheres and axes.
    #[must_use]
    pub fn mesh(self) -> Option<Mesh> {
        let mesh = match self {
            Self::ExactSphere | Self::Axis => return None,
            Self::Box => cube(),
            Self::Square => net((1, 1), |u, v| (Vec3::new(2.0 * u - 1.0, 0.0, 2.0 * v - 1.0), Vec3::Y), true),
            Self::Sphere { slices, stacks } => net(
                (slices, stacks),
                |u, v| {
                    let ((sin_a, cos_a), (sin_b, cos_b)) = ((u * TAU).sin_cos(), (v * PI - FRAC_PI_2).sin_cos());
                    let at = Vec3::new(sin_a * cos_b, sin_b, cos_a * cos_b);
                    (at, at)
                },
                false,
            ),
            Self::Grid { divisions, length } => {
                let at = |u, v| (Vec3::new((u - 0.5) * length, 0.0, (0.5 - v) * length), Vec3::Y);
                let mut grid = net((divisions, divisions), at, false);
                // The engine divides columns and rows by one more than the number of divisions, so the last column does not reach 1. Rows
                // count along z.
                let part = divisions as f32 / (divisions as f32 + 1.0);
                grid.texcoords.iter_mut().for_each(|at| *at = Vec2::new(at.x, 1.0 - at.y) * part);
                grid
            }
        };
        Some(mesh)
    }
}

/// A grid of quads over the unit square. `at` returns position and normal at (u, v), which are also the texture coordinates.
/// `turned` reverses the winding, for surfaces where u cross v points inwards.
fn net((columns, rows): (u32, u32), at: impl Fn(f32, f32) -> (Vec3, Vec3), turned: bool) -> Mesh {
    let mut mesh = Mesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let (u, v) = (column as f32 / columns as f32, row as f32 / rows as f32);
            let (position, normal) = at(u, v);
            mesh.positions.push(position);
            mesh.normals.push(normal);
            mesh.texcoords.push(Vec2::new(u, v));
        }
    }
    let mut triangles = Vec::with_capacity(2 * columns as usize * rows as usize);
    for row in 0..rows {
        for column in 0..columns {
            let corner = row * (columns + 1) + column;
            let (right, up) = (corner + 1, corner + columns + 1);
            triangles.extend([[corner, right, up], [right, up + 1, up]]);
        }
    }
    if turned {
        triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    mesh.groups.push(Group { material: 0, triangles });
    mesh
}

/// Six faces that share no vertex.
fn cube() -> Mesh {
    // Normal, and direction of u; the direction of v is their cross product.
    const FACES: [(Vec3, Vec3); 6] = [
        (Vec3::Z, Vec3::X),
        (Vec3::NEG_X, Vec3::Z),
        (Vec3::NEG_Z, Vec3::NEG_X),
        (Vec3::X, Vec3::NEG_Z),
        (Vec3::Y, Vec3::X),
        (Vec3::NEG_Y, Vec3::X),
    ];
    let mut mesh = Mesh::default();
    let mut triangles = Vec::new();
    for (normal, right) in FACES {
        let up = normal.cross(right);
        let first = mesh.positions.len() as u32;
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            mesh.positions.push(normal + right * (2.0 * u - 1.0) + up * (2.0 * v - 1.0));
            mesh.normals.push(normal);
            mesh.texcoords.push(Vec2::new(u, v));
        }
        triangles.extend([[0, 1, 2], [0, 2, 3]].map(|triangle| triangle.map(|corner: u32| first + corner)));
    }
    mesh.groups.push(Group { material: 0, triangles });
    mesh
}

/// Adds primitives to a loaded scene; axes are left out, since they have no mesh. `file` is named in the error.
///
/// # Errors
/// If their meshes take more than `max_bytes`.
pub(crate) fn add(scene: &mut Scene, shapes: &[Shape], file: &Path, max_bytes: u64) -> Result<(), SceneError> {
    let bytes = shapes.iter().fold(0_u64, |sum, shape| sum.saturating_add(shape.kind.bytes()));
    if bytes > max_bytes {
        let what = format!("the primitives need {bytes} bytes, and {max_bytes} are allowed");
        return Err(SceneError::file(file, what).help("`--max-memory` raises the limit"));
    }
    for shape in shapes.iter().filter(|shape| shape.kind != ShapeKind::Axis) {
        let named = scene.materials.iter().position(|material| material.name == shape.material);
        let material = named.unwrap_or_else(|| {
            scene.materials.push(Material { name: shape.material.clone(), ..Material::default() });
            scene.materials.len() - 1
        });
        let Some(mut mesh) = shape.kind.mesh() else {
            let (name, transform) = (shape.name.clone(), shape.place.matrix());
            scene.spheres.push(PlacedSphere { name, material: material as u32, transform });
            continue;
        };
        mesh.name.clone_from(&shape.name);
        mesh.groups.iter_mut().for_each(|group| group.material = material as u32);
        let number = scene.meshes.len() as u32;
        scene.meshes.push(mesh);
        scene.objects.push(Object { name: shape.name.clone(), mesh: number, transform: shape.place.matrix() });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Area and, by the divergence theorem, volume of a shape. Checks that every face points to the side of its normals.
    fn measured(kind: ShapeKind) -> (f64, f64) {
        let mesh = kind.mesh().expect("it has a mesh");
        let (mut area, mut volume) = (0.0, 0.0);
        for triangle in &mesh.groups[0].triangles {
            let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize].as_dvec3());
            let normal = (b - a).cross(c - a);
            if normal.length() > 1e-6 {
                let shading = triangle.iter().fold(Vec3::ZERO, |sum, corner| sum + mesh.normals[*corner as usize]);
                assert!(normal.dot(shading.as_dvec3()) > 0.0, "{kind:?}: {triangle:?} looks the wrong way");
            }
            area += normal.length() / 2.0;
            volume += a.dot(b.cross(c)) / 6.0;
        }
        assert!(mesh.normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-6));
        (area, volume)
    }

    #[test]
    fn primitives_have_the_area_and_volume_of_their_closed_forms() {
        let near = |found: (f64, f64), expected: (f64, f64)| {
            assert!((found.0 - expected.0).abs() < 1e-4 && (found.1 - expected.1).abs() < 1e-4, "{found:?}");
        };
        near(measured(ShapeKind::Box), (24.0, 8.0));
        near(measured(ShapeKind::Square), (4.0, 0.0));
        near(measured(ShapeKind::Grid { divisions: 7, length: 3.0 }), (9.0, 0.0));
        // A band between two latitudes consists of n trapezoids; its volume is the difference of pyramids with n corners.
        let (slices, stacks) = (12_u32, 9_u32);
        let (mut area, mut volume) = (0.0, 0.0);
        let turn = std::f64::consts::PI / f64::from(slices);
        for stack in 0..stacks {
            let angle = |stack: u32| std::f64::consts::PI * (f64::from(stack) / f64::from(stacks) - 0.5);
            let ((low, r), (high, s)) = (angle(stack).sin_cos(), angle(stack + 1).sin_cos());
            let slant = ((high - low).powi(2) + ((r - s) * turn.cos()).powi(2)).sqrt();
            area += f64::from(slices) * (r + s) * turn.sin() * slant;
            let polygon = f64::from(slices) * turn.sin() * turn.cos();
            volume += polygon * (high - low) * (r * r + r * s + s * s) / 3.0;
        }
        near(measured(ShapeKind::Sphere { slices, stacks }), (area, volume));
    }

    #[test]
    fn placements_multiply_in_their_order() {
        let place = Placement {
            translation: Vec3::new(10.0, 0.0, 0.0),
            axis: Vec3::new(0.0, 5.0, 0.0),
            degrees: 90.0,
            scale: Vec3::new(1.0, 2.0, 3.0),
            order: "T_R_S",
        };
        // The image of (1, 1, 1): a quarter turn about y takes z to x, and x to -z.
        for (order, expected) in [
            ("T_R_S", [13.0, 2.0, -1.0]),
            ("T_S_R", [11.0, 2.0, -3.0]),
            ("R_T_S", [3.0, 2.0, -11.0]),
            ("R_S_T", [3.0, 2.0, -11.0]),
            ("S_R_T", [1.0, 2.0, -33.0]),
            ("S_T_R", [11.0, 2.0, -3.0]),
        ] {
            let found = Placement { order, ..place }.matrix().transform_point3(Vec3::ONE);
            assert!(found.distance(Vec3::from(expected)) < 1e-5, "{order}: {found}");
        }
        assert_eq!(Placement::default().matrix(), Mat4::IDENTITY);
        let without_axis = Placement { axis: Vec3::ZERO, degrees: 30.0, ..Placement::default() };
        assert_eq!(without_axis.matrix(), Mat4::IDENTITY);
    }

    #[test]
    fn shapes_share_the_materials_of_their_names_and_keep_the_memory_limit() {
        let shape =
            |name: &str, kind| Shape { name: name.into(), material: "wall".into(), kind, place: Placement::default() };
        let known = Material { name: "wall".into(), shininess: 3.0, ..Material::default() };
        let mut scene = Scene { materials: vec![Material::default(), known], ..Scene::default() };
        let shapes = [shape("a", ShapeKind::Box), shape("b", ShapeKind::Sphere { slices: 3, stacks: 2 })];
        add(&mut scene, &shapes, Path::new("p.xml"), 1 << 20).expect("they fit");
        assert_eq!((scene.materials.len(), scene.meshes.len(), scene.objects[1].mesh), (2, 2, 1));
        assert!(scene.meshes.iter().all(|mesh| mesh.groups[0].material == 1));
        add(&mut scene, &[shape("d", ShapeKind::ExactSphere)], Path::new("p.xml"), 1 << 20).expect("it fits");
        assert_eq!((scene.meshes.len(), scene.objects.len(), scene.spheres[0].material), (2, 2, 1));
        let largest = [shape("c", ShapeKind::Grid { divisions: ShapeKind::MOST, length: 1.0 })];
        let error = add(&mut scene, &largest, Path::new("p.xml"), 1 << 20).expect_err("too large").to_string();
        assert!(error.contains("p.xml") && error.contains("--max-memory"), "{error}");
    }
}
