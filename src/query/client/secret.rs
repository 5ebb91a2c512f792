//! Cuts a key out of texts that a server sends: whole or in part, as it is or escaped as in JSON, however often.
//!
//! A placeholder for servers that need no key ("none", "EMPTY", one letter) may be a word of any answer. It is cut only where
//! it follows the word `Bearer`.

const CUT: &str = "[key]";

/// Shorter texts are placeholders.
const SHORTEST: usize = 8;

/// Texts that consist of letters or of digits alone and are shorter than this are placeholders, and may be words or numbers of
/// any answer: keys have both.
const SHORTEST_OF_A_KIND: usize = 16;

/// A part of a key that has this many characters is cut. No word in an answer is likely to contain as many of them.
const PART: usize = 10;

/// The texts that are cut.
struct Pattern {
    /// In lower case.
    secret: Vec<u8>,
    /// The number of its characters that must be found in a row.
    least: usize,
    /// True if it must not go on with a letter or a digit.
    is_word: bool,
    /// For each pair of characters, whether the secret contains it.
    pairs: Vec<bool>,
}

/// `text` without `secret` and without long parts of it.
pub fn cut(secret: &str, text: &str) -> String {
    Pattern::of(secret, PART).cut(text)
}

/// `text` without `secret`. Parts of it stay: those of a text that is still in pieces are to be recognised once it is joined.
pub fn cut_whole(secret: &str, text: &str) -> String {
    Pattern::of(secret, usize::MAX).cut(text)
}

impl Pattern {
    /// The pattern of a secret or of parts of it that have `least` characters.
    fn of(secret: &str, least: usize) -> Self {
        let is_of_a_kind =
            secret.chars().all(|c| c.is_ascii_alphabetic()) || secret.chars().all(|c| c.is_ascii_digit());
        let is_word = secret.len() < if is_of_a_kind { SHORTEST_OF_A_KIND } else { SHORTEST };
        let text = if is_word { format!("bearer {secret}") } else { secret.to_owned() };
        let mut secret = Vec::new();
        let mut at = 0;
        while at < text.len() {
            let (byte, next) = character(text.as_bytes(), at);
            secret.push(byte);
            at = next;
        }
        let mut pairs = vec![false; 1 << 16];
        secret.windows(2).for_each(|pair| pairs[index(pair[0], pair[1])] = true);
        let least = if is_word { secret.len() } else { secret.len().min(least) };
        Self { secret, least, is_word, pairs }
    }

    fn cut(&self, text: &str) -> String {
        let bytes = text.as_bytes();
        let mut cut = String::with_capacity(text.len());
        let (mut at, mut kept) = (0, 0);
        while at < bytes.len() {
            match self.end_at(bytes, at) {
                Some(end) => {
                    cut.push_str(&text[kept..at]);
                    cut.push_str(CUT);
                    (at, kept) = (end, end);
                }
                None => at = character(bytes, at).1,
            }
        }
        cut.push_str(&text[kept..]);
        cut
    }

    /// The end of the longest part of the secret that begins at `at`; `None` if no part does that is long enough.
    fn end_at(&self, text: &[u8], at: usize) -> Option<usize> {
        let (first, next) = character(text, at);
        let (second, _) = character(text, next);
        if !self.pairs[index(first, second)] {
            return None;
        }
        let starts = 0..=self.secret.len() - self.least;
        starts.filter_map(|start| self.end_of(&self.secret[start..], text, at)).max()
    }

    /// The end of as many characters of `part` as stand at `at`.
    fn end_of(&self, part: &[u8], text: &[u8], mut at: usize) -> Option<usize> {
        let mut found = 0;
        while let Some(expected) = part.get(found)
            && let (byte, next) = character(text, at)
            && byte == *expected
        {
            found += 1;
            at = next;
        }
        let goes_on = self.is_word && character(text, at).0.is_ascii_alphanumeric();
        (found >= self.least && !goes_on).then_some(at)
    }
}

fn index(first: u8, second: u8) -> usize {
    (usize::from(first) << 8) | usize::from(second)
}

/// The character at `at` in lower case, and the place after it. Backslashes before a character belong to it, and `\u` with
/// four digits is the character that it stands for. Characters that no key has are given as one of their bytes; after the
/// end of the text there are zeros.
fn character(text: &[u8], at: usize) -> (u8, usize) {
    let rest = text.get(at..).unwrap_or_default();
    let backslashes = rest.iter().take_while(|byte| **byte == b'\\').count();
    match &rest[backslashes..] {
        [] => (0, at + backslashes.max(1)),
        [b'u', digits @ ..] if backslashes > 0 && digits.len() >= 4 => {
            let code = std::str::from_utf8(&digits[..4]).ok().and_then(|digits| u16::from_str_radix(digits, 16).ok());
            match code {
                Some(code) => (u8::try_from(code).unwrap_or(u8::MAX).to_ascii_lowercase(), at + backslashes + 5),
                None => (b'u', at + backslashes + 1),
            }
        }
        [byte, ..] => (byte.to_ascii_lowercase(), at + backslashes + 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: &str = "sk-ab/12cd34EF56gh78";

    #[test]
    fn a_key_is_cut_however_it_is_written() {
        let escaped: String = KEY.chars().map(|c| format!("\\u{:04X}", u32::from(c))).collect();
        let mixed = KEY.replace("sk", "\\u0073k").replace('/', "\\/");
        let texts = [
            KEY,
            &escaped,
            &mixed,
            &mixed.replace('\\', "\\\\"),
            &escaped.replace('\\', "\\\\\\\\"),
            &KEY.to_uppercase(),
        ];
        for text in texts {
            assert_eq!(cut(KEY, &format!("é \"{text}\" é")), "é \"[key]\" é", "{text}");
            assert_eq!(cut(KEY, text), "[key]", "{text}");
        }
        assert_eq!(cut(KEY, &format!("{KEY}{KEY}")), "[key][key]");
    }

    #[test]
    fn a_long_part_of_a_key_is_cut_and_a_short_one_is_not() {
        for part in [&KEY[..12], &KEY[5..], &KEY[4..15], &KEY[..10]] {
            assert_eq!(cut(KEY, &format!("<{part}>")), "<[key]>", "{part}");
        }
        assert_eq!(cut(KEY, "sk-ab***gh78"), "sk-ab***gh78", "as servers mask it");
        assert_eq!(cut_whole(KEY, &format!("{KEY} {}", &KEY[1..])), format!("[key] {}", &KEY[1..]));
    }

    #[test]
    fn a_placeholder_is_cut_after_the_word_bearer_only() {
        for key in ["a", "none", "sk-1", "anything", "material", "12345678", "123456789012345"] {
            let text = format!("{{\"{key}\": \"{key}\", \"density\": 0.{key}}} bearers, a Bearer {key}ly");
            assert_eq!(cut(key, &text), text);
            assert_eq!(cut(key, &format!("not Bearer {key}, and not BEARER {key}")), "not [key], and not [key]");
        }
    }

    #[test]
    fn texts_without_a_key_stay_as_they_are() {
        for text in ["", "\\", "\\\\", "\\u", "\\u00", "\\uD83D\\uDE00 😀 \\n\\u00e9", "s", "sk", "ssssk-ab/12c"] {
            assert_eq!(cut(KEY, text), text);
        }
    }
}
