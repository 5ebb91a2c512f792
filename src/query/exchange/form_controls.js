// Controls: a node for every field of a schema, the same for an answer and for the items of its lists. A control's `update` shows
// what was typed, and in grey what is saved if nothing is.
const make = (tag, properties, ...children) => {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
};
const SUGGESTIONS = 40;
const UNITS = { kg_m3: "kg/m³", mpa: "MPa", mm: "mm", ml: "ml", g: "g" };
const WORDS = {
  probability: "probability, %", printed: "printed on it about its contents", numbers: "regions, by their numbers", under: "only if it is",
  hypotheses: "what it may be", choices: "made of", alternatives: "or else made of", unnumbered: "what has no number",
  confidence: "confidence in the material, 0 to 1", fill_share: "share of the hollow, 0 to 1",
};
/* What fields ask, and what options mean. */
const HELP = {
  several_materials: "Yes if you see more than one material in the marked part; then answer for the one that covers most of it. A print or a coat of paint is none.",
  form: "Whether the part is one material through and through.",
  wall_thickness_mm: "How thick the wall is. One number if you know it, two if it lies between them.",
  inside: "What is behind the wall. A sealed package is filled; an open cup is empty unless its contents show.",
  filling: "What fills the hollow: choose a name from the list.",
  fill_share: "How much of the hollow is filled, with the gaps between the pieces: 0.95 for a full bottle.",
  bulk_density_kg_m3: "Its mass divided by the volume within its outer surface, with all gaps.",
  confidence: "How sure you are of the material: 1 if you know it, 0.5 if it may as well be another.",
  alternatives: "What else it may be made of. What you leave to none of them is for anything else.",
  numbers: "The numbers in the picture that belong to this piece.",
  probability: "How probable this is. What you leave open is what is left to 100.",
  printed: "What is written on it, such as NET WT 305 g. Nothing if nothing is.",
  mass_g: "The mass of the whole object if this is what it is. One number if you know it.",
  solid: "One material through and through: a hammer's head, a wooden spoon.",
  shell: "A wall with a hollow or something else behind it: a cup, a can, a lid, a cover.",
  mixed: "Neither, so that only its density as a whole can be judged: a book, a motor in its housing, a bundle of cables.",
  empty: "Air.",
  filled: "Something, even if no photo shows it.",
};
const help = (name) => HELP[name] || "";
/* The buttons of lists. */
const ADD = { hypotheses: "It may also be ...", pieces: "Another piece", choices: "Or else ...", alternatives: "Or else ...", unnumbered: "Something without a number" };
const REMOVE = { hypotheses: "It is not this", pieces: "Remove this piece", choices: "Not this", alternatives: "Not this", unnumbered: "Remove" };
const label = (name) => WORDS[name] || name.replace(/_(kg_m3|mpa|mm|ml|g)$/, (_, unit) => ", " + UNITS[unit]).replaceAll("_", " ");
const wordFor = (option) => (option === false ? "no" : option === true ? "yes" : String(option));

function textControl(change, more) {
  const input = make("input", { type: "text", ...more });
  input.addEventListener("input", () => change(input.value));
  input.update = (typed, fallback) => {
    if (input !== document.activeElement) input.value = typed ?? "";
    input.placeholder = fallback ?? more?.placeholder ?? "";
  };
  return input;
}

/* A range of two numbers, or of three with the one in the middle. */
function rangeControl(property, change) {
  const names = property.minItems === 3 ? ["lowest", "best guess", "highest"] : ["lowest", "highest"];
  const read = () => change(ends.map((input) => input.value));
  const ends = names.map((name) => textControl(read, { inputMode: "decimal", ariaLabel: name, placeholder: name }));
  const range = make("span", { className: "range" }, ...ends);
  range.update = (typed, fallback) => ends.forEach((input, end) => input.update(typed?.[end], fallback?.[end]));
  return range;
}

function optionsControl(name, property, change) {
  const all = options(property), group = make("span", { className: "options", role: "radiogroup" });
  const inputs = all.map((option, number) => {
    const input = make("input", { type: "radio", name });
    input.addEventListener("change", () => change(option));
    group.append(make("label", { title: help(option) }, input, `${number + 1} ${wordFor(option)}`));
    return input;
  });
  group.addEventListener("keydown", (event) => {
    const input = inputs[Number(event.key) - 1];
    if (!input) return;
    event.preventDefault();
    input.focus();
    change(all[inputs.indexOf(input)]);
    goOn(input);
  });
  group.update = (typed, fallback) => inputs.forEach((input, number) => { input.checked = all[number] === (typed ?? fallback); });
  return group;
}

/* Offers the names of the library's fillings; anything else is no answer. */
function fillingControl(change) {
  const input = textControl(change, { placeholder: "water, sugar, foam ..." });
  input.setAttribute("list", "fillings");
  return input;
}

/* Several of `all()`, each with a value and a text, to switch on and off. A click leaves the focus where it is. */
function chipsControl(all, toggle) {
  const group = make("span", { className: "chips" });
  group.addEventListener("mousedown", (event) => event.preventDefault());
  group.update = (typed) => {
    const chips = all();
    while (group.children.length > chips.length) group.lastChild.remove();
    while (group.children.length < chips.length) group.append(make("button", { type: "button" }));
    chips.forEach(({ value, text }, number) => {
      const isOn = (typed || []).includes(value);
      Object.assign(group.children[number], { textContent: text, ariaPressed: String(isOn), onclick: () => toggle(value, isOn) });
    });
  };
  return group;
}

const sorted = (numbers) => [...numbers].sort((a, b) => a - b);
const without = (list, value) => (list || []).filter((other) => other !== value);

/* Every region is in one piece: a click takes it from the piece that has it; a second click gives it back to the first. */
function regionsControl({ query, siblings, record }) {
  const all = () => query.regions.map((region) => ({ value: region, text: region }));
  return chipsControl(all, (region, isOn) => {
    for (const piece of siblings) piece.numbers = without(piece.numbers, region);
    const piece = isOn ? siblings[0] : record;
    piece.numbers = sorted([...piece.numbers, region]);
    keep();
  });
}

function hypothesesControl({ answer, record }, change) {
  const all = () => answer.hypotheses.map(({ what }, number) => ({ value: number + 1, text: `${number + 1} ${what || ""}` }));
  return chipsControl(all, (hypothesis, isOn) => change(sorted(isOn ? without(record.under, hypothesis) : [...(record.under || []), hypothesis])));
}

/* The materials to choose from: those that the end of the prompt lists, one family per line, as in "wood: ash, white; beech; ...";
   all of the library if the question names none. */
const known = new Map(materials.map((material) => [material.fields.material, material]));
const choice = (family, material) => {
  const { aliases = [], fields = { family, material } } = known.get(material) || {};
  return { family, material, fields, names: [material, ...aliases], found: [material, family, ...aliases].join(" ").toLowerCase() };
};
const choicesOf = ({ prompt, schema }) => {
  if (!schema.properties.family) return materials.map(({ fields }) => choice(fields.family, fields.material));
  return (schema.properties.family.enum || []).flatMap((family) => {
    const line = prompt.split("\n").find((line) => line.startsWith(family + ": ")) || "";
    return line.slice(family.length + 2).split("; ").filter(Boolean).map((material) => choice(family, material));
  });
};
const choices = texts.map(choicesOf);

/* How well a material fits a word: it is in the name, in another name or the family, one of these begins with it, or it is part of
   a longer word. */
function rank({ material, found }, word) {
  if (wordsIn(material).includes(word)) return 0;
  if (wordsIn(found).includes(word)) return 1;
  return wordsIn(found).some((other) => other.startsWith(word)) ? 2 : 3;
}

/* 2 if the text is a name of the material, 1 if it is the noun of one, such as "steel, mild" or "clay pot". */
function isNamed({ material, names }, text) {
  const typed = text.trim().toLowerCase(), is = (name) => name.toLowerCase() === typed;
  if (names.some(is)) return 2;
  return is(material.split(",")[0]) || names.some((name) => name.toLowerCase().endsWith(" " + typed)) ? 1 : 0;
}

/* 2 if the name begins with the text, 1 if another name does. */
function begins({ material, names }, text) {
  const typed = wordsIn(text).join(" "), is = (name) => wordsIn(name).join(" ").startsWith(typed);
  return is(material) ? 2 : names.some(is) ? 1 : 0;
}

/* The materials that have all of the words in their name, family or other names, the best first: those that are called just so,
   then those that begin so, then by their ranks. Parts of longer words count only if there is nothing better. */
function matching(query, text) {
  const words = wordsIn(text);
  const all = choices[query.text].filter((choice) => words.every((word) => choice.found.includes(word)));
  if (!words.length) return all;
  const ranked = all.map((choice) => ({ choice, ranks: words.map((word) => rank(choice, word)) }));
  const whole = ranked.filter(({ ranks }) => Math.max(...ranks) < 3);
  const sum = ({ ranks }) => ranks.reduce((total, one) => total + one, 0);
  return (whole.length ? whole : ranked)
    .sort((a, b) => isNamed(b.choice, text) - isNamed(a.choice, text) || begins(b.choice, text) - begins(a.choice, text)
      || sum(a) - sum(b) || a.choice.material.length - b.choice.material.length)
    .map(({ choice }) => choice);
}

/* The materials whose names are likest to a text that none has, as to a misspelling. */
const likeTyped = (query, text) => nearestOf(text, choices[query.text], ({ found }) => found);

/* The other name by which a material was found, if it is not its own. */
function otherName({ material, names }, text) {
  const has = (name) => wordsIn(text).every((word) => name.toLowerCase().includes(word));
  return has(material) ? "" : names.find(has) || "";
}

function materialControl(entry) {
  const { query, path, record, schema } = entry, id = path + "materials";
  const input = make("input", { type: "text", placeholder: "steel, oak, cork ..." });
  const list = make("ul", { role: "listbox", hidden: true, id });
  for (const [name, to] of [["role", "combobox"], ["aria-controls", id], ["aria-expanded", "false"]]) input.setAttribute(name, to);
  let found = [], marked = 0;
  /* -1: none is marked yet, and Enter takes none. */
  const mark = (to) => {
    marked = Math.min(Math.max(to, -1), found.length - 1);
    [...list.children].forEach((item, number) => item.setAttribute("aria-selected", String(number === marked)));
    list.children[marked]?.scrollIntoView({ block: "nearest" });
  };
  const open = (isOpen) => { list.hidden = !isOpen; input.setAttribute("aria-expanded", String(isOpen)); };
  const suggest = () => {
    const all = matching(query, input.value), isFound = all.length > 0;
    found = isFound ? all.slice(0, SUGGESTIONS) : likeTyped(query, input.value);
    list.replaceChildren(...found.map((choice, number) => {
      const more = [choice.family, otherName(choice, input.value)].filter(Boolean).join(": ");
      const item = make("li", { role: "option" }, choice.material, " ", make("small", {}, more));
      item.addEventListener("pointerdown", (event) => { event.preventDefault(); take(number); });
      return item;
    }));
    if (all.length > found.length) list.append(make("li", { className: "more" }, `${all.length - found.length} more: keep typing`));
    if (!isFound) list.append(make("li", { className: "more" }, found.length ? "these are the nearest; what you typed is not in the library" : "not in the library"));
    open(true);
    mark(isFound ? 0 : -1);
  };
  /* Fills in what the library knows, except what is saved anyway if it is left open. */
  const take = (number) => {
    const { fields } = found[number];
    for (const name of Object.keys(schema.properties)) {
      if (name in fields && !lineOf(fallbacks, entry, name)) record[name] = fields[name];
    }
    record.not_taken = undefined;
    input.value = fields.material;
    open(false);
    keep();
    goOn(input);
  };
  input.addEventListener("input", () => { record.material = record.not_taken = undefined; keep(); if (input.value.trim()) suggest(); else open(false); });
  input.addEventListener("focus", () => { input.select(); if (record.material === undefined && input.value.trim()) suggest(); });
  input.addEventListener("blur", () => {
    open(false);
    if (record.material !== undefined || !input.value.trim()) return;
    record.not_taken = input.value.trim();
    keep();
  });
  input.addEventListener("keydown", (event) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (step && !event.altKey) { event.preventDefault(); if (list.hidden) suggest(); else mark(Math.max(marked + step, 0)); }
    if (event.key === "Escape") open(false);
    if (event.key === "Enter" && !list.hidden && found[marked]) { event.preventDefault(); event.stopPropagation(); take(marked); }
  });
  const combo = make("span", { className: "combo" }, input, list);
  combo.update = (typed) => { if (input !== document.activeElement) input.value = typed ?? record.not_taken ?? ""; };
  return combo;
}

/* The items of a list, each with its fields; those that have lists of their own fold away, one of them open at a time. */
function listControl(entry, name) {
  const property = entry.schema.properties[name], { record, query } = entry;
  const folds = Object.values(property.items.properties).some(isList);
  const most = name === "pieces" ? query.regions.length : property.maxItems ?? Infinity;
  const list = make("div", { className: "list" });
  const add = make("button", { type: "button" }, ADD[name] || "Add another");
  const blank = () => (name === "pieces" ? { numbers: record[name].length ? [] : query.regions } : {});
  const draw = () => {
    list.replaceChildren(...entriesOf(entry, name).map(item), add);
    add.hidden = record[name].length >= most;
  };
  const item = (one, number) => {
    const remove = make("button", { type: "button", className: "remove", hidden: record[name].length <= (property.minItems || 0) }, REMOVE[name] || "Remove");
    remove.addEventListener("click", () => {
      removed(entry, name, number);
      clearHidden(entryOf(query));
      draw();
      keep();
      add.focus();
    });
    if (!folds) return make("div", { className: "item" }, ...rowsOf(one), remove);
    return make("details", { className: "item", name, open: number === record[name].length - 1 }, make("summary"), ...rowsOf(one), remove);
  };
  add.addEventListener("click", () => {
    record[name].push(blank());
    draw();
    keep();
    const added = add.previousSibling;
    focusOn(added.querySelector(".combo input") || stops().find((node) => added.contains(node)));
  });
  list.update = () => entriesOf(entry, name).forEach((one, number) => {
    const summary = list.children[number]?.querySelector(":scope > summary");
    if (summary) summary.textContent = titleOf(one);
  });
  record[name] ??= [];
  if (property.minItems && !record[name].length) record[name].push(blank());
  draw();
  return list;
}

/* Takes an item out of its list, and out of what refers to it. */
function removed({ answer, record }, name, number) {
  const [gone] = record[name].splice(number, 1);
  if (name === "pieces") record[name][0].numbers = sorted([...record[name][0].numbers, ...gone.numbers]);
  if (name !== "hypotheses") return;
  for (const choice of answer.pieces.flatMap((piece) => piece.choices)) {
    choice.under = without(choice.under, number + 1).map((place) => (place > number + 1 ? place - 1 : place));
  }
}

/* Forgets what was typed into fields that are hidden now, so that it does not come back with the next item. The numbers of a piece
   are kept: they say what is left for another. */
function clearHidden(entry) {
  for (const name of namesOf(entry.schema)) {
    if (isList(entry.schema.properties[name])) entriesOf(entry, name).forEach(clearHidden);
    else if (name !== "numbers" && !isShown(entry, name)) delete entry.record[name];
  }
}

function titleOf({ record, siblings }) {
  const regions = siblings.length === 1 ? "all regions" : record.numbers.join(", ") || "no region yet";
  const materials = (record.choices || []).map(({ material }) => material).filter(Boolean).join(" or ");
  return [regions, record.caption, materials].filter(Boolean).join(": ");
}

function controlOf(entry, name) {
  const property = entry.schema.properties[name];
  const change = (to) => { entry.record[name] = to; keep(); };
  return name === "material" ? materialControl(entry)
    : name === "filling" ? fillingControl(change)
    : name === "numbers" ? regionsControl(entry)
    : name === "under" ? hypothesesControl(entry, change)
    : options(property).length ? optionsControl(entry.path + name, property, change)
    : isList(property) ? listControl(entry, name)
    : isRange(property) ? rangeControl(property, change)
    : textControl(change, { inputMode: isNumber(property) ? "decimal" : "text" });
}

/* A field with its control, and the problem with what was typed. */
function field(entry, name) {
  const control = controlOf(entry, name), problem = make("small", { className: "problem" });
  const row = make("div", { className: "field" }, make("span", { title: help(name) }, label(name)), make("div", {}, control, problem));
  row.dataset.name = entry.path + name;
  row.lacks = () => !isList(entry.schema.properties[name]) && lacks(entry, name);
  row.update = () => {
    row.hidden = !isShown(entry, name);
    const fallback = fallbackOf(entry, name);
    control.update(entry.record[name], name === "probability" ? Math.round(100 * fallback) : fallback);
    problem.textContent = problemOf(entry, name) ?? "";
    if (!row.lacks()) row.classList.remove("lacking");
  };
  return row;
}

/* The fields of an entry: the material first, then what only a person can say, then, folded away, what the library fills in. An
   item of a list does not show the latter. */
function rowsOf(entry) {
  const names = namesOf(entry.schema), hasMaterial = names.includes("material");
  const isFilledIn = (name) => hasMaterial && name in (materials[0]?.fields || {}) && !lineOf(fallbacks, entry, name);
  const filled = names.filter((name) => name !== "material" && isFilledIn(name));
  const rows = (names) => names.map((name) => field(entry, name));
  const own = [...rows(names.filter((name) => name === "material")), ...rows(names.filter((name) => !isFilledIn(name)))];
  if (entry.path || !filled.length) return own;
  const summary = make("summary", {}, `${filled.length} more fields, from the library once a material is chosen`);
  return [...own, make("details", {}, summary, ...rows(filled))];
}
