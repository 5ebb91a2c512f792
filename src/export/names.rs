//! The names of bodies, links, geoms, prims and nodes, which are the same in every format: `mug__cup` is the part that is called a
//! cup, `mug__cup_0` the first of its colliders.

use std::collections::BTreeMap;

use super::identifier;
use crate::vote::FieldPart;

/// Most bytes of a part's own name. Whole words of its caption are taken.
const LONGEST: usize = 32;

/// What follows these words in a caption says where the thing is or what it has, not what it is.
const ENDS: [&str; 12] = ["with", "without", "that", "which", "of", "from", "in", "on", "for", "at", "under", "and"];

/// The own name of each part, by id: the first words of its caption, in lower case. Of parts that are called the same, those after
/// the first have a number.
pub fn of_parts(labels: &[FieldPart]) -> BTreeMap<u32, String> {
    let mut names: BTreeMap<u32, String> = BTreeMap::new();
    for label in labels {
        let first = of_caption(&label.caption);
        let mut name = first.clone();
        let mut number = 2;
        while names.values().any(|known| *known == name) {
            name = format!("{first}_{number}");
            number += 1;
        }
        names.insert(label.id, name);
    }
    names
}

/// A name that no part has.
pub fn new(labels: &[FieldPart], name: &str) -> String {
    let taken = of_parts(labels);
    let mut name = name.to_owned();
    while taken.values().any(|known| *known == name) {
        name.push('_');
    }
    name
}

/// A thing of an object, under a name that no other object has: several may be in one folder or one simulation.
pub fn within(object: &str, own: &str) -> String {
    format!("{object}__{own}")
}

/// The words up to the first comma, bracket or the like, or one of [`ENDS`], as many as fit.
fn of_caption(caption: &str) -> String {
    let head =
        caption.split([',', ';', ':', '(', '.']).map(str::trim).find(|piece| !piece.is_empty()).unwrap_or("part");
    let mut name = String::new();
    for word in head.split_whitespace() {
        let mut word = spelled(word);
        if !name.is_empty() && ENDS.contains(&word.as_str()) {
            break;
        }
        if name.is_empty() {
            word.truncate(LONGEST);
            name = word;
        } else if name.len() + 1 + word.len() <= LONGEST {
            name = format!("{name}_{word}");
        } else {
            break;
        }
    }
    if name.is_empty() { "part".to_owned() } else { name }
}

/// A word in letters, digits and underscores. It stands behind the object's name, so it may begin with a digit.
fn spelled(word: &str) -> String {
    let trimmed = word.trim_matches(|c: char| !c.is_alphanumeric());
    identifier(&format!("a{trimmed}"))[1..].to_lowercase()
}

#[cfg(test)]
mod tests {
    use super::of_caption;

    #[test]
    fn a_part_is_called_by_the_first_words_of_its_caption() {
        let captions = [
            "ribbed black grip sleeve with a closed end, pulled over",
            "Cup",
            "木の柄",
            "(lid)",
            "",
            "3 legs",
            "\"a\" <b>",
        ];
        let names = ["ribbed_black_grip_sleeve", "cup", "u6728u306eu67c4", "lid", "part", "3_legs", "a_b"];
        assert_eq!(captions.map(of_caption), names);
        assert!(of_caption(&"木".repeat(85)).len() <= 32);
    }
}
