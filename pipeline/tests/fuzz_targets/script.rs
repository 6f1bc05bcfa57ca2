//! Scripts of projects: the body of the fuzz target `script`.

use super::fuzz_targets::check::{self, Outcome};
use super::fuzz_targets::{Folder, LIBRARY, PROJECT};

/// Replacements in [`PROJECT`]: they add attributes for scripts to read, and three scripts to a pass. The first runs before the pass, the
/// second after it, and the third decides whether the pass runs again.
const ADDED: [[&str; 2]; 2] = [
    [
        "<assets>",
        r#"<assets><attributes><attribute type="PASS" name="Level" data="INT" value="0"/>
<attribute type="PASS" name="Share" data="FLOAT" value="0.5"/>
<attribute type="RENDERER" name="COUNT" data="INT" value="3"/></attributes>"#,
    ],
    [
        r#"<pass class="quad" name="show">"#,
        r#"<pass class="quad" name="show"><preScript file="s.lua" script="before"/><postScript file="s.lua" script="after"/>
<testScript file="s.lua" script="again" TEST_MODE="RUN_WHILE"/>"#,
    ],
];

/// Reads [`PROJECT`] with the input as a Lua file; the last pass calls three functions of it. A second read must decide the same.
pub fn script(input: &[u8]) -> Outcome {
    let folder = Folder::new();
    folder.write("everything.mlib", LIBRARY.as_bytes());
    folder.write("s.lua", input);
    let project = ADDED.iter().fold(PROJECT.to_owned(), |text, [from, to]| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    });
    let path = folder.write("project.xml", project.as_bytes());
    let outcome = check::project(&path);
    let decided = || curitiba_pipeline::project::load(&path).ok().map(|project| format!("{:?}", project.pipelines));
    assert_eq!(decided(), decided(), "a script decides otherwise a second time");
    outcome
}
