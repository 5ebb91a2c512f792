//! The text of a USD layer (`.usda`): prims with their metadata, attributes and relationships.
//!
//! What composes layers (references, payloads, sublayers, variants) is not resolved; a prim says whether it has some.

use super::super::Broken;

/// More levels than any layer nests its prims and values.
const MOST_DEPTH: usize = 200;
/// More prims than any asset has.
const MOST_PRIMS: usize = 1_000_000;

/// A prim and what it holds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Prim {
    /// `def`, `over` or `class`.
    pub specifier: String,
    /// Such as `Mesh`; empty if it has none.
    pub kind: String,
    pub name: String,
    /// The bytes of its head.
    pub head: std::ops::Range<usize>,
    /// Names of API schemas.
    pub schemas: Vec<String>,
    /// Whether other layers or variants would add to it.
    pub is_composed: bool,
    pub properties: Vec<(String, Value)>,
    pub children: Vec<Prim>,
}

/// A value, or what matters of it.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Numbers, those of tuples and lists one after the other.
    Numbers(Vec<f64>),
    /// Strings, tokens and paths.
    Texts(Vec<String>),
    /// Nothing, or what gprop has no use for.
    Other,
}

impl Prim {
    pub fn value(&self, name: &str) -> Option<&Value> {
        self.properties.iter().rev().find(|(own, _)| own == name).map(|(_, value)| value)
    }

    pub fn numbers(&self, name: &str) -> Option<&[f64]> {
        match self.value(name)? {
            Value::Numbers(numbers) => Some(numbers),
            _ => None,
        }
    }

    pub fn vector<const N: usize>(&self, name: &str) -> Option<[f64; N]> {
        self.numbers(name)?.try_into().ok()
    }

    pub fn number(&self, name: &str) -> Option<f64> {
        self.vector::<1>(name).map(|[number]| number)
    }

    pub fn texts(&self, name: &str) -> &[String] {
        match self.value(name) {
            Some(Value::Texts(texts)) => texts,
            _ => &[],
        }
    }

    pub fn text(&self, name: &str) -> Option<&str> {
        self.texts(name).first().map(String::as_str)
    }

    pub fn has_schema(&self, name: &str) -> bool {
        self.schemas.iter().any(|schema| schema == name)
    }
}

/// The layer's metadata as the properties of a prim without name, with its prims below it.
pub fn parse(text: &str) -> Result<Prim, Broken> {
    let mut parser = Parser { text, at: 0, prims: 0 };
    if !text.starts_with("#usda") {
        return Err(parser.broken("does not begin with `#usda`: only USD in text is read"));
    }
    parser.skip_space();
    let mut root = Prim::default();
    if parser.is_next('(') {
        parser.metadata(&mut root)?;
    }
    while !parser.is_at_end() {
        match parser.prim(0)? {
            Some(prim) => root.children.push(prim),
            None => return Err(parser.broken("a prim is expected here")),
        }
    }
    Ok(root)
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    prims: usize,
}

impl<'a> Parser<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn broken(&self, problem: &str) -> Broken {
        Broken::new(self.text[..self.at].matches('\n').count() + 1, problem)
    }

    /// Moves past spaces, semicolons and comments.
    fn skip_space(&mut self) {
        loop {
            let rest = self.rest();
            let space = rest.len() - rest.trim_start_matches(|c: char| c.is_whitespace() || c == ';').len();
            self.at += space;
            if self.rest().starts_with('#') {
                self.at += self.rest().find('\n').unwrap_or(self.rest().len());
            } else if space == 0 {
                return;
            }
        }
    }

    fn is_at_end(&mut self) -> bool {
        self.skip_space();
        self.rest().is_empty()
    }

    fn is_next(&mut self, c: char) -> bool {
        self.skip_space();
        self.rest().starts_with(c)
    }

    fn take(&mut self, c: char) -> bool {
        let is_next = self.is_next(c);
        self.at += if is_next { c.len_utf8() } else { 0 };
        is_next
    }

    fn expect(&mut self, c: char) -> Result<(), Broken> {
        if self.take(c) { Ok(()) } else { Err(self.broken(&format!("`{c}` is expected here"))) }
    }

    /// A word: a name with colons, dots and brackets, as types and properties have them.
    fn word(&mut self) -> &'a str {
        self.skip_space();
        let is_of_word = |c: char| c.is_alphanumeric() || matches!(c, '_' | ':' | '.' | '-' | '+');
        let rest = self.rest();
        let mut end = rest.find(|c| !is_of_word(c)).unwrap_or(rest.len());
        if rest[end..].starts_with("[]") {
            end += 2;
        }
        self.at += end;
        &rest[..end]
    }

    /// A prim; `None` if something else comes next.
    fn prim(&mut self, depth: usize) -> Result<Option<Prim>, Broken> {
        self.skip_space();
        let start = self.at;
        let specifier = self.word();
        if !["def", "over", "class"].contains(&specifier) {
            self.at = start;
            return Ok(None);
        }
        self.prims += 1;
        if depth > MOST_DEPTH || self.prims > MOST_PRIMS {
            return Err(self.broken("there are too many prims, or they are nested too deep"));
        }
        let kind = if self.is_next('"') { "" } else { self.word() };
        let name = self.string()?;
        let head = start..self.at;
        let mut prim = Prim { specifier: specifier.to_owned(), kind: kind.to_owned(), name, head, ..Prim::default() };
        if self.is_next('(') {
            self.metadata(&mut prim)?;
        }
        self.expect('{')?;
        while !self.take('}') {
            match self.prim(depth + 1)? {
                Some(child) => prim.children.push(child),
                None => self.property(&mut prim, depth)?,
            }
        }
        Ok(Some(prim))
    }

    /// What stands in parentheses behind a prim's name, or at the top of a layer.
    fn metadata(&mut self, prim: &mut Prim) -> Result<(), Broken> {
        self.expect('(')?;
        while !self.take(')') {
            // A comment in quotes.
            if self.is_next('"') || self.is_next('\'') {
                self.string()?;
                continue;
            }
            let mut name = self.word();
            if ["prepend", "append", "add", "delete", "reorder"].contains(&name) {
                name = self.word();
            }
            if name.is_empty() {
                return Err(self.broken("a name is expected here"));
            }
            let value = if self.take('=') { self.value(0)? } else { Value::Other };
            match (name, value) {
                ("apiSchemas", Value::Texts(names)) => prim.schemas.extend(names),
                (
                    "references" | "payload" | "inherits" | "specializes" | "variants" | "variantSets" | "subLayers",
                    _,
                ) => {
                    prim.is_composed = true;
                }
                (name, value) => prim.properties.push((name.to_owned(), value)),
            }
        }
        Ok(())
    }

    /// An attribute, a relationship or a set of variants.
    fn property(&mut self, prim: &mut Prim, depth: usize) -> Result<(), Broken> {
        let mut words = Vec::new();
        while !self.is_next('=') && !self.is_next('(') && !self.is_next('{') && !self.is_next('"') && !self.is_next('}')
        {
            let word = self.word();
            if word.is_empty() {
                return Err(self.broken("an attribute, a relationship or a prim is expected here"));
            }
            words.push(word);
            // A type, a name; the next word begins another property.
            if words.len() > 1 && !is_modifier(words[words.len() - 2]) {
                break;
            }
        }
        if words.first() == Some(&"variantSet") {
            prim.is_composed = true;
            self.string()?;
            self.expect('=')?;
            return self.skip_block(depth);
        }
        let value = if self.take('=') { self.value(0)? } else { Value::Other };
        if self.is_next('(') {
            self.metadata(&mut Prim::default())?;
        }
        match words.last() {
            Some(name) if words.len() > 1 => prim.properties.push(((*name).to_owned(), value)),
            _ => return Err(self.broken("an attribute, a relationship or a prim is expected here")),
        }
        Ok(())
    }

    /// Passes over what stands in braces.
    fn skip_block(&mut self, depth: usize) -> Result<(), Broken> {
        self.expect('{')?;
        let mut open = 1;
        while open > 0 {
            self.skip_space();
            let rest = self.rest();
            match rest.chars().next() {
                None => return Err(self.broken("the text ends within braces")),
                Some('"' | '\'') => drop(self.string()?),
                Some('@') => drop(self.asset()?),
                Some(c) => {
                    open += usize::from(c == '{');
                    open -= usize::from(c == '}');
                    if depth + open > MOST_DEPTH {
                        return Err(self.broken("braces are nested too deep"));
                    }
                    self.at += c.len_utf8();
                }
            }
        }
        Ok(())
    }

    fn value(&mut self, depth: usize) -> Result<Value, Broken> {
        if depth > MOST_DEPTH {
            return Err(self.broken("values are nested too deep"));
        }
        self.skip_space();
        match self.rest().chars().next() {
            Some('"' | '\'') => Ok(Value::Texts(vec![self.string()?])),
            Some('@') => {
                let asset = self.asset()?;
                // A reference may name a prim in the other layer.
                if self.is_next('<') {
                    self.path()?;
                }
                Ok(Value::Texts(vec![asset]))
            }
            Some('<') => Ok(Value::Texts(vec![self.path()?])),
            Some('{') => self.skip_block(0).map(|()| Value::Other),
            Some(open @ ('(' | '[')) => {
                self.at += 1;
                self.values(if open == '(' { ')' } else { ']' }, depth)
            }
            _ => self.scalar(),
        }
    }

    /// The values up to a closing bracket.
    fn values(&mut self, close: char, depth: usize) -> Result<Value, Broken> {
        let (mut numbers, mut texts) = (Vec::new(), Vec::new());
        while !self.take(close) {
            match self.value(depth + 1)? {
                Value::Numbers(more) => numbers.extend(more),
                Value::Texts(more) => texts.extend(more),
                Value::Other => {}
            }
            self.take(',');
        }
        Ok(if texts.is_empty() { Value::Numbers(numbers) } else { Value::Texts(texts) })
    }

    fn scalar(&mut self) -> Result<Value, Broken> {
        let word = self.word();
        match word {
            "" => Err(self.broken("a value is expected here")),
            "true" | "True" => Ok(Value::Numbers(vec![1.0])),
            "false" | "False" => Ok(Value::Numbers(vec![0.0])),
            "inf" | "-inf" | "nan" => Ok(Value::Numbers(vec![word.parse().unwrap_or(f64::NAN)])),
            _ => Ok(word.parse().map_or(Value::Other, |number| Value::Numbers(vec![number]))),
        }
    }

    fn path(&mut self) -> Result<String, Broken> {
        self.expect('<')?;
        self.until(">")
    }

    fn asset(&mut self) -> Result<String, Broken> {
        self.expect('@')?;
        if self.rest().starts_with("@@") {
            self.at += 2;
            return self.until("@@@");
        }
        self.until("@")
    }

    /// The text up to an end, which is passed over.
    fn until(&mut self, end: &str) -> Result<String, Broken> {
        let rest = self.rest();
        let length = rest.find(end).ok_or_else(|| self.broken(&format!("`{end}` is missing")))?;
        self.at += length + end.len();
        Ok(rest[..length].to_owned())
    }

    fn string(&mut self) -> Result<String, Broken> {
        self.skip_space();
        let rest = self.rest();
        let quote = ["\"\"\"", "'''", "\"", "'"].into_iter().find(|quote| rest.starts_with(quote));
        let quote = quote.ok_or_else(|| self.broken("a name in quotes is expected here"))?;
        let mut at = quote.len();
        while !rest[at..].starts_with(quote) {
            let mut following = rest[at..].chars();
            let length = match following.next() {
                None => return Err(self.broken("the text ends within quotes")),
                Some('\\') => 1 + following.next().map_or(0, char::len_utf8),
                Some(c) => c.len_utf8(),
            };
            at += length;
        }
        self.at += at + quote.len();
        Ok(rest[quote.len()..at].to_owned())
    }
}

/// Words that may stand before the type of a property.
fn is_modifier(word: &str) -> bool {
    ["custom", "uniform", "varying", "config", "prepend", "append", "add", "delete", "reorder"].contains(&word)
}
