//! The shipped square has no cracks: no pixel shows the earth below its flat paving.

use curitiba::Choice;
use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::plan::Settings;
use curitiba::pipeline::project::ChannelRef;
use glam::{DVec2, DVec3, Vec3};
use std::path::Path;

/// Height of the earth, in metres.
const EARTH: f64 = -0.03;
/// The paved rectangle in x and z, in metres.
const PAVED: [DVec2; 2] = [DVec2::new(-23.0, -42.0), DVec2::new(67.0, 48.0)];

#[test]
fn no_pixel_sees_through_the_paving() {
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("xml_projects/SceneShadows.xml");
    for name in ["MainCamera", "Vidro"] {
        let settings = Settings { camera: Some(name.to_owned()), size: Some([1024; 2]), ..Settings::default() };
        let mut renderer = curitiba::open(&project, settings, Choice::CPU, &mut Silent).expect("it opens");
        renderer.frame(&mut Silent).expect("it renders");
        let project = renderer.project();
        let eye: DVec3 = project.cameras.iter().find(|camera| camera.name == name).expect("a camera").position;
        let channels = project.targets.iter().enumerate().flat_map(|(target, found)| {
            found.channels.iter().enumerate().map(move |(channel, texture)| (ChannelRef { target, channel }, texture))
        });
        let (positions, _) = channels.into_iter().find(|(_, texture)| texture.name == "pos").expect("positions");
        let mut cracks = Vec::new();
        for (index, &[x, y, z, _]) in renderer.channel(positions).iter().enumerate() {
            let at = Vec3::new(x, y, z).as_dvec3();
            if (at.y - EARTH).abs() > 1e-4 {
                continue;
            }
            // The point where the ray passed through the plane of the paving.
            let passed = eye + (at - eye) * (eye.y / (eye.y - at.y));
            let passed = DVec2::new(passed.x, passed.z);
            if passed.cmpge(PAVED[0]).all() && passed.cmple(PAVED[1]).all() {
                cracks.push((index % 1024, index / 1024, passed));
            }
        }
        assert!(cracks.is_empty(), "{name}: {cracks:?}");
    }
}
