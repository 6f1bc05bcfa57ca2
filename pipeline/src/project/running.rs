//! When passes run: `<mode>`, and the scripts that run before and after passes and decide whether, and how often, passes run.

use super::Scripted;
use super::attributes::{GROUPS, MAX_GROUPS};
use super::dom::Element;
use super::loader::Loader;
use super::report::{shown, suggest};

/// Elements that a pass of any class may contain.
pub(super) const RUNNING: [&str; 4] = ["mode", "testScript", "preScript", "postScript"];

/// The mode of a pass that never runs.
const NEVER: &str = "DONT_RUN";
/// A picture corresponds to the engine's second frame. By then a pass of every mode but [`NEVER`] has run.
const MODES: [&str; 6] = ["RUN_ALWAYS", "RUN_ONCE", "SKIP_FIRST_FRAME", "RUN_EVEN", "RUN_ODD", NEVER];

/// The classes of passes that a script can repeat.
const REPEATED: [&str; 2] = ["compute", "quad"];

/// Greatest number of runs that the scripts of a pipeline may request.
const MAX_RUNS: u32 = 4096;

/// Whether a pass is of one of these classes.
pub(super) fn of_class(pass: &Element, classes: &[&str]) -> bool {
    pass.attribute("class").is_some_and(|class| classes.iter().any(|name| class.text.eq_ignore_ascii_case(name)))
}

impl Loader {
    /// Reads when a pass runs: `<mode>`. Returns whether it runs at all.
    pub fn runs(&mut self, pass: &Element) -> bool {
        let name = shown(pass.attribute("name").map_or("", |name| &name.text)).to_string();
        let Some(mode) = self.single(pass, &["mode"]) else { return true };
        let Some(value) = self.required(mode, "value") else { return true };
        if !MODES.iter().any(|mode| value.text.eq_ignore_ascii_case(mode)) {
            let message = format!("pass `{name}` has the mode `{}`", value.shown());
            self.report.error_help(value.span, message, || suggest(&value.text, MODES));
        }
        let runs = !value.text.eq_ignore_ascii_case(NEVER);
        if !runs {
            let message = format!("pass `{name}` is left out: its mode is `{NEVER}`");
            self.report.warning(value.span, message, || None);
        }
        runs
    }

    /// Whether a pass that has run `before` times runs again, as its test script decides. Without a test script a pass runs once.
    pub fn runs_again(&mut self, pass: &Element, before: u32) -> bool {
        let Some(test) = pass.children_named(&["testScript"]).next() else { return before == 0 };
        let (repeats, can_repeat) = (repeats(test), of_class(pass, &REPEATED));
        if before > 0 && !(repeats && can_repeat) {
            return false;
        }
        let name = shown(pass.attribute("name").map_or("", |name| &name.text)).to_string();
        if before == 0 && repeats && !can_repeat {
            let message = format!("pass `{name}` runs as often as {} says: it runs once", script(test));
            let help = "scripts repeat passes of the classes compute and quad";
            self.report.warning(test.span, message, || Some(help.to_owned()));
        }
        let answer = self.asks_script(pass, test);
        if before == 0 && answer == Some(false) {
            let message = format!("pass `{name}` is left out: {} says that it does not run", script(test));
            self.report.note(test.span, message);
        }
        self.running.runs += u32::from(answer == Some(true));
        if self.running.runs > MAX_RUNS {
            let message = format!("{} lets pass `{name}` run {before} times, and does not end", script(test));
            self.report.error_help(test.span, message, || {
                format!("valid: {MAX_RUNS} runs in a pipeline, all passes together")
            });
            return false;
        }
        answer == Some(true)
    }

    /// Warns of scripts that the engine runs before and after a pipeline or a pass, and that are not run here.
    pub fn warn_of_scripts(&mut self, element: &Element, of: &str) {
        for child in element.children_named(&["preScript", "postScript"]) {
            let when = if child.is(&["preScript"]) { "before" } else { "after" };
            let message = format!("{} runs {when} {of} in the engine, and is not run", script(child));
            let help = "what it would change is as the project's files say";
            self.report.warning(child.span, message, || Some(help.to_owned()));
        }
    }
}

impl Loader {
    /// Describes which run of a pass this is, and what scripts set for it; `None` for a pass without a test script for which
    /// scripts set nothing.
    pub fn told_of_run(&mut self, pass: &Element, run: u32) -> Option<Scripted> {
        let set = std::mem::take(&mut self.attributes.set);
        let test = pass.children_named(&["testScript"]).next();
        if test.is_none() && set.is_empty() {
            return None;
        }
        let why = test.map(|test| format!("run {run}, as {} says", script(test)));
        let set = (!set.is_empty()).then(|| format!("scripts set {}", set.join(", ")));
        Some(Scripted { run, told: why.into_iter().chain(set).collect::<Vec<_>>().join("; ") })
    }

    /// Records the numbers of workgroups of a compute pass. An invalid number is recorded as 1; it is reported when the pass is read.
    pub fn announce_groups(&mut self, key: &str, pass: &Element) {
        let Some(material) = pass.children_named(&["material"]).next().filter(|_| of_class(pass, &["compute"])) else {
            return;
        };
        let count = |name: &str| {
            let text = material.attribute(name)?.text.trim_end_matches(',');
            let number: f32 = text.parse().ok().or_else(|| self.constants.get(text).copied())?;
            (1.0..=MAX_GROUPS as f32).contains(&number).then_some(number as u32)
        };
        let groups = GROUPS.map(|(_, attribute)| count(attribute).unwrap_or(1));
        self.attributes.groups.insert(key.to_owned(), groups);
    }
}

#[cfg(not(feature = "glsl"))]
impl Loader {
    /// Warns of the scripts before or after a pass, which this build does not run.
    pub fn runs_scripts(&mut self, pass: &Element, when: &'static str) {
        // One call warns of both kinds.
        if when == "preScript" {
            let name = pass.attribute("name").map_or("", |name| &name.text);
            self.warn_of_scripts(pass, &format!("pass `{}`", shown(name)));
        }
    }

    /// Warns of a pass's test script, which this build does not run. The pass runs as if the script returned true.
    fn asks_script(&mut self, pass: &Element, test: &Element) -> Option<bool> {
        let name = pass.attribute("name").map_or("", |name| &name.text);
        let when = if repeats(test) { "as often as" } else { "if" };
        let message = format!("pass `{}` runs {when} {} says, which is not run", shown(name), script(test));
        let help = "it runs once; builds with the feature `glsl` run scripts: cargo build --features glsl";
        self.report.warning(test.span, message, || Some(help.to_owned()));
        Some(true)
    }
}

/// Whether a pass runs repeatedly until its test script returns false. If not, the test script decides whether the pass runs once.
pub(super) fn repeats(test: &Element) -> bool {
    test.attribute("TEST_MODE").is_some_and(|mode| mode.text.eq_ignore_ascii_case("RUN_WHILE"))
}

/// A script in words.
pub(super) fn script(element: &Element) -> String {
    let of = |name: &str| element.attribute(name).map(|value| shown(&value.text).to_string()).unwrap_or_default();
    format!("the script `{}` of `{}`", of("script"), of("file"))
}
