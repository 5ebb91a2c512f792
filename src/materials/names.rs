//! Compares names: folded for equality, by weighted tokens for similarity.

use std::collections::HashMap;

/// American and variant spellings, with the spelling that the library uses.
pub const SPELLINGS: [(&str, &str); 24] = [
    ("aluminum", "aluminium"),
    ("anodised", "anodized"),
    ("armor", "armour"),
    ("caoutchouc", "rubber"),
    ("color", "colour"),
    ("colored", "coloured"),
    ("fiber", "fibre"),
    ("fiberboard", "fibreboard"),
    ("fiberglass", "fibreglass"),
    ("fibers", "fibre"),
    ("galvanised", "galvanized"),
    ("gray", "grey"),
    ("metallic", "metal"),
    ("molded", "moulded"),
    ("molding", "moulding"),
    ("plow", "plough"),
    ("polythene", "polyethylene"),
    ("sulfide", "sulphide"),
    ("tire", "tyre"),
    ("tires", "tyre"),
    ("vulcanised", "vulcanized"),
    ("wooden", "wood"),
    ("woolen", "wool"),
    ("woollen", "wool"),
];

/// A token that is in no name counts as a misspelling of one with at least this similarity (1 minus edit distance over
/// the longer length). Of two tokens that are in names, neither is a misspelling: metal is not a misspelling of petal.
const MISSPELLING: f64 = 0.74;

/// No built-in name has more tokens. If the text given as a name is longer, only this many tokens are compared with every
/// name.
const MOST_TOKENS: usize = 32;

/// Lower case, punctuation as single spaces, one spelling: names that are equal after this are the same name.
pub fn fold(name: &str) -> String {
    let lower = name.to_lowercase();
    let mut folded = String::with_capacity(lower.len());
    for word in lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()) {
        if !folded.is_empty() {
            folded.push(' ');
        }
        let spelling = SPELLINGS.binary_search_by(|(variant, _)| variant.cmp(&word));
        folded.push_str(spelling.map_or(word, |at| SPELLINGS[at].1));
    }
    folded
}

/// "oak, white" in its usual order: "white oak". `None` without exactly one comma.
pub fn inverted(name: &str) -> Option<String> {
    let (head, rest) = name.split_once(',')?;
    (!rest.contains(',')).then(|| format!("{} {}", rest.trim(), head.trim()))
}

/// Names as bags of tokens, each weighted by its rarity.
#[derive(Debug, Clone)]
pub struct TokenIndex {
    /// The tokens of each name, and the row to which the name belongs.
    names: Vec<(Vec<String>, usize)>,
    weights: HashMap<String, f64>,
    unknown_weight: f64,
}

impl TokenIndex {
    /// An index of folded `(name, row)` pairs.
    pub fn new<'a>(folded: impl Iterator<Item = (&'a str, usize)>) -> Self {
        let names: Vec<(Vec<String>, usize)> =
            folded.map(|(name, row)| (name.split(' ').map(str::to_owned).collect(), row)).collect();
        let mut counts: HashMap<String, usize> = HashMap::new();
        for token in names.iter().flat_map(|(tokens, _)| tokens) {
            *counts.entry(token.clone()).or_default() += 1;
        }
        let total = names.len() as f64;
        let weights = counts.into_iter().map(|(token, count)| (token, (1.0 + total / count as f64).ln())).collect();
        Self { names, weights, unknown_weight: (1.0 + total).ln() }
    }

    /// Of the rows for which `may_be` is true, the one whose name is most similar to `name`, and the similarity from 0 to 1
    /// (1: the same words in any order).
    ///
    /// The score is Dice's coefficient of the two token bags, each token weighted by ln(1 + N / frequency) so that
    /// "oak" decides and "wood" hardly counts. A misspelt token has the weight of the token that it stands for, and counts
    /// as shared in proportion to their similarity. Equal scores go to the name with fewer tokens, then to the first row.
    pub fn nearest(&self, name: &str, may_be: impl Fn(usize) -> bool) -> Option<(usize, f64)> {
        let folded = fold(name);
        let tokens = folded.split(' ').filter(|token| !token.is_empty()).take(MOST_TOKENS);
        let wanted: Vec<Wanted> = tokens.map(|token| Wanted::new(token, self.weights.contains_key(token))).collect();
        let mut best: Option<(usize, f64, usize)> = None;
        for (tokens, row) in self.names.iter().filter(|(_, row)| may_be(*row)) {
            let score = self.dice(&wanted, tokens);
            let better = best.is_none_or(|(_, top, length)| score > top || (score == top && tokens.len() < length));
            if score > 0.0 && better {
                best = Some((*row, score, tokens.len()));
            }
        }
        best.map(|(row, score, _)| (row, score))
    }

    fn dice(&self, wanted: &[Wanted], tokens: &[String]) -> f64 {
        let mut free: Vec<&str> = tokens.iter().map(String::as_str).collect();
        let mut shared = 0.0;
        let mut all: f64 = tokens.iter().map(|token| self.weight(token)).sum();
        for wanted in wanted {
            let likest = free
                .iter()
                .enumerate()
                .map(|(at, other)| (at, wanted.likeness(other)))
                .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
            if let Some((at, likeness)) = likest.filter(|(_, likeness)| *likeness >= MISSPELLING) {
                let weight = self.weight(free.swap_remove(at));
                shared += 2.0 * likeness * weight;
                all += weight;
            } else {
                all += self.weight(wanted.token);
            }
        }
        // The minimum is for rounding: the sums are not in the same order.
        if all > 0.0 { (shared / all).min(1.0) } else { 0.0 }
    }

    fn weight(&self, token: &str) -> f64 {
        self.weights.get(token).copied().unwrap_or(self.unknown_weight)
    }
}

/// A token of the text that is looked up.
struct Wanted<'a> {
    token: &'a str,
    /// Number of characters.
    length: usize,
    /// False for tokens of names and for grades.
    may_be_misspelt: bool,
}

impl<'a> Wanted<'a> {
    /// `is_known`: it is a token of a name.
    fn new(token: &'a str, is_known: bool) -> Self {
        Self { token, length: token.chars().count(), may_be_misspelt: !is_known && !is_grade(token) }
    }

    /// 1 for equal tokens. A token that is in no name may be misspelt: 1 minus the Levenshtein distance over the longer
    /// length. Tokens with digits are grades: equal or different, never misspelt.
    fn likeness(&self, other: &str) -> f64 {
        if self.token == other {
            return 1.0;
        }
        if !self.may_be_misspelt || is_grade(other) {
            return 0.0;
        }
        let other_length = other.chars().count();
        let (short, long) = (self.length.min(other_length), self.length.max(other_length));
        if (short as f64) < MISSPELLING * long as f64 {
            return 0.0;
        }
        1.0 - edit_distance(self.token, other) as f64 / long as f64
    }
}

fn is_grade(token: &str) -> bool {
    token.chars().any(|c| c.is_ascii_digit())
}

fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, to) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(from != *to);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(row[j + 1] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::TokenIndex;

    fn index() -> TokenIndex {
        let names = ["gun metal", "petal", "wool", "pine wood", "aluminium", "alloy of aluminium", "steel 304"];
        TokenIndex::new(names.into_iter().zip(0..))
    }

    #[test]
    fn a_word_of_one_name_is_no_misspelling_of_another() {
        for (name, row) in [("metal", 0), ("wood", 3), ("wooden", 3)] {
            assert_eq!(index().nearest(name, |_| true).map(|(row, _)| row), Some(row), "{name}");
        }
        assert_eq!(index().nearest("metal", |row| row == 1), None, "of another kind");
    }

    /// One letter of nine is missing; 304 and 305 are different grades.
    #[test]
    fn a_misspelt_word_counts_in_proportion_to_its_likeness() {
        let (row, score) = index().nearest("alumnium", |_| true).expect("a name");
        assert_eq!(row, 4);
        assert!((score - 8.0 / 9.0).abs() < 1e-12, "{score}");
        assert_eq!(index().nearest("305", |_| true), None);
        let (row, score) = index().nearest("metal gun", |_| true).expect("a name");
        assert!(row == 0 && score > 1.0 - 1e-12 && score <= 1.0, "{row} {score}");
    }

    /// Two letters of six differ, which is too many; in bytes, it would be two of eight.
    #[test]
    fn lengths_are_in_characters() {
        let index = TokenIndex::new([("mohair", 0)].into_iter());
        assert_eq!(index.nearest("möhäir", |_| true), None);
        assert!(index.nearest("möhair", |_| true).is_some(), "one of six");
    }
}
