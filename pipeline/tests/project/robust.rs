//! Damaged or hostile files must cause a message, never a panic, a hang or unbounded use of memory.

use crate::support::{FINAL, Files, LIBRARY, RASTER, SHOW, bad, errors, line, project};
use curitiba_pipeline::project::load;

#[track_caller]
fn only_error(bytes: impl AsRef<[u8]>, expected: &str) {
    let problems = bad(bytes);
    let found = errors(&problems);
    assert!(found.len() == 1 && found[0].starts_with(expected), "expected `{expected}`:\n{found:#?}");
}

#[test]
fn a_missing_file_and_a_folder_are_messages() {
    let files = Files::new("");
    let missing = load(&files.path("none.xml")).expect_err("missing");
    assert!(errors(&missing)[0].starts_with("none.xml:1:1: cannot read "), "{missing}");
    let folder = load(&files.path("")).expect_err("a folder");
    assert!(errors(&folder)[0].contains("not a regular file"), "{folder}");
}

#[test]
fn other_encodings_are_named_with_their_place() {
    only_error(b"<project>\n<!-- Ponte de Lima, S\xE3o -->", "project.xml:2:22: byte 31 (0xE3) is not UTF-8");
    only_error(b"\xFF\xFE<\0p\0", "project.xml:1:1: the file is UTF-16");
    only_error(b"\xFE\xFF\0<\0p", "project.xml:1:1: the file is UTF-16");
    only_error(b"<\0p\0", "project.xml:1:2: byte 1 (0x00) is a control character");
}

#[test]
fn the_place_of_a_wrong_byte_can_be_shown() {
    // The replacement character for an invalid byte is three bytes long, and spans must not cut it.
    for bytes in [&b"<project name=\"\xF4\"/>"[..], b"\xFF\xFE<\0", b"\xEF\xBB\xBFab\xC3"] {
        let problems = bad(bytes);
        let (source, range) = problems.0[0].place.clone().expect("a place");
        assert_eq!(source.text.get(range), Some("\u{FFFD}"));
    }
}

#[test]
fn empty_and_truncated_files_say_where_they_end() {
    only_error("", "project.xml:1:1: the file holds no XML element");
    only_error("just words", "project.xml:1:1: the file holds no XML element");
    only_error("<project name=\"p\">\n<assets>\n", "project.xml:2:1: <assets> is never closed");
    only_error("<project name=\"p\">\n  <assets", "project.xml:2:3: syntax error: tag not closed");
    only_error("<project name=\"p>\n</project>", "project.xml:1:1: syntax error: attribute value not closed");
    only_error("<project>\n<!-- x", "project.xml:2:1: syntax error: comment not closed");
}

#[test]
fn every_truncation_of_a_project_is_answered() {
    let text = project(&[RASTER, FINAL, SHOW].concat());
    let files = Files::new("");
    for length in (0..text.trim_end().len()).step_by(7) {
        files.write("project.xml", &text[..length]);
        let problems = files.load().expect_err("a part of a project");
        assert!(problems.has_errors(), "cut at {length}");
    }
}

#[test]
fn flipped_bytes_never_panic() {
    let text = project(&[RASTER, FINAL, SHOW].concat());
    let files = Files::new("");
    // A linear congruential generator (Numerical Recipes): the same damage in every run.
    let mut state = 1_u32;
    let mut random = |below: usize| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as usize % below
    };
    let mut loaded = 0;
    for round in 0..1500 {
        let original = if round % 3 == 0 { LIBRARY } else { &text };
        let mut bytes = original.as_bytes().to_vec();
        for _ in 0..=random(3) {
            let at = random(bytes.len());
            match random(4) {
                0 => bytes[at] = random(256) as u8,
                1 => bytes[at] = b"<>/\"'=&; \n0-"[random(12)],
                2 => {
                    bytes.remove(at);
                }
                _ => {
                    let end = (at + random(40)).min(bytes.len());
                    let piece = bytes[at..end].to_vec();
                    let to = random(bytes.len());
                    bytes.splice(to..to, piece);
                }
            }
        }
        let (damaged, whole) = if round % 3 == 0 { ("lib.mlib", "project.xml") } else { ("project.xml", "lib.mlib") };
        files.write(damaged, &bytes);
        files.write(whole, if whole == "lib.mlib" { LIBRARY } else { &text });
        match files.load() {
            Ok(_) => loaded += 1,
            Err(problems) => assert!(problems.has_errors() && !problems.to_string().is_empty()),
        }
    }
    assert!((1..1500).contains(&loaded), "some damage is harmless, some is not: {loaded} loaded");
}

#[test]
fn deep_nesting_stops_at_a_message() {
    let deep = format!("<project name=\"p\">{}", "<a>".repeat(1_000_000));
    only_error(deep, "project.xml:1:208: elements are nested deeper than 64");
}

#[test]
fn definitions_of_entities_are_refused() {
    let bomb =
        "<?xml version=\"1.0\"?>\n<!DOCTYPE p [<!ENTITY a \"ha\"><!ENTITY b \"&a;&a;&a;\">]>\n<project name=\"&b;\"/>";
    only_error(bomb, "project.xml:2:1: this DOCTYPE has definitions of its own: they are refused");
    let external = "<!DOCTYPE p SYSTEM \"x\" [ <!ENTITY a SYSTEM \"file:///etc/hostname\"> ]><project name=\"&a;\"/>";
    only_error(external, "project.xml:1:1: this DOCTYPE");
    let problems = bad("<project name=\"a &nbsp; b\"/>");
    assert_eq!(errors(&problems)[0], "project.xml:1:1: the project has no <assets>");
    assert!(errors(&problems).contains(&"project.xml:1:18: `&nbsp;` is not defined".to_owned()), "{problems}");
}

#[test]
fn huge_files_values_and_counts_are_capped() {
    let huge = format!("<project name=\"p\"><!--{}--></project>", "x".repeat(16 << 20));
    only_error(huge, "project.xml:1:1: cannot read ");
    let attributes: String = (0..300).map(|index| format!(" a{index}=1")).collect();
    only_error(format!("<project{attributes}/>"), "project.xml:1:1692: too many attributes");
    let elements = format!("<project name=\"p\">\n{}</project>", "<a/>".repeat(70_000));
    only_error(elements, "project.xml:2:262141: the file has more than 65536 elements");
    let many = format!("<project name=\"p\">\n{}</project>", "<a b=1 c=2 d=3 e=4 f=5 g=6/>".repeat(60_000));
    assert_eq!(errors(&bad(many)).len(), 1);
    let long = bad(format!("<project name=\"{}\"/>", "n".repeat(5000)));
    assert!(errors(&long).contains(&"project.xml:1:16: the value of `name` is longer than 4096 bytes".to_owned()));
    only_error(format!("<project>{}</project>", "t".repeat(5000)), "project.xml:1:10: this text is longer than 4096");
    only_error(format!("<{}/>", "n".repeat(500)), "project.xml:1:1: an element's name is longer than 128 bytes");
}

#[test]
fn hostile_repetition_takes_bounded_time_and_memory() {
    // Each of these would take quadratic time or memory with a naive implementation.
    let textures = "<texture unit=\"0\" name=\"color\"/>".repeat(20_000);
    let library = LIBRARY.replace(
        "<material name=\"glass\">",
        &format!("<material name=\"big\"><textures>{textures}</textures></material><material name=\"glass\">"),
    );
    let maps = "<map fromMaterial=\"a\" toLibrary=\"Lib\" toMaterial=\"big\"/>".repeat(20_000);
    let files = Files::new(project(&RASTER.replace("</pass>", &format!("<materialMaps>{maps}</materialMaps></pass>"))));
    files.write("lib.mlib", &library);
    let loaded = files.load().unwrap_or_else(|problems| panic!("{problems}"));
    assert!(loaded.problems.to_string().contains("more notes and warnings are not listed"));

    let missing = (0..20_000).map(|index| format!("<file>f{index}.obj</file>")).collect::<String>();
    files.write("project.xml", project(RASTER).replace("<file>box.obj</file>", &missing));
    assert_eq!(files.load().unwrap_or_else(|problems| panic!("{problems}")).scenes[0].files.len(), 20_000);

    let colors =
        (0..5_000).map(|index| format!("<color name=\"c{index}\" internalFormat=\"R8\"/>")).collect::<String>();
    files.write("project.xml", project(RASTER));
    files.write("lib.mlib", LIBRARY.replacen("<colors>", &format!("<colors>{colors}"), 1));
    let problems = files.load().expect_err("too many channels");
    assert!(errors(&problems)[0].ends_with("more than 32 colour channels"), "{problems}");

    only_error(format!("<project>{}", "& ".repeat(100_000)), "project.xml:1:");
    assert!(bad(format!("{}<project/>", "& ".repeat(100_000))).has_errors());
}

#[test]
fn very_many_problems_are_counted() {
    let cameras = "<camera name=\"c\"><position x=\"1.2.3\" y=\"0\" z=\"0\"/></camera>\n".repeat(20_000);
    let problems = bad(format!("<project name=\"p\"><assets><cameras>\n{cameras}</cameras></assets></project>"));
    assert!(problems.0.len() <= 202, "{} problems", problems.0.len());
    let text = problems.to_string();
    assert!(text.contains("more errors are not listed"), "{text}");
}

#[test]
fn very_many_unclosed_elements_are_counted() {
    let pairs = "<b><c></b>\n".repeat(30_000);
    let problems = bad(format!("<project name=\"p\">\n{pairs}</project>"));
    assert_eq!(errors(&problems)[0], "project.xml:2:4: <c> is never closed");
    assert!(problems.to_string().contains("more errors are not listed"));
}

#[test]
fn crossed_tags_are_named_and_reading_goes_on() {
    let text = "<project name=\"p\" width=\"0\" height=\"5\">\n<assets>\n<scenes>\n</assets>\n</scenes>\n</project>";
    let found = errors(&bad(text));
    assert_eq!(
        found,
        [
            "project.xml:1:1: the project has no <pipeline>",
            "project.xml:1:26: `0` is not a number of pixels",
            "project.xml:3:1: <scenes> is never closed",
            "project.xml:5:1: </scenes> closes nothing",
        ]
    );
}

#[test]
fn damaged_tags_are_named() {
    only_error("<project>\n a < b </project>", "project.xml:2:4: `<` does not start an element");
    let found = errors(&bad("<project name=\"p\"\n width=1024height=\"3\" x y=>\n</project>"));
    assert!(found.contains(&"project.xml:2:8: `1024height=\"3\"` is ambiguous without quotes".to_owned()), "{found:?}");
    assert!(found.contains(&"project.xml:2:23: attribute `x` has no value".to_owned()), "{found:?}");
    assert!(found.contains(&"project.xml:2:27: attribute `y` has no value".to_owned()), "{found:?}");
    let found = errors(&bad("<project name=\"p>\n<assets/><x a=\"/>"));
    assert!(
        found.contains(&"project.xml:1:16: the value of `name` contains `<`: is a quote missing?".to_owned()),
        "{found:?}"
    );
    let found = errors(&bad("<project name=\"p\" NAME=\"q\"/>\n<project/>"));
    assert!(found.contains(&"project.xml:1:19: attribute `NAME` stands twice".to_owned()), "{found:?}");
    assert!(found.contains(&"project.xml:2:1: a second root element <project>".to_owned()), "{found:?}");
}

#[test]
fn a_library_that_is_a_project_or_the_reverse_is_named() {
    let files = Files::new(project(RASTER).replace("lib.mlib", "project.xml"));
    let problems = files.load().expect_err("a project as its own library");
    assert_eq!(errors(&problems), ["project.xml:1:1: a material library does not start with <project>"]);
    only_error(LIBRARY, "project.xml:2:1: a project does not start with <materiallib>");
}

#[test]
fn problems_of_the_project_and_its_libraries_come_together() {
    let files = Files::new(project(RASTER).replace("z=\"5\"", "z=\"5..5\""));
    files.write("lib.mlib", LIBRARY.replace("RGBA16F", "RGBA12").replace("width=\"64\"", "width=\"0\""));
    let problems = files.load().expect_err("three errors");
    assert_eq!(
        errors(&problems),
        [
            "project.xml:5:54: `5..5` is not a number",
            "lib.mlib:5:17: `0` is not a number of pixels",
            "lib.mlib:9:40: `RGBA12` is not a format",
            "lib.mlib:13:17: `0` is not a number of pixels",
        ]
    );
    assert!(problems.0.iter().all(|problem| !line(problem).is_empty()));
}
