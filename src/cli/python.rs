//! The options of the Python module, `python/gprop/_options.py`: generated from the definitions of the flags, so that names,
//! types and documentation cannot differ.

use std::any::TypeId;
use std::ffi::OsString;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::{env, fs};

use clap::builder::PossibleValue;
use clap::{Arg, ArgAction, Args};

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
from typing import Annotated, Literal, TypedDict

Path = str | os.PathLike[str]

#: Of the files in a work folder.
"#;

/// Names that Python keeps for itself and that options have.
const RESERVED: &[&str] = &["from"];

/// Flags that Python's functions set themselves, have as parameters of their own, or have no use for.
const NOT_OPTIONS: &[&str] =
    &["json", "quiet", "verbose", "help", "help-all", "dry-run", "end-with-stdin", "for-python"];

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
    let is_bool = option.get_value_parser().type_id() == TypeId::of::<bool>();
    if is_bool && option.get_action().takes_values() { ", \"true or false\"" } else { "" }
}

/// The type of a keyword argument.
fn type_of(option: &Arg) -> String {
    if !option.get_action().takes_values() {
        return "bool".to_owned();
    }
    let parsed = option.get_value_parser().type_id();
    let is = |types: &[TypeId]| types.iter().any(|of| parsed == *of);
    let one = if is_choice(option) {
        let choices = option.get_possible_values();
        let choices: Vec<_> = choices.iter().map(|value| format!("{:?}", value.get_name())).collect();
        format!("Literal[{}]", choices.join(", "))
    } else if is(&[TypeId::of::<bool>()]) {
        "bool".to_owned()
    } else if is(&[TypeId::of::<f32>(), TypeId::of::<f64>()]) && !takes_units(option) {
        "float".to_owned()
    } else if is(&integers()) {
        "int".to_owned()
    } else if is(&[TypeId::of::<PathBuf>()]) {
        "Path".to_owned()
    } else if is(&[TypeId::of::<String>(), TypeId::of::<OsString>()]) {
        "str".to_owned()
    } else {
        // Text that means a length, a mass, a number or "auto", and the like.
        "str | float".to_owned()
    };
    if matches!(option.get_action(), ArgAction::Append) { format!("{one} | Sequence[{one}]") } else { one }
}

/// Whether an option takes one of a few words.
fn is_choice(option: &Arg) -> bool {
    let is_bool = option.get_value_parser().type_id() == TypeId::of::<bool>();
    option.get_action().takes_values() && !is_bool && !option.get_possible_values().is_empty()
}

/// Whether a number may have a unit, which makes it a text.
fn takes_units(option: &Arg) -> bool {
    let command = clap::Command::new("option").arg(option.clone().required(true));
    let flag = format!("--{}=", option.get_long().unwrap_or_default());
    ["1g", "1mm"].iter().any(|value| command.clone().try_get_matches_from(["option", &(flag.clone() + value)]).is_ok())
}

fn integers() -> [TypeId; 8] {
    [
        TypeId::of::<u8>(),
        TypeId::of::<u16>(),
        TypeId::of::<u32>(),
        TypeId::of::<u64>(),
        TypeId::of::<usize>(),
        TypeId::of::<i32>(),
        TypeId::of::<i64>(),
        TypeId::of::<NonZeroUsize>(),
    ]
}

/// The help on one line, with the default.
fn doc_of(option: &Arg) -> String {
    let help = option.get_long_help().or_else(|| option.get_help()).map(ToString::to_string).unwrap_or_default();
    let paragraphs = help.replace("\n\n", ". ");
    let mut words: Vec<&str> = paragraphs.split_whitespace().collect();
    let defaults: Vec<_> = option.get_default_values().iter().map(|value| value.to_string_lossy()).collect();
    let default = format!("[default: {}]", defaults.join(","));
    if option.get_action().takes_values() && !defaults.is_empty() && !option.is_hide_default_value_set() {
        words.push(&default);
    }
    let choices = option.get_possible_values();
    let choices: Vec<_> = choices.iter().map(PossibleValue::get_name).collect();
    let choices = format!("[possible values: {}]", choices.join(", "));
    if is_choice(option) {
        words.push(&choices);
    }
    words.join(" ")
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
