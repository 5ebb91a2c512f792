//! Output for people at a terminal. Captions, server texts, file headers and names come from outside and may contain
//! characters that move the cursor, colour the text after them, change the window's title or reverse the reading
//! direction; they are shown as escapes.
//!
//! Everything that gprop prints, except help and bars, goes through this module: stdout and pages through [`harmless`],
//! stderr through [`tell`] and [`Log`].

use std::borrow::Cow;
use std::io::{self, Write};

/// Groups of three digits with commas between them.
pub fn thousands(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A count with its noun: "1 view", "2,000 views".
pub fn counted(count: usize, noun: &str) -> String {
    format!("{} {noun}{}", thousands(count as u64), if count == 1 { "" } else { "s" })
}

/// The word that agrees with a count: `one` ("is") for 1, else `more` ("are").
pub fn agreeing(count: usize, one: &'static str, more: &'static str) -> &'static str {
    if count == 1 { one } else { more }
}

/// `text` with the characters that act on a terminal written as JSON escapes (`\u001b`), so that JSON keeps its meaning.
/// Newlines and tabs are kept.
pub fn harmless(text: &str) -> Cow<'_, str> {
    escaped(text, |c| matches!(c, '\n' | '\t'))
}

/// Like [`harmless`], but also escapes newlines and tabs: for text on one line or in a table's cell.
pub fn one_line(text: &str) -> Cow<'_, str> {
    escaped(text, |_| false)
}

/// Prints lines on stderr. If stderr cannot be written, this is ignored.
pub fn tell(text: &str) {
    let _ = io::stderr().write_all(format!("{}\n", harmless(text)).as_bytes());
}

/// The log: one line on stderr per event.
#[derive(Debug, Clone, Copy)]
pub struct Log;

impl Write for Log {
    fn write(&mut self, event: &[u8]) -> io::Result<usize> {
        tell(&one_line(String::from_utf8_lossy(event).trim_end_matches('\n')));
        Ok(event.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The error in a TOML text, on one line.
pub fn toml_problem(error: &toml::de::Error, text: &str) -> String {
    let line = |start| text[..start].matches('\n').count() + 1;
    match error.span() {
        Some(span) => format!("line {}: {}", line(span.start), error.message()),
        None => error.message().to_owned(),
    }
}

fn escaped(text: &str, keep: impl Fn(char) -> bool) -> Cow<'_, str> {
    let acts = |c: char| acts_on_a_terminal(c) && !keep(c);
    if !text.contains(acts) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            c if !acts(c) => shown.push(c),
            '\n' => shown.push_str("\\n"),
            '\r' => shown.push_str("\\r"),
            '\t' => shown.push_str("\\t"),
            c => shown.push_str(&format!("\\u{:04x}", u32::from(c))),
        }
    }
    Cow::Owned(shown)
}

/// Control characters (C0, DEL, C1), line and paragraph separators, and the embeddings, overrides and isolates of
/// Unicode's bidirectional algorithm (UAX #9).
fn acts_on_a_terminal(c: char) -> bool {
    c.is_control() || matches!(c, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_acts_is_shown_and_the_rest_is_left() {
        let cases = [
            ("oak, 5 µm, 木", "oak, 5 µm, 木"),
            ("\x1b]0;title\x07", r"\u001b]0;title\u0007"),
            ("\u{9b}31m\u{7f}\u{8}", r"\u009b31m\u007f\u0008"),
            ("\u{202e}drawkcab\u{2069}", r"\u202edrawkcab\u2069"),
            ("50 %\r 5 %", r"50 %\r 5 %"),
        ];
        for (text, shown) in cases {
            assert_eq!((&*harmless(text), &*one_line(text)), (shown, shown));
        }
        assert_eq!((&*harmless("a\n\tb"), &*one_line("a\n\tb")), ("a\n\tb", r"a\n\tb"));
    }

    #[test]
    fn json_stays_the_same_json() {
        let value = serde_json::json!({ "caption": "\u{9b}2J\u{202e}\x1b[31m\u{7f}\n\u{2028}" });
        let text = serde_json::to_string_pretty(&value).unwrap();
        let shown = harmless(&text);
        assert!(!shown.chars().any(|c| acts_on_a_terminal(c) && c != '\n'), "{shown}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&shown).unwrap(), value);
    }
}
