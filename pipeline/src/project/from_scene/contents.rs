//! The part of a scene that the camera looks at: the box of all triangles, or of most of them, and the shell around them if there is one.

use super::extent::{Every, Extent, around, parts};
use super::shell::{Shell, outermost};
use crate::scene::Scene;
use glam::DVec3;

/// Bounding boxes of a scene, and the shell around its other parts.
#[derive(Debug)]
pub(super) struct Contents {
    /// The box of all triangles.
    pub whole: Extent,
    /// The box of the part that the camera looks at.
    pub focus: Extent,
    /// The shell around everything else.
    pub shell: Option<Shell>,
    /// Indices of the materials of the skies in the shell.
    pub skies: Vec<u32>,
}

impl Contents {
    /// Examines a scene; `None` if it has no triangle.
    pub fn of(scene: &Scene) -> Option<Self> {
        /// Greatest number of nested shells, such as clouds in a sky dome.
        const MOST: usize = 4;
        let mut rest = parts(scene);
        let whole = around(&rest)?;
        let (mut shell, mut skies, mut left_out): (Option<Shell>, Vec<u32>, Vec<(usize, usize)>) = Default::default();
        for _ in 0..MOST {
            let Some((found, is_member)) = outermost(scene, &rest) else { break };
            let (members, others): (Vec<_>, Vec<_>) = rest.iter().zip(is_member).partition(|(_, member)| *member);
            left_out.extend(members.iter().map(|(part, _)| (part.object, part.group)));
            let is_sky = found.is_sky;
            if is_sky {
                skies.extend(members.iter().map(|(part, _)| part.material));
            }
            rest = others.into_iter().map(|(part, _)| *part).collect();
            shell = Some(match shell {
                Some(outer) => outer.around_another(found),
                None => found,
            });
            if !is_sky {
                break;
            }
        }
        let looked_at = around(&rest).unwrap_or(whole);
        Some(Self { whole, focus: focus(scene, looked_at, &left_out), shell, skies })
    }
}

/// The bounding box of most triangles, if a few far ones (a sky, a plane to the horizon) make the whole box more than three times
/// as large; otherwise the whole box. The walls of a room around finely tessellated objects make it at most three times as large.
/// The triangles of each (object, group) of `left_out` are not examined.
fn focus(scene: &Scene, whole: Extent, left_out: &[(usize, usize)]) -> Extent {
    /// Greatest number of triangles that are examined.
    const MOST: usize = 1 << 16;
    /// Share of the corners of the examined triangles that may lie beyond the box on each side.
    const BEYOND: f64 = 0.03;
    let groups = || {
        scene.objects.iter().enumerate().flat_map(|(index, object)| {
            let mesh = &scene.meshes[object.mesh as usize];
            let groups = mesh.groups.iter().enumerate().filter(move |(group, _)| !left_out.contains(&(index, *group)));
            groups.map(move |(_, group)| (object, mesh, group))
        })
    };
    let step = groups().map(|(_, _, group)| group.triangles.len()).sum::<usize>().div_ceil(MOST).max(1);
    let mut corners: [Vec<f32>; 3] = Default::default();
    let mut every = Every::nth(step);
    for (object, mesh, group) in groups() {
        for triangle in every.of(&group.triangles) {
            let placed = triangle.iter().filter_map(|corner| mesh.positions.get(*corner as usize));
            let placed = placed.map(|position| object.transform.transform_point3(*position));
            for corner in placed.filter(|corner| corner.is_finite()) {
                corners.iter_mut().zip(corner.to_array()).for_each(|(list, value)| list.push(value));
            }
        }
    }
    let mut bounds = [DVec3::ZERO; 2];
    for (axis, mut list) in corners.into_iter().enumerate() {
        if list.is_empty() {
            return whole;
        }
        list.sort_unstable_by(f32::total_cmp);
        let beyond = (list.len() as f64 * BEYOND) as usize;
        bounds[0][axis] = scene.origin[axis] + f64::from(list[beyond]);
        bounds[1][axis] = scene.origin[axis] + f64::from(list[list.len() - 1 - beyond]);
    }
    let [low, high] = bounds;
    let most = Extent { low, high };
    if most.diagonal() > 0.0 && whole.diagonal() > 3.0 * most.diagonal() { most } else { whole }
}
