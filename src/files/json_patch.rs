//! Changes of a JSON text that leave every other byte as it is: order, spaces, and how numbers are written.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::de::IgnoredAny;
use serde_json::{Map, Value};

use super::{BYTE_ORDER_MARK, json};

/// What becomes of a value.
#[derive(Debug, Clone, PartialEq)]
pub enum Patch {
    /// It is replaced.
    Set(Value),
    /// It is taken out of its object.
    Remove,
    /// Members of an object change; those that it does not have are added behind the others.
    Members(Vec<(String, Patch)>),
    /// Items of a list change, and more follow behind the last one.
    Items { changed: BTreeMap<usize, Patch>, added: Vec<Value> },
}

impl Default for Patch {
    fn default() -> Self {
        Self::Members(Vec::new())
    }
}

impl Patch {
    /// The change of a member of this object. A change of the whole object is forgotten.
    pub fn member(&mut self, key: &str) -> &mut Self {
        if !matches!(self, Self::Members(_)) {
            *self = Self::default();
        }
        let Self::Members(members) = self else { unreachable!("it has just been made so") };
        let at = members.iter().position(|(name, _)| name == key).unwrap_or_else(|| {
            members.push((key.to_owned(), Self::default()));
            members.len() - 1
        });
        &mut members[at].1
    }

    /// The change of an item of this list.
    pub fn item(&mut self, index: usize) -> &mut Self {
        self.items().0.entry(index).or_default()
    }

    /// Adds an item to this list.
    pub fn add(&mut self, value: Value) {
        self.items().1.push(value);
    }

    /// Replaces the value.
    pub fn set(&mut self, value: impl Into<Value>) {
        *self = Self::Set(value.into());
    }

    fn items(&mut self) -> (&mut BTreeMap<usize, Self>, &mut Vec<Value>) {
        if !matches!(self, Self::Items { .. }) {
            *self = Self::Items { changed: BTreeMap::new(), added: Vec::new() };
        }
        match self {
            Self::Items { changed, added } => (changed, added),
            _ => unreachable!("it has just been made so"),
        }
    }

    /// The value where there was none; `None` for a change that needs one.
    pub fn into_value(self) -> Option<Value> {
        match self {
            Self::Set(value) => Some(value),
            Self::Remove => None,
            Self::Members(members) => {
                let values = members.into_iter().filter_map(|(key, patch)| Some((key, patch.into_value()?)));
                Some(Value::Object(values.collect::<Map<_, _>>()))
            }
            Self::Items { added, .. } => Some(Value::Array(added)),
        }
    }

    /// The text with the changes; `None` if it is not JSON, or a changed value is neither object nor list where members or items
    /// of it change.
    pub fn applied(self, text: &str) -> Option<String> {
        let start = if text.starts_with(BYTE_ORDER_MARK) { BYTE_ORDER_MARK.len() } else { 0 };
        json::read::<IgnoredAny>(&text.as_bytes()[start..]).ok()?;
        let mut writer = Writer { text, out: String::with_capacity(text.len()), copied: 0 };
        writer.value(start_of_value(text, start)?, self)?;
        writer.copy_to(text.len());
        Some(writer.out)
    }
}

/// Where the items of a list stand that is a member of the whole object; none if there is no such list. The text is JSON.
pub fn places_of_items(text: &str, list: &str) -> Vec<Range<usize>> {
    let find = || {
        let members = children(text, start_of_value(text, 0)?, '{')?;
        let is_list = |member: &&Child| member.key.clone().is_some_and(|key| text[key].trim_matches('"') == list);
        children(text, members.iter().find(is_list)?.value, '[')
    };
    find().unwrap_or_default().iter().map(|item| item.value..item.end).collect()
}

/// The changed text while it is written.
struct Writer<'a> {
    text: &'a str,
    out: String,
    /// Up to here, the text is written.
    copied: usize,
}

impl Writer<'_> {
    fn copy_to(&mut self, end: usize) {
        self.out.push_str(&self.text[self.copied..end]);
        self.copied = end;
    }

    /// Writes the value that begins at `start`, as the patch changes it.
    fn value(&mut self, start: usize, patch: Patch) -> Option<()> {
        match patch {
            Patch::Set(value) => {
                self.copy_to(start);
                self.out.push_str(&value.to_string());
                self.copied = end_of_value(self.text, start)?;
            }
            // Only a member can be removed.
            Patch::Remove => return None,
            Patch::Members(changes) => self.members(start, changes)?,
            Patch::Items { changed, added } => self.items(start, changed, added)?,
        }
        Some(())
    }

    fn members(&mut self, start: usize, mut changes: Vec<(String, Patch)>) -> Option<()> {
        let children = children(self.text, start, '{')?;
        let mut kept = 0;
        for (n, child) in children.iter().enumerate() {
            let key: String = json::read(self.text[child.key.clone()?].as_bytes()).ok()?;
            let change = changes.iter().position(|(name, _)| *name == key).map(|at| changes.remove(at).1);
            match change {
                // With the comma before it, or behind it if no other stays before it.
                Some(Patch::Remove) if kept > 0 => {
                    self.copy_to(children[n - 1].end);
                    self.copied = child.end;
                    continue;
                }
                Some(Patch::Remove) => {
                    self.copy_to(child.begin());
                    self.copied = children.get(n + 1).map_or(child.end, Child::begin);
                    continue;
                }
                Some(patch) => self.value(child.value, patch)?,
                None => {}
            }
            kept += 1;
        }
        let added = changes.into_iter().filter_map(|(key, patch)| Some((key, patch.into_value()?)));
        let texts = added.map(|(key, value)| format!("{}:{value}", Value::String(key)));
        self.add(start, &children, kept, &texts.collect::<Vec<_>>());
        Some(())
    }

    fn items(&mut self, start: usize, mut changed: BTreeMap<usize, Patch>, added: Vec<Value>) -> Option<()> {
        let children = children(self.text, start, '[')?;
        for (index, child) in children.iter().enumerate() {
            if let Some(patch) = changed.remove(&index) {
                self.value(child.value, patch)?;
            }
        }
        if !changed.is_empty() {
            return None;
        }
        self.add(start, &children, children.len(), &added.iter().map(Value::to_string).collect::<Vec<_>>());
        Some(())
    }

    /// Adds texts behind the children of the object or list at `start`, of which `kept` stay, spaced like the first of them.
    fn add(&mut self, start: usize, children: &[Child], kept: usize, texts: &[String]) {
        if texts.is_empty() {
            return;
        }
        let first = children.first().map_or(start + 1, Child::begin);
        let space = &self.text[start + 1..first];
        self.copy_to(children.last().map_or(start + 1, |child| child.end));
        for (n, text) in texts.iter().enumerate() {
            if kept > 0 || n > 0 {
                self.out.push(',');
            }
            self.out.push_str(if children.is_empty() { "" } else { space });
            self.out.push_str(text);
        }
    }
}

/// A member of an object or an item of a list.
struct Child {
    /// Of a member: its name with the quotes.
    key: Option<Range<usize>>,
    /// Where the value begins.
    value: usize,
    /// Where the value ends.
    end: usize,
}

impl Child {
    fn begin(&self) -> usize {
        self.key.as_ref().map_or(self.value, |key| key.start)
    }
}

/// The children of the object or list that begins at `start` with `bracket`.
fn children(text: &str, start: usize, bracket: char) -> Option<Vec<Child>> {
    if !text[start..].starts_with(bracket) {
        return None;
    }
    let mut children: Vec<Child> = Vec::new();
    let mut at = start_of_value(text, start + 1)?;
    while !text[at..].starts_with(['}', ']']) {
        if text[at..].starts_with(',') {
            at = start_of_value(text, at + 1)?;
        }
        let begin = at;
        let key = (bracket == '{').then(|| end_of_string(text, at)).flatten().map(|end| begin..end);
        if let Some(key) = &key {
            let colon = start_of_value(text, key.end)?;
            at = start_of_value(text, colon + 1)?;
        }
        let (value, end) = (at, end_of_value(text, at)?);
        children.push(Child { key, value, end });
        at = start_of_value(text, end)?;
    }
    Some(children)
}

/// The first place from `at` on that is not space.
fn start_of_value(text: &str, at: usize) -> Option<usize> {
    Some(at + text.get(at..)?.find(|c: char| !c.is_ascii_whitespace())?)
}

fn end_of_string(text: &str, start: usize) -> Option<usize> {
    let bytes = text.as_bytes();
    let mut at = start + 1;
    while *bytes.get(at)? != b'"' {
        at += if bytes[at] == b'\\' { 2 } else { 1 };
    }
    Some(at + 1)
}

fn end_of_value(text: &str, start: usize) -> Option<usize> {
    let bytes = text.as_bytes();
    let (mut at, mut depth) = (start, 0_usize);
    loop {
        match *bytes.get(at)? {
            b'"' => at = end_of_string(text, at)?,
            b'{' | b'[' => (at, depth) = (at + 1, depth + 1),
            b'}' | b']' => (at, depth) = (at + 1, depth.checked_sub(1)?),
            b',' | b':' | b' ' | b'\n' | b'\r' | b'\t' => at += 1,
            // A number or a word.
            _ => {
                let is_end = |byte: &u8| matches!(byte, b',' | b']' | b'}' | b' ' | b'\n' | b'\r' | b'\t');
                at += bytes[at..].iter().position(is_end).unwrap_or(bytes.len() - at);
            }
        }
        if depth == 0 {
            return Some(at);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "{\n  \"a\": 1.50, \"list\" : [1e-05, {\"x\":\"}\\\"\"} ],\n  \"b\": {}\n}  ";

    fn patched(text: &str, change: impl FnOnce(&mut Patch)) -> String {
        let mut patch = Patch::default();
        change(&mut patch);
        patch.applied(text).unwrap()
    }

    #[test]
    fn what_does_not_change_keeps_its_bytes() {
        assert_eq!(patched(TEXT, |_| {}), TEXT);
        let changed = patched(TEXT, |patch| {
            patch.member("list").item(1).member("x").set(2);
            patch.member("list").add(true.into());
            patch.member("b").member("deep").member("er").set("é");
            patch.member("c").add(1.into());
        });
        let expected = TEXT
            .replace("\"}\\\"\"", "2")
            .replace("} ]", "},true ]")
            .replace("{}\n}", "{\"deep\":{\"er\":\"é\"}},\n  \"c\":[1]\n}");
        assert_eq!(changed, expected);
    }

    #[test]
    fn members_go_with_their_commas() {
        let without = |names: &[&str]| {
            patched(r#"{"a":1,"b":[2],"c":"3"}"#, |patch| {
                names.iter().for_each(|name| *patch.member(name) = Patch::Remove);
            })
        };
        assert_eq!(without(&["a"]), r#"{"b":[2],"c":"3"}"#);
        assert_eq!(without(&["b"]), r#"{"a":1,"c":"3"}"#);
        assert_eq!(without(&["a", "b"]), r#"{"c":"3"}"#);
        assert_eq!(without(&["b", "c"]), r#"{"a":1}"#);
        assert_eq!(without(&["a", "b", "c"]), "{}");
        assert_eq!(without(&["d"]), r#"{"a":1,"b":[2],"c":"3"}"#);
    }

    #[test]
    fn what_does_not_fit_changes_nothing() {
        let mut in_number = Patch::default();
        in_number.member("a").member("b").set(1);
        assert_eq!(in_number.applied(TEXT), None);
        let mut no_such_item = Patch::default();
        no_such_item.member("list").item(2).set(1);
        assert_eq!(no_such_item.applied(TEXT), None);
        assert_eq!(Patch::default().applied("{"), None);
        assert_eq!(Patch::default().applied("\u{feff}{} ").as_deref(), Some("\u{feff}{} "));
    }
}
