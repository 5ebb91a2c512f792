// Corrections: what is typed about parts, with what is corrected already, becomes the scene's file of corrections. What the program
// would refuse is refused here, by the same rules.
"use strict";
(() => {
  const byId = (id) => document.getElementById(id);
  const box = byId("correct"), rows = [...box.querySelectorAll("tr[data-part]")], text = byId("corrections"), link = byId("corrections-file"), copy = byId("corrections-copy");
  const { materials, fillings, spellings, quantities, none: NONE, empty: EMPTY } = JSON.parse(byId("library").textContent);
  const quantityOf = Object.fromEntries(quantities.map((quantity) => [quantity.key, quantity]));

  /* A name as the program compares it. */
  const folded = (name) => wordsIn(name).map((word) => spellings[word] ?? word).join(" ");
  const inverted = (name) => (name.split(",").length === 2 ? name.split(",").reverse().map((part) => part.trim()).join(" ") : name);
  const names = new Set(materials.flatMap(({ name, aliases }) => [name, inverted(name), ...aliases, ...aliases.map(inverted)]).map(folded));
  const fillingNames = new Set([EMPTY, ...fillings].map(folded));

  const onOneLine = (words) => words.replace(/\p{Cc}+/gu, " ");
  /* A number alone is in the first unit, but a share of at most 1 has none. */
  const unitOf = (key, typed) => (key === "share" && typed.split("-").every((end) => Number(end) <= 1) ? "" : quantityOf[key].units[0][0]);
  const valueOf = ({ name, value }) => {
    const typed = onOneLine(value).trim();
    return quantityOf[name] && /^[\d.\s-]+$/.test(typed) ? typed.replaceAll(" ", "") + unitOf(name, typed) : typed;
  };

  // --- What is refused.

  const sentence = (words) => `${words[0].toUpperCase()}${words.slice(1)}.`;
  function problemOfQuantity({ units, within: [least, most], form, limits }, value) {
    if (/\d,\d/.test(value)) return `${sentence(form)} Decimals follow a point, not a comma.`;
    const [unit, factor] = units.find(([unit]) => value.endsWith(unit)) ?? [];
    const number = "\\s*(\\d+\\.?\\d*|\\.\\d+)\\s*", ends = unit === undefined ? null : value.slice(0, value.length - unit.length).match(`^${number}(?:-${number})?$`);
    if (!ends) return sentence(form);
    const [low, high = low] = ends.slice(1).filter(Boolean).map((end) => Number(end) * factor);
    return low > high ? "The lowest number comes first." : low < least || high > most ? sentence(limits) : "";
  }
  function problemOfName(typed, all, textOf) {
    const nearest = nearestOf(typed, all, textOf).map((one) => one.name ?? one);
    return `"${typed}" is not in the library${nearest.length ? `; the nearest ${nearest.length > 1 ? "are" : "is"} ${nearest.join("; ")}` : ""}.`;
  }
  /* The problem with a value alone. */
  function problemOf(key, value) {
    if (!value || key === "caption") return "";
    if (quantityOf[key]) return key === "wall" && value.toLowerCase() === NONE ? "" : problemOfQuantity(quantityOf[key], value);
    if (key === "filling") return fillingNames.has(folded(value)) ? "" : problemOfName(value, [EMPTY, ...fillings], (filling) => filling);
    return names.has(folded(value)) ? "" : problemOfName(value, materials, ({ name, aliases }) => [name, ...aliases].join(" "));
  }
  /* The problem with what is said to be inside of a part, beside its wall. */
  function problemOfInside(row, { wall, filling, share }) {
    if (!filling && !share) return "";
    const isShell = wall ? wall.toLowerCase() !== NONE : row.dataset.form === "shell", isFilled = Boolean(row.dataset.filled);
    if (!isShell) return "It has no hollow to fill: say how thick its wall is.";
    if (filling && filling.toLowerCase() !== EMPTY && !share && !isFilled) return "The answers do not say how full it is: give a share, such as 80%.";
    return !filling && !isFilled ? "Nothing is known to be inside: say what is." : "";
  }

  const inputsOf = (row) => [...row.querySelectorAll("input")];
  /* Shows the problems with what is typed about a part; true if there are any. */
  function check(row) {
    const values = Object.fromEntries(inputsOf(row).map((input) => [input.name, valueOf(input)]));
    const problems = inputsOf(row).map(({ name }) => problemOf(name, values[name]) || (name === (values.filling ? "filling" : "share") ? problemOfInside(row, values) : ""));
    inputsOf(row).forEach((input, n) => {
      input.setAttribute("aria-invalid", String(problems[n] !== ""));
      input.nextElementSibling.textContent = problems[n];
    });
    return problems.some(Boolean);
  }

  // --- What is written.

  /* The table of a part, if anything was typed about it. */
  function table(row) {
    const keys = inputsOf(row).filter(({ value }) => value.trim());
    const lines = keys.map((input) => `${input.name} = ${JSON.stringify(valueOf(input))}`);
    return lines.length ? [`[part.${row.dataset.part}] # ${onOneLine(row.dataset.name)}`, ...lines, ""].join("\n") : "";
  }
  const begunWith = rows.map(table).join("");
  function write() {
    const isRefused = rows.map(check).some(Boolean);
    text.textContent = rows.map(table).join("");
    link.href = "data:text/plain;charset=utf-8," + encodeURIComponent(text.textContent);
    // Without any, an empty file takes the place of the one that there is.
    byId("corrections-made").hidden = isRefused || (!text.textContent && !begunWith);
    byId("corrections-refused").hidden = !isRefused;
  }
  async function copyText() {
    getSelection().selectAllChildren(text);
    try {
      await navigator.clipboard.writeText(text.textContent);
      copy.textContent = "Copied";
    } catch {
      copy.textContent = "Marked: copy it with Ctrl C";
    }
  }
  box.addEventListener("input", () => { copy.textContent = "Copy"; write(); });
  copy.addEventListener("click", copyText);
  write();
  for (const opener of document.querySelectorAll("a[href='#correct'][data-part]")) {
    opener.addEventListener("click", (event) => {
      event.preventDefault();
      box.open = true;
      box.querySelector(`tr[data-part="${opener.dataset.part}"] input[name=material]`).focus();
    });
  }
})();
