//! Scripts of passes: which attributes they read and set, and where their faults are.

use super::attributes::{Attributes, GROUPS, Held, MAX_GROUPS};
use super::dom::Element;
use super::loader::Loader;
use super::report::{Span, shown, suggest};
use super::running::script;
use crate::diagnostic::Source;
use crate::script::{self, Asked, Fault, MAX_FILE, Scripts};
use std::cell::RefCell;
use std::collections::HashMap;
use std::path::PathBuf;
use std::rc::Rc;

/// Highest mip level of an image of the largest size.
const MAX_LEVEL: u32 = 16;

/// Attributes of the engine that scripts can only read: a picture is that of the second frame, and no time passes.
const FIXED: [(&str, f64); 2] = [("FRAME_COUNT", 1.0), ("TIMER", 0.0)];

/// The kinds of things whose attributes scripts read and set.
const KINDS: [&str; 3] = ["PASS", "RENDERER", "IMAGE_TEXTURE"];

/// The scripts of a pipeline, and the files that were read.
pub(super) struct Loaded {
    scripts: Scripts,
    /// The loader's own, while a script runs.
    attributes: Rc<RefCell<Attributes>>,
    /// Places of the files in the report; `None` of one that failed.
    files: HashMap<PathBuf, Option<u32>>,
}

/// What an attribute is.
enum Place {
    /// Work groups of a pass in a direction.
    Groups(String, usize),
    /// A number of a pass.
    Pass(String),
    /// Numbers of the project.
    Renderer,
    /// The level of an image of a material.
    Level(String, u32),
    /// One that cannot be set.
    Fixed(f64),
}

impl Attributes {
    /// What a script asks for.
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
    /// The level that is bound to an image unit of a material.
    fn level(&self, material: &str, unit: u32) -> u32 {
        let key = (material.to_owned(), unit);
        self.levels.get(&key).or_else(|| self.bound.get(&key)).copied().unwrap_or_default()
    }
}

impl Loader {
    /// Runs the scripts before (`preScript`) or after (`postScript`) a pass. One that fails sets nothing, with a warning.
    pub fn runs_scripts(&mut self, pass: &Element, when: &'static str) {
        for element in pass.children_named(&[when]) {
            let before = self.attributes.clone();
            let Some(name) = self.script_of(pass, element) else { continue };
            let called = self.with_scripts(|scripts| scripts.call(&name));
            self.warn_of_left_out(element);
            if let Err(fault) = called {
                self.attributes = before;
                let at = self.line_of(&fault, element.span);
                let message = format!("{} stops, and sets nothing: {}", script(element), fault.message);
                let help = "what it would change is as the project's files and the scripts before it say";
                self.report.warning(at, message, || Some(help.to_owned()));
            }
        }
    }

    /// The answer of the script that says whether a pass runs; `None` after an error.
    pub(super) fn asks_script(&mut self, pass: &Element, test: &Element) -> Option<bool> {
        let name = self.script_of(pass, test)?;
        let answer = self.with_scripts(|scripts| scripts.test(&name));
        self.warn_of_left_out(test);
        answer
            .map_err(|fault| {
                let at = self.line_of(&fault, test.span);
                self.report.error(at, format!("{} fails: {}", script(test), fault.message));
            })
            .ok()
    }

    /// Reads the file of a script, unless it was, and says what the script is called. `None` after an error.
    fn script_of(&mut self, pass: &Element, element: &Element) -> Option<String> {
        let (file, name) = (self.required(element, "file"), self.required(element, "script"));
        let (file, name) = (file?, name?.text.clone());
        self.attributes.current = (
            format!("{}#{}", self.pipeline_name, pass.attribute("name").map_or("", |name| &name.text)),
            pass.children_named(&["material"]).next().and_then(|material| {
                Some(format!("{}::{}", material.attribute("fromLibrary")?.text, material.attribute("name")?.text))
            }),
        );
        if self.running.scripts.is_none() {
            let attributes = Rc::default();
            match Scripts::new(&attributes) {
                Ok(scripts) => self.running.scripts = Some(Loaded { scripts, attributes, files: HashMap::new() }),
                Err(fault) => {
                    self.report.error(element.span, format!("scripts cannot be run: {}", fault.message));
                    return None;
                }
            }
            self.announce_images();
        }
        let path = self.folder.resolve(&mut self.report, file)?;
        let known = self.running.scripts.as_ref().and_then(|loaded| loaded.files.get(&path).copied());
        if let Some(known) = known {
            return known.map(|_| name);
        }
        let read = match crate::files::read(&path, MAX_FILE) {
            Ok(bytes) => {
                let text = String::from_utf8_lossy(bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&bytes)).into_owned();
                let index = self.report.add_source(Source { path: path.clone(), text: text.clone().into() });
                match self.with_scripts(|scripts| scripts.load(index, &text)) {
                    Ok(()) => Some(index),
                    Err(fault) => {
                        let at = self.line_of(&fault, file.span);
                        self.report.error(at, fault.message);
                        None
                    }
                }
            }
            Err(why) => {
                let message = format!("cannot read {}: {why}", path.display());
                let help = || {
                    if path.exists() { "valid: a file of Lua".to_owned() } else { crate::paths::nearest_help(&path) }
                };
                self.report.error_help(file.span, message, help);
                None
            }
        };
        self.running.scripts.as_mut()?.files.insert(path, read);
        read.map(|_| name)
    }

    /// Takes down the images that materials bind, and the levels.
    fn announce_images(&mut self) {
        for library in &self.libraries.list {
            for material in library.materials.iter().flatten() {
                for image in &material.images {
                    let level = image.level.as_ref().and_then(|level| level.text.parse().ok()).unwrap_or_default();
                    let key = (format!("{}::{}", library.name, material.name), image.unit);
                    self.attributes.bound.insert(key, level);
                }
            }
        }
    }

    /// Hands the attributes to the scripts, and takes them back.
    fn with_scripts<T>(&mut self, run: impl FnOnce(&Scripts) -> Result<T, Fault>) -> Result<T, Fault> {
        let Some(loaded) = &self.running.scripts else { unreachable!("scripts are there once one is asked for") };
        loaded.attributes.replace(std::mem::take(&mut self.attributes));
        let done = run(&loaded.scripts);
        self.attributes = loaded.attributes.take();
        done
    }

    /// Warns of functions that a script called and that do nothing here.
    fn warn_of_left_out(&mut self, element: &Element) {
        let left_out = self.running.scripts.as_ref().map(|loaded| loaded.scripts.left_out()).unwrap_or_default();
        for function in left_out {
            let message = format!("{} calls `{function}`, which does nothing here", script(element));
            let help = "scripts run before the first pass, and write no files";
            self.report.warning(element.span, message, || Some(help.to_owned()));
        }
    }

    /// The line of a fault, or else `otherwise`.
    fn line_of(&self, fault: &Fault, otherwise: Span) -> Span {
        let Some((file, line)) = fault.place else { return otherwise };
        let text = &self.report.source(file).text;
        let start: usize = text.split_inclusive('\n').take(line - 1).map(str::len).sum();
        let line = text[start..].lines().next().unwrap_or_default();
        let indent = line.len() - line.trim_start().len();
        Self::span_in(file, [start + indent, start + line.trim_end().len()])
    }
}
