//! XML of which every element and value has its place in the text, so that a finding can name its line and a value can be
//! replaced without touching another byte.
//!
//! Names keep their prefixes, which need not be declared: MuJoCo and most readers of URDF know nothing of namespaces either.
//! Entities that a document defines are refused, so none expands.

use std::ops::Range;

use quick_xml::Reader;
use quick_xml::escape::unescape;
use quick_xml::events::{BytesStart, Event};

use super::error::Broken;

/// The most elements of a document: far more than the largest robots and scenes have (some ten thousand).
pub const MOST_ELEMENTS: usize = 500_000;
/// The most elements inside each other; models have about twenty.
const MOST_DEPTH: usize = 256;
/// The most attributes of an element; MuJoCo's richest has about fifty.
const MOST_ATTRIBUTES: usize = 256;

/// A document and the places of everything in it.
#[derive(Debug)]
pub struct Document {
    text: String,
    /// In the order of their start tags; the first is the root.
    elements: Vec<Element>,
    /// The byte with which each line begins.
    lines: Vec<usize>,
}

#[derive(Debug)]
struct Element {
    name: String,
    attributes: Vec<Attribute>,
    children: Vec<usize>,
    /// The bytes of its start tag, brackets included.
    tag: Range<usize>,
    /// The bytes from its start tag to its end tag.
    whole: Range<usize>,
    /// The text directly in it, without spaces around it.
    text: String,
}

/// An attribute as it is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Attribute {
    pub name: String,
    /// With its references replaced.
    pub value: String,
    /// The bytes between the quotes.
    pub value_bytes: Range<usize>,
    /// The bytes from the name to the closing quote.
    pub bytes: Range<usize>,
}

/// An element of a document.
#[derive(Debug, Clone, Copy)]
pub struct Node<'a> {
    document: &'a Document,
    element: usize,
}

impl Document {
    /// Parses a document.
    ///
    /// # Errors
    /// If it is not well-formed, defines entities, or asks for more than the limits above.
    pub fn parse(bytes: Vec<u8>) -> Result<Self, Broken> {
        if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
            return Err(Broken::new(1, "it is UTF-16 text; save it as UTF-8"));
        }
        let text = readable(bytes);
        let lines = line_starts(&text);
        let mut tree = Tree::default();
        let mut reader = Reader::from_str(&text);
        let broken = |byte: usize, problem: String| Broken::new(line_of(&lines, byte), problem);
        loop {
            let start = reader.buffer_position() as usize;
            let event = match reader.read_event() {
                Ok(event) => event,
                Err(error) => return Err(broken(reader.error_position() as usize, error.to_string())),
            };
            let done = match event {
                Event::Start(tag) => tree.open(&text, &tag, false),
                Event::Empty(tag) => tree.open(&text, &tag, true),
                Event::End(tag) => tree.close(offset(&text, &tag) + tag.len() + ">".len()),
                Event::Text(content) => tree.add_text(&content.into_inner()),
                Event::DocType(content) if content.contains("<!ENTITY") => {
                    Err("it defines entities, which gprop does not expand; write out what they stand for".to_owned())
                }
                Event::Eof => break,
                _ => Ok(()),
            };
            done.map_err(|problem| broken(start, problem))?;
        }
        if let Some(&open) = tree.open.last() {
            let element = &tree.elements[open];
            return Err(broken(element.tag.start, format!("<{}> is never closed", element.name)));
        }
        if tree.elements.is_empty() {
            return Err(Broken::new(1, "it has no element"));
        }
        Ok(Self { elements: tree.elements, text, lines })
    }

    pub fn root(&self) -> Node<'_> {
        Node { document: self, element: 0 }
    }

    /// The text as it is, apart from bytes that are not UTF-8.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The element whose start tag begins at `byte`.
    pub fn element_at(&self, byte: usize) -> Option<Node<'_>> {
        let element = self.elements.binary_search_by_key(&byte, |element| element.tag.start).ok()?;
        Some(Node { document: self, element })
    }
}

/// The elements that were met so far.
#[derive(Default)]
struct Tree {
    elements: Vec<Element>,
    /// Those that are not closed yet, outermost first.
    open: Vec<usize>,
}

impl Tree {
    fn open(&mut self, text: &str, tag: &BytesStart, is_empty: bool) -> Result<(), String> {
        let start = offset(text, tag);
        let end = start + tag.len() + if is_empty { "/>".len() } else { ">".len() };
        let bytes = start - "<".len()..end;
        let element = self.elements.len();
        match self.open.last() {
            _ if element >= MOST_ELEMENTS => return Err(format!("it has more than {MOST_ELEMENTS} elements")),
            _ if self.open.len() >= MOST_DEPTH => {
                return Err(format!("its elements lie in one another more than {MOST_DEPTH} deep"));
            }
            Some(&parent) => self.elements[parent].children.push(element),
            None if element > 0 => return Err("it has a second root element".to_owned()),
            None => {}
        }
        self.elements.push(Element {
            name: tag.name().as_ref().to_owned(),
            attributes: attributes(text, tag)?,
            children: Vec::new(),
            whole: bytes.clone(),
            tag: bytes,
            text: String::new(),
        });
        if !is_empty {
            self.open.push(element);
        }
        Ok(())
    }

    fn close(&mut self, end: usize) -> Result<(), String> {
        let element = self.open.pop().ok_or("an end tag has no start tag")?;
        self.elements[element].whole.end = end;
        Ok(())
    }

    fn add_text(&mut self, text: &str) -> Result<(), String> {
        let text = text.trim_matches(|c: char| c.is_whitespace() || c == '\0');
        match self.open.last() {
            _ if text.is_empty() => {}
            Some(&element) => self.elements[element].text.push_str(text),
            None => return Err("there is text outside of its elements".to_owned()),
        }
        Ok(())
    }
}

fn attributes(text: &str, tag: &BytesStart) -> Result<Vec<Attribute>, String> {
    let mut found: Vec<Attribute> = Vec::new();
    for attribute in tag.attributes().with_checks(false) {
        let attribute = attribute.map_err(|error| format!("<{}>: {error}", tag.name().as_ref()))?;
        let name = attribute.key.as_ref();
        if found.len() >= MOST_ATTRIBUTES {
            return Err(format!("<{}> has more than {MOST_ATTRIBUTES} attributes", tag.name().as_ref()));
        }
        if found.iter().any(|other| other.name == name) {
            return Err(format!("<{}> has the attribute {name} twice", tag.name().as_ref()));
        }
        let value = unescape(&attribute.value).map_err(|error| format!("attribute {name}: {error}"))?;
        let value_start = offset(text, &attribute.value);
        let value_bytes = value_start..value_start + attribute.value.len();
        found.push(Attribute {
            name: name.to_owned(),
            value: value.into_owned(),
            bytes: offset(text, name)..value_bytes.end + 1,
            value_bytes,
        });
    }
    Ok(found)
}

/// The place of `part` in the text that it is a part of.
fn offset(text: &str, part: &str) -> usize {
    part.as_ptr().addr() - text.as_ptr().addr()
}

/// The text of a file. Bytes that are not UTF-8 (in comments of old files, mostly) become question marks, one for each, so
/// that every other byte keeps its place.
fn readable(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes).unwrap_or_else(|error| {
        let bytes = error.into_bytes();
        let mut text = String::with_capacity(bytes.len());
        for chunk in bytes.utf8_chunks() {
            text.push_str(chunk.valid());
            text.extend(chunk.invalid().iter().map(|_| '?'));
        }
        text
    })
}

/// The byte with which each line begins.
pub fn line_starts(text: &str) -> Vec<usize> {
    let after = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(at, _)| at + 1);
    std::iter::once(0).chain(after).collect()
}

/// The line of a byte, counted from 1.
pub fn line_of(lines: &[usize], byte: usize) -> usize {
    lines.partition_point(|start| *start <= byte).max(1)
}

impl<'a> Node<'a> {
    fn get(self) -> &'a Element {
        &self.document.elements[self.element]
    }

    pub fn name(self) -> &'a str {
        &self.get().name
    }

    /// The text directly in it, without spaces around it.
    pub fn text(self) -> &'a str {
        &self.get().text
    }

    pub fn attributes(self) -> &'a [Attribute] {
        &self.get().attributes
    }

    pub fn attribute(self, name: &str) -> Option<&'a Attribute> {
        self.get().attributes.iter().find(|attribute| attribute.name == name)
    }

    pub fn value(self, name: &str) -> Option<&'a str> {
        self.attribute(name).map(|attribute| attribute.value.as_str())
    }

    pub fn children(self) -> impl Iterator<Item = Node<'a>> {
        self.get().children.iter().map(move |element| Node { document: self.document, element: *element })
    }

    /// The first child of that name.
    pub fn child(self, name: &str) -> Option<Node<'a>> {
        self.children().find(|child| child.name() == name)
    }

    /// The bytes of its start tag, brackets included.
    pub fn tag(self) -> Range<usize> {
        self.get().tag.clone()
    }

    /// The bytes from its start tag to its end tag.
    pub fn whole(self) -> Range<usize> {
        self.get().whole.clone()
    }

    /// The line on which its start tag begins, counted from 1.
    pub fn line(self) -> usize {
        line_of(&self.document.lines, self.get().tag.start)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(text: &str) -> String {
        Document::parse(text.as_bytes().to_vec()).unwrap_err().to_string()
    }

    #[test]
    fn every_value_has_its_bytes_and_its_line() {
        let text = "<?xml version='1.0'?>\n<!-- é -->\n<robot name = 'a&amp;b'>\n  <x:link name=\"l\"/>\n <mu> 0.5 </mu></robot>\n";
        let document = Document::parse(text.as_bytes().to_vec()).unwrap();
        let root = document.root();
        let name = root.attribute("name").unwrap();
        assert_eq!((name.value.as_str(), &text[name.value_bytes.clone()]), ("a&b", "a&amp;b"));
        assert_eq!(&text[name.bytes.clone()], "name = 'a&amp;b'");
        let link = root.child("x:link").unwrap();
        assert_eq!((root.line(), link.line(), &text[link.tag()]), (3, 4, "<x:link name=\"l\"/>"));
        assert_eq!(
            (root.child("mu").unwrap().text(), &text[root.child("mu").unwrap().whole()]),
            ("0.5", "<mu> 0.5 </mu>")
        );
        assert!(text[root.whole()].ends_with("</robot>"));
        assert_eq!(document.element_at(link.tag().start).unwrap().name(), "x:link");
    }

    #[test]
    fn bytes_that_are_not_utf_8_move_nothing() {
        let document = Document::parse(b"<a><!-- caf\xe9 \xff\xfe --><b c='\xe9'/></a>".to_vec()).unwrap();
        let value = document.root().child("b").unwrap().attribute("c").unwrap().clone();
        assert_eq!((value.value.as_str(), value.value_bytes), ("?", 25..26));
    }

    #[test]
    fn broken_documents_are_refused_with_their_line() {
        for (text, words) in [
            ("", "no element"),
            ("<a>\n<b>\n</a>", "line 3"),
            ("<a>\n <b>", "line 2: <b> is never closed"),
            ("<a/>\n<b/>", "line 2: it has a second root"),
            ("<a b='1' b='2'/>", "attribute b twice"),
            ("<a b='&unknown;'/>", "unknown"),
            ("<!DOCTYPE a [<!ENTITY x 'y'>]>\n<a b='&x;'/>", "defines entities"),
            ("<a></a></a>", "line 1"),
            ("<a b=1/>", "line 1"),
        ] {
            assert!(problem(text).contains(words), "no {words:?} for {text:?}: {}", problem(text));
        }
        assert!(problem("\u{0}").contains("line 1"));
        assert!(Document::parse(b"\xff\xfe<\0a\0".to_vec()).unwrap_err().to_string().contains("UTF-16"));
    }

    #[test]
    fn what_a_document_may_ask_for_is_bounded() {
        let deep = "<a>".repeat(MOST_DEPTH + 1) + &"</a>".repeat(MOST_DEPTH + 1);
        assert!(problem(&deep).contains("256 deep"));
        let many = format!("<a>{}</a>", "<b/>".repeat(MOST_ELEMENTS));
        assert!(problem(&many).contains("more than 500000 elements"));
        let wide: String = (0..=MOST_ATTRIBUTES).map(|n| format!(" a{n}=''")).collect();
        assert!(problem(&format!("<a{wide}/>")).contains("more than 256 attributes"));
    }
}
