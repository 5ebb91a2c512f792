//! Output for people. Captions, server texts, file headers and names come from outside and may contain characters that
//! move a terminal's cursor, colour the text after them, change the window's title, reverse the reading direction or
//! cannot be seen; they are shown as escapes.
//!
//! Everything that gprop shows goes through this module: stdout through [`harmless`], stderr through [`tell`], pages
//! through [`super::html`], and tables through [`super::table`]. Only help and bars do not; they contain no text from
//! outside.

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

/// `text` with the characters that are [not shown](is_not_shown) written as JSON escapes (`\u001b`), so that JSON keeps its
/// meaning.
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

/// The error in a TOML text, on one line.
pub fn toml_problem(error: &toml::de::Error, text: &str) -> String {
    let line = |start| text[..start].matches('\n').count() + 1;
    match error.span() {
        Some(span) => format!("line {}: {}", line(span.start), error.message()),
        None => error.message().to_owned(),
    }
}

fn escaped(text: &str, keep: impl Fn(char) -> bool) -> Cow<'_, str> {
    let is_escaped = |c: char| is_not_shown(c) && !keep(c);
    if !text.contains(is_escaped) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            c if !is_escaped(c) => shown.push(c),
            '\n' => shown.push_str("\\n"),
            '\r' => shown.push_str("\\r"),
            '\t' => shown.push_str("\\t"),
            // JSON writes a character beyond U+FFFF as the two halves of UTF-16.
            c => c.encode_utf16(&mut [0; 2]).iter().for_each(|unit| shown.push_str(&format!("\\u{unit:04x}"))),
        }
    }
    Cow::Owned(shown)
}

/// Characters that are never shown as they are, anywhere: control characters (C0, DEL, C1), line and paragraph separators,
/// all that Unicode calls Bidi_Control (UAX #9), the byte order mark, and the invisible tags U+E0000 to U+E007F.
pub fn is_not_shown(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{2028}' | '\u{2029}' | '\u{feff}' | '\u{e0000}'..='\u{e007f}')
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
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
            ("\u{61c}\u{200e}\u{200f}\u{202a}\u{2066}", r"\u061c\u200e\u200f\u202a\u2066"),
            ("\u{feff}oak\u{e0041}\u{e007f}", r"\ufeffoak\udb40\udc41\udb40\udc7f"),
        ];
        for (text, shown) in cases {
            assert_eq!((&*harmless(text), &*one_line(text)), (shown, shown));
        }
        assert_eq!((&*harmless("a\n\tb"), &*one_line("a\n\tb")), ("a\n\tb", r"a\n\tb"));
    }

    #[test]
    fn json_stays_the_same_json() {
        let value =
            serde_json::json!({ "caption": "\u{9b}2J\u{202e}\x1b[31m\u{7f}\n\u{2028}\u{feff}\u{e0041}\u{200e}" });
        let text = serde_json::to_string_pretty(&value).unwrap();
        let shown = harmless(&text);
        assert!(!shown.chars().any(|c| is_not_shown(c) && c != '\n'), "{shown}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&shown).unwrap(), value);
    }
}
