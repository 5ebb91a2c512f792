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
  hypotheses: "what it may be", choices: "made of", unnumbered: "what has no number",
};
/* The buttons of lists. */
const ADD = { hypotheses: "It may also be ...", pieces: "Another piece", choices: "Or else ...", unnumbered: "Something without a number" };
const REMOVE = { hypotheses: "It is not this", pieces: "Remove this piece", choices: "Not this", unnumbered: "Remove" };
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
    group.append(make("label", {}, input, `${number + 1} ${wordFor(option)}`));
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
  return { family, material, fields, found: [material, family, ...aliases].join(" ").toLowerCase() };
};
const choices = texts.map(({ prompt, schema }) => {
  if (!schema.properties.family) return materials.map(({ fields }) => choice(fields.family, fields.material));
  return (schema.properties.family.enum || []).flatMap((family) => {
    const line = prompt.split("\n").find((line) => line.startsWith(family + ": ")) || "";
    return line.slice(family.length + 2).split("; ").filter(Boolean).map((material) => choice(family, material));
  });
});

/* The materials that have all of the words in their name, family or other names; names that begin with them first. */
function matching(query, text) {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  const rank = ({ material, found }) =>
    material.toLowerCase().startsWith(words[0]) ? 0 : found.split(" ").some((word) => word.startsWith(words[0])) ? 1 : 2;
  const found = choices[query.text].filter((choice) => words.every((word) => choice.found.includes(word)));
  return words.length ? found.sort((a, b) => rank(a) - rank(b) || a.material.length - b.material.length) : found;
}

function materialControl(entry) {
  const { query, path, record, schema } = entry, id = path + "materials";
  const input = make("input", { type: "text", placeholder: "steel, oak, cork ..." });
  const list = make("ul", { role: "listbox", hidden: true, id });
  for (const [name, to] of [["role", "combobox"], ["aria-controls", id], ["aria-expanded", "false"]]) input.setAttribute(name, to);
  let found = [], marked = 0;
  const mark = (to) => {
    marked = Math.min(Math.max(to, 0), found.length - 1);
    [...list.children].forEach((item, number) => item.setAttribute("aria-selected", String(number === marked)));
    list.children[marked]?.scrollIntoView({ block: "nearest" });
  };
  const open = (isOpen) => { list.hidden = !isOpen; input.setAttribute("aria-expanded", String(isOpen)); };
  const suggest = () => {
    const all = matching(query, input.value);
    found = all.slice(0, SUGGESTIONS);
    list.replaceChildren(...found.map((choice, number) => {
      const item = make("li", { role: "option" }, choice.material, " ", make("small", {}, choice.family));
      item.addEventListener("pointerdown", (event) => { event.preventDefault(); take(number); });
      return item;
    }));
    if (all.length > found.length) list.append(make("li", { className: "more" }, `${all.length - found.length} more: keep typing`));
    open(true);
    mark(0);
  };
  /* Fills in what the library knows, except what is saved anyway if it is left open. */
  const take = (number) => {
    const { fields } = found[number];
    for (const name of Object.keys(schema.properties)) {
      if (name in fields && !lineOf(fallbacks, entry, name)) record[name] = fields[name];
    }
    input.value = fields.material;
    open(false);
    keep();
    goOn(input);
  };
  input.addEventListener("input", () => { record.material = undefined; keep(); suggest(); });
  input.addEventListener("focus", () => { input.select(); if (record.material === undefined) suggest(); });
  input.addEventListener("blur", () => open(false));
  input.addEventListener("keydown", (event) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (step && !event.altKey) { event.preventDefault(); if (list.hidden) suggest(); else mark(marked + step); }
    if (event.key === "Escape") open(false);
    if (event.key === "Enter" && !list.hidden && found.length) { event.preventDefault(); event.stopPropagation(); take(marked); }
  });
  const combo = make("span", { className: "combo" }, input, list);
  combo.update = (typed) => { if (input !== document.activeElement) input.value = typed ?? ""; };
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
    remove.addEventListener("click", () => { removed(entry, name, number); draw(); keep(); add.focus(); });
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
  const row = make("div", { className: "field" }, make("span", {}, label(name)), make("div", {}, control, problem));
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
