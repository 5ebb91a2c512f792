// Answers: what was typed, which of the schema's fields belong to an answer, what it lacks, and what is saved.
"use strict";
const store = "gprop answers " + (served ? "" : queries.map((query) => query.query).join("").slice(0, 200));
const answers = JSON.parse(localStorage.getItem(store) || "{}");

const answerTo = (query) => (answers[query.query] ??= {});
/* The names of the fields, in the order in which the schema requires them. */
const namesOf = ({ required, properties }) => [...new Set([...required, ...Object.keys(properties)])];
const types = (property) => [].concat(property?.type || []);
const mayBeNull = (property) => types(property).includes("null");
const isNumber = (property) => types(property).includes("number");
const isRange = (property) => isNumber(property.items);
/* A list of objects, each with fields of its own. */
const isList = (property) => types(property.items).includes("object");
const options = (property) => (types(property).includes("boolean") ? [false, true] : (property.enum || []).filter((option) => option !== null));

/* An entry is an answer, or an item of a list in one: what was typed is in `record`, and `siblings` are the items of its list.
   `path` is "" or, for example, "pieces.0.choices.1.". */
const entryOf = (query) =>
  ({ query, answer: answerTo(query), record: answerTo(query), schema: texts[query.text].schema, path: "", siblings: [] });
const entriesOf = (entry, name) => (entry.record[name] || []).map((record, number, siblings) =>
  ({ ...entry, record, schema: entry.schema.properties[name].items, path: `${entry.path}${name}.${number}.`, siblings }));

/* The line of a table for a field: that of its lists and its name, such as "pieces.choices.inside", or else of its name. */
const lineOf = (table, { path }, name) => table[path.replace(/\d+\./g, "") + name] ?? table[name];

/* Fields that belong to some answers only: elsewhere they are hidden, and what was typed there is not saved. */
const isShell = ({ record }) => record.form === "shell", isMixed = ({ record }) => record.form === "mixed";
const isFilled = (entry) => isShell(entry) && entry.record.inside === "filled";
const isPrinted = ({ record }) => Boolean(record.printed?.trim());
const isOneOfSeveral = ({ siblings }) => siblings.length > 1;
const belongs = {
  wall_thickness_mm: isShell, inside: isShell, filling: isFilled, fill_share: isFilled, filling_density_kg_m3: isFilled,
  bulk_density_kg_m3: isMixed, bulk_reason: isMixed, printed_mass_g: isPrinted, printed_volume_ml: isPrinted,
  "hypotheses.probability": isOneOfSeveral, "pieces.choices.probability": isOneOfSeveral, numbers: isOneOfSeveral,
  "hypotheses.what": isOneOfSeveral, "pieces.caption": isOneOfSeveral,
  under: (entry) => isOneOfSeveral(entry) && entry.answer.hypotheses?.length > 1,
  panel: () => false, at: () => false,
  "alternatives.wall_thickness_mm": ({ answer }) => answer.form === "shell",
};
const isShown = (entry, name) => lineOf(belongs, entry, name)?.(entry) ?? true;

/* What is saved for fields that are left open; undefined if they must not be. */
const fallbacks = {
  printed_mass_g: () => null, printed_volume_ml: () => null, filling_density_kg_m3: () => null,
  "hypotheses.what": ({ answer, siblings, record }) => (record === siblings[0] && answer.object) || undefined,
  "hypotheses.probability": shareOf, "pieces.choices.probability": shareOf, "alternatives.probability": shareOf,
  "unnumbered.probability": () => 1,
  numbers: ({ query, siblings }) => (siblings.length === 1 ? query.regions : undefined),
  "pieces.caption": ({ answer, siblings, record }) => (siblings.length === 1 && answer.object) || record.choices?.[0].material,
  under: () => [],
  "pieces.choices.inside": (entry) => (isShell(entry) ? "not known" : undefined),
  "pieces.choices.density_kg_m3": (entry) => (isMixed(entry) ? undefined : known.get(entry.record.material)?.fields.density_kg_m3),
  "alternatives.density_kg_m3": ({ answer, record }) => (answer.form === "mixed" ? undefined : known.get(record.material)?.fields.density_kg_m3),
  "alternatives.wall_thickness_mm": ({ query, answer }) => (answer.form === "shell" ? reading(entryOf(query), "wall_thickness_mm").value : undefined),
};
function fallbackOf(entry, name) {
  const fallback = lineOf(fallbacks, entry, name);
  if (fallback) return fallback(entry);
  return mayBeNull(entry.schema.properties[name]) && !lineOf(belongs, entry, name) ? null : undefined;
}

/* Hypotheses exclude one another, and so do the choices of a piece under each hypothesis, and the alternatives to a material that is
   named with a confidence: for each such group that an entry is in, the probability that is left, and how many of the group have none
   yet. */
function groupsOf({ query, record, siblings, answer }) {
  const groupOf = (group, all) => {
    const given = group.map((other) => numbersFrom(other.probability, 1, [0, 100], "probability").value?.[0]);
    return { left: all - given.reduce((sum, percent = 0) => sum + percent / 100, 0), open: given.filter((percent) => percent === undefined).length };
  };
  if (!answer.hypotheses) return [groupOf(siblings, 1 - (reading(entryOf(query), "confidence").value ?? 0))];
  const under = record.under?.length ? record.under : answer.hypotheses.map((_, number) => number + 1);
  return under.map((hypothesis) => groupOf(siblings.filter((other) => !other.under?.length || other.under.includes(hypothesis)), 1));
}

/* An entry without a probability has an equal share of what is left. */
function shareOf(entry) {
  return entry.answer.hypotheses && entry.siblings.length === 1 ? 1 : Math.max(0, Math.min(...groupsOf(entry).map(({ left, open }) => left / open)));
}

function problemOfShare(entry) {
  const groups = groupsOf(entry), least = Math.min(...groups.map(({ left }) => left));
  const percent = Math.round(Math.abs(1000 * least)) / 10;
  if (!entry.answer.hypotheses) return least < -0.0005 ? `${percent} % too much: with the confidence, they make at most 100 %.` : undefined;
  if (least < -0.0005) return `${percent} % too much: together they make 100 %.`;
  if (least > 0.0005 && groups.every(({ open }) => !open)) return `${percent} % are left: together they make 100 %.`;
  return undefined;
}

/* Fields in which 1 is all of it: they may be typed in percent, too. */
const SHARES = ["confidence", "fill_share"];

/* A number as people type it, such as 1,5 or 80%, or the problem with it. What may mean two things is asked about. */
function numberFrom(text, name) {
  const [, digits, sign] = text.match(/^(.*?)\s*(%?)$/s);
  if (/^[1-9]\d{0,2}(,\d{3})+$/.test(digits)) {
    return { problem: `${digits.replace(",", ".")}, or ${digits.replaceAll(",", "")}? Type it without the comma.` };
  }
  const number = Number(digits.replace(",", "."));
  if (!digits || !Number.isFinite(number)) return { problem: "This is not a number." };
  if (sign && name !== "probability") return SHARES.includes(name) ? { number: number / 100 } : { problem: "This is not measured in percent." };
  if (!sign && name === "probability" && number > 0 && number < 1) {
    const percent = Math.round(1e4 * number) / 100;
    return { problem: `${number} %, or ${percent} %? Type ${number}% or ${percent}%.` };
  }
  return { number };
}

/* Numbers that were typed, within what is possible; one number alone is both ends of a range of two. */
function numbersFrom(typed, count, [lowest, highest], name) {
  const given = [].concat(typed ?? []).map((text) => String(text).trim()).filter(Boolean);
  if (!given.length) return {};
  const read = given.map((text) => numberFrom(text, name)), numbers = read.map(({ number }) => number);
  const problem = read.find(({ problem }) => problem)?.problem;
  if (problem) return { problem };
  if (count === 3 && given.length < count) return { problem: "All three numbers are needed." };
  if (numbers.some((number) => number < lowest || number > highest)) {
    return { problem: `Only ${lowest.toLocaleString("en")} to ${highest.toLocaleString("en")} is possible.` };
  }
  if (numbers.some((number, end) => number < numbers[end - 1])) return { problem: "The lowest number comes first." };
  return { value: numbers.length < count ? [numbers[0], numbers[0]] : numbers };
}

const limitsOf = (entry, name) => (name === "probability" ? [0, 100] : lineOf(limits, entry, name) || [-Infinity, Infinity]);

/* What a field holds, as it is saved; nothing if nothing was typed, or if there is a problem with it. A probability is typed in
   percent. */
function reading(entry, name) {
  const property = entry.schema.properties[name], typed = entry.record[name];
  if (isRange(property)) return numbersFrom(typed, property.minItems, limitsOf(entry, name), name);
  if (isNumber(property)) {
    const { value, problem } = numbersFrom(typed, 1, limitsOf(entry, name), name);
    return { value: value && (name === "probability" ? value[0] / 100 : value[0]), problem };
  }
  const value = typeof typed === "string" ? typed.trim() : typed;
  if (name === "filling" && value && !fillings.includes(value)) return { problem: isNotThere(value, nearestOf(value, fillings, (filling) => filling)) };
  if (name === "material" && !value && entry.record.not_taken) return { problem: problemOfMaterial(entry) };
  return { value: value == null || value.length === 0 ? undefined : value };
}

const isNotThere = (typed, nearest) =>
  `"${typed}" is not in the library${nearest.length ? `; the nearest ${nearest.length > 1 ? "are" : "is"} ${nearest.join("; ")}` : ""}.`;

/* What was typed as a material, and is none until it is chosen from the list. */
function problemOfMaterial({ query, record: { not_taken: typed } }) {
  const found = matching(query, typed).slice(0, 5).map(({ material }) => material);
  return found.length ? `Choose a material from the list, such as ${found.join("; ")}.` : isNotThere(typed, likeTyped(query, typed).map(({ material }) => material));
}

function problemOf(entry, name) {
  return reading(entry, name).problem || (lineOf(fallbacks, entry, name) === shareOf ? problemOfShare(entry) : undefined);
}

function lacks(entry, name) {
  const property = entry.schema.properties[name];
  if (!isShown(entry, name) || !entry.schema.required.includes(name)) return false;
  if (isList(property)) {
    const items = entriesOf(entry, name);
    return items.length < (property.minItems || 0) || items.some(isIncomplete);
  }
  return problemOf(entry, name) !== undefined || (reading(entry, name).value ?? fallbackOf(entry, name)) === undefined;
}
const isIncomplete = (entry) => namesOf(entry.schema).some((name) => lacks(entry, name));

function saved(entry, name) {
  if (isList(entry.schema.properties[name])) return entriesOf(entry, name).map(complete);
  const value = isShown(entry, name) ? reading(entry, name).value : undefined;
  return value ?? fallbackOf(entry, name) ?? null;
}

/* The fields of an entry in the schema's order; null for an empty field that may be null. */
function complete(entry) {
  return Object.fromEntries(namesOf(entry.schema).map((name) => [name, saved(entry, name)]));
}
