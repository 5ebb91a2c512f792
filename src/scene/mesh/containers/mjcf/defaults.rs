//! Default classes: what an attribute is if an element does not have it.

use std::collections::HashMap;

use super::documents::{Documents, Item};

/// The class of everything that names none.
pub const MAIN: &str = "main";

/// All default classes of a model.
#[derive(Default)]
pub struct Defaults<'a> {
    classes: HashMap<&'a str, Class<'a>>,
}

#[derive(Default)]
struct Class<'a> {
    parent: Option<&'a str>,
    /// The elements with the values, such as `<geom>`, in the order of the file.
    elements: Vec<Item<'a>>,
}

impl<'a> Defaults<'a> {
    pub fn read(documents: &'a Documents) -> Self {
        let mut all = Self::default();
        for section in documents.sections("default") {
            all.add(documents, section, None);
        }
        all
    }

    fn add(&mut self, documents: &'a Documents, item: Item<'a>, parent: Option<&'a str>) {
        let name = item.node.value("class").unwrap_or(MAIN);
        let children = documents.children(item);
        let class = self.classes.entry(name).or_default();
        // The first place of a class decides; a class above itself would have no end.
        if class.elements.is_empty() && name != MAIN {
            class.parent = Some(parent.unwrap_or(MAIN));
        }
        class.elements.extend(children.iter().filter(|child| child.node.name() != "default"));
        for child in children.into_iter().filter(|child| child.node.name() == "default") {
            self.add(documents, child, Some(name));
        }
    }

    pub fn has(&self, class: &str) -> bool {
        class == MAIN || self.classes.contains_key(class)
    }

    /// The elements of this kind in the class and those above it, nearest first.
    fn of_class(&self, class: &str, kind: &str) -> Vec<Item<'a>> {
        let mut found = Vec::new();
        let mut at = Some(class);
        for _ in 0..=self.classes.len() {
            let Some(class) = at.and_then(|name| self.classes.get(name)) else { break };
            found.extend(class.elements.iter().rev().filter(|item| item.node.name() == kind));
            at = class.parent;
        }
        found
    }
}

/// An element with the values that its class has for it.
pub struct Settings<'a> {
    /// The element itself, then those of its classes.
    items: Vec<Item<'a>>,
}

impl<'a> Settings<'a> {
    /// An element of a class: the one that it names, or else `inherited`.
    pub fn of(item: Item<'a>, defaults: &Defaults<'a>, inherited: &'a str) -> Self {
        let class = item.node.value("class").unwrap_or(inherited);
        let mut items = vec![item];
        items.extend(defaults.of_class(class, item.node.name()));
        Self { items }
    }

    pub fn value(&self, name: &str) -> Option<&'a str> {
        self.items.iter().find_map(|item| item.node.value(name))
    }

    /// The nearest element that has any of these attributes.
    pub fn with_any(&self, names: &[&str]) -> Option<Item<'a>> {
        self.items.iter().find(|item| names.iter().any(|name| item.node.value(name).is_some())).copied()
    }
}
