//! Straight lines as triangles: each line is a pixel wide in the picture of one camera, as in OpenGL.

use super::{Group, Material, Mesh, Object, Scene};
use glam::{DVec2, DVec3, Mat4, Vec3, Vec4};

/// A straight line in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Line {
    /// Its ends.
    pub ends: [DVec3; 2],
    /// Its colour.
    pub color: LineColor,
}

/// The colours of the engine's lines. A camera's near rectangle is red and its other lines are green. Coordinate axes are red (x), green
/// (y) and blue (z).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LineColor {
    Red,
    Green,
    Blue,
}

impl LineColor {
    const ALL: [Self; 3] = [Self::Red, Self::Green, Self::Blue];

    /// Name of its material, as in the engine; projects map materials by it.
    fn material(self) -> &'static str {
        match self {
            Self::Red => "__Emission Red",
            Self::Green => "__Emission Green",
            Self::Blue => "__Emission Blue",
        }
    }

    fn rgb(self) -> Vec3 {
        match self {
            Self::Red => Vec3::X,
            Self::Green => Vec3::Y,
            Self::Blue => Vec3::Z,
        }
    }
}

/// The camera in whose picture lines are a pixel wide.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LineViewer {
    /// Its position in world space.
    pub position: DVec3,
    /// Its unit axes: right, up, and the viewing direction.
    pub axes: [DVec3; 3],
    /// Width and height in world units of a pixel in the middle of the picture: at a distance of 1 with perspective, at any distance
    /// without.
    pub pixel: DVec2,
    /// Distance of the near plane with perspective; `None` without perspective.
    pub near: Option<f64>,
}

impl LineViewer {
    /// The corners of a line's ribbon, two at each end. `None` if the line is wholly behind the near plane, or is seen end on.
    ///
    /// The corners are offset by half a pixel to either side, along the axis of the picture along which the line is shorter. All points of
    /// the ribbon have the depth of the line.
    fn ribbon(&self, line: &Line) -> Option<[[DVec3; 2]; 2]> {
        let mut ends = line.ends.map(|end| DVec3::from_array(self.axes.map(|axis| axis.dot(end - self.position))));
        if let Some(near) = self.near {
            let [a, b] = ends;
            let cut = |behind: DVec3, before: DVec3| behind.lerp(before, (near - behind.z) / (before.z - behind.z));
            ends = match (a.z < near, b.z < near) {
                (true, true) => return None,
                (true, false) => [cut(a, b), b],
                (false, true) => [a, cut(b, a)],
                (false, false) => ends,
            };
        }
        // Size of a pixel at each end.
        let pixels = ends.map(|end| if self.near.is_some() { self.pixel * end.z } else { self.pixel });
        let [from, to] = [0, 1].map(|end| ends[end].truncate() / pixels[end]);
        let along = (to - from).abs();
        if along.max_element() < 1e-6 {
            return None;
        }
        let aside = if along.x >= along.y { DVec2::Y } else { DVec2::X };
        Some([0, 1].map(|end| {
            [-0.5, 0.5].map(|half| {
                let at = ends[end] + (aside * pixels[end] * half).extend(0.0);
                self.axes[0] * at.x + self.axes[1] * at.y + self.axes[2] * at.z
            })
        }))
    }
}

/// The lines as a scene: ribbons that face the viewer. Their materials are a [sky](Material::sky), so they have their own colours whatever
/// the light, and they write no positions or ids that rays would start from. `None` if no line is in front of the viewer.
pub(crate) fn scene(lines: &[Line], viewer: &LineViewer) -> Option<Scene> {
    // Positions are relative to the viewer.
    let mut mesh = Mesh { name: "lines".to_owned(), ..Mesh::default() };
    let mut materials = Vec::new();
    for color in LineColor::ALL {
        let of_color = lines.iter().filter(|line| line.color == color);
        let mut triangles = Vec::new();
        for [[a, b], [c, d]] in of_color.filter_map(|line| viewer.ribbon(line)) {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([a, b, c, d].map(DVec3::as_vec3));
            triangles.extend([[first, first + 1, first + 2], [first + 1, first + 3, first + 2]]);
        }
        if !triangles.is_empty() {
            mesh.groups.push(Group { material: materials.len() as u32, triangles });
            materials.push(Material {
                name: color.material().to_owned(),
                diffuse: Vec4::W,
                ambient: Vec4::W,
                emission: color.rgb().extend(1.0),
                emission_added: true,
                sky: true,
                ..Material::default()
            });
        }
    }
    if materials.is_empty() {
        return None;
    }
    mesh.normals = vec![-viewer.axes[2].as_vec3(); mesh.positions.len()];
    let object = Object { name: mesh.name.clone(), mesh: 0, transform: Mat4::IDENTITY };
    let (meshes, objects) = (vec![mesh], vec![object]);
    Some(Scene { meshes, objects, materials, origin: viewer.position, ..Scene::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn viewer(near: Option<f64>) -> LineViewer {
        LineViewer {
            position: DVec3::new(1.0, 2.0, 3.0),
            axes: [DVec3::X, DVec3::Y, DVec3::NEG_Z],
            pixel: DVec2::new(0.01, 0.02),
            near,
        }
    }

    fn line(ends: [[f64; 3]; 2]) -> Line {
        Line { ends: ends.map(|end| DVec3::from_array(end) + DVec3::new(1.0, 2.0, 3.0)), color: LineColor::Red }
    }

    fn near(found: [[DVec3; 2]; 2], expected: [[[f64; 3]; 2]; 2]) {
        for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
            assert!(found.distance(DVec3::from_array(*expected)) < 1e-12, "{found} beside {expected:?}");
        }
    }

    /// A pixel at the distance 4 is four times as wide as at 1.
    #[test]
    fn a_ribbon_is_a_pixel_wide_at_each_end_across_the_axis_along_which_it_goes() {
        let level = viewer(Some(0.1)).ribbon(&line([[0.0, 0.0, -1.0], [2.0, 0.0, -4.0]])).expect("it is seen");
        near(level, [[[0.0, -0.01, -1.0], [0.0, 0.01, -1.0]], [[2.0, -0.04, -4.0], [2.0, 0.04, -4.0]]]);
        let upright = viewer(Some(0.1)).ribbon(&line([[0.0, 0.0, -1.0], [0.0, 2.0, -4.0]])).expect("it is seen");
        near(upright, [[[-0.005, 0.0, -1.0], [0.005, 0.0, -1.0]], [[-0.02, 2.0, -4.0], [0.02, 2.0, -4.0]]]);
        let flat = viewer(None).ribbon(&line([[0.0, 0.0, 1.0], [0.0, 2.0, -4.0]])).expect("it is seen");
        near(flat, [[[-0.005, 0.0, 1.0], [0.005, 0.0, 1.0]], [[-0.005, 2.0, -4.0], [0.005, 2.0, -4.0]]]);
    }

    #[test]
    fn what_is_behind_the_near_plane_is_cut_off() {
        let cut = viewer(Some(1.0)).ribbon(&line([[0.0, 0.0, 1.0], [4.0, 0.0, -3.0]])).expect("a part is seen");
        near(cut, [[[2.0, -0.01, -1.0], [2.0, 0.01, -1.0]], [[4.0, -0.03, -3.0], [4.0, 0.03, -3.0]]]);
        assert_eq!(viewer(Some(1.0)).ribbon(&line([[0.0, 0.0, 1.0], [4.0, 0.0, -0.9]])), None);
        assert_eq!(viewer(Some(1.0)).ribbon(&line([[1.0, 1.0, -2.0], [2.0, 2.0, -4.0]])), None, "seen from its end");
    }

    #[test]
    fn lines_of_a_colour_share_a_material_that_light_passes() {
        let green = Line { color: LineColor::Green, ..line([[0.0, 1.0, -1.0], [1.0, 1.0, -1.0]]) };
        let lines = [line([[0.0, 0.0, -1.0], [1.0, 0.0, -1.0]]), green, line([[0.0, 2.0, -1.0], [1.0, 2.0, -1.0]])];
        let scene = scene(&lines, &viewer(Some(0.5))).expect("they are seen");
        let names: Vec<&str> = scene.materials.iter().map(|material| material.name.as_str()).collect();
        assert_eq!(names, ["__Emission Red", "__Emission Green"]);
        assert!(scene.materials.iter().all(|material| material.sky && material.emission_added));
        let triangles: Vec<usize> = scene.meshes[0].groups.iter().map(|group| group.triangles.len()).collect();
        assert_eq!((triangles, scene.meshes[0].positions.len()), (vec![4, 2], 12));
        assert_eq!(scene.origin, DVec3::new(1.0, 2.0, 3.0));
        assert!(super::scene(&lines, &viewer(Some(2.0))).is_none());
    }
}
