//! When passes run: `<mode>`, and the engine's scripts, which are not run.

use super::dom::Element;
use super::loader::Loader;
use super::report::{shown, suggest};

/// What a pass of any class may hold.
pub(super) const RUNNING: [&str; 4] = ["mode", "testScript", "preScript", "postScript"];

/// The mode of a pass that never runs.
const NEVER: &str = "DONT_RUN";
/// A picture is that of the engine's second frame: whatever runs in one of the first two has run.
const MODES: [&str; 6] = ["RUN_ALWAYS", "RUN_ONCE", "SKIP_FIRST_FRAME", "RUN_EVEN", "RUN_ODD", NEVER];

impl Loader {
    /// Reads when a pass runs, and warns of its scripts. Returns whether it runs at all.
    pub fn runs(&mut self, pass: &Element) -> bool {
        let name = shown(pass.attribute("name").map_or("", |name| &name.text)).to_string();
        self.warn_of_scripts(pass, &format!("pass `{name}`"));
        let is_compute = pass.attribute("class").is_some_and(|class| class.text.eq_ignore_ascii_case("compute"));
        if let Some(test) = pass.children_named(&["testScript"]).next()
            && !(is_compute && repeats(test))
        {
            let when = if repeats(test) { "as often as" } else { "if" };
            let message = format!("pass `{name}` runs {when} {} says, which is not run", script(test));
            self.report.warning(test.span, message, || Some("it runs once".to_owned()));
        }
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

    /// Warns of scripts that run before and after a pass or a pipeline.
    pub fn warn_of_scripts(&mut self, element: &Element, of: &str) {
        for child in element.children_named(&["preScript", "postScript"]) {
            let when = if child.is(&["preScript"]) { "before" } else { "after" };
            let message = format!("{} runs {when} {of} in the engine, and is not run", script(child));
            let help = "what it would change is as the project's files say";
            self.report.warning(child.span, message, || Some(help.to_owned()));
        }
    }
}

/// Whether a pass runs until its script says no; otherwise the script says whether it runs.
pub(super) fn repeats(test: &Element) -> bool {
    test.attribute("TEST_MODE").is_some_and(|mode| mode.text.eq_ignore_ascii_case("RUN_WHILE"))
}

/// A script in words.
pub(super) fn script(element: &Element) -> String {
    let of = |name: &str| element.attribute(name).map(|value| shown(&value.text).to_string()).unwrap_or_default();
    format!("the script `{}` of `{}`", of("script"), of("file"))
}
