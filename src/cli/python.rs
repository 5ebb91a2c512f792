//! The options of the Python module, `python/gprop/_options.py`: generated from the definitions of the flags, so that names,
//! types and documentation cannot differ.

use std::path::Path;
use std::{env, fs};

use clap::{Arg, Args};

use super::option_types::{Kind, doc_of, takes_several};
use super::{Global, command};
use crate::files::json;
use crate::pipeline::{self, THREADS};
use crate::workdir::FORMAT_VERSION;

/// If set, the test writes the file.
const UPDATE: &str = "GPROP_UPDATE_PYTHON";
const FILE: &str = "python/gprop/_options.py";

const HEAD: &str = r#""""The options of gprop's commands, as keyword arguments, and the format of its files.

Written by `GPROP_UPDATE_PYTHON=1 cargo test --profile quick --lib python` from the definitions of the flags.
"""

import os
from collections.abc import Sequence
from typing import Annotated, Literal, TypedDict, Union

Path = Union[str, os.PathLike[str]]

#: Of the files in a work folder.
"#;

/// Names that Python keeps for itself and that options have.
const RESERVED: &[&str] = &["from"];

/// Flags that Python's functions set themselves, have as parameters of their own, or have no use for.
const NOT_OPTIONS: &[&str] =
    &["json", "quiet", "verbose", "help", "help-all", "dry-run", "end-with-stdin", "for-mcp", "for-python", "list"];

/// A class whose fields are options.
struct Class<'a> {
    name: &'a str,
    base: &'a str,
    doc: &'a str,
    options: Vec<Arg>,
}

impl Class<'_> {
    fn text(&self) -> String {
        let Self { name, base, doc, options } = self;
        let mut text = format!("\n\nclass {name}({base}, total=False):\n    \"\"\"{doc}\"\"\"\n\n");
        for option in options {
            let long = option.get_long().expect("only options have fields");
            let end = if RESERVED.contains(&long) { "_" } else { "" };
            let (field, doc) = (long.replace('-', "_"), json::compact(&doc_of(option)).unwrap());
            text += &format!("    {field}{end}: Annotated[{}, {doc}{}]\n", type_of(option), mark_of(option));
        }
        text
    }
}

/// Marks an option that is given as `true` or `false`, where a switch is given or not.
fn mark_of(option: &Arg) -> &'static str {
    if Kind::of(option) == Kind::Bool { ", \"true or false\"" } else { "" }
}

/// The type of a keyword argument, as Python 3.9 can read it, which has no `|`.
fn type_of(option: &Arg) -> String {
    let one = match Kind::of(option) {
        Kind::Switch => return "bool".to_owned(),
        Kind::Bool => "bool".to_owned(),
        Kind::Choice(words) => {
            let words: Vec<_> = words.iter().map(|word| format!("{word:?}")).collect();
            format!("Literal[{}]", words.join(", "))
        }
        Kind::Float => "float".to_owned(),
        Kind::Int => "int".to_owned(),
        Kind::Path => "Path".to_owned(),
        Kind::Text => "str".to_owned(),
        Kind::TextOrNumber => "Union[str, float]".to_owned(),
    };
    if takes_several(option) { format!("Union[{one}, Sequence[{one}]]") } else { one }
}

/// The options of a command that are not in `known`.
fn options_of(words: &[&str], known: &[Arg]) -> Vec<Arg> {
    let mut found = command();
    found.build();
    for word in words {
        found = found.find_subcommand(word).expect("it is a command").clone();
    }
    let is_known = |option: &&Arg| known.iter().any(|known| known.get_long() == option.get_long());
    let is_new = |option: &&Arg| {
        option.get_long().is_some_and(|long| !NOT_OPTIONS.contains(&long) && long != THREADS) && !is_known(option)
    };
    found.get_arguments().filter(is_new).cloned().collect()
}

/// The module.
fn module() -> String {
    let stages = pipeline::Options::augment_args(clap::Command::new("stages"));
    let stages: Vec<Arg> = stages.get_arguments().filter(|option| option.get_long().is_some()).cloned().collect();
    let global = Global::augment_args(clap::Command::new("global"));
    let threads = global.get_arguments().filter(|option| option.get_long() == Some(THREADS)).cloned().collect();
    // The folder to export into is a parameter of its own, which is required.
    let mut of_export = options_of(&["export"], &stages);
    of_export.retain(|option| option.get_long() != Some("out"));
    let (of_run, of_audit) = (options_of(&["run"], &stages), options_of(&["audit"], &[]));
    let of_list = options_of(&["materials", "list"], &[]);
    let classes = [
        Class { name: "Options", base: "TypedDict", doc: "Options of every command.", options: threads },
        Class { name: "StageOptions", base: "Options", doc: "Options of the stages.", options: stages },
        Class { name: "RunOptions", base: "StageOptions", doc: "Options of `gprop run`.", options: of_run },
        Class { name: "ExportOptions", base: "StageOptions", doc: "Options of `gprop export`.", options: of_export },
        Class { name: "AuditOptions", base: "Options", doc: "Options of `gprop audit`.", options: of_audit },
        Class {
            name: "MaterialsOptions",
            base: "Options",
            doc: "Options of `gprop materials list`.",
            options: of_list,
        },
    ];
    let format = format!("FORMAT_VERSION = {FORMAT_VERSION}\n");
    HEAD.to_owned() + &format + &classes.iter().map(Class::text).collect::<String>()
}

#[test]
fn the_options_of_the_python_module_are_those_of_the_program() {
    let (path, text) = (Path::new(env!("CARGO_MANIFEST_DIR")).join(FILE), module());
    if env::var_os(UPDATE).is_some() {
        fs::write(&path, &text).unwrap();
    }
    let is_same = fs::read_to_string(&path).is_ok_and(|written| written == text);
    assert!(is_same, "{FILE} is not that of the flags; `{UPDATE}=1 cargo test --profile quick --lib python` writes it");
}
