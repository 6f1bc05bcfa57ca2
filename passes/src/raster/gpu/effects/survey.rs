//! Finds the planes of glass that a picture shows, on the device that holds the G-buffer.

use super::inputs::{Inputs, Ready};
use super::question::{Question, Words};
use super::shader::{self, GROUP, SEGMENT};
use super::table::Table;
use super::uniforms::SurveyUniform;
use crate::raster::effects::mirrors::{Seen, Survey};
use crate::raster::effects::planes::{GlassPlane, Glazing};
use crate::raster::gpu::device::Gpu;
use curitiba_pipeline::backend::{BackendError, EffectJob};
use glam::Vec4;

/// Numbers that the shader writes for each plane.
const FIELDS: usize = 5;

const WORDS: Words =
    Words { label: "survey", building: "building the survey of the glass", asking: "looking for the planes of glass" };

/// The question, and its tables and answer.
#[derive(Debug)]
pub struct Surveyor {
    question: Question,
    normals: Table,
    found: Vec<u32>,
}

impl Surveyor {
    pub fn new(gpu: &Gpu, inputs: &Inputs) -> Result<Self, BackendError> {
        let source = shader::survey_source();
        let question = Question::new(gpu, inputs, WORDS, source, size_of::<SurveyUniform>(), 2)?;
        Ok(Self { question, normals: Table::new(gpu)?, found: Vec::new() })
    }

    /// Visits all pixels, and waits for the result. `ranges` is the table of the glazing's runs.
    pub fn look(
        &mut self,
        gpu: &Gpu,
        ready: &Ready<'_>,
        job: &EffectJob<'_>,
        glazing: &Glazing,
        ranges: &wgpu::Buffer,
    ) -> Result<Survey, BackendError> {
        let normals: Vec<Vec4> = glazing.planes.iter().map(GlassPlane::agreement).collect();
        self.normals.write(gpu, bytemuck::cast_slice(&normals))?;
        self.found.clear();
        self.found.resize(FIELDS * (normals.len() + 1), 0);
        let size = [job.width, job.height];
        let params = SurveyUniform { size, id_base: ready.id_base, ranges: glazing.runs.len() as u32 };
        let groups = [job.width.div_ceil(GROUP * SEGMENT), job.height.div_ceil(GROUP)];
        let tables = [ranges, &self.normals.buffer];
        self.question.ask(gpu, ready.group, &tables, bytemuck::bytes_of(&params), groups, &mut self.found)?;
        let (all, planes) = self.found.as_chunks::<FIELDS>().0.split_first().unwrap_or((&[0; FIELDS], &[]));
        let planes = planes.iter().map(|&[pixels, left, top, right, bottom]| match pixels {
            0 => Seen::NONE,
            _ => Seen { pixels, low: [!left, !top], high: [right, bottom] },
        });
        Ok(Survey { planes: planes.collect(), glass: u64::from(all[0]) })
    }
}
