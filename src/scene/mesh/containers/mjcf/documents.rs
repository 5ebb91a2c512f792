//! An MJCF and the files that it includes, read as one: an `<include>` stands for the children of the other file's root.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::super::xml::{Document, MOST_ELEMENTS, Node};
use super::super::{Broken, ContainerError, Place, document, files};
use crate::files::read_scope::ReadScope;

/// The most files of a model; MuJoCo's own include about ten.
const MOST_FILES: usize = 256;

/// The texts of a model.
pub struct Documents {
    /// The model, then what it includes.
    pub paths: Vec<PathBuf>,
    documents: Vec<Document>,
    /// For each include, by the document and the byte in which it is: the document that it stands for.
    included: HashMap<(usize, usize), usize>,
}

/// An element of one of the documents.
#[derive(Debug, Clone, Copy)]
pub struct Item<'a> {
    pub node: Node<'a>,
    pub source: usize,
}

impl Item<'_> {
    pub fn place(self) -> Place {
        Place { source: self.source, line: self.node.line(), bytes: self.node.tag() }
    }
}

impl Documents {
    /// The model at `path` and everything that it includes.
    ///
    /// # Errors
    /// If an included file cannot be read, may not be, includes itself, or if there are too many.
    pub fn load(path: &Path, model: Document, scope: &ReadScope) -> Result<Self, ContainerError> {
        let mut all = Self { paths: vec![path.to_owned()], documents: vec![model], included: HashMap::new() };
        // The document that includes each one.
        let mut includer = vec![None];
        let mut elements = 0;
        let mut source = 0;
        while source < all.documents.len() {
            let mut includes = Vec::new();
            elements += collect_includes(all.documents[source].root(), &mut includes);
            let refuse = |line, problem: String| Err(Broken::new(line, problem).of(&all.paths[source]));
            if elements > MOST_ELEMENTS {
                return refuse(1, format!("with what it includes, it has more than {MOST_ELEMENTS} elements"));
            }
            let mut found = Vec::new();
            for (byte, line, named) in includes {
                // MuJoCo takes every name as relative to the model's own folder.
                let folder = path.parent().unwrap_or(Path::new(""));
                let file = match files::find(&named, folder, scope) {
                    Ok(file) => file,
                    Err(problem) => return refuse(line, format!("<include>: {problem}")),
                };
                let mut above = Some(source);
                while let Some(at) = above {
                    if all.paths[at] == file {
                        return refuse(line, format!("{named:?} includes itself"));
                    }
                    above = includer[at];
                }
                if all.documents.len() + found.len() >= MOST_FILES {
                    return refuse(line, format!("the model has more than {MOST_FILES} files"));
                }
                found.push((byte, file));
            }
            for (byte, file) in found {
                all.included.insert((source, byte), all.documents.len());
                all.documents.push(document(&file)?);
                all.paths.push(file);
                includer.push(Some(source));
            }
            source += 1;
        }
        Ok(all)
    }

    pub fn root(&self) -> Item<'_> {
        Item { node: self.documents[0].root(), source: 0 }
    }

    /// The children of an element, with those of included files in the place of the includes.
    pub fn children<'a>(&'a self, of: Item<'a>) -> Vec<Item<'a>> {
        let mut children = Vec::new();
        for node in of.node.children() {
            match self.included.get(&(of.source, node.tag().start)) {
                Some(&source) => {
                    children.extend(self.children(Item { node: self.documents[source].root(), source }));
                }
                None => children.push(Item { node, source: of.source }),
            }
        }
        children
    }

    /// The sections of the model with this name.
    pub fn sections<'a>(&'a self, name: &str) -> Vec<Item<'a>> {
        let mut sections = self.children(self.root());
        sections.retain(|section| section.node.name() == name);
        sections
    }
}

/// Lists the includes below `node` (byte, line, name), and counts the elements.
fn collect_includes(node: Node, found: &mut Vec<(usize, usize, String)>) -> usize {
    if node.name() == "include"
        && let Some(named) = node.value("file")
    {
        found.push((node.tag().start, node.line(), named.to_owned()));
    }
    1 + node.children().map(|child| collect_includes(child, found)).sum::<usize>()
}
