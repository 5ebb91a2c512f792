// The page: choosing a material fills in what the library knows; the answer to another view of the same part is offered as a start;
// every step can be done with the keyboard alone.
const at = (id) => document.getElementById(id);
let place = 0;

const isOpen = (query) => isIncomplete(entryOf(query));

/* Keeps what was typed in the browser, and shows what follows from it. */
function keep() {
  localStorage.setItem(store, JSON.stringify(answers));
  for (const row of document.querySelectorAll("#fields .field")) row.update();
  const done = queries.filter((query) => !isOpen(query)).length;
  at("state").textContent = `${done} of ${queries.length} answered`;
}

// --- Going on.

const stops = () => [...document.querySelectorAll("#fields :is(input, .options), #done")]
  .filter((node) => node.checkVisibility() && node.type !== "radio");
const focusOn = (node) => (node?.classList.contains("options") ? node.querySelector(":checked") || node.querySelector("input") : node)?.focus();

/* Focuses the control after `node`; the button at the end of the form goes to the next question. */
function goOn(node) {
  const all = stops(), own = node.closest(".options") || node;
  focusOn(all[all.indexOf(own) + 1] || at("done"));
}

function show() {
  const query = queries[place];
  at("sheet").src = at("large").href = query.sheet;
  at("prompt").textContent = texts[query.text].prompt;
  at("place").textContent = `${place + 1} / ${queries.length}`;
  at("fields").replaceChildren(...rowsOf(entryOf(query)));
  offer(query);
  keep();
}

/* Offers the last answer about the same part, as long as this question has none. */
function offer(query) {
  const same = (other) => other !== query && other.part === query.part && other.text === query.text && !isOpen(other);
  const last = Object.keys(answerTo(query)).length ? null : queries.filter(same).pop();
  at("offer").hidden = !last;
  if (!last) return;
  const { material = "", caption = "" } = answerTo(last);
  const use = make("button", { type: "button", id: "use" }, "Start from that answer");
  use.addEventListener("click", () => { Object.assign(answerTo(query), answerTo(last)); show(); at("done").focus(); });
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
  if (isOpen(queries[place])) {
    const rows = [...document.querySelectorAll("#fields .field")];
    for (const row of rows) row.classList.toggle("lacking", row.lacks());
    const row = rows.find((row) => row.lacks());
    row?.closest("details")?.setAttribute("open", "");
    focusOn(row?.querySelector(".options") || row?.querySelector("input, button"));
    return;
  }
  const left = queries.findIndex(isOpen);
  if (left < 0) return (at("name").value ? at("save") : at("name")).focus();
  place = place + 1 < queries.length ? place + 1 : left;
  start();
}

// --- What is saved.

function lines() {
  const model = at("name").value.trim() || undefined;
  return queries.map((query) => JSON.stringify({ query: query.query, answer: isOpen(query) ? null : complete(entryOf(query)), model }) + "\n");
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
}

at("back").addEventListener("click", () => go(-1));
at("next").addEventListener("click", () => go(1));
at("save").addEventListener("click", save);
at("form").addEventListener("submit", (event) => { event.preventDefault(); next(); });
at("fields").addEventListener("keydown", (event) => {
  if (event.key !== "Enter" || event.target.matches("summary, button")) return;
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
