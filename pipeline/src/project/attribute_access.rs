//! The attributes of a project that scripts can read and set.

use super::attributes::{Attributes, GROUPS, Held, MAX_GROUPS};
use super::report::{shown, suggest};
use crate::script::{self, Asked};

/// Highest mip level of an image of the largest size.
const MAX_LEVEL: u32 = 16;

/// Attributes of the engine that scripts can only read. A picture corresponds to the engine's second frame, and no time passes.
const FIXED: [(&str, f64); 2] = [("FRAME_COUNT", 1.0), ("TIMER", 0.0)];

/// The kinds of objects whose attributes scripts read and set.
const KINDS: [&str; 3] = ["PASS", "RENDERER", "IMAGE_TEXTURE"];

/// The place of an attribute that a script names.
enum Place {
    /// Number of workgroups of a compute pass, by its `pipeline#pass`, along axis 0 to 2.
    Groups(String, usize),
    /// A named number of a pass, by its `pipeline#pass`.
    Pass(String),
    /// A value that `<attributes>` declare for shaders.
    Renderer,
    /// The mip level that a material, `Library::material`, binds to an image unit.
    Level(String, u32),
    /// A constant, which cannot be set.
    Fixed(f64),
}

impl Attributes {
    /// Finds the attribute that a script names.
    fn place(&self, asked: &Asked) -> Result<Place, String> {
        let (name, current) = (asked.component.as_str(), asked.context == "CURRENT");
        let missing = |valid: Vec<&str>| {
            let kind = &asked.kind;
            Err(format!("there is no attribute `{}` of {kind}; {}", shown(name), suggest(name, valid)))
        };
        match asked.kind.as_str() {
            "PASS" => {
                let key = if current { &self.current.0 } else { &asked.context };
                if !self.pass_keys.contains(key) {
                    let valid = self.pass_keys.iter().map(String::as_str).chain(["CURRENT"]);
                    return Err(format!("there is no pass `{}`; {}", shown(key), suggest(key, valid)));
                }
                let axis = GROUPS.iter().position(|(group, _)| *group == name);
                if let Some(axis) = axis.filter(|_| self.groups.contains_key(key)) {
                    return Ok(Place::Groups(key.clone(), axis));
                }
                if self.pass_values.contains_key(name) {
                    return Ok(Place::Pass(key.clone()));
                }
                let groups = GROUPS.iter().map(|(group, _)| *group).filter(|_| self.groups.contains_key(key));
                missing(self.pass_values.keys().map(String::as_str).chain(groups).collect())
            }
            "RENDERER" if !current => Err(format!("RENDERER is `{}`; valid: CURRENT", shown(&asked.context))),
            "RENDERER" => match FIXED.iter().find(|(fixed, _)| *fixed == name) {
                Some((_, value)) => Ok(Place::Fixed(*value)),
                None if self.renderer_values.contains_key(name) => Ok(Place::Renderer),
                None => missing(self.renderer_values.keys().map(String::as_str).chain(FIXED.map(|(f, _)| f)).collect()),
            },
            "IMAGE_TEXTURE" if name != "LEVEL" => missing(vec!["LEVEL"]),
            "IMAGE_TEXTURE" => {
                let material = if current { self.current.1.clone().unwrap_or_default() } else { asked.context.clone() };
                let unit = u32::try_from(asked.id).unwrap_or(u32::MAX);
                if self.bound.contains_key(&(material.clone(), unit)) {
                    return Ok(Place::Level(material, unit));
                }
                let mut bound: Vec<String> = self.bound.keys().map(|(of, unit)| format!("{of} with {unit}")).collect();
                bound.sort_unstable();
                let valid = if bound.is_empty() {
                    "no material binds one".to_owned()
                } else {
                    format!("valid: {}", bound.join(", "))
                };
                Err(format!("material `{}` binds no image to unit {}; {valid}", shown(&material), asked.id))
            }
            kind => Err(format!(
                "scripts have no attributes of {}, which are as the project's files say; {}",
                shown(kind),
                suggest(kind, KINDS)
            )),
        }
    }

    fn held(&self, place: &Place, name: &str) -> Held {
        let declared = |of_pass: bool| self.held.get(&(of_pass, name.to_owned())).copied();
        match place {
            Place::Groups(..) | Place::Level(..) => Held { count: 1, whole: true },
            Place::Pass(_) => Held { count: 1, ..declared(true).unwrap_or(Held { count: 1, whole: false }) },
            Place::Renderer => declared(false).unwrap_or(Held { count: 1, whole: false }),
            Place::Fixed(_) => Held { count: 1, whole: false },
        }
    }
}

impl script::Attributes for Attributes {
    fn get(&self, asked: &Asked) -> Result<Vec<f64>, String> {
        let place = self.place(asked)?;
        let Held { count, .. } = self.held(&place, &asked.component);
        Ok(match place {
            Place::Groups(key, axis) => vec![f64::from(self.set_groups.get(&key).unwrap_or(&self.groups[&key])[axis])],
            Place::Pass(key) => vec![f64::from(self.of_pass(&key, &asked.component).unwrap_or_default())],
            Place::Renderer => {
                self.renderer_values[&asked.component].iter().take(count).map(|value| f64::from(*value)).collect()
            }
            Place::Level(material, unit) => vec![f64::from(self.level(&material, unit))],
            Place::Fixed(value) => vec![value],
        })
    }

    fn set(&mut self, asked: &Asked, values: &[f64]) -> Result<(), String> {
        let place = self.place(asked)?;
        let (name, Held { whole, .. }) = (&asked.component, self.held(&place, &asked.component));
        let first = values.first().copied().unwrap_or_default();
        if let Some(value) = values.iter().find(|value| whole && value.fract() != 0.0 || !(**value as f32).is_finite())
        {
            let valid = if whole { "whole numbers" } else { "finite numbers" };
            return Err(format!("`{name}` of {} is set to {value}; valid: {valid}", asked.kind));
        }
        let between = |least: u32, most: u32| match (f64::from(least)..=f64::from(most)).contains(&first) {
            true => Ok(first as u32),
            false => Err(format!("`{name}` of {} is set to {first}; valid: {least} to {most}", asked.kind)),
        };
        let told = match &place {
            Place::Groups(key, axis) => {
                let (count, declared) = (between(1, MAX_GROUPS)?, self.groups[key]);
                self.set_groups.entry(key.clone()).or_insert(declared)[*axis] = count;
                format!("{name} of `{key}` = {first}")
            }
            Place::Pass(key) => {
                self.given_values.insert((key.clone(), name.clone()), first as f32);
                format!("{name} of `{key}` = {first}")
            }
            Place::Renderer => {
                let mut held = self.renderer_values[name];
                held.iter_mut().zip(values).for_each(|(held, value)| *held = *value as f32);
                self.renderer_values.insert(name.clone(), held);
                let values: Vec<String> = values.iter().map(f64::to_string).collect();
                format!("{name} = {}", values.join(" "))
            }
            Place::Level(material, unit) => {
                self.levels.insert((material.clone(), *unit), between(0, MAX_LEVEL)?);
                format!("level of image unit {unit} of `{material}` = {first}")
            }
            Place::Fixed(_) => return Err(format!("`{name}` of {} is read only", asked.kind)),
        };
        self.set.push(told);
        Ok(())
    }
}

impl Attributes {
    /// The mip level of the image that a material binds to an image unit: the one that a script set, or else the one that the material
    /// declares. 0 if the material binds no image to the unit.
    fn level(&self, material: &str, unit: u32) -> u32 {
        let key = (material.to_owned(), unit);
        self.levels.get(&key).or_else(|| self.bound.get(&key)).copied().unwrap_or_default()
    }
}
