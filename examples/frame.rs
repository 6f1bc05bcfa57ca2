//! Renders a frame, changes a parameter, and renders only the passes that depend on it.
//!
//! ```sh
//! cargo run --release --example frame -- xml_projects/SceneSSAO.xml
//! ```

use curitiba::Choice;
use curitiba::pipeline::executor::Silent;
use curitiba::pipeline::image::write_png;
use curitiba::pipeline::plan::Settings;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let project = std::env::args().nth(1).unwrap_or_else(|| "xml_projects/SceneSSAO.xml".to_owned());
    let settings = Settings { size: Some([512, 512]), ..Settings::default() };
    let mut renderer = curitiba::open(&project, settings, Choice::default(), &mut Silent)?;
    let picture = renderer.frame(&mut Silent)?;
    write_png("frame.png".as_ref(), &picture)?;
    // Only the ray pass and the passes that show its output run again.
    renderer.set_parameter("pass2", "radius", "2")?;
    let wider = renderer.update(&mut Silent)?;
    write_png("wider.png".as_ref(), &wider)?;
    println!("frame.png and wider.png; the second took {}", renderer.passes_run().collect::<Vec<_>>().join(", "));
    for row in &renderer.timeline().rows {
        println!("{:9} {:20} {:8.2} ms", row.kind.name(), row.name, row.median_ms());
    }
    Ok(())
}
