//! Reading intersection passes: rays in one storage buffer, and their hits in another.

use super::dom::{Element, Value};
use super::loader::Loader;
use super::passes::PassContext;
use super::report::{Span, shown};
use super::running::RUNNING;
use super::{ChannelRef, IntersectionPass, RaysTraced};
use crate::glsl;
use crate::programs::Query;

/// Names in files for the kinds of hit that can be written for each ray.
const QUERIES: [(&str, Query); 2] = [("CLOSEST", Query::Closest), ("ANY", Query::Any)];

impl Loader {
    /// Reads a pass of class `optixPrime` or `embree`.
    pub fn intersection_pass(&mut self, context: &mut PassContext<'_>) -> Option<IntersectionPass> {
        let element = context.element;
        if !glsl::AVAILABLE {
            let message =
                format!("pass `{}` traces the rays of a storage buffer, which own shaders fill", shown(&context.name));
            self.report.error_help(element.span, message, || glsl::MISSING.to_owned());
            context.facts.writes_all();
            return None;
        }
        self.expect_children(element, &[&["scene", "scenes", "rays", "hits", "rayCount"][..], &RUNNING].concat());
        self.no_parameters(context, "optixPrime");
        let scenes = self.scenes_hit(context);
        let rays = self.buffer_of(context, "rays", &["buffer", "queryType"]);
        let hits = self.buffer_of(context, "hits", &["buffer"]);
        context.facts.writes_first(1);
        if let Some((hits, at_hits)) = hits {
            context.facts.set_target(Some(hits), 1, at_hits);
        }
        let asked = self.single(element, &["rays"]).and_then(|rays| self.required(rays, "queryType"));
        let query = asked.map(|asked| QUERIES.iter().find(|(name, _)| asked.text.eq_ignore_ascii_case(name)));
        if let (Some(asked), Some(None)) = (asked, query) {
            let message = format!("queryType `{}` is not known", asked.shown());
            self.report.error_help(asked.span, message, || "valid: CLOSEST, ANY".to_owned());
            return None;
        }
        let query = query.flatten().map_or(Query::Closest, |(_, query)| *query);
        let ((rays, at_rays), (hits, at_hits)) = (rays?, hits?);
        Self::reads(context, Some(ChannelRef { target: rays, channel: 0 }), at_rays);
        let rays_held = self.held(context, rays, IntersectionPass::RAY, at_rays);
        let hits_held = self.held(context, hits, IntersectionPass::HIT, at_hits);
        let (rays_held, hits_held) = (rays_held?, hits_held?);
        let count = self.rays_traced(context, (rays, rays_held, at_rays), (hits, hits_held))?;
        Some(IntersectionPass { scenes: scenes?, rays, hits, count, query })
    }

    /// The scenes, in `<scene name="…"/>` of the pass itself or in its `<scenes>`.
    fn scenes_hit(&mut self, context: &PassContext<'_>) -> Option<Vec<usize>> {
        let own: Vec<&Element> = context.element.children_named(&["scene"]).collect();
        if own.is_empty() {
            return self.pass_scenes(context);
        }
        let listed = match context.element.children_named(&["scenes"]).next() {
            Some(_) => self.pass_scenes(context),
            None => Some(Vec::new()),
        };
        let own: Vec<Option<usize>> = own.into_iter().map(|reference| self.scene_named(reference)).collect();
        let own: Option<Vec<usize>> = own.into_iter().collect();
        Some([listed?, own?].concat())
    }

    /// The buffer that a child of the pass names, and the place in the file that names it.
    fn buffer_of(&mut self, context: &PassContext<'_>, child: &str, attributes: &[&str]) -> Option<(usize, Span)> {
        let Some(found) = self.single(context.element, &[child]) else {
            let message = format!("pass `{}` names no buffer of {child}", shown(&context.name));
            let help = match child {
                "rays" => "valid: <rays buffer=\"Library::name\" queryType=\"CLOSEST\"/>",
                _ => "valid: <hits buffer=\"Library::name\"/>",
            };
            self.report.error_help(context.element.span, message, || help.to_owned());
            return None;
        };
        self.expect(found, &[], attributes);
        let name = self.required(found, "buffer")?;
        Some((self.find_buffer_of(name)?, name.span))
    }

    /// How many records of `size` bytes a buffer holds. Its size must be a multiple of `size`.
    fn held(&mut self, context: &PassContext<'_>, target: usize, size: u64, at: Span) -> Option<u64> {
        let buffer = &self.libraries.targets[target];
        let bytes = buffer.buffer.unwrap_or_default();
        if bytes >= size && bytes.is_multiple_of(size) {
            return Some(bytes / size);
        }
        let what = if size == IntersectionPass::RAY { "rays" } else { "hits" };
        let message = format!(
            "pass `{}`: the buffer `{}` of {bytes} bytes is not full of {what} of {size} bytes",
            shown(&context.name),
            shown(&buffer.name)
        );
        self.report.error_help(at, message, || format!("valid: a multiple of {size} bytes"));
        None
    }

    /// How many rays are traced: the number in `<rayCount>`, or else as many as the buffer of hits has room for.
    fn rays_traced(
        &mut self,
        context: &mut PassContext<'_>,
        (rays, rays_held, at_rays): (usize, u64, Span),
        (hits, hits_held): (usize, u64),
    ) -> Option<RaysTraced> {
        let asked = self.single(context.element, &["rayCount"]);
        if let Some(asked) = asked {
            self.expect(asked, &[], &["value", "buffer", "offset"]);
            let most = rays_held.min(hits_held);
            if let Some(value) = asked.attribute("value") {
                let count = self.whole(value, most, "-1 for all, or a number of rays")?;
                if let Some(count) = count {
                    return Some(RaysTraced::Fixed(count));
                }
            } else {
                return self.counted(context, asked, most);
            }
        }
        if rays_held < hits_held {
            let [rays, hits] = [rays, hits].map(|target| shown(&self.libraries.targets[target].name));
            let message = format!(
                "pass `{}`: the buffer `{rays}` holds {rays_held} rays, and `{hits}` has room for {hits_held} hits",
                shown(&context.name)
            );
            let help =
                || format!("valid: {} bytes of rays, or a <rayCount value=\"…\"/>", hits_held * IntersectionPass::RAY);
            self.report.error_help(at_rays, message, help);
            return None;
        }
        Some(RaysTraced::Fixed(hits_held))
    }

    /// The number of rays as an integer in a buffer: `<rayCount buffer="…" offset="…"/>`.
    fn counted(&mut self, context: &mut PassContext<'_>, asked: &Element, most: u64) -> Option<RaysTraced> {
        let name = self.required(asked, "buffer")?;
        let buffer = self.find_buffer_of(name)?;
        let bytes = self.libraries.targets[buffer].buffer.unwrap_or_default();
        let offset = match asked.attribute("offset") {
            None => 0,
            Some(offset) => {
                let last = bytes.saturating_sub(4);
                let what = "bytes from the start of the buffer, a multiple of 4";
                let found = self.whole(offset, last, what)?;
                match found.filter(|offset| offset.is_multiple_of(4)) {
                    Some(found) => found,
                    None => {
                        let message = format!("no number of rays begins at `{}`", offset.shown());
                        self.report.error_help(offset.span, message, || format!("valid: {what}, up to {last}"));
                        return None;
                    }
                }
            }
        };
        if offset + 4 > bytes {
            let message = format!("the buffer `{}` of {bytes} bytes holds no number of rays", name.shown());
            self.report.error_help(name.span, message, || "valid: a buffer of 4 bytes or more".to_owned());
            return None;
        }
        Self::reads(context, Some(ChannelRef { target: buffer, channel: 0 }), name.span);
        Some(RaysTraced::Counted { buffer, offset, most })
    }

    /// A whole number from 0 to `most`; inner `None` for -1, outer `None` after an error.
    fn whole(&mut self, value: &Value, most: u64, what: &str) -> Option<Option<u64>> {
        let number = self.number(value)?;
        if number == -1.0 {
            return Some(None);
        }
        // `number` is an `f32`. A large integer that it would round is parsed from the text.
        let number =
            value.text.parse::<u64>().ok().or((number.fract() == 0.0 && number >= 0.0).then_some(number as u64));
        if let Some(number) = number.filter(|number| *number <= most) {
            return Some(Some(number));
        }
        let message = format!("`{}` is out of range", value.shown());
        self.report.error_help(value.span, message, || format!("valid: {what}, up to {most}"));
        None
    }
}
