//! What an option takes, from the definition of its flag: for the Python module and the tools of `gprop mcp`.

use std::any::TypeId;
use std::ffi::OsString;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::builder::PossibleValue;
use clap::{Arg, ArgAction};

/// What one value of an option is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Kind {
    /// It is given or not.
    Switch,
    /// It is given as `true` or `false`.
    Bool,
    /// One of a few words.
    Choice(Vec<String>),
    Float,
    Int,
    Path,
    Text,
    /// Text that means a length, a mass, a number or "auto", and the like.
    TextOrNumber,
}

impl Kind {
    pub fn of(option: &Arg) -> Self {
        let parsed = option.get_value_parser().type_id();
        let is_one_of = |types: &[TypeId]| types.iter().any(|of| parsed == *of);
        if !option.get_action().takes_values() {
            Self::Switch
        } else if is_one_of(&[TypeId::of::<bool>()]) {
            Self::Bool
        } else if !option.get_possible_values().is_empty() {
            Self::Choice(option.get_possible_values().iter().map(|value| value.get_name().to_owned()).collect())
        } else if is_one_of(&[TypeId::of::<f32>(), TypeId::of::<f64>()]) && !takes_units(option) {
            Self::Float
        } else if is_one_of(&integers()) {
            Self::Int
        } else if is_one_of(&[TypeId::of::<PathBuf>()]) {
            Self::Path
        } else if is_one_of(&[TypeId::of::<String>(), TypeId::of::<OsString>()]) {
            Self::Text
        } else {
            Self::TextOrNumber
        }
    }
}

/// Whether an option may be given several values.
pub fn takes_several(option: &Arg) -> bool {
    matches!(option.get_action(), ArgAction::Append)
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
pub fn doc_of(option: &Arg) -> String {
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
    if matches!(Kind::of(option), Kind::Choice(_)) {
        words.push(&choices);
    }
    words.join(" ")
}
