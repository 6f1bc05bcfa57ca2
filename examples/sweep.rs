//! How the error of ambient occlusion falls with more samples, against a reference whose own error is printed.
//!
//! ```sh
//! cargo run --release --example sweep -- xml_projects/SceneSSAO.xml
//! ```

use curitiba::Choice;
use curitiba::pipeline::executor::{Goal, Silent};
use curitiba::pipeline::metrics::{Options, compare};
use curitiba::pipeline::plan::Settings;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let project = std::env::args().nth(1).unwrap_or_else(|| "xml_projects/SceneSSAO.xml".to_owned());
    let settings = Settings { size: Some([256, 256]), ..Settings::default() };
    let mut renderer = curitiba::open(&project, settings, Choice::default(), &mut Silent)?;
    let accumulation = renderer.accumulate(Goal::Samples(4096), &mut Silent)?;
    let reference = renderer.window_image();
    println!("reference: {} samples, standard error {:.6}", accumulation.samples(), accumulation.error());
    for samples in [1, 2, 4, 8, 16, 32, 64, 128, 256] {
        renderer.set_parameter("pass2", "samples", &samples.to_string())?;
        let picture = renderer.update(&mut Silent)?;
        println!("{samples:4} samples  RMSE {:.6}", compare(&picture, &reference, &Options::default())?.rmse);
    }
    Ok(())
}
