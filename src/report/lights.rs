//! Projects with other numbers of lights.

use crate::pipeline::project::{Light, Pass, PassKind, Project};
use glam::Quat;

/// Angle about the vertical from one copy of a light to the next, as a share of a full turn. It is the golden angle, which spreads any number of
/// copies evenly.
const TURN: f32 = 0.381_966;

/// Gives each pass that has lights `count` lights: first the pass's own lights, then copies of them that are rotated about the vertical. A copy of
/// a light with a position keeps the position. Passes with the same lights get the same copies.
///
/// # Errors
/// If no pass has a light.
pub(super) fn shine(project: &mut Project, count: usize) -> Result<(), String> {
    // Index of a light, number of its copy from 1 on, and index of the copy in `lights`.
    let mut copies: Vec<(usize, usize, usize)> = Vec::new();
    let Project { pipelines, lights, .. } = project;
    let mut any = false;
    for pass in pipelines.iter_mut().flat_map(|pipeline| &mut pipeline.passes) {
        let Some(own) = of_pass(pass).filter(|own| !own.is_empty()) else { continue };
        any = true;
        let wanted = (0..count).map(|index| (own[index % own.len()], index / own.len()));
        let shining = wanted.map(|(light, number)| {
            let known = copies.iter().find(|(of, copy, _)| (*of, *copy) == (light, number)).map(|(_, _, index)| *index);
            match known {
                _ if number == 0 => light,
                Some(index) => index,
                None => {
                    let copy = turned(&lights[light], number, lights);
                    copies.push((light, number, lights.len()));
                    lights.push(copy);
                    lights.len() - 1
                }
            }
        });
        let shining: Vec<usize> = shining.collect();
        *own = shining;
    }
    if any { Ok(()) } else { Err("no pass has a light, so there are none to copy; name one in <lights>".to_owned()) }
}

fn of_pass(pass: &mut Pass) -> Option<&mut Vec<usize>> {
    match &mut pass.kind {
        PassKind::Raster(raster) => Some(&mut raster.lights),
        PassKind::Ray(ray) => Some(&mut ray.lights),
        PassKind::Effect(effect) => Some(&mut effect.lights),
        PassKind::Quad(_) | PassKind::Intersection(_) | PassKind::Compute(_) => None,
    }
}

/// A copy of a light, with a name that no other light has.
fn turned(light: &Light, number: usize, others: &[Light]) -> Light {
    let turn = Quat::from_rotation_y(std::f32::consts::TAU * TURN * number as f32);
    let mut copy = light.clone();
    copy.direction = light.direction.map(|direction| (turn * direction).normalize());
    if let Some(spot) = &mut copy.falloff.spot {
        spot.axis = (turn * spot.axis).normalize();
    }
    copy.name = format!("{} {}", light.name, number + 1);
    while others.iter().any(|other| other.name.eq_ignore_ascii_case(&copy.name)) {
        copy.name.push('\'');
    }
    copy
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::project;
    use std::path::Path;

    fn shipped(file: &str) -> Project {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects").join(file);
        project::load(&path).expect("a valid project")
    }

    fn shining(project: &Project) -> Vec<&[usize]> {
        project.pipelines[0].passes.iter().map(|pass| pass.kind.lights()).filter(|lights| !lights.is_empty()).collect()
    }

    #[test]
    fn passes_get_the_same_lights_all_with_directions_and_names_of_their_own() {
        let mut project = shipped("SceneShadows.xml");
        shine(&mut project, 4).expect("it has a light");
        assert_eq!(shining(&project), [[0, 1, 2, 3]; 2]);
        for (index, light) in project.lights.iter().enumerate() {
            let direction = light.direction.expect("a directional light");
            let first = project.lights[0].direction.expect("a directional light");
            assert!((direction.length() - 1.0).abs() < 1e-6 && (direction.y - first.y).abs() < 1e-6);
            for other in &project.lights[..index] {
                assert!(other.direction.expect("a direction").distance(direction) > 0.5 && other.name != light.name);
            }
        }
        // With a single light, only the project's own light is left.
        shine(&mut project, 1).expect("it has lights");
        assert_eq!(shining(&project), [[0]; 2]);
        assert_eq!(project.lights[0].direction, shipped("SceneShadows.xml").lights[0].direction);
    }

    #[test]
    fn several_lights_are_copied_in_turn_and_lamps_stay_where_they_stand() {
        let mut project = shipped("SceneShadows.xml");
        shine(&mut project, 2).expect("it has a light");
        project.lights[1].direction = None;
        shine(&mut project, 5).expect("it has lights");
        assert_eq!(shining(&project), [[0, 1, 2, 3, 4]; 2]);
        let names: Vec<&str> = project.lights.iter().map(|light| light.name.as_str()).collect();
        assert_eq!(names, ["Sun", "Sun 2", "Sun 2'", "Sun 2 2", "Sun 3"]);
        assert_eq!(project.lights[3].position, project.lights[1].position);
    }

    #[test]
    fn a_project_without_lights_is_refused() {
        let mut project = shipped("SceneShadows.xml");
        for pass in &mut project.pipelines[0].passes {
            of_pass(pass).into_iter().for_each(Vec::clear);
        }
        assert!(shine(&mut project, 2).expect_err("no light").contains("name one in <lights>"));
    }
}
