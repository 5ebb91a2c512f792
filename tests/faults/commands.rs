//! Commands that gprop suggests, for folders whose names a shell would run.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use super::run;
use crate::batch::ball::Balls;
use crate::run::gprop;

/// A name that creates the file `X` wherever a shell reads it unquoted or in double quotes.
const EVIL: &str = "a$(touch X)`touch X`b;touch X;'\u{202e}";

/// The commands between backticks in a message, as far as they begin with `begin`.
fn suggested<'a>(message: &'a str, begin: &str) -> Vec<&'a str> {
    // A name has backticks too, so a command ends at the backtick before a space, a comma or the like.
    let rest = message.match_indices(begin).map(|(at, _)| &message[at..]);
    let end = |rest: &'a str| ["` ", "`,", "`;", "`)", "`\n", "`\""].iter().filter_map(|end| rest.find(end)).min();
    rest.map(|rest| rest[..end(rest).unwrap_or(rest.trim_end().trim_end_matches('`').len())].trim_end()).collect()
}

/// Has a shell read the commands that gprop suggests in `output`, and fails if one does more than name the folder.
#[track_caller]
fn assert_quoted(output: &Output, begin: &str, folder: &Path) {
    let message = [output.stdout.as_slice(), &output.stderr].concat();
    let message = String::from_utf8(message).unwrap();
    let commands = suggested(&message, begin);
    assert!(!commands.is_empty(), "no {begin:?} in {message}");
    for command in commands {
        let home = tempfile::tempdir().unwrap();
        let words = format!("printf '%s\\n' {command}");
        let read = Command::new("bash").current_dir(home.path()).env("LC_ALL", "C.UTF-8").args(["-c", &words]).output();
        let read = String::from_utf8(read.unwrap().stdout).unwrap();
        assert!(read.contains(&folder.display().to_string()), "{command} is {read}");
        assert_eq!(fs::read_dir(home.path()).unwrap().count(), 0, "{command} ran something");
    }
}

#[test]
fn a_suggested_command_runs_nothing_that_a_name_says() {
    let balls = Balls::new(1);
    let evil = balls.folder().join(EVIL);
    fs::create_dir(&evil).unwrap();
    fs::rename(balls.scene(0), evil.join("scene")).unwrap();
    let asked = |words: &[&str], folder: &Path| gprop().args(words).arg(folder).output().unwrap();
    assert_quoted(&asked(&["view"], &evil), "gprop report ", &evil);
    assert_quoted(&asked(&["view"], &evil), "gprop inspect ", &evil);
    assert_quoted(&asked(&["run"], &evil), "gprop batch ", &evil);
    assert_quoted(&asked(&["evaluate", "robustness"], &evil.join("scene")), "gprop run ", &evil.join("scene"));
}

#[test]
fn a_path_to_allow_is_quoted() {
    let (balls, outside, out) = (Balls::new(1), tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let evil = outside.path().canonicalize().unwrap().join(EVIL);
    fs::create_dir(&evil).unwrap();
    let photo = balls.scene(0).join("images/000.png");
    fs::rename(&photo, evil.join("000.png")).unwrap();
    std::os::unix::fs::symlink(evil.join("000.png"), &photo).unwrap();
    assert_quoted(&run(&balls, out.path()), "--allow-read ", &evil);
}
