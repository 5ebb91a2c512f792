//! Compares names: folded for equality, by weighted tokens for similarity.

use std::collections::HashMap;

/// American and variant spellings, with the spelling that the library uses.
const SPELLINGS: [(&str, &str); 24] = [
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

/// Two tokens with at least this similarity (1 minus edit distance over the longer length) count as misspellings of
/// each other.
const MISSPELLING: f64 = 0.74;

/// No name has more tokens. If the text given as a name is longer, only this many tokens are compared with every name.
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

    /// The row whose name is most similar to `name`, and the similarity from 0 to 1 (1: the same words in any order).
    ///
    /// The score is Dice's coefficient of the two token bags, each token weighted by ln(1 + N / frequency) so that
    /// "oak" decides and "wood" hardly counts. Equal scores go to the name with fewer tokens, then to the first row.
    pub fn nearest(&self, name: &str) -> Option<(usize, f64)> {
        let folded = fold(name);
        let wanted: Vec<&str> = folded.split(' ').filter(|token| !token.is_empty()).take(MOST_TOKENS).collect();
        let mut best: Option<(usize, f64, usize)> = None;
        for (tokens, row) in &self.names {
            let score = self.dice(&wanted, tokens);
            let better = best.is_none_or(|(_, top, length)| score > top || (score == top && tokens.len() < length));
            if score > 0.0 && better {
                best = Some((*row, score, tokens.len()));
            }
        }
        best.map(|(row, score, _)| (row, score))
    }

    fn dice(&self, wanted: &[&str], tokens: &[String]) -> f64 {
        let mut free: Vec<&str> = tokens.iter().map(String::as_str).collect();
        let mut shared = 0.0;
        for token in wanted {
            let likest = free
                .iter()
                .enumerate()
                .map(|(at, other)| (at, likeness(token, other)))
                .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
            if let Some((at, likeness)) = likest.filter(|(_, likeness)| *likeness >= MISSPELLING) {
                shared += 2.0 * likeness * self.weight(free.swap_remove(at));
            }
        }
        let all: f64 = wanted.iter().map(|t| self.weight(t)).chain(tokens.iter().map(|t| self.weight(t))).sum();
        if all > 0.0 { (shared / all).min(1.0) } else { 0.0 }
    }

    fn weight(&self, token: &str) -> f64 {
        self.weights.get(token).copied().unwrap_or(self.unknown_weight)
    }
}

/// 1 for equal tokens, reduced by the Levenshtein distance over the longer length. Tokens with digits are grades: equal
/// or different, never misspelt.
fn likeness(a: &str, b: &str) -> f64 {
    if a == b {
        return 1.0;
    }
    let is_grade = |token: &str| token.chars().any(|c| c.is_ascii_digit());
    let (short, long) = (a.len().min(b.len()), a.len().max(b.len()));
    if is_grade(a) || is_grade(b) || (short as f64) < MISSPELLING * long as f64 {
        return 0.0;
    }
    1.0 - edit_distance(a, b) as f64 / long as f64
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
