//! The texts of the programs: one file an effect, and what they have in common.

use super::layout;
use curitiba_pipeline::backend::BackendError;
use curitiba_pipeline::programs::{Fidelity, RayProgram};

/// How the products of the triangle test are rounded. Nothing leaks whichever it is; only [`Rounding::Separate`] does not depend on the
/// driver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Rounding {
    /// Each by itself, as on the processor.
    #[default]
    Separate,
    /// As the driver likes: for tests.
    Driver,
    /// One of two is not rounded before the difference, as drivers do that fuse: for tests.
    Fused,
}

macro_rules! text {
    ($stem:literal) => {
        include_str!(concat!("programs/", $stem, ".wgsl"))
    };
}

/// The programs that there are.
const TABLE: &[(RayProgram, &[&str])] = &[
    (RayProgram::Dummy, &[text!("dummy")]),
    (RayProgram::DeferredShadows, &[text!("deferredShadows")]),
    (RayProgram::Reflection, &[text!("optics"), text!("reflection")]),
    (RayProgram::Refraction, &[text!("sampling"), text!("optics"), text!("glass"), text!("refraction")]),
    (RayProgram::Ssao, &[text!("sampling"), text!("occlusion"), text!("ssao")]),
    (RayProgram::Final, &[text!("sampling"), text!("occlusion"), text!("optics"), text!("glass"), text!("final")]),
];

/// What all programs have in common, but for how products are rounded.
const COMMON: [&str; 6] =
    [text!("params"), text!("wide"), text!("scene"), text!("triangle"), text!("traverse"), text!("surface")];

/// The functions that programs are made of, without one.
pub fn functions(rounding: Rounding) -> String {
    let rounding = match rounding {
        Rounding::Separate => text!("rounding_separate"),
        Rounding::Driver => text!("rounding_driver"),
        Rounding::Fused => text!("rounding_fused"),
    };
    let mut source = layout::constants();
    COMMON.into_iter().chain([rounding]).for_each(|text| source.push_str(text));
    source
}

/// A program in one fidelity, whole; `None` if it is written for other backends alone.
pub fn source(program: RayProgram, fidelity: Fidelity, rounding: Rounding) -> Option<String> {
    let (_, texts) = TABLE.iter().find(|(own, _)| *own == program)?;
    let function = match fidelity {
        Fidelity::Corrected => "corrected",
        Fidelity::Thesis => "thesis",
    };
    let mut source = functions(rounding);
    source.push_str(text!("pass"));
    texts.iter().for_each(|text| source.push_str(text));
    source.push_str(&format!("fn picture(pixel: Pixel) -> vec4f {{ return {function}(pixel); }}\n"));
    Some(source)
}

/// Whether there is a program.
pub fn is_written(program: RayProgram) -> bool {
    TABLE.iter().any(|(own, _)| *own == program)
}

/// The error of a program that there is not.
pub fn not_written(backend: &'static str, program: RayProgram) -> BackendError {
    let why = "it is not written for this backend; `--backend cpu` runs it".to_owned();
    BackendError::Unsupported { backend, what: program.info().stem.to_owned(), why }
}
