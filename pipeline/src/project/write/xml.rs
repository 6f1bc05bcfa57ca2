//! An XML writer that puts each element on a line.

use super::WriteError;
use std::fmt::Write as _;

/// Longest attribute value that the reader accepts, bytes.
const MAX_VALUE: usize = 4096;

/// A document under construction.
pub(super) struct Xml {
    text: String,
    open: Vec<&'static str>,
    /// The error for the first text that the format cannot hold.
    wrong: Option<WriteError>,
}

impl Xml {
    pub fn new(comment: &str) -> Self {
        let text = format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!-- {comment} -->\n");
        Self { text, open: Vec::new(), wrong: None }
    }

    /// Elements without a document around them.
    pub fn fragment() -> Self {
        Self { text: String::new(), open: Vec::new(), wrong: None }
    }

    /// Begins an element with children; [`Self::end`] closes it.
    pub fn begin(&mut self, name: &'static str, attributes: &[(&str, &str)]) {
        self.start(name, attributes);
        self.text.push_str(">\n");
        self.open.push(name);
    }

    /// Ends the innermost open element.
    pub fn end(&mut self) {
        if let Some(name) = self.open.pop() {
            self.indent();
            writeln!(self.text, "</{name}>").expect("a string takes all");
        }
    }

    /// Writes an element without children.
    pub fn empty(&mut self, name: &'static str, attributes: &[(&str, &str)]) {
        self.start(name, attributes);
        self.text.push_str("/>\n");
    }

    /// Writes an element that contains text.
    pub fn text(&mut self, name: &'static str, text: &str) {
        self.indent();
        let escaped = self.escaped(text);
        writeln!(self.text, "<{name}>{escaped}</{name}>").expect("a string takes all");
    }

    /// Records that a text cannot be written.
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

    /// Escapes a text. Text that the reader would change (it trims, folds white space and rejects control characters) is refused.
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

    /// The document, or the first error.
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
