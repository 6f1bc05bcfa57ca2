//! `render --pixel` and `render --check-numerics`: inspection of what passes write.

use super::Failure;
use super::display::Display;
use super::progress::Bars;
use curitiba::passes::explain;
use curitiba::pipeline::backend::RayJob;
use curitiba::pipeline::executor::{Fallback, Faults, Observer, Output, Progress, StepKind, Triangles};
use curitiba::pipeline::image::Image;
use glam::DVec3;
use std::sync::Arc;

/// An observer that shows progress and inspects outputs of passes.
pub struct Inspector {
    bars: Bars,
    pixel: Option<[u32; 2]>,
    check: bool,
    lines: Vec<String>,
    /// Why the pixel could not be explained.
    failed: Option<String>,
    checked: Vec<Checked>,
    display: Option<Display>,
}

/// Counts of invalid values in one component of an output, over all frames.
struct Checked {
    /// Name, such as ``pass `pass2`, library::texture.red``.
    name: String,
    width: u32,
    faults: Faults,
}

impl Inspector {
    /// `pixel` is explained in the first frame; with `check` values are checked in every frame.
    pub fn new(bars: Bars, pixel: Option<[u32; 2]>, check: bool) -> Self {
        Self { bars, pixel, check, lines: Vec::new(), failed: None, checked: Vec::new(), display: None }
    }

    /// Sends pictures to a viewer.
    pub fn show_on(&mut self, display: Display) {
        self.display = Some(display);
    }

    /// Checks before the work whether the pixel lies in the picture.
    pub fn check_pixel(&self, [width, height]: [u32; 2]) -> Result<(), Failure> {
        match self.pixel {
            Some([x, y]) if x >= width || y >= height => Err(Failure::Usage(format!(
                "pixel {x},{y} is outside the window of {width} x {height}; columns and rows count from 0,0 at the top left"
            ))),
            _ => Ok(()),
        }
    }

    /// Prints the explanation of the pixel; later frames add nothing.
    pub fn print_pixel(&mut self) -> Result<(), Failure> {
        self.bars.end();
        for line in self.lines.drain(..) {
            crate::say!("{line}");
        }
        self.pixel = None;
        self.failed.take().map_or(Ok(()), |message| Err(Failure::Work(message)))
    }

    /// Fails if an invalid value was found; the message says where. Otherwise prints how many channels were checked, unless `quiet`.
    pub fn verdict(&self, quiet: bool) -> Result<(), Failure> {
        if !self.check {
            return Ok(());
        }
        let wrong: Vec<&Checked> = self.checked.iter().filter(|checked| checked.faults.total() > 0).collect();
        if wrong.is_empty() {
            if !quiet {
                let count = self.checked.len();
                crate::say!("numerics: {count} channels checked, every value is finite and in its range");
            }
            return Ok(());
        }
        let mut message = format!("{} of {} channels hold wrong values", wrong.len(), self.checked.len());
        let mut example = None;
        for Checked { name, width, faults } in wrong {
            let kinds = [
                (faults.nan, "NaN"),
                (faults.infinite, "infinite"),
                (faults.negative, "negative"),
                (faults.out_of_range, "out of range"),
            ];
            let counts: Vec<String> =
                kinds.iter().filter(|(count, _)| *count > 0).map(|(count, kind)| format!("{count} {kind}")).collect();
            let first = faults.first.unwrap_or_default();
            let (x, y) = (first % (*width).max(1) as usize, first / (*width).max(1) as usize);
            message += &format!("\n       {name}: {}; first at {x},{y}", counts.join(", "));
            example.get_or_insert((x, y));
        }
        if let Some((x, y)) = example {
            message += &format!("\n       --pixel {x},{y} prints how such a value comes about");
        }
        Err(Failure::Work(message))
    }

    fn note(&mut self, name: String, width: u32, faults: Faults) {
        match self.checked.iter_mut().find(|checked| checked.name == name) {
            Some(checked) => checked.faults = checked.faults.and(faults),
            None => self.checked.push(Checked { name, width, faults }),
        }
    }
}

impl Observer for Inspector {
    fn begin(&mut self, kind: StepKind, name: &str, progress: &Arc<Progress>) {
        self.bars.begin(kind, name, progress);
    }

    fn end(&mut self) {
        self.bars.end();
    }

    fn fell_back(&mut self, fallback: &Fallback) {
        self.bars.fell_back(fallback);
    }

    fn wants_picture(&mut self) -> bool {
        self.display.as_mut().is_some_and(Display::is_due)
    }

    fn wrote(&mut self, output: &Output<'_>) {
        if let Some(display) = &mut self.display {
            display.send(output);
        }
        if let Some([x, y]) = self.pixel {
            let value = if x < output.width && y < output.height {
                let [r, g, b, a] = output.pixels[y as usize * output.width as usize + x as usize];
                format!("({r}, {g}, {b}, {a})")
            } else {
                format!("is outside its {} x {} pixels", output.width, output.height)
            };
            self.lines.push(format!("pass `{}` pixel {x},{y} of {} {value}", output.pass, output.channel));
        }
        if self.check {
            for (component, faults) in output.components().into_iter().zip(output.faults()) {
                let name = format!("pass `{}`, {}.{component}", output.pass, output.channel);
                self.note(name, output.width, faults);
            }
        }
    }

    fn wrote_triangles(&mut self, triangles: &Triangles<'_>) {
        if self.check {
            let name = format!("pass `{}`, triangle ids", triangles.pass);
            self.note(name, triangles.width, triangles.faults());
        }
    }

    fn traced(&mut self, pass: &str, job: &RayJob<'_>, picture: &Image) {
        let Some([x, y]) = self.pixel else { return };
        let (stem, fidelity) = (job.program.info().stem, format!("{:?}", job.fidelity).to_lowercase());
        let title = format!("pass `{pass}` {stem}, {fidelity}, pixel {x},{y}");
        if x >= job.width || y >= job.height {
            self.lines.push(format!("{title}: outside its {} x {} pixels", job.width, job.height));
            return;
        }
        match explain::pixel(job, x, y) {
            Ok(rays) => {
                self.lines.push(title);
                if job.scene.origin != DVec3::ZERO {
                    let DVec3 { x, y, z } = job.scene.origin;
                    self.lines.push(format!("  all positions are relative to {x} {y} {z}"));
                }
                self.lines.push(rays.to_string().trim_end().to_owned());
                let drawn = picture.pixels[y as usize * job.width as usize + x as usize];
                if drawn.map(f32::to_bits) != rays.value.map(f32::to_bits) {
                    self.lines.push(format!("  the pass itself wrote {drawn:?}: another ray backend, or a fault"));
                }
            }
            Err(error) => self.failed = Some(format!("{title}: {error}")),
        }
    }
}
