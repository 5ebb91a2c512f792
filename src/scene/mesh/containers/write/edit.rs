//! Changes of attributes and elements in a text, by bytes.

use std::ops::Range;

use super::super::xml::{Document, Node};

/// Changes that are applied together.
pub struct Edits<'a> {
    document: &'a Document,
    /// What replaces which bytes.
    changes: Vec<(Range<usize>, String)>,
}

impl<'a> Edits<'a> {
    pub fn of(document: &'a Document) -> Self {
        Self { document, changes: Vec::new() }
    }

    /// Gives an attribute a value; adds the attribute if the element does not have it.
    pub fn set(&mut self, node: Node, name: &str, value: &str) {
        match node.attribute(name) {
            Some(attribute) => self.changes.push((attribute.value_bytes.clone(), value.to_owned())),
            None => self.add(node, &format!("{name}=\"{value}\"")),
        }
    }

    /// Replaces an attribute with another one.
    pub fn replace(&mut self, node: Node, name: &str, new: &str) {
        if let Some(attribute) = node.attribute(name) {
            self.changes.push((attribute.bytes.clone(), new.to_owned()));
        }
    }

    /// Adds an attribute as it is written behind the last one.
    pub fn add(&mut self, node: Node, attribute: &str) {
        let tag = node.tag();
        let last = node.attributes().iter().map(|attribute| attribute.bytes.end).max();
        let at = last.unwrap_or(tag.start + "<".len() + node.name().len());
        self.changes.push((at..at, format!(" {attribute}")));
    }

    /// Adds an element on a line of its own behind `node`, indented alike.
    pub fn add_behind(&mut self, node: Node, element: &str) {
        let at = node.whole().end;
        self.changes.push((at..at, format!("{}{element}", self.line_break(node))));
    }

    /// Adds an element on a line of its own before `node`, indented alike.
    pub fn add_before(&mut self, node: Node, element: &str) {
        let at = node.tag().start;
        self.changes.push((at..at, format!("{element}{}", self.line_break(node))));
    }

    /// The end of a line and the spaces before `node`; nothing if it is not the first on its line.
    fn line_break(&self, node: Node) -> String {
        let before = &self.document.text()[..node.tag().start];
        let line = &before[before.rfind('\n').map_or(before.len(), |feed| feed + 1)..];
        if !line.trim().is_empty() || line.is_empty() && !before.ends_with('\n') {
            return String::new();
        }
        let feed = if before.contains("\r\n") { "\r\n" } else { "\n" };
        format!("{feed}{line}")
    }

    /// The bytes of the text with all changes.
    pub fn applied(mut self, bytes: &[u8]) -> Vec<u8> {
        self.changes.sort_by_key(|(range, _)| range.start);
        let mut new = Vec::with_capacity(bytes.len() + 1024);
        let mut at = 0;
        for (range, text) in &self.changes {
            new.extend_from_slice(&bytes[at..range.start]);
            new.extend_from_slice(text.as_bytes());
            at = range.end;
        }
        new.extend_from_slice(&bytes[at..]);
        new
    }
}

/// Numbers with nine significant digits and spaces between them.
pub fn numbers(all: impl IntoIterator<Item = f64>) -> String {
    let number = |value: f64| {
        let rounded: f64 = format!("{value:.8e}").parse().unwrap_or(value);
        // A zero without a sign.
        (rounded + 0.0).to_string()
    };
    all.into_iter().map(number).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_leave_every_other_byte() {
        let text = b"<a>\r\n\t<b  x = '1' />\r\n\t<!-- \xe9 --><c/>\r\n</a >\r\n";
        let document = Document::parse(text.to_vec()).unwrap();
        let (b, c) = (document.root().child("b").unwrap(), document.root().child("c").unwrap());
        let mut edits = Edits::of(&document);
        edits.add_behind(b, "<d/>");
        edits.set(b, "y", "3");
        edits.set(b, "x", "2");
        edits.set(c, "z", "4");
        edits.add_before(b, "<e/>");
        edits.add_before(c, "<f/>");
        let new = edits.applied(text);
        let expected =
            b"<a>\r\n\t<e/>\r\n\t<b  x = '2' y=\"3\" />\r\n\t<d/>\r\n\t<!-- \xe9 --><f/><c z=\"4\"/>\r\n</a >\r\n";
        assert_eq!(String::from_utf8_lossy(&new), String::from_utf8_lossy(expected));
    }

    #[test]
    fn numbers_have_nine_digits() {
        assert_eq!(numbers([1.0 / 3.0, -0.0, 1e-7, 2.5]), "0.333333333 0 0.0000001 2.5");
    }
}
