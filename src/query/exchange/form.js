// The form: a control for every field of the schema. Choosing a material fills in what the library knows; the answer to another
// view of the same part is offered as a start; every step can be done with the keyboard alone.
"use strict";
const at = (id) => document.getElementById(id);
const make = (tag, properties, ...children) => {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
};
const store = "gprop answers " + queries.map((query) => query.query).join("").slice(0, 200);
const answers = JSON.parse(localStorage.getItem(store) || "{}");
const SUGGESTIONS = 40;
let place = 0;

const answerTo = (query) => answers[query.query] || {};
const schemaOf = (query) => texts[query.text].schema;
/* The names of the fields, in the order in which the schema requires them. */
const namesOf = (query) => { const { required, properties } = schemaOf(query); return [...new Set([...required, ...Object.keys(properties)])]; };
const types = (property) => [].concat(property.type);
const mayBeNull = (property) => types(property).includes("null");
const isRange = (property) => types(property).includes("array") && types(property.items).includes("number");
const isList = (property) => types(property).includes("array") && !isRange(property);
const options = (property) => (types(property).includes("boolean") ? [false, true] : (property.enum || []).filter((option) => option !== null));
const label = (name) => name.replaceAll("_", " ");
const wordFor = (option) => (option === false ? "no" : option === true ? "yes" : String(option));

/* Fields that belong to some answers only: there they are needed, elsewhere they are hidden and saved as null. */
const isShell = ({ form }) => form === "shell", isMixed = ({ form }) => form === "mixed", isFilled = (answer) => isShell(answer) && answer.inside === "filled";
const needed = {
  wall_thickness_mm: isShell, inside: isShell, filling: isFilled, fill_share: isFilled, bulk_density_kg_m3: isMixed, bulk_reason: isMixed,
};

/* The end of the prompt lists the materials of each family, one family per line: "wood: ash, white; beech; ...". */
const known = new Map(materials.map((material) => [material.fields.material, material]));
const choices = texts.map(({ prompt, schema }) => (schema.properties.family?.enum || []).flatMap((family) => {
  const line = prompt.split("\n").find((line) => line.startsWith(family + ": ")) || "";
  return line.slice(family.length + 2).split("; ").filter(Boolean).map((material) => {
    const { aliases = [], fields = { family, material } } = known.get(material) || {};
    return { family, material, fields, found: [material, family, ...aliases].join(" ").toLowerCase() };
  });
}));

/* The materials that have all of the words in their name, family or other names; names that begin with them first. */
function matching(query, text) {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  const rank = ({ material, found }) =>
    material.toLowerCase().startsWith(words[0]) ? 0 : found.split(" ").some((word) => word.startsWith(words[0])) ? 1 : 2;
  const found = choices[query.text].filter((choice) => words.every((word) => choice.found.includes(word)));
  return words.length ? found.sort((a, b) => rank(a) - rank(b) || a.material.length - b.material.length) : found;
}

/* The fields of a question: the material first, then what only a person can say, then what the library fills in. */
function fieldsOf(query) {
  const names = namesOf(query);
  const first = names.includes("material") ? ["material"] : [];
  const fills = new Set(first.length ? Object.keys(materials[0]?.fields || {}) : []);
  return { first, own: names.filter((name) => !fills.has(name)), filled: names.filter((name) => fills.has(name) && name !== "material") };
}

function lacking(query) {
  const { required, properties } = schemaOf(query), answer = answerTo(query);
  return required.filter((name) => answer[name] == null && (needed[name]?.(answer) ?? !mayBeNull(properties[name])));
}

function keep(query, changes) {
  answers[query.query] = { ...answerTo(query), ...changes };
  localStorage.setItem(store, JSON.stringify(answers));
  count();
}

function count() {
  const done = queries.filter((query) => lacking(query).length === 0).length;
  at("state").textContent = `${done} of ${queries.length} answered`;
}

// --- Controls. Each is a node whose value `changed` takes; Enter in it goes on to the next.

const numberFrom = (text) => (text.trim() === "" || !Number.isFinite(Number(text)) ? undefined : Number(text));

function textControl(property, value, changed) {
  const isNumber = types(property).includes("number");
  const input = make("input", { type: "text", inputMode: isNumber ? "decimal" : "text", value: value ?? "" });
  input.addEventListener("input", () => changed(isNumber ? numberFrom(input.value) : input.value.trim() || undefined));
  return input;
}

/* A range of two numbers, or of three with the one in the middle. */
function rangeControl(property, value, changed) {
  const names = property.minItems === 3 ? ["lowest", "best guess", "highest"] : ["lowest", "highest"];
  const ends = names.map((name, end) => make("input", { type: "text", inputMode: "decimal", value: value?.[end] ?? "", ariaLabel: name, placeholder: name }));
  const read = () => {
    const range = ends.map((input) => numberFrom(input.value));
    changed(range.includes(undefined) ? undefined : range);
  };
  ends.forEach((input) => input.addEventListener("input", read));
  return make("span", { className: "range" }, ...ends);
}

/* A list of objects, written as JSON: its form is in the question. */
function listControl(value, changed) {
  const input = make("textarea", { rows: 8, value: value ? JSON.stringify(value, null, 1) : "", placeholder: "a JSON list, as the question below describes it" });
  input.addEventListener("input", () => {
    let list;
    try { list = JSON.parse(input.value); } catch { list = undefined; }
    input.setCustomValidity(Array.isArray(list) ? "" : "This is not a JSON list.");
    changed(Array.isArray(list) ? list : undefined);
  });
  return input;
}

function optionsControl(name, property, value, changed) {
  const all = options(property), group = make("span", { className: "options", role: "radiogroup" });
  const inputs = all.map((option, number) => {
    const input = make("input", { type: "radio", name, checked: option === value });
    input.addEventListener("change", () => changed(option));
    group.append(make("label", {}, input, `${number + 1} ${wordFor(option)}`));
    return input;
  });
  group.addEventListener("keydown", (event) => {
    const input = inputs[Number(event.key) - 1];
    if (!input) return;
    event.preventDefault();
    input.checked = true;
    input.focus();
    changed(all[inputs.indexOf(input)]);
    goOn(input);
  });
  return group;
}

/* Offers the names of the library's fillings; anything else is no answer. */
function fillingControl(value, changed) {
  const input = make("input", { type: "text", value: value ?? "", placeholder: "water, sugar, foam ..." });
  input.setAttribute("list", "fillings");
  input.addEventListener("input", () => changed(fillings.includes(input.value.trim()) ? input.value.trim() : undefined));
  return input;
}

function materialControl(query, value) {
  const input = make("input", { type: "text", value: value ?? "", placeholder: "steel, oak, cork ..." });
  const list = make("ul", { role: "listbox", hidden: true, id: "materials" });
  for (const [name, to] of [["role", "combobox"], ["aria-controls", "materials"], ["aria-expanded", "false"]]) input.setAttribute(name, to);
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
  const take = (number) => {
    const { fields } = found[number];
    const wanted = Object.keys(schemaOf(query).properties).filter((name) => name in fields);
    keep(query, Object.fromEntries(wanted.map((name) => [name, fields[name]])));
    show();
    goOn(at("fields").querySelector(".combo input"));
  };
  input.addEventListener("input", () => { keep(query, { material: undefined }); suggest(); });
  input.addEventListener("focus", () => { input.select(); if (answerTo(query).material === undefined) suggest(); });
  input.addEventListener("blur", () => open(false));
  input.addEventListener("keydown", (event) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (step && !event.altKey) { event.preventDefault(); if (list.hidden) suggest(); else mark(marked + step); }
    if (event.key === "Escape") open(false);
    if (event.key === "Enter" && !list.hidden && found.length) { event.preventDefault(); event.stopPropagation(); take(marked); }
  });
  return make("span", { className: "combo" }, input, list);
}

function field(query, name) {
  const property = schemaOf(query).properties[name], value = answerTo(query)[name];
  const changed = (to) => {
    keep(query, { [name]: to });
    row.classList.remove("lacking");
    for (const [other, isNeeded] of Object.entries(needed)) {
      const its = document.querySelector(`.field[data-name=${other}]`);
      if (its) its.hidden = !isNeeded(answerTo(query));
    }
  };
  const control = name === "material" ? materialControl(query, value)
    : name === "filling" ? fillingControl(value, changed)
    : options(property).length ? optionsControl(name, property, value, changed)
    : isList(property) ? listControl(value, changed)
    : isRange(property) ? rangeControl(property, value, changed)
    : textControl(property, value, changed);
  const row = make("div", { className: "field" }, make("span", {}, label(name)), control);
  row.dataset.name = name;
  row.hidden = name in needed && !needed[name](answerTo(query));
  return row;
}

// --- Going on.

const stops = () => [...document.querySelectorAll("#fields .field:not([hidden]) :is(input, textarea, .options), #done")]
  .filter((node) => !node.closest("details:not([open])") && !(node.type === "radio"));
const focusOn = (node) => (node?.classList.contains("options") ? node.querySelector(":checked") || node.querySelector("input") : node)?.focus();

/* Focuses the control after `node`; the button at the end of the form goes to the next question. */
function goOn(node) {
  const all = stops(), own = node.closest(".options") || node;
  focusOn(all[all.indexOf(own) + 1] || at("done"));
}

function show() {
  const query = queries[place], { first, own, filled } = fieldsOf(query);
  at("sheet").src = query.sheet;
  at("prompt").textContent = texts[query.text].prompt;
  at("place").textContent = `${place + 1} / ${queries.length}`;
  const rows = (names) => names.map((name) => field(query, name));
  at("fields").replaceChildren(...rows(first), ...rows(own));
  if (filled.length) {
    const from = answerTo(query).material ? "from the library" : "filled in when you choose a material";
    at("fields").append(make("details", {}, make("summary", {}, `${filled.length} more fields, ${from}`), ...rows(filled)));
  }
  offer(query);
  count();
}

/* Offers the last answer about the same part, as long as this question has none. */
function offer(query) {
  const same = (other) => other !== query && other.part === query.part && other.text === query.text && !lacking(other).length;
  const last = Object.keys(answerTo(query)).length ? null : queries.filter(same).pop();
  at("offer").hidden = !last;
  if (!last) return;
  const { material = "", caption = "" } = answerTo(last);
  const use = make("button", { type: "button", id: "use" }, "Start from that answer");
  use.addEventListener("click", () => { keep(query, answerTo(last)); show(); at("done").focus(); });
  at("offer").replaceChildren(`The same part as in question ${queries.indexOf(last) + 1}: `, make("b", {}, [material, caption].filter(Boolean).join(", ")), ". ", use);
}

function start() {
  show();
  scrollTo(0, 0);
  focusOn(at("offer").hidden ? stops()[0] : at("use"));
}

function go(step) {
  place = Math.min(Math.max(place + step, 0), queries.length - 1);
  start();
}

/* The next question, if this one is complete; otherwise what it lacks. After the last, the first that is open. */
function next() {
  const query = queries[place], open = lacking(query);
  if (open.length) {
    for (const row of document.querySelectorAll(".field")) row.classList.toggle("lacking", open.includes(row.dataset.name));
    const row = document.querySelector(".field.lacking");
    row?.closest("details")?.setAttribute("open", "");
    focusOn(row?.querySelector(".options") || row?.querySelector("input"));
    return;
  }
  const left = queries.findIndex((query) => lacking(query).length);
  if (left < 0) return (at("name").value ? at("save") : at("name")).focus();
  place = place + 1 < queries.length ? place + 1 : left;
  start();
}

// --- What is saved: fields in the schema's order; null for an empty field that may be null.

function complete(query) {
  if (lacking(query).length) return null;
  const answer = answerTo(query), kept = (name) => (needed[name]?.(answer) ?? true ? answer[name] : null);
  return Object.fromEntries(namesOf(query).map((name) => [name, kept(name) ?? null]));
}

function lines() {
  const model = at("name").value.trim() || undefined;
  return queries.map((query) => JSON.stringify({ query: query.query, answer: complete(query), model }) + "\n");
}

function save() {
  if (!at("name").value.trim()) {
    at("state").textContent = "Please type your name first: it is kept with the answers.";
    at("name").focus();
    return;
  }
  const link = make("a", { href: URL.createObjectURL(new Blob(lines(), { type: "application/jsonl" })), download: "answers.jsonl" });
  link.click();
  URL.revokeObjectURL(link.href);
  count();
}

at("back").addEventListener("click", () => go(-1));
at("next").addEventListener("click", () => go(1));
at("save").addEventListener("click", save);
at("form").addEventListener("submit", (event) => { event.preventDefault(); next(); });
at("fields").addEventListener("keydown", (event) => {
  if (event.key !== "Enter" || event.target.matches("summary")) return;
  event.preventDefault();
  goOn(event.target);
});
document.addEventListener("keydown", (event) => {
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (event.altKey && step) { event.preventDefault(); go(step); }
});
at("name").value = localStorage.getItem("gprop name") || "";
at("name").addEventListener("input", () => localStorage.setItem("gprop name", at("name").value));
if (queries.length) start(); else at("place").textContent = "no questions are left";
