//! The elements of an XML file with look-up by id, since COLLADA elements refer to elements that come later in the file.

use crate::guard;
use crate::scene::context::Context;
use crate::scene::error::{Place, SceneError};
use quick_xml::escape::unescape;
use quick_xml::events::Event;
use std::borrow::Cow;
use std::collections::HashMap;

/// An element. Its children are indices into [`Document::elements`].
#[derive(Debug, Default)]
pub(super) struct Element<'a> {
    /// Tag name without its prefix.
    name: &'a str,
    attributes: Vec<(&'a str, &'a str)>,
    /// Text as written, joined across child elements.
    text: Cow<'a, str>,
    children: Vec<u32>,
    /// Byte offset of the element in the file.
    at: u64,
}

/// A parsed file.
#[derive(Debug)]
pub(super) struct Document<'a> {
    elements: Vec<Element<'a>>,
    by_id: HashMap<&'a str, u32>,
}

/// Memory is booked in steps of at least twice this many bytes.
const BLOCK: usize = 1 << 16;

impl<'a> Document<'a> {
    /// Reads a file; element 0 is its root.
    pub(super) fn read(text: &'a str, context: &mut Context<'_>) -> Result<Self, SceneError> {
        let file = context.file;
        // The reader does not count a byte order mark.
        let (whole, text) = (text.len(), text.trim_start_matches('\u{feff}'));
        let skipped = (whole - text.len()) as u64;
        let mut reader = quick_xml::Reader::from_str(text);
        let config = reader.config_mut();
        config.check_end_names = false;
        config.allow_dangling_amp = true;
        let mut this = Self { elements: Vec::new(), by_id: HashMap::new() };
        let mut open: Vec<u32> = Vec::new();
        let (mut held, mut booked) = (0, 0);
        loop {
            let start = reader.buffer_position() as usize;
            let fail = |what: String| SceneError::new(file, Place::Byte(skipped + start as u64), what);
            let event = guard::call("quick-xml", || reader.read_event()).map_err(&fail)?;
            let end = reader.buffer_position() as usize;
            match event.map_err(|error| fail(error.to_string()))? {
                Event::Eof => break,
                Event::Start(_) | Event::Empty(_) => {
                    let raw = text[start..end].trim_start_matches('<').trim_end_matches('>');
                    let empty = raw.ends_with('/');
                    let raw = raw.trim_end_matches('/');
                    let element = element(raw, skipped + start as u64).map_err(&fail)?;
                    held += size_of::<Element<'_>>() + 24 + element.attributes.len() * 32;
                    let index = this.elements.len() as u32;
                    if let Some(id) = element.attribute("id") {
                        held += 32;
                        this.by_id.entry(id).or_insert(index);
                    }
                    if let Some(parent) = open.last() {
                        this.elements[*parent as usize].children.push(index);
                    } else if index > 0 {
                        return Err(fail("a second element beside the first one".to_owned()));
                    }
                    this.elements.push(element);
                    if !empty {
                        open.push(index);
                    }
                }
                Event::End(_) => _ = open.pop(),
                Event::Text(_) | Event::GeneralRef(_) => held += this.push(&open, &text[start..end]),
                Event::CData(_) => {
                    let raw = text[start..end].strip_prefix("<![CDATA[").and_then(|raw| raw.strip_suffix("]]>"));
                    held += this.push(&open, raw.unwrap_or_default());
                }
                _ => {}
            }
            // Growing lists double their capacity, so twice the bytes are booked.
            if 2 * held > booked {
                context.take("the elements", 1, 2 * BLOCK.max(2 * held - booked))?;
                booked += 2 * BLOCK.max(2 * held - booked);
            }
        }
        Ok(this)
    }

    /// Adds text to the innermost open element; returns the number of bytes that it allocates.
    fn push(&mut self, open: &[u32], raw: &'a str) -> usize {
        let Some(open) = open.last() else { return 0 };
        // Blanks between children only separate words.
        let raw = if raw.trim().is_empty() { " " } else { raw };
        let text = &mut self.elements[*open as usize].text;
        if text.trim().is_empty() {
            *text = Cow::Borrowed(raw);
            return 0;
        }
        let before = text.len();
        let borrowed = matches!(text, Cow::Borrowed(_));
        text.to_mut().push_str(raw);
        raw.len() + if borrowed { before } else { 0 }
    }

    /// The root; `None` in an empty file.
    pub(super) fn root(&self) -> Option<&Element<'a>> {
        self.elements.first()
    }

    pub(super) fn get(&self, index: u32) -> &Element<'a> {
        &self.elements[index as usize]
    }

    /// The element that a URL within this file (`#id`), or an id, refers to.
    pub(super) fn find(&self, url: &str) -> Option<u32> {
        self.by_id.get(url.strip_prefix('#').unwrap_or(url)).copied()
    }

    /// The children with a name.
    pub(super) fn children<'d>(&'d self, of: &'d Element<'a>, name: &'d str) -> impl Iterator<Item = &'d Element<'a>> {
        self.all_children(of).map(|(_, child)| child).filter(move |child| child.name == name)
    }

    /// All children with their indices.
    pub(super) fn all_children<'d>(&'d self, of: &'d Element<'a>) -> impl Iterator<Item = (u32, &'d Element<'a>)> {
        of.children.iter().map(|child| (*child, self.get(*child)))
    }

    /// The descendant along a path of names, at each step the first child with the name.
    pub(super) fn descend<'d>(&'d self, from: &'d Element<'a>, names: &[&str]) -> Option<&'d Element<'a>> {
        names.iter().try_fold(from, |element, name| {
            self.all_children(element).map(|(_, child)| child).find(|child| child.name == *name)
        })
    }

    /// The first element with a name, anywhere in the file.
    pub(super) fn first(&self, name: &str) -> Option<u32> {
        self.elements.iter().position(|element| element.name == name).map(|index| index as u32)
    }

    /// The indices of all elements with a name.
    pub(super) fn all<'d>(&'d self, name: &'d str) -> impl Iterator<Item = u32> {
        (0..).zip(&self.elements).filter(move |(_, element)| element.name == name).map(|(index, _)| index)
    }
}

impl<'a> Element<'a> {
    pub(super) fn name(&self) -> &'a str {
        self.name
    }

    /// An attribute as written.
    pub(super) fn attribute(&self, name: &str) -> Option<&'a str> {
        self.attributes.iter().find(|(own, _)| *own == name).map(|(_, value)| *value)
    }

    /// The text as written, without blanks around it.
    pub(super) fn text(&self) -> &str {
        self.text.trim()
    }

    /// An attribute that is a whole number; `otherwise` if it is missing.
    pub(super) fn count(&self, name: &str, otherwise: usize) -> Result<usize, (u64, String)> {
        let Some(written) = self.attribute(name) else { return Ok(otherwise) };
        written.trim().parse().map_err(|_| self.wrong(format!("`{name}` is no whole number from 0 on")))
    }

    /// Describes a fault of this element, with its position.
    pub(super) fn wrong(&self, what: String) -> (u64, String) {
        (self.at, format!("<{}>: {what}", self.name))
    }

    /// The most bytes that the numbers of the element's text take.
    pub(super) fn size_of_numbers<T>(&self) -> u64 {
        (self.text.len() as u64 / 2 + 1) * size_of::<T>() as u64
    }

    /// The numbers of the element's text. A word that is not a number is an error. [`Self::size_of_numbers`] is booked; the caller gives it
    /// back when the numbers are dropped.
    pub(super) fn numbers<T: std::str::FromStr>(&self, context: &mut Context<'_>) -> Result<Vec<T>, SceneError> {
        context.budget.take(context.file, "the numbers of an element", self.size_of_numbers::<T>())?;
        let read = |word: &str| {
            word.parse().map_err(|_| {
                let word: String = word.chars().take(20).collect();
                let (at, what) = self.wrong(format!("`{word}` is no number of its kind"));
                let error = SceneError::new(context.file, Place::Byte(at), what);
                if word.contains(',') { error.help("valid: numbers with a point, apart by spaces") } else { error }
            })
        };
        self.text.split_ascii_whitespace().map(read).collect()
    }
}

/// Parses the name and attributes of a tag, given without its brackets.
fn element(raw: &str, at: u64) -> Result<Element<'_>, String> {
    let end = raw.find(|letter: char| letter.is_ascii_whitespace()).unwrap_or(raw.len());
    let name = &raw[..end];
    let name = name.rsplit_once(':').map_or(name, |(_, name)| name);
    let mut attributes = Vec::new();
    let mut rest = raw[end..].trim_start();
    while let Some((key, after)) = rest.split_once('=') {
        let after = after.trim_start();
        let quote = after.chars().next().filter(|quote| matches!(quote, '"' | '\''));
        let quote = quote.ok_or_else(|| format!("<{name}>: an attribute without quotes"))?;
        let (value, after) =
            after[1..].split_once(quote).ok_or_else(|| format!("<{name}>: an attribute without a closing quote"))?;
        attributes.push((key.trim(), value));
        rest = after.trim_start();
    }
    Ok(Element { name, attributes, at, ..Element::default() })
}

/// The text with its entities replaced; unchanged if they are malformed.
pub(super) fn plain(text: &str) -> Cow<'_, str> {
    unescape(text).unwrap_or(Cow::Borrowed(text))
}
