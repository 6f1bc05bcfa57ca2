//! Scripts of passes: reads their files, runs them, and locates their faults.

use super::dom::Element;
use super::loader::Loader;
use super::report::Span;
use super::run_state::Loaded;
use super::running::script;
use crate::script::{Fault, MAX_FILE, Scripts};
use std::collections::HashMap;
use std::rc::Rc;

impl Loader {
    /// Runs the scripts before (`preScript`) or after (`postScript`) a pass. A script that fails sets nothing, and a warning says so.
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

    /// Runs the test script of a pass and returns whether the pass runs; `None` after an error.
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

    /// Reads the file of a script, unless it was read before, and returns the script's name. `None` after an error.
    fn script_of(&mut self, pass: &Element, element: &Element) -> Option<String> {
        let (file, name) = (self.required(element, "file"), self.required(element, "script"));
        let (file, name) = (file?, name?.text.clone());
        self.attributes.current = (
            self.pass_key(pass.attribute("name").map_or("", |name| &name.text)),
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
        let index = self.text_file(&path, file, MAX_FILE);
        let read = index.filter(|index| {
            let text = self.report.source(*index).text.clone();
            let loaded = self.with_scripts(|scripts| scripts.load(*index, &text));
            if let Err(fault) = &loaded {
                let at = self.line_of(fault, file.span);
                self.report.error(at, fault.message.clone());
            }
            loaded.is_ok()
        });
        self.running.scripts.as_mut()?.files.insert(path, read);
        read.map(|_| name)
    }

    /// Records the image units that materials bind, with their mip levels.
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

    /// Calls `run`. Scripts have the attributes meanwhile, in place of the loader.
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
