//! Which options a command's help shows. Every command that works on a scene takes the options of all stages: about a
//! hundred. `-h` and `--help` show those of the command's own stage and the few that most scenes need; `--help-all`
//! shows the rest too.

use clap::{Arg, ArgAction, Args};

use crate::error::{Result, UsageError};
use crate::pipeline;

use super::{command, refuse};

/// The options of the stages that every command on a scene shows: where the scene's files are.
const OF_THE_SCENE: &[&str] = &["views", "splat", "cameras", "images"];
/// The option for the object's size, which is shown from the parts on.
const OF_SIZE: &[&str] = &["scale"];

/// The heading of the options that name ONNX Runtime and SAM.
const SETUP: &str = "ONNX Runtime and SAM";

/// The stages' options that commands with all stages show as well: those that people set for one run.
const OF_A_RUN: &[&str] = &["preset", "masks", "offline", "lmm-url", "lmm-model", "max-usd", "scenario", "gripper"];

/// Those of them that concern a single scene.
const OF_ONE_SCENE: &[&str] =
    &["view-list", "align", "up", "object", "object-box", "answers", "correct", "part", "policy"];

/// Those of a film.
const OF_A_FILM: &[&str] = &["turntable", "size", "fps"];

/// Numerical settings that gprop chooses itself, and what few will want: only `--help-all` shows them.
const FOR_EXPERTS: &[&str] =
    &["cfl", "fixed-step", "hints", "lmm-retries", "lmm-temperature", "lmm-wait-s", "max-stiffness", "soften"];

/// The headings of the stages' options that are a command's own.
fn own_headings(command: &str) -> &'static [&'static str] {
    match command {
        "segment" => &["Segmentation", SETUP],
        "query" | "answer" => &["Parts", "Questions", "Materials"],
        "vote" => &["Vote"],
        "parts" => &["Parts and mass"],
        "simulate" => &["Simulation"],
        "grasp" => &["Grasp"],
        "inspect" | "objects" => &["Scene"],
        "materials" => &["Materials"],
        "evaluate" | "setup" | "doctor" => &[SETUP],
        _ => &[],
    }
}

/// The program's command with the flags for help, and with the options of other stages left out of each command's help.
pub fn with_help(program: clap::Command) -> clap::Command {
    let stages = pipeline::Options::augment_args(clap::Command::new("stages"));
    let headings: Vec<&str> = stages.get_arguments().filter_map(Arg::get_help_heading).collect();
    let shortened = program.mut_subcommands(|command| {
        let (own, common) = (own_headings(command.get_name()), common_options(command.get_name()));
        let shorten = |argument: Arg| {
            let is_other = |heading| headings.contains(&heading) && !own.contains(&heading);
            let is_common = argument.get_long().is_some_and(|long| common.contains(&long));
            let hide = argument.get_help_heading().is_some_and(is_other) && !is_common;
            let for_experts = argument.get_long().is_some_and(|long| FOR_EXPERTS.contains(&long));
            argument.hide_short_help(hide || for_experts)
        };
        command.mut_args(shorten).mut_subcommands(|nested| nested.mut_args(shorten))
    });
    let help = Arg::new("help").short('h').long("help").help("Print this command's most common options");
    let help_all = Arg::new("help-all").long("help-all").help("Print every option, with the meaning of its values");
    shortened.disable_help_flag(true).disable_help_subcommand(true).args([
        help.action(ArgAction::HelpShort).global(true).display_order(904),
        help_all.action(ArgAction::HelpLong).global(true).display_order(905),
    ])
}

/// The stages' options that `command` shows although they are not its own.
fn common_options(command: &str) -> Vec<&'static str> {
    match command {
        "run" | "report" => [OF_THE_SCENE, OF_SIZE, OF_A_RUN, OF_ONE_SCENE].concat(),
        "batch" => [OF_THE_SCENE, OF_SIZE, OF_A_RUN].concat(),
        "segment" | "query" | "answer" | "vote" => OF_THE_SCENE.to_vec(),
        "show" => [OF_THE_SCENE, OF_A_FILM].concat(),
        _ => [OF_THE_SCENE, OF_SIZE].concat(),
    }
}

/// `gprop help COMMAND`: ends the process with that command's help.
pub fn show(of: &[String]) -> Result<()> {
    let words = ["gprop"].into_iter().chain(of.iter().map(String::as_str)).chain(["--help"]);
    match command().try_get_matches_from(words) {
        Err(help) => refuse(help),
        Ok(_) => Err(UsageError("there is no help on that; `gprop --help` lists the commands".to_owned()).into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two screens of fifty lines.
    const MOST_LINES: usize = 100;

    /// Every command and nested command with its words.
    fn commands() -> Vec<(String, clap::Command)> {
        let mut program = command().term_width(100);
        program.build();
        let mut found = vec![("gprop".to_owned(), program.clone())];
        for child in program.get_subcommands() {
            found.push((child.get_name().to_owned(), child.clone()));
            found
                .extend(child.get_subcommands().map(|c| (format!("{} {}", child.get_name(), c.get_name()), c.clone())));
        }
        found
    }

    #[test]
    fn the_help_of_every_command_fits_two_screens() {
        for (name, mut command) in commands() {
            let lines = command.render_help().to_string().lines().count();
            assert!(lines <= MOST_LINES, "gprop {name} --help has {lines} lines");
        }
    }

    #[test]
    fn a_command_shows_its_own_options_and_the_common_ones_and_help_all_shows_all() {
        let commands = commands();
        let find = |name: &str| commands.iter().find(|(found, _)| found == name).unwrap().1.clone();
        let has = |help: &str, flag: &str| help.split([' ', '\n', ',']).any(|word| word == flag);
        for (name, shown, hidden) in [
            ("run", "--lmm-url", "--crop-nms"),
            ("run", "--gripper", "--lmm-retries"),
            ("segment", "--crop-nms", "--lmm-url"),
            ("grasp", "--force-margin", "--sam-encoder"),
            ("parts", "--carve-views", "--sam-encoder"),
            ("export", "--format", "--sam-encoder"),
            ("evaluate parts", "--sam-encoder", "--crop-nms"),
            ("setup", "--sam-encoder", "--crop-nms"),
        ] {
            let mut command = find(name);
            let short = command.render_help().to_string();
            assert!(has(&short, shown), "gprop {name} --help lacks {shown}");
            assert!(has(&short, "--help-all"), "gprop {name} --help does not say how to see all");
            assert!(!has(&short, hidden), "gprop {name} --help has {hidden}");
            let all = command.render_long_help().to_string();
            let options: Vec<&str> =
                command.get_arguments().filter(|a| !a.is_hide_set()).filter_map(|a| a.get_long()).collect();
            let missing: Vec<_> = options.iter().filter(|flag| !all.contains(&format!("--{flag}"))).collect();
            assert!(missing.is_empty(), "gprop {name} --help-all lacks {missing:?}");
        }
    }

    #[test]
    fn every_heading_is_shown_by_a_command() {
        let stages = pipeline::Options::augment_args(clap::Command::new("stages"));
        let program = command();
        let own: Vec<&str> =
            program.get_subcommands().flat_map(|command| own_headings(command.get_name())).copied().collect();
        for argument in stages.get_arguments() {
            let (long, heading) =
                (argument.get_long().unwrap_or_default(), argument.get_help_heading().unwrap_or_default());
            assert!(own.contains(&heading) || OF_A_RUN.contains(&long), "no command shows --{long} ({heading})");
        }
    }

    #[test]
    fn every_name_in_the_lists_is_an_option_or_a_heading() {
        let stages = pipeline::Options::augment_args(clap::Command::new("stages"));
        let is_option = |name: &&&str| stages.get_arguments().any(|argument| argument.get_long() == Some(**name));
        assert_eq!(
            [OF_THE_SCENE, OF_SIZE, OF_A_RUN, OF_ONE_SCENE].concat().iter().filter(|name| !is_option(name)).count(),
            0
        );
        for command in command().get_subcommands() {
            for heading in own_headings(command.get_name()) {
                let has = stages.get_arguments().any(|argument| argument.get_help_heading() == Some(*heading));
                assert!(has, "no option has the heading {heading}");
            }
        }
    }
}
