//! The layout of the source: data moves one way, so no import may lead back.
//!
//! Imports are read from the text of the crate: `use` lines and paths in the code, followed through re-exports to the file
//! that defines the name. Not counted are code under `#[cfg(test)]`, the name of a module on its own, and imports
//! from the `mod.rs` of a folder that contains the file: a folder's `mod.rs` defines the items that its files share,
//! and calls them.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fs;
use std::path::Path;

use gprop::pipeline::Stage;

/// For each importing module, the modules that it imports, each with one imported name.
type Graph = BTreeMap<String, BTreeMap<String, String>>;

/// The path of a module from the crate's root; the root's own is empty.
type ModulePath = Vec<String>;

#[derive(Default)]
struct Module {
    /// Path relative to `src/`.
    file: String,
    tokens: Vec<String>,
    /// The names in the module's `use` lines, with the path of each.
    names: BTreeMap<String, Vec<String>>,
}

struct Source(BTreeMap<ModulePath, Module>);

/// The folder of the table of stages.
const TABLE: &str = "pipeline/stages/";

#[test]
fn no_files_import_each_other_in_a_circle() {
    let circles = circles(&Source::read().imports());
    assert!(circles.is_empty(), "files that import each other:\n{}", circles.join("\n"));
}

#[test]
fn no_rooms_import_each_other_in_a_circle() {
    let circles = circles(&rooms(&Source::read().imports()));
    assert!(circles.is_empty(), "rooms that import each other:\n{}", circles.join("\n"));
}

/// The room of a stage (its folder below `src/`) and its file in the table of stages import only those of earlier ones.
#[test]
fn no_stage_imports_a_later_one() {
    let files = Source::read().imports();
    let stages: Vec<String> = Stage::all().iter().map(|stage| stage.name()).collect();
    // One room has the questions of two stages, and comes before both.
    let stage_of = |room: String| if room == "query" { "recognise".to_owned() } else { room };
    let is_of = |file: &str, stage: &String| stage_of(room(file)) == *stage || file == format!("{TABLE}{stage}.rs");
    for (n, stage) in stages.iter().enumerate() {
        assert!(files.contains_key(&format!("{TABLE}{stage}.rs")), "{stage} has no file");
        let imports = files.iter().filter(|(file, _)| is_of(file, stage));
        for (file, (imported, name)) in imports.flat_map(|(file, all)| all.iter().map(move |one| (file, one))) {
            let is_later = stages[n + 1..].iter().any(|later| is_of(imported, later));
            assert!(!is_later, "{file} imports {name} from {imported}, a later stage");
        }
    }
}

/// The pipeline calls the stages; no stage calls the pipeline, or reads its keys and records.
#[test]
fn no_stage_imports_the_pipeline() {
    let source = Source::read();
    let files = source.imports();
    for (file, imports) in files.iter().filter(|(file, _)| file.starts_with(TABLE)) {
        for of_pipeline in ["builder", "plan", "record", "run", "stored"] {
            let imported = imports.get(&format!("pipeline/{of_pipeline}.rs"));
            assert_eq!(imported, None, "{file} imports from pipeline/{of_pipeline}.rs");
        }
    }
    for module in source.0.values().filter(|module| module.file.starts_with(TABLE)) {
        assert!(!module.tokens.iter().any(|token| token == "Pipeline"), "{} names the pipeline", module.file);
    }
}

#[test]
fn the_reader_of_imports_sees_circles() {
    let source = |files: &[(&str, &str)]| {
        Source::of(files.iter().map(|(file, text)| ((*file).to_owned(), (*text).to_owned())).collect())
    };
    let open = source(&[
        ("a/mod.rs", "mod b; mod c; pub use b::Shared; fn f() { c::go() }"),
        ("a/b.rs", "pub struct Shared; #[cfg(test)] mod tests { use super::super::c::go; }"),
        ("a/c.rs", "use super::Shared; /* crate::d::Top */ pub fn go() { let _ = \"crate::d::Top\"; }"),
        ("d.rs", "use crate::a; struct Top(a::Shared);"),
    ]);
    assert!(circles(&open.imports()).is_empty(), "{:?}", circles(&open.imports()));
    let closed = source(&[
        ("a/mod.rs", "mod b; mod c; pub use b::Shared;"),
        ("a/b.rs", "pub struct Shared(crate::d::Top);"),
        ("a/c.rs", "use super::{Shared as S};"),
        ("d.rs", "use crate::{a::{self}}; pub struct Top; impl Top { fn f(_: &a::Shared) {} }"),
    ]);
    assert_eq!(circles(&closed.imports()), ["a/b.rs -> (Top) d.rs -> (Shared) a/b.rs"]);
    assert_eq!(circles(&rooms(&closed.imports())), ["a -> (Top) d -> (Shared) a"]);
}

impl Source {
    fn read() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let mut files = rust_files(&root);
        files.retain(|file| file != "main.rs");
        Self::of(files.into_iter().map(|file| (file.clone(), fs::read_to_string(root.join(&file)).unwrap())).collect())
    }

    fn of(files: Vec<(String, String)>) -> Self {
        let module = |(file, text): (String, String)| {
            let mut path: ModulePath = file.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
            if path.last().is_some_and(|last| last == "mod" || last == "lib") {
                path.pop();
            }
            let tokens = without_tests(tokens(&text));
            let names = uses(&tokens).into_iter().map(|(name, path)| (name, path.clone())).collect();
            (path, Module { file, tokens, names })
        };
        Self(files.into_iter().map(module).collect())
    }

    /// The imports of each file, by paths.
    fn imports(&self) -> Graph {
        let mut graph = Graph::new();
        for (path, module) in &self.0 {
            let of_file = graph.entry(module.file.clone()).or_default();
            let in_code = paths(&module.tokens).into_iter().filter(|used| {
                let first = used[0].as_str();
                ["crate", "self", "super"].contains(&first) || module.names.contains_key(first) || self.has(path, first)
            });
            for used in module.names.values().cloned().chain(in_code) {
                let Some((definer, name)) = self.defining_module(path, &used, 0) else { continue };
                if !path.starts_with(&definer) {
                    of_file.entry(self.0[&definer].file.clone()).or_insert(name);
                }
            }
        }
        graph
    }

    fn has(&self, parent: &[String], child: &str) -> bool {
        self.0.contains_key(&[parent, &[child.to_owned()]].concat())
    }

    /// The module that defines the item at `path`, as seen from the module `from`, and the item's name; `None` for
    /// modules and for items of other crates.
    fn defining_module(&self, from: &[String], path: &[String], depth: usize) -> Option<(ModulePath, String)> {
        assert!(depth < 20, "{path:?} in {from:?} names itself");
        let mut module = from.to_vec();
        for (n, part) in path.iter().enumerate() {
            let is_last = n + 1 == path.len();
            let names = self.0.get(&module).map(|module| &module.names);
            let behind = names.and_then(|names| names.get(part)).filter(|behind| *behind != path || module != from);
            match part.as_str() {
                "crate" => module.clear(),
                "self" => {}
                "super" => {
                    module.pop()?;
                }
                _ if self.has(&module, part) && !(is_last && behind.is_some()) => module.push(part.clone()),
                _ => {
                    return match behind {
                        Some(behind) => self.defining_module(&module, &[behind, &path[n + 1..]].concat(), depth + 1),
                        // A path that starts with a name that this module does not know is another crate's.
                        None if n == 0 => None,
                        None => Some((module, part.clone())),
                    };
                }
            }
        }
        None
    }
}

/// Every file below `folder` that ends in `.rs`, with slashes, sorted.
fn rust_files(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let name = entry.file_name().into_string().unwrap();
        if entry.path().is_dir() {
            found.extend(rust_files(&entry.path()).into_iter().map(|file| format!("{name}/{file}")));
        } else if name.ends_with(".rs") {
            found.push(name);
        }
    }
    found.sort();
    found
}

/// Words, `::` and single punctuation characters; comments, strings and character literals are left out.
fn tokens(text: &str) -> Vec<String> {
    let chars: Vec<char> = text.chars().collect();
    let (mut found, mut at) = (Vec::new(), 0);
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let find = |from: usize, end: &str| {
        let end: Vec<char> = end.chars().collect();
        (from..chars.len()).find(|&i| chars[i..].starts_with(&end)).map_or(chars.len(), |i| i + end.len())
    };
    while at < chars.len() {
        let rest = &chars[at..];
        let hashes = rest.iter().skip(1).take_while(|c| **c == '#').count();
        at = match rest {
            ['/', '/', ..] => find(at, "\n"),
            ['/', '*', ..] => find(at, "*/"),
            ['r', ..] if rest.get(1 + hashes) == Some(&'"') => {
                find(at + 2 + hashes, &format!("\"{}", "#".repeat(hashes)))
            }
            ['"', ..] => {
                let mut end = at + 1;
                while chars[end] != '"' {
                    end += if chars[end] == '\\' { 2 } else { 1 };
                }
                end + 1
            }
            ['\'', '\\', ..] => find(at + 3, "'"),
            ['\'', _, '\'', ..] => at + 3,
            [':', ':', ..] => {
                found.push("::".to_owned());
                at + 2
            }
            [c, ..] if is_word(*c) => {
                let word: String = rest.iter().take_while(|c| is_word(**c)).collect();
                let length = word.chars().count();
                found.push(word);
                at + length
            }
            [c, ..] => {
                if !c.is_whitespace() {
                    found.push(c.to_string());
                }
                at + 1
            }
            [] => unreachable!("the loop ends before"),
        };
    }
    found
}

/// The tokens without those in braces after `#[cfg(test)]`.
fn without_tests(mut tokens: Vec<String>) -> Vec<String> {
    let mark = ["#", "[", "cfg", "(", "test", ")", "]"];
    while let Some(start) = tokens.windows(mark.len()).position(|window| window.iter().zip(mark).all(|(a, b)| a == b)) {
        let mut depth = 0;
        let mut end = start + mark.len();
        loop {
            match tokens[end].as_str() {
                "{" => depth += 1,
                "}" => depth -= 1,
                _ => {}
            }
            end += 1;
            if depth == 0 && ["}", ";"].contains(&tokens[end - 1].as_str()) {
                break;
            }
        }
        tokens.drain(start..end);
    }
    tokens
}

/// The items of the `use` lines: the name in this module and its path.
fn uses(tokens: &[String]) -> Vec<(String, Vec<String>)> {
    let mut found = Vec::new();
    for start in (0..tokens.len()).filter(|&n| tokens[n] == "use") {
        tree(tokens, start + 1, &[], &mut found);
    }
    found
}

/// Reads one branch of a `use` line from `at` on; returns where it ends.
fn tree(tokens: &[String], mut at: usize, before: &[String], found: &mut Vec<(String, Vec<String>)>) -> usize {
    let mut path = before.to_vec();
    loop {
        match tokens[at].as_str() {
            "{" => {
                while tokens[at] != "}" {
                    at = tree(tokens, at + 1, &path, found);
                }
                return at + 1;
            }
            "::" => at += 1,
            "as" => {
                found.push((tokens[at + 1].clone(), path));
                return at + 2;
            }
            "," | "}" | ";" => {
                if path.len() > before.len() {
                    if path.last().is_some_and(|last| last == "self") && path.len() > 1 {
                        path.pop();
                    }
                    found.push((path.last().expect("it has grown").clone(), path));
                }
                return at;
            }
            word => {
                path.push(word.to_owned());
                at += 1;
            }
        }
    }
}

/// Every path of two words or more.
fn paths(tokens: &[String]) -> Vec<Vec<String>> {
    let mut found: Vec<Vec<String>> = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        let mut path = vec![tokens[at].clone()];
        while tokens.get(at + 1).is_some_and(|sign| sign == "::") {
            let Some(next) =
                tokens.get(at + 2).filter(|next| next.starts_with(|c: char| c.is_alphabetic() || c == '_'))
            else {
                break;
            };
            path.push(next.clone());
            at += 2;
        }
        if path.len() > 1 {
            found.push(path);
        }
        at += 1;
    }
    found
}

/// The imports between the folders and files directly below `src/`.
fn rooms(files: &Graph) -> Graph {
    let mut graph = Graph::new();
    for (file, imported) in files {
        let of_room = graph.entry(room(file)).or_default();
        for (other, name) in imported.iter().filter(|(other, _)| room(other) != room(file)) {
            of_room.entry(room(other)).or_insert(name.clone());
        }
    }
    graph
}

/// The folder or file directly below `src/` that a file is in.
fn room(file: &str) -> String {
    file.split('/').next().unwrap_or(file).trim_end_matches(".rs").to_owned()
}

/// The shortest cycle through every node that is not part of a cycle already found: "a -> (name) b -> (name) a".
fn circles(graph: &Graph) -> Vec<String> {
    let mut named = BTreeSet::new();
    let mut found = Vec::new();
    for start in graph.keys() {
        let Some(circle) = circle_through(graph, start).filter(|_| !named.contains(start)) else { continue };
        let step = |pair: &[&String]| format!(" -> ({}) {}", graph[pair[0]][pair[1]], pair[1]);
        found.push(format!("{start}{}", circle.windows(2).map(step).collect::<String>()));
        named.extend(circle.into_iter().cloned());
    }
    found
}

fn circle_through<'a>(graph: &'a Graph, start: &'a String) -> Option<Vec<&'a String>> {
    let mut from: BTreeMap<&String, &String> = BTreeMap::new();
    let mut queue = VecDeque::from([start]);
    while let Some(node) = queue.pop_front() {
        for next in graph.get(node).into_iter().flat_map(BTreeMap::keys) {
            if next == start {
                let mut chain = vec![start, node];
                while let Some(&before) = from.get(chain[chain.len() - 1]) {
                    chain.push(before);
                }
                chain.reverse();
                chain.dedup();
                if chain.len() == 2 && chain[0] == chain[1] {
                    return None;
                }
                return Some(chain);
            }
            if next != start && !from.contains_key(next) {
                from.insert(next, node);
                queue.push_back(next);
            }
        }
    }
    None
}
