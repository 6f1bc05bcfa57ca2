//! Lines that fit the terminal: tables whose last column is text go on below it, in whole words.

/// Columns of the terminal that the output stream is; `None` where it is none.
pub fn of_terminal() -> Option<usize> {
    #[cfg(unix)]
    {
        let size = rustix::termios::tcgetwinsize(std::io::stdout()).ok()?;
        (size.ws_col > 0).then_some(size.ws_col.into())
    }
    #[cfg(not(unix))]
    None
}

/// A line of a table, cut at words so that each part is at most `width` columns wide, if there is room for that; the last column goes on below
/// itself. A column begins behind two spaces. Lines without columns are left to the terminal: what is copied from there, such as commands, stays
/// whole.
pub fn wrapped(line: &str, width: usize) -> Vec<String> {
    // The least width of a last column.
    const LEAST: usize = 18;
    let characters: Vec<char> = line.chars().collect();
    if characters.len() <= width || line.contains(['\x1b', '\n']) {
        return vec![line.to_owned()];
    }
    let begins = |at: &usize| {
        let gap = characters[at - 2..*at].iter().all(|character| *character == ' ');
        gap && characters[*at] != ' ' && characters[..*at].iter().any(|character| *character != ' ')
    };
    let room = |at: &usize| at + LEAST <= width;
    let Some(indent) = (2..characters.len()).filter(begins).take_while(room).last() else {
        return vec![line.to_owned()];
    };
    let text: String = characters[indent..].iter().collect();
    let mut lines = vec![characters[..indent].iter().collect::<String>()];
    let mut used = indent;
    for word in text.split(' ') {
        let length = word.chars().count();
        let Some(last) = lines.last_mut() else { continue };
        match used {
            used if used == indent => last.push_str(word),
            used if used + 1 + length <= width => {
                last.push(' ');
                last.push_str(word);
            }
            _ => {
                lines.push(" ".repeat(indent) + word);
                used = indent + length;
                continue;
            }
        }
        used += length + usize::from(used > indent);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::wrapped;

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
