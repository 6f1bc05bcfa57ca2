//! A small document tree in which every name, attribute and text has its position.
//!
//! `quick-xml` finds the tags. The inside of a tag is parsed here, because messages give the column of each attribute and because
//! real files omit quotes and the white space between attributes. Documents are limited by [`MAX_DEPTH`], [`MAX_ELEMENTS`],
//! [`MAX_ATTRIBUTES`], [`MAX_ALL_ATTRIBUTES`] and [`MAX_VALUE`]. Files cannot define entities.

use super::report::{Report, Span, shown};
use crate::guard;
use quick_xml::events::Event;

/// Deepest nesting of elements.
pub(super) const MAX_DEPTH: usize = 64;
/// Greatest number of elements of a file.
pub(super) const MAX_ELEMENTS: usize = 65_536;
/// Greatest number of attributes of an element.
pub(super) const MAX_ATTRIBUTES: usize = 256;
/// Greatest number of attributes of a file.
pub(super) const MAX_ALL_ATTRIBUTES: usize = 4 * MAX_ELEMENTS;
/// Longest name of an element or attribute, bytes.
pub(super) const MAX_NAME: usize = 128;
/// Longest attribute value or text, bytes.
pub(super) const MAX_VALUE: usize = 4096;

/// An attribute's value or an element's text: entities are resolved, white space is folded to single spaces and trimmed.
#[derive(Debug, Clone)]
pub(super) struct Value {
    pub text: String,
    /// For a text with line breaks: the same text with the line breaks, and the white space around them, removed. This restores
    /// paths that a printed page wrapped.
    pub joined: Option<String>,
    pub span: Span,
}

impl Value {
    fn new(raw: &str, span: Span) -> Self {
        let text = raw.split_whitespace().collect::<Vec<_>>().join(" ");
        let lines = || raw.lines().map(str::trim).collect::<String>();
        let joined = raw.trim().contains(['\n', '\r']).then(lines);
        Self { text, joined, span }
    }

    /// Whether it is `true`, `yes` or `1`; case is ignored.
    pub fn is_true(&self) -> bool {
        ["true", "yes", "1"].iter().any(|yes| self.text.eq_ignore_ascii_case(yes))
    }

    /// The value, shortened for messages.
    pub fn shown(&self) -> String {
        shown(&self.text)
    }
}

/// An attribute.
#[derive(Debug, Clone)]
pub(super) struct Attribute {
    pub name: String,
    pub name_span: Span,
    pub value: Value,
}

/// An element.
#[derive(Debug)]
pub(super) struct Element {
    pub name: String,
    /// Position of the start tag.
    pub span: Span,
    /// Line of the start tag, from 1.
    pub line: u32,
    /// Column of the start tag in characters, from 1.
    pub column: u32,
    pub attributes: Vec<Attribute>,
    pub children: Vec<Element>,
    /// Text between the tags, without children and comments; `None` if it is only white space.
    pub text: Option<Value>,
}

impl Element {
    /// A copy of the element's start tag alone, without children and text.
    pub fn tag(&self) -> Self {
        let (name, attributes) = (self.name.clone(), self.attributes.clone());
        Self { name, attributes, children: Vec::new(), text: None, ..*self }
    }

    /// Whether the element has one of these names; case is ignored.
    pub fn is(&self, names: &[&str]) -> bool {
        names.iter().any(|name| self.name.eq_ignore_ascii_case(name))
    }

    /// An attribute by its name; case is ignored.
    pub fn attribute(&self, name: &str) -> Option<&Value> {
        self.attributes.iter().find(|attribute| attribute.name.eq_ignore_ascii_case(name)).map(|found| &found.value)
    }

    /// The attribute `value` of the first child of that name; case is ignored.
    pub fn child_value(&self, name: &str) -> Option<&Value> {
        self.children.iter().find(|child| child.is(&[name]))?.attribute("value")
    }

    /// Children with any of these names; case is ignored.
    pub fn children_named<'e>(&'e self, names: &'e [&'e str]) -> impl Iterator<Item = &'e Element> {
        self.children.iter().filter(move |child| child.is(names))
    }
}

/// An element whose end tag was not reached yet.
struct Open {
    element: Element,
    text: String,
    text_span: Option<Span>,
}

struct Parser<'a> {
    text: &'a str,
    file: u32,
    report: &'a mut Report,
    open: Vec<Open>,
    root: Option<Element>,
    elements: usize,
    all_attributes: usize,
    /// Whether text outside the root was reported already.
    stray_noted: bool,
    /// Line, column and offset of the last position for which line and column were determined.
    cursor: (u32, u32, usize),
}

/// Parses a document. `None` if too little of it is valid to be interpreted; an error is then reported.
pub(super) fn parse(report: &mut Report, file: u32) -> Option<Element> {
    let text = report.source(file).text.clone();
    let mut parser = Parser {
        text: &text,
        file,
        report,
        open: Vec::new(),
        root: None,
        elements: 0,
        all_attributes: 0,
        stray_noted: false,
        cursor: (1, 1, 0),
    };
    let whole = parser.read();
    if !whole {
        return None;
    }
    if let Some(unclosed) = parser.open.last() {
        let names: Vec<String> = parser.open.iter().rev().take(8).map(|open| shown(&open.element.name)).collect();
        let (at, end) = (unclosed.element.span, parser.span(text.len(), text.len()));
        let (line, column) = parser.report.line_column(end);
        let help = format!("the file ends at {line}:{column} inside <{}>; is it truncated?", names.join(">, inside <"));
        parser.report.error_help(at, format!("<{}> is never closed", names[0]), || help);
        return None;
    }
    if parser.root.is_none() {
        let at = parser.span(0, 0);
        parser.report.error(at, "the file holds no XML element");
    }
    parser.root
}

impl Parser<'_> {
    fn span(&self, start: usize, end: usize) -> Span {
        // Files are limited to 16 MiB, so offsets fit.
        Span { file: self.file, start: start as u32, end: end as u32 }
    }

    /// Parses to the end of the file; `false` if it had to stop earlier.
    fn read(&mut self) -> bool {
        // Positions of `quick-xml` do not count leading byte-order marks. The file's first mark was removed before; more marks may follow
        // it.
        let skipped = self.text.len() - self.text.trim_start_matches('\u{feff}').len();
        let mut reader = quick_xml::Reader::from_str(&self.text[skipped..]);
        let config = reader.config_mut();
        config.check_end_names = false;
        config.allow_unmatched_ends = true;
        config.allow_dangling_amp = true;
        loop {
            let start = skipped + reader.buffer_position() as usize;
            let event = match guard::call("quick-xml", || reader.read_event()) {
                Ok(Ok(event)) => event,
                Ok(Err(error)) => {
                    let start = (skipped + reader.error_position() as usize).min(self.text.len());
                    self.report.error(self.rest_of_line(start), error.to_string());
                    return false;
                }
                Err(panic) => {
                    self.report.error(self.rest_of_line(start), panic);
                    return false;
                }
            };
            let end = skipped + reader.buffer_position() as usize;
            let goes_on = match event {
                Event::Eof => return true,
                Event::Start(_) => self.start(start, end, false),
                Event::Empty(_) => self.start(start, end, true),
                Event::End(_) => self.end(start, end),
                Event::Text(_) | Event::GeneralRef(_) => self.characters(start, end),
                Event::CData(data) => self.push_text(&data, start, end),
                Event::DocType(content) => self.doctype(&content, start, end),
                Event::Comment(_) | Event::Decl(_) | Event::PI(_) => true,
            };
            if !goes_on {
                return false;
            }
        }
    }

    /// The span from an offset to the end of its line.
    fn rest_of_line(&self, start: usize) -> Span {
        let end = self.text[start..].find('\n').map_or(self.text.len(), |line| start + line);
        self.span(start, end)
    }

    fn doctype(&mut self, content: &str, start: usize, end: usize) -> bool {
        if content.contains(['[', '<']) || content.to_ascii_uppercase().contains("ENTITY") {
            self.report.error_help(
                self.span(start, end),
                "this DOCTYPE has definitions of its own: they are refused",
                || "valid: no DOCTYPE, and the entities &lt; &gt; &amp; &quot; &apos; and &#…;".to_owned(),
            );
            return false;
        }
        true
    }

    fn characters(&mut self, start: usize, end: usize) -> bool {
        let raw = &self.text[start..end];
        if raw.trim().is_empty() {
            // White space only separates words; it is kept only after the first other characters of a text.
            if let Some(open) = self.open.last_mut().filter(|open| open.text_span.is_some()) {
                open.text.push_str(raw);
            }
            return true;
        }
        if self.open.is_empty() {
            return self.push_text(raw, start, end);
        }
        let text = self.unescape(raw, start);
        self.push_text(&text, start, end)
    }

    fn push_text(&mut self, text: &str, start: usize, end: usize) -> bool {
        let (file, raw) = (self.file, &self.text[start..end]);
        let first = start + (raw.len() - raw.trim_start().len());
        let last = start + raw.trim_end().len();
        let Some(open) = self.open.last_mut() else {
            if !self.stray_noted {
                self.stray_noted = true;
                // Before the first element the text is not quoted: the file may be of another format, with private contents.
                let quoted = self.root.as_ref().map(|_| format!("`{}` ", shown(text.trim())));
                let message = format!("stray text {}is ignored", quoted.unwrap_or_default());
                self.report.note(self.span(first, last), message);
            }
            return true;
        };
        open.text.push_str(text);
        let begin = open.text_span.map_or(first as u32, |span| span.start);
        open.text_span = Some(Span { file, start: begin, end: last as u32 });
        if open.text.len() > MAX_VALUE {
            let at = self.span(first, last);
            self.report.error(at, format!("this text is longer than {MAX_VALUE} bytes"));
            return false;
        }
        true
    }

    /// Resolves the entities of a piece of the file that starts at `start`.
    fn unescape(&mut self, raw: &str, start: usize) -> String {
        let mut out = String::with_capacity(raw.len());
        let mut rest = raw;
        while let Some(position) = rest.find('&') {
            out.push_str(&rest[..position]);
            rest = &rest[position..];
            let name_length = rest[1..].find(|c: char| !(c.is_ascii_alphanumeric() || c == '#' || c == '_'));
            let Some(length) = name_length.filter(|length| *length > 0 && rest[1 + length..].starts_with(';')) else {
                // A `&` that begins no entity is kept as it is, as in the engine's parser.
                out.push('&');
                rest = &rest[1..];
                continue;
            };
            let name = &rest[1..=length];
            match entity(name) {
                Some(character) => out.push(character),
                None => {
                    let offset = start + (raw.len() - rest.len());
                    let at = self.span(offset, offset + length + 2);
                    self.report.error_help(at, format!("`&{};` is not defined", shown(name)), || {
                        "valid: &lt; &gt; &amp; &quot; &apos; and &#…;".to_owned()
                    });
                }
            }
            rest = &rest[length + 2..];
        }
        out.push_str(rest);
        out
    }

    fn start(&mut self, start: usize, end: usize, empty: bool) -> bool {
        let span = self.span(start, end);
        self.elements += 1;
        if self.elements > MAX_ELEMENTS {
            self.report.error(span, format!("the file has more than {MAX_ELEMENTS} elements"));
            return false;
        }
        if self.open.len() >= MAX_DEPTH {
            self.report.error(span, format!("elements are nested deeper than {MAX_DEPTH}"));
            return false;
        }
        // `<name a="1">` or `<name a="1"/>`: what is between `<` and `>` or `/>`.
        let content = &self.text[start + 1..end - if empty { 2 } else { 1 }];
        let name_length = content.find(char::is_whitespace).unwrap_or(content.len());
        let name = &content[..name_length];
        if !name.starts_with(|c: char| c.is_alphabetic() || c == '_') || name.contains(['<', '"', '\'', '=', '&']) {
            self.report.error_help(span, format!("`<{}` does not start an element", shown(name)), || {
                "a name must follow `<` at once; write `&lt;` for the sign itself".to_owned()
            });
            return false;
        }
        if name.len() > MAX_NAME {
            self.report.error(span, format!("an element's name is longer than {MAX_NAME} bytes"));
            return false;
        }
        let Some(attributes) = self.attributes(&content[name_length..], start + 1 + name_length) else { return false };
        let (line, column) = self.advance(start);
        let element =
            Element { name: name.to_owned(), span, line, column, attributes, children: Vec::new(), text: None };
        if empty {
            self.close(element);
        } else {
            self.open.push(Open { element, text: String::new(), text_span: None });
        }
        true
    }

    /// Line and column of an offset, which must not be before the offset of the last call.
    fn advance(&mut self, offset: usize) -> (u32, u32) {
        let (mut line, mut column, last) = self.cursor;
        for character in self.text[last..offset].chars() {
            (line, column) = if character == '\n' { (line + 1, 1) } else { (line, column + 1) };
        }
        self.cursor = (line, column, offset);
        (line, column)
    }

    fn close(&mut self, element: Element) {
        if let Some(parent) = self.open.last_mut() {
            parent.element.children.push(element);
        } else if self.root.is_none() {
            self.root = Some(element);
        } else {
            self.report.error(element.span, format!("a second root element <{}>", shown(&element.name)));
        }
    }

    fn close_last(&mut self) {
        if let Some(mut open) = self.open.pop() {
            open.element.text = open.text_span.map(|span| Value::new(&open.text, span));
            self.close(open.element);
        }
    }

    fn end(&mut self, start: usize, end: usize) -> bool {
        let name = self.text[start + 2..end - 1].trim();
        let span = self.span(start, end);
        let exact = self.open.iter().rposition(|open| open.element.name == name);
        let any_case = || self.open.iter().rposition(|open| open.element.name.eq_ignore_ascii_case(name));
        let Some(index) = exact.or_else(any_case) else {
            let help = match self.open.last() {
                Some(open) => format!("<{}> of line {} is open", shown(&open.element.name), open.element.line),
                None => "no element is open".to_owned(),
            };
            self.report.error_help(span, format!("</{}> closes nothing", shown(name)), || help);
            return true;
        };
        let (line, column) = self.advance(start);
        while self.open.len() > index + 1 {
            let inner = &self.open[self.open.len() - 1].element;
            let (at, message) = (inner.span, format!("<{}> is never closed", shown(&inner.name)));
            self.report
                .error_help(at, message, || format!("its parent's </{}> stands at {line}:{column}", shown(name)));
            self.close_last();
        }
        let opened = &self.open[index].element.name;
        if opened != name {
            self.report.note(span, format!("</{}> closes <{}>", shown(name), shown(opened)));
        }
        self.close_last();
        true
    }

    /// Parses the attributes of a tag; `content` starts at `offset` in the file. `None` if there are too many.
    fn attributes(&mut self, content: &str, offset: usize) -> Option<Vec<Attribute>> {
        let mut attributes: Vec<Attribute> = Vec::new();
        let mut at = 0;
        loop {
            at += content[at..].len() - content[at..].trim_start().len();
            if at == content.len() {
                return Some(attributes);
            }
            self.all_attributes += 1;
            if attributes.len() == MAX_ATTRIBUTES || self.all_attributes > MAX_ALL_ATTRIBUTES {
                let here = self.span(offset + at, offset + content.len());
                let limits = format!("valid: {MAX_ATTRIBUTES} in an element, {MAX_ALL_ATTRIBUTES} in a file");
                self.report.error_help(here, "too many attributes", || limits);
                return None;
            }
            let key_end = at
                + content[at..]
                    .find(|c: char| c.is_whitespace() || matches!(c, '=' | '"' | '\''))
                    .unwrap_or(content.len() - at);
            let name = &content[at..key_end];
            let name_span = self.span(offset + at, offset + key_end.max(at + 1));
            let after = key_end + (content[key_end..].len() - content[key_end..].trim_start().len());
            if name.is_empty() || name.len() > MAX_NAME || !content[after..].starts_with('=') {
                let what = if name.len() > MAX_NAME {
                    format!("an attribute's name is longer than {MAX_NAME} bytes")
                } else if name.is_empty() {
                    format!("`{}` is not an attribute", shown(&content[at..]))
                } else {
                    format!("attribute `{}` has no value", shown(name))
                };
                self.report.error_help(name_span, what, || "valid: name=\"value\"".to_owned());
                // Continues after the next white space, so that each invalid piece gets one message.
                at = content[at..].find(char::is_whitespace).map_or(content.len(), |space| at + space);
                continue;
            }
            let start = after + 1 + (content[after + 1..].len() - content[after + 1..].trim_start().len());
            let (value, next) = self.value(content, start, offset, name)?;
            if let Some(value) = value {
                let twice = attributes.iter().any(|other: &Attribute| other.name.eq_ignore_ascii_case(name));
                if twice {
                    self.report.error(name_span, format!("attribute `{}` stands twice", shown(name)));
                } else {
                    attributes.push(Attribute { name: name.to_owned(), name_span, value });
                }
            }
            at = next;
        }
    }

    /// Parses the value of attribute `name` at `start` of `content`, quoted or not; no value after an error. Also returns
    /// where in `content` the next attribute may start.
    fn value(&mut self, content: &str, start: usize, offset: usize, name: &str) -> Option<(Option<Value>, usize)> {
        let opening = content[start..].chars().next();
        let (first, last, next) = match opening {
            // Curly quotes, as word processors write them; no value starts with one.
            Some(quote) if let Some(closing) = curly(quote) => {
                let first = start + quote.len_utf8();
                let Some(length) = content[first..].find(closing) else {
                    let at = self.span(offset + start, offset + content.len());
                    let message = format!("the quote of attribute `{}` is never closed", shown(name));
                    self.report.error_help(at, message, || STRAIGHT.to_owned());
                    return Some((None, content.len()));
                };
                let last = first + length;
                let end = content[last..].chars().next().map_or(last, |quote| last + quote.len_utf8());
                let at = self.span(offset + start, offset + end);
                let message = format!("the quotes of attribute `{}` are curly", shown(name));
                self.report.warning(at, message, || Some(STRAIGHT.to_owned()));
                (first, last, end)
            }
            Some(quote @ ('"' | '\'')) => match content[start + 1..].find(quote) {
                Some(length) => (start + 1, start + 1 + length, start + 2 + length),
                None => {
                    let at = self.span(offset + start, offset + content.len());
                    self.report.error(at, format!("the quote of attribute `{}` is never closed", shown(name)));
                    return Some((None, content.len()));
                }
            },
            _ => {
                let length = content[start..].find(char::is_whitespace).unwrap_or(content.len() - start);
                (start, start + length, start + length)
            }
        };
        let (raw, span) = (&content[first..last], self.span(offset + first, offset + last));
        let quoted = first > start;
        let problem = if raw.len() > MAX_VALUE {
            Some(format!("the value of `{}` is longer than {MAX_VALUE} bytes", shown(name)))
        } else if raw.contains('<') {
            Some(format!("the value of `{}` contains `<`: is a quote missing?", shown(name)))
        } else if !quoted && raw.is_empty() {
            Some(format!("attribute `{}` has no value", shown(name)))
        } else if !quoted && raw.contains(['=', '"', '\'']) {
            Some(format!("`{}` is ambiguous without quotes", shown(raw)))
        } else {
            None
        };
        if let Some(problem) = problem {
            self.report.error_help(span, problem, || format!("valid: {}=\"value\"", shown(name)));
            return Some((None, next));
        }
        let text = self.unescape(raw, offset + first);
        Some((Some(Value::new(&text, span)), next))
    }
}

const STRAIGHT: &str = "valid: straight quotes, name=\"value\"; a word processor turned them";

/// The quotes that may close a value opened with the curly quote `opening`; `None` if `opening` is no curly quote.
fn curly(opening: char) -> Option<&'static [char]> {
    match opening {
        '\u{201c}' | '\u{201d}' | '\u{201e}' | '\u{2033}' => Some(&['\u{201c}', '\u{201d}', '\u{2033}', '"']),
        '\u{2018}' | '\u{2019}' | '\u{201a}' => Some(&['\u{2018}', '\u{2019}', '\'']),
        _ => None,
    }
}

/// The character of a predefined or numeric entity.
fn entity(name: &str) -> Option<char> {
    let code = match name {
        "lt" => return Some('<'),
        "gt" => return Some('>'),
        "amp" => return Some('&'),
        "quot" => return Some('"'),
        "apos" => return Some('\''),
        _ => name.strip_prefix('#')?,
    };
    let number = match code.strip_prefix(['x', 'X']) {
        Some(hexadecimal) => u32::from_str_radix(hexadecimal, 16).ok()?,
        None => code.parse().ok()?,
    };
    char::from_u32(number).filter(|c| !c.is_control() || matches!(c, '\t' | '\n' | '\r'))
}
