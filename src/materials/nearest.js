// Names that are like what was typed: for misspellings, and to say what there is instead of a name that the library lacks.
const wordsIn = (text) => text.toLowerCase().split(/[^\p{L}\p{N}]+/u).filter(Boolean);

/* Under this likeness, two words have nothing to do with each other. */
const UNLIKE = 0.5;

/* 1 minus the edit distance over the longer length. */
function likeness(one, other) {
  let row = [...Array(other.length + 1).keys()];
  for (let i = 1; i <= one.length; i++) {
    const next = [i];
    for (let j = 1; j <= other.length; j++) next[j] = Math.min(row[j] + 1, next[j - 1] + 1, row[j - 1] + (one[i - 1] !== other[j - 1]));
    row = next;
  }
  return 1 - row[other.length] / Math.max(one.length, other.length);
}

/* Of `all`, the `most` whose words, those of `textOf`, are likest to the typed ones, the likest first; none if all are unlike. */
function nearestOf(typed, all, textOf, most = 5) {
  const typedWords = wordsIn(typed).slice(0, 8).map((word) => word.slice(0, 40));
  const seen = new Map();
  const like = (word, other) => {
    const key = word + " " + other;
    if (!seen.has(key)) seen.set(key, likeness(word, other));
    return seen.get(key);
  };
  const scored = all.map((one) => {
    const words = wordsIn(textOf(one));
    const sum = typedWords.reduce((sum, word) => sum + Math.max(0, ...words.map((other) => like(word, other))), 0);
    return { one, words: words.length, score: sum / (typedWords.length || 1) };
  });
  return scored.filter(({ score }) => score >= UNLIKE).sort((a, b) => b.score - a.score || a.words - b.words).slice(0, most).map(({ one }) => one);
}
