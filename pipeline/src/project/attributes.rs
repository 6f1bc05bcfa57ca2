//! Named numbers of a project: those that `<attributes>` declare for passes and for shaders, and those that passes
//! declare for themselves. Scripts may set these numbers, and also numbers of workgroups and mip levels of images.

use super::dom::Element;
use std::collections::HashMap;

/// Greatest number of workgroups in one direction: the limit that every device supports.
pub(super) const MAX_GROUPS: u32 = 65_535;

/// Names of the three numbers of workgroups of a compute pass, in scripts and in XML.
pub(super) const GROUPS: [(&str, &str); 3] = [("DIM_X", "dimX"), ("DIM_Y", "dimY"), ("DIM_Z", "dimZ")];

/// Type of an attribute's value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Held {
    /// Number of components.
    pub count: usize,
    /// Whether the components are integers.
    pub whole: bool,
}

/// The numbers of a project. What a script sets applies to the passes that follow in its pipeline.
#[derive(Debug, Clone, Default)]
pub(super) struct Attributes {
    /// Named numbers of passes, declared by the project; a pass may override them.
    pub pass_values: HashMap<String, f32>,
    /// Values that `<attributes>` declare for shaders.
    pub renderer_values: HashMap<String, [f32; 4]>,
    /// Numbers that passes declare for themselves, or that scripts set, by `pipeline#pass` and name.
    pub given_values: HashMap<(String, String), f32>,
    /// `pipeline#pass` of each pass.
    pub pass_keys: Vec<String>,
    /// Types of declared attributes. The key is whether the attribute is declared for passes, and its name.
    pub held: HashMap<(bool, String), Held>,
    /// Numbers of workgroups of compute passes, by `pipeline#pass`, as their elements say.
    pub groups: HashMap<String, [u32; 3]>,
    /// Numbers of workgroups of compute passes, by `pipeline#pass`, where scripts set them.
    pub set_groups: HashMap<String, [u32; 3]>,
    /// Mip levels of images, by `Library::material` and unit, where a script set them.
    pub levels: HashMap<(String, u32), u32>,
    /// Descriptions of what scripts set since the last run of a pass, for `plan`.
    pub set: Vec<String>,
    /// `pipeline#pass` of the pass whose script runs, and `Library::material` of the material that the pass names.
    #[cfg(feature = "glsl")]
    pub current: (String, Option<String>),
    /// Levels that materials bind to image units, by `Library::material` and unit.
    #[cfg(feature = "glsl")]
    pub bound: HashMap<(String, u32), u32>,
}

impl Attributes {
    /// Records the type of an `<attribute>`.
    pub fn declare(&mut self, item: &Element, name: &str, of_pass: bool) {
        let data = item.attribute("data").map_or("", |data| &data.text).to_ascii_uppercase();
        let count = data.strip_prefix(['I', 'U', 'B', 'D']).unwrap_or(&data).strip_prefix("VEC");
        let count = count.and_then(|count| count.parse().ok()).filter(|count| (2..=4).contains(count)).unwrap_or(1);
        let whole = ["I", "U", "B", "E"].iter().any(|kind| data.starts_with(kind));
        self.held.insert((of_pass, name.to_owned()), Held { count, whole });
    }

    /// The number that the project declares for passes by this name, with the name as it is declared. If no name has these letters in
    /// this case, the first in byte order of those that differ in case alone.
    pub fn declared(&self, name: &str) -> Option<(&str, f32)> {
        let alike = || self.pass_values.iter().filter(|(known, _)| known.eq_ignore_ascii_case(name));
        let found = self.pass_values.get_key_value(name).or_else(|| alike().min_by(|a, b| a.0.cmp(b.0)));
        found.map(|(known, value)| (known.as_str(), *value))
    }

    /// A number of a pass by its name: declared by the pass or set by a script, or else declared by the project.
    pub fn of_pass(&self, pass: &str, name: &str) -> Option<f32> {
        let own = self.given_values.get(&(pass.to_owned(), name.to_owned()));
        own.or_else(|| self.pass_values.get(name)).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_differ_in_case_alone_are_told_apart_and_chosen_in_a_fixed_order() {
        let mut attributes = Attributes::default();
        let names = ["ao_rays", "Ao_Rays", "AO_RAYS", "ao_Rays", "other"];
        attributes.pass_values.extend((0_u8..).zip(names).map(|(number, name)| (name.to_owned(), f32::from(number))));
        for (name, found) in [("ao_rays", 0.0), ("AO_RAYS", 2.0), ("ao_Rays", 3.0), ("AO_rays", 2.0), ("OTHER", 4.0)] {
            assert_eq!(attributes.declared(name).map(|(_, value)| value), Some(found), "{name}");
        }
        assert_eq!(attributes.declared("Other"), Some(("other", 4.0)));
        assert_eq!(attributes.declared("rays"), None);
    }
}
