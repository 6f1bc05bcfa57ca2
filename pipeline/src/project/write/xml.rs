//! Elements with attributes, one a line.

use super::WriteError;
use std::fmt::Write as _;

/// Longest attribute value that the reader takes, bytes.
const MAX_VALUE: usize = 4096;

/// A document that grows from its beginning.
pub(super) struct Xml {
    text: String,
    open: Vec<&'static str>,
    /// The first text that the format cannot hold.
    wrong: Option<WriteError>,
}

impl Xml {
    pub fn new(comment: &str) -> Self {
        let text = format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!-- {comment} -->\n");
        Self { text, open: Vec::new(), wrong: None }
    }

    /// Elements for a document that is there already.
    pub fn fragment() -> Self {
        Self { text: String::new(), open: Vec::new(), wrong: None }
    }

    /// An element with children, up to [`Self::end`].
    pub fn begin(&mut self, name: &'static str, attributes: &[(&str, &str)]) {
        self.start(name, attributes);
        self.text.push_str(">\n");
        self.open.push(name);
    }

    /// Ends the element that was begun last.
    pub fn end(&mut self) {
        if let Some(name) = self.open.pop() {
            self.indent();
            writeln!(self.text, "</{name}>").expect("a string takes all");
        }
    }

    /// An element without children.
    pub fn empty(&mut self, name: &'static str, attributes: &[(&str, &str)]) {
        self.start(name, attributes);
        self.text.push_str("/>\n");
    }

    /// An element that holds a text.
    pub fn text(&mut self, name: &'static str, text: &str) {
        self.indent();
        let escaped = self.escaped(text);
        writeln!(self.text, "<{name}>{escaped}</{name}>").expect("a string takes all");
    }

    /// Says that a text cannot be written.
    pub fn refuse(&mut self, text: &str) {
        let start: String = text.chars().take(64).collect();
        self.wrong.get_or_insert(WriteError::Text(start.escape_debug().to_string()));
    }

    fn start(&mut self, name: &str, attributes: &[(&str, &str)]) {
        self.indent();
        self.text.push('<');
        self.text.push_str(name);
        for (name, value) in attributes {
            let escaped = self.escaped(value);
            write!(self.text, " {name}=\"{escaped}\"").expect("a string takes all");
        }
    }

    fn indent(&mut self) {
        self.text.push_str(&"  ".repeat(self.open.len()));
    }

    /// A text as the reader will have it: it trims, folds white space, and takes no control character.
    fn escaped(&mut self, text: &str) -> String {
        let folded = text.split_whitespace().collect::<Vec<_>>().join(" ");
        let mut escaped = String::with_capacity(text.len());
        for character in text.chars() {
            match character {
                '&' => escaped.push_str("&amp;"),
                '<' => escaped.push_str("&lt;"),
                '>' => escaped.push_str("&gt;"),
                '"' => escaped.push_str("&quot;"),
                _ => escaped.push(character),
            }
        }
        if text.is_empty() || folded != text || text.contains(char::is_control) || escaped.len() > MAX_VALUE {
            self.refuse(text);
        }
        escaped
    }

    /// The whole text.
    pub fn finish(mut self) -> Result<String, WriteError> {
        while !self.open.is_empty() {
            self.end();
        }
        match self.wrong {
            Some(wrong) => Err(wrong),
            None => Ok(self.text),
        }
    }
}
