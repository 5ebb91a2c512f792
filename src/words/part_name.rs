//! Short names of parts, made from the long captions that a model writes.
//!
//! A caption says what a part is, what it does and how it looks: "bare hammer handle shaft that takes the blow in bending;
//! pale tan, coarse lengthwise grain". Its name is at most three words, by this rule:
//!
//! 1. Only the caption before its first comma, semicolon or colon or the end of its first sentence counts, without what
//!    stands in brackets.
//! 2. Of that, the words up to the first preposition, conjunction, article or participle ("under the seat", "that takes",
//!    "seen from above"); such words at the beginning are skipped.
//! 3. The last three of these words, because English puts the noun last: "hammer handle shaft".
//! 4. If these words are a single one, or end in a word for a piece, and "of" follows, their last word is put after the
//!    name of the whole: "end of the wooden hammer handle" becomes "hammer handle end".
//! 5. If nothing is left, the name is that of the material, up to its first comma.

/// The largest number of words in a name.
const WORDS: usize = 3;
/// The largest number of characters in one of its words: longer than any word of a material or tool.
const CHARACTERS: usize = 24;

/// Words that end the name of a thing: after them comes what it does, what it has or where it lies.
const ENDS: [&str; 74] = [
    "a",
    "an",
    "the",
    "its",
    "their",
    "this",
    "that",
    "which",
    "who",
    "whose",
    "where",
    "while",
    "and",
    "or",
    "but",
    "as",
    "of",
    "on",
    "in",
    "at",
    "to",
    "for",
    "with",
    "without",
    "from",
    "by",
    "under",
    "over",
    "below",
    "above",
    "behind",
    "between",
    "through",
    "around",
    "inside",
    "outside",
    "against",
    "beside",
    "near",
    "into",
    "onto",
    "across",
    "along",
    "within",
    "beyond",
    "seen",
    "shown",
    "standing",
    "covering",
    "holding",
    "carrying",
    "closing",
    "joining",
    "supporting",
    "bracing",
    "crossing",
    "crossed",
    "pulled",
    "caught",
    "made",
    "placed",
    "mounted",
    "fitted",
    "attached",
    "lying",
    "hanging",
    "resting",
    "wrapped",
    "used",
    "sticking",
    "forming",
    "facing",
    "connecting",
    "is",
];
/// Words for a piece of something.
const PIECES: [&str; 20] = [
    "end", "top", "bottom", "side", "edge", "middle", "centre", "center", "half", "part", "piece", "bit", "fragment",
    "patch", "patches", "front", "back", "rest", "section", "corner",
];

/// The short name of a part with this caption and material.
pub fn part_name(caption: &str, material: &str) -> String {
    let caption = without_brackets(caption);
    let mut words = first_clause(&caption).split_whitespace();
    let (phrase, end) = noun_phrase(&mut words);
    let has_whole = end.is_some_and(|end| end.eq_ignore_ascii_case("of"));
    let name = match phrase.as_slice() {
        [] => return material.split(',').next().unwrap_or_default().trim().to_owned(),
        [.., piece] if has_whole && (phrase.len() == 1 || is_one_of(&PIECES, piece)) => {
            let (whole, _) = noun_phrase(&mut words);
            [last(&whole, WORDS - 1), &[*piece]].concat()
        }
        all => last(all, WORDS).to_vec(),
    };
    name.into_iter().map(shortened).collect::<Vec<_>>().join(" ")
}

/// The text before its first comma, semicolon or colon, or before the full stop at the end of its first sentence: one that
/// ends the text, or that white space and a capital letter follow, unlike those of "approx. 5 mm" and "St. Andrew's cross".
fn first_clause(text: &str) -> &str {
    /// Abbreviations before a name.
    const TITLES: [&str; 4] = ["Dr", "Mr", "Mt", "St"];
    let ends_sentence = |before: &str, after: &str| {
        let next = after.trim_start();
        let word = before.split_whitespace().next_back().unwrap_or_default();
        next.is_empty() || (next.len() < after.len() && next.starts_with(char::is_uppercase) && !TITLES.contains(&word))
    };
    let ends = |(at, c): &(usize, char)| match c {
        ',' | ';' | ':' => true,
        '.' => ends_sentence(&text[..*at], &text[at + 1..]),
        _ => false,
    };
    text.char_indices().find(ends).map_or(text, |(at, _)| &text[..at])
}

/// The words before the first one that ends a name, and that one.
fn noun_phrase<'a>(words: &mut impl Iterator<Item = &'a str>) -> (Vec<&'a str>, Option<&'a str>) {
    let mut phrase = Vec::new();
    for word in words {
        if !is_one_of(&ENDS, word) {
            phrase.push(word);
        } else if !phrase.is_empty() {
            return (phrase, Some(word));
        }
    }
    (phrase, None)
}

fn is_one_of(list: &[&str], word: &str) -> bool {
    list.iter().any(|known| known.eq_ignore_ascii_case(word))
}

fn last<'w, 'a>(words: &'w [&'a str], most: usize) -> &'w [&'a str] {
    &words[words.len().saturating_sub(most)..]
}

fn shortened(word: &str) -> String {
    match word.char_indices().nth(CHARACTERS) {
        Some((at, _)) => format!("{}…", &word[..at]),
        None => word.to_owned(),
    }
}

fn without_brackets(text: &str) -> String {
    let mut depth = 0_u32;
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            c if depth == 0 => out.push(c),
            _ => {}
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_have_three_words_and_the_noun() {
        let cases = [
            ("bare hammer handle shaft that takes the blow in bending; pale tan", "hammer handle shaft"),
            ("ribbed sleeve grip on a hammer handle, for hold and damping", "ribbed sleeve grip"),
            ("end of the wooden hammer handle standing out of the head's eye; pale tan", "hammer handle end"),
            ("ball peen of a hammer head, rounded end", "ball peen"),
            ("far striking end (poll) of a ball-peen hammer head; satin grey", "hammer head end"),
            ("cylindrical striking poll of a ball-peen hammer", "cylindrical striking poll"),
            ("mug body, holds the drink", "mug body"),
            ("body of a mug", "mug body"),
            ("round coaster or base disc under a round object; matt beige", "round coaster"),
            ("crescent of a coaster disc, pressed beige", "coaster disc crescent"),
            ("white globe bulb standing inside the lampshade", "white globe bulb"),
            ("tapered front leg with side stretcher of a chair", "tapered front leg"),
            ("A lid", "lid"),
            ("under the seat", "seat"),
            ("Griff", "Griff"),
            ("End Of The Hammer Handle", "Hammer Handle End"),
            ("The lid. It is red, with a knob", "lid"),
            ("lid (round).", "lid"),
            ("end of the handle. Made of oak", "handle end"),
            ("approx. 5 mm rod", "5 mm rod"),
            ("6.5 mm. rod", "6.5 mm. rod"),
            ("St. Andrew's cross. It is white", "St. Andrew's cross"),
            ("foot no. 2. It is black", "foot no. 2"),
            ("White PP. It is shiny", "White PP"),
        ];
        for (caption, name) in cases {
            assert_eq!(part_name(caption, "steel"), name, "{caption}");
        }
    }

    #[test]
    fn without_words_it_is_the_material_and_long_words_are_cut() {
        assert_eq!(part_name("", "steel, medium carbon 1045"), "steel");
        assert_eq!(part_name("; red (a lid)", "cork, agglomerated"), "cork");
        assert_eq!(part_name("(unclosed lid", "cork"), "cork");
        assert_eq!(part_name(&"ö".repeat(30), ""), format!("{}…", "ö".repeat(24)));
    }
}
