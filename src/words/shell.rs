//! Commands that gprop suggests: whoever copies one into a shell runs what it says and nothing else, whatever files and
//! scenes are called.

use std::path::Path;

use super::output::{is_not_shown, one_line};

/// A word of a command, quoted if a shell would take it for anything but itself.
pub fn word(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=,@%+".contains(c);
    if word.contains(is_not_shown) {
        // bash, zsh and ksh read escapes in `$'...'`, so the word can be shown and is still the same.
        return format!("$'{}'", word.chars().map(ansi_c).collect::<String>());
    }
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

/// A path as a word of a command that takes it for a path, not for an option.
pub fn path(path: &Path) -> String {
    let text = path.to_string_lossy();
    if text.starts_with('-') { word(&format!("./{text}")) } else { word(&text) }
}

/// A character inside `$'...'`.
fn ansi_c(c: char) -> String {
    match c {
        '\'' | '\\' => format!("\\{c}"),
        c if is_not_shown(c) && u32::from(c) > 0xffff => format!("\\U{:08x}", u32::from(c)),
        c if is_not_shown(c) => one_line(c.encode_utf8(&mut [0; 4])).into_owned(),
        c => c.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;

    #[test]
    fn a_shell_reads_the_word_that_was_meant() {
        let words =
            ["scene", "", "a$(touch X)", "a b", "it's; `ls` & \"x\" > y", "*?[a]{b,c}~", "-x", "#!", "木", "a\nb"];
        let evil = ["\u{1b}]0;x\u{7}'\\$(ls)", "\u{202e}\u{feff}", "\u{e0041}", "\t\r\n"];
        for text in words.into_iter().chain(evil) {
            let shown = word(text);
            assert!(!shown.contains(is_not_shown), "{shown:?}");
            let echo =
                Command::new("bash").env("LC_ALL", "C.UTF-8").args(["-c", &format!("printf %s {shown}")]).output();
            let Ok(echo) = echo else { continue };
            assert_eq!(String::from_utf8_lossy(&echo.stdout), text, "{shown}");
        }
        assert_eq!(path(Path::new("-rf")), "./-rf");
        assert_eq!(path(Path::new("a/b")), "a/b");
    }
}
