//! Wraps lines to the width of the terminal at words. In tables, the last column continues below itself.

/// Number of columns of the output stream's terminal; `None` if it is not a terminal.
pub fn of_terminal() -> Option<usize> {
    #[cfg(unix)]
    return columns(std::io::stdout());
    #[cfg(not(unix))]
    None
}

/// Number of columns of the error stream's terminal; `None` if it is not a terminal.
pub fn of_error_stream() -> Option<usize> {
    #[cfg(unix)]
    return columns(std::io::stderr());
    #[cfg(not(unix))]
    None
}

#[cfg(unix)]
fn columns(stream: impl std::os::fd::AsFd) -> Option<usize> {
    let size = rustix::termios::tcgetwinsize(stream).ok()?;
    (size.ws_col > 0).then_some(size.ws_col.into())
}

/// A line of a table, wrapped at words to at most `width` columns if there is room for that; the last column continues below itself. A column
/// begins after two spaces or, if the first columns are empty, after at least [`EMPTY`]. Lines without columns are not wrapped: text that
/// users copy, such as commands, stays whole.
pub fn wrapped(line: &str, width: usize) -> Vec<String> {
    // The least width of a last column.
    const LEAST: usize = 18;
    let characters: Vec<char> = line.chars().collect();
    if characters.len() <= width || line.contains(['\x1b', '\n']) {
        return vec![line.to_owned()];
    }
    let begins = |at: &usize| {
        let gap = characters[at - 2..*at].iter().all(|character| *character == ' ');
        let behind_a_column = || *at >= EMPTY || characters[..*at].iter().any(|character| *character != ' ');
        gap && characters[*at] != ' ' && behind_a_column()
    };
    let room = |at: &usize| at + LEAST <= width;
    let Some(indent) = (2..characters.len()).filter(begins).take_while(room).last() else {
        return vec![line.to_owned()];
    };
    let [first, text] = [&characters[..indent], &characters[indent..]].map(|part| part.iter().collect::<String>());
    filled(first, &text, indent, width)
}

/// Least number of leading spaces in a table's line that count as empty first columns.
const EMPTY: usize = 8;

/// Prose, wrapped at words to at most `width` columns; all lines but the first are indented by two spaces. With `None`, which means no terminal,
/// it stays whole.
pub fn folded(text: &str, width: Option<usize>) -> Vec<String> {
    folded_by(text, 2, width)
}

/// As [`folded`], with `indent` spaces before all lines but the first.
pub fn folded_by(text: &str, indent: usize, width: Option<usize>) -> Vec<String> {
    match width {
        Some(width) if text.chars().count() > width => filled(String::new(), text, indent, width),
        _ => vec![text.to_owned()],
    }
}

/// `first` and then the words of `text`, in lines of at most `width` columns, indented from the second line on. A longer word has its own line.
fn filled(first: String, text: &str, indent: usize, width: usize) -> Vec<String> {
    let mut used = first.chars().count();
    let mut lines = vec![first];
    let mut is_first_word = true;
    for word in text.split(' ') {
        let length = word.chars().count();
        if !is_first_word && used + 1 + length > width {
            lines.push(" ".repeat(indent));
            (used, is_first_word) = (indent, true);
        }
        let Some(line) = lines.last_mut() else { continue };
        if !is_first_word {
            line.push(' ');
            used += 1;
        }
        line.push_str(word);
        (used, is_first_word) = (used + length, false);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::{folded, folded_by, wrapped};

    #[test]
    fn the_last_column_goes_on_below_itself_in_whole_words() {
        let line = "rays       pass2           57.01  final on cpu: 65512 shadow, 1957700 occlusion, 655 reflected";
        let found = wrapped(line, 60);
        assert_eq!(
            found,
            [
                "rays       pass2           57.01  final on cpu: 65512",
                "                                  shadow, 1957700 occlusion,",
                "                                  655 reflected",
            ]
        );
        assert!(found.iter().all(|line| line.chars().count() <= 60));
        let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(words(&found.join(" ")), words(line), "nothing is lost");
        assert_eq!(wrapped(line, 200), [line]);
        // Letters are counted, not bytes.
        assert_eq!(wrapped("a  ééé ééé", 10), ["a  ééé ééé"]);
    }

    #[test]
    fn a_line_whose_first_columns_are_empty_goes_on_below_its_text() {
        let line = format!("{}read by reflection, refraction, final, albedo", " ".repeat(20));
        let found = wrapped(&line, 50);
        let expected = ["read by reflection,", "refraction, final, albedo"].map(|text| " ".repeat(20) + text);
        assert_eq!(found, expected);
        let near = format!("{}read by reflection, refraction, final, albedo", " ".repeat(7));
        assert_eq!(wrapped(&near, 50), [near], "seven spaces are no column");
    }

    #[test]
    fn prose_is_folded_for_a_terminal_alone() {
        let text = "one two three four";
        assert_eq!(folded(text, Some(9)), ["one two", "  three", "  four"]);
        assert_eq!(folded(text, Some(18)), [text]);
        assert_eq!(folded(text, None), [text]);
        assert_eq!(folded("a wordthatislong b", Some(6)), ["a", "  wordthatislong", "  b"], "one word is not cut");
        assert_eq!(folded_by("  one two three", 4, Some(9)), ["  one two", "    three"], "what stands in front stays");
    }

    #[test]
    fn prose_and_what_has_no_room_are_left_alone() {
        for line in [
            "this makes it: curitiba reference a/path/that/is/long.xml --size 256x256",
            "  two spaces before are no column",
        ] {
            assert_eq!(wrapped(line, 20), [line]);
        }
        let late = format!("{}  note", "x".repeat(70));
        assert_eq!(wrapped(&late, 60).concat(), late);
        let word = format!("a  {}", "y".repeat(40));
        assert_eq!(wrapped(&word, 30).join("\n"), word, "one word is not cut");
    }
}
