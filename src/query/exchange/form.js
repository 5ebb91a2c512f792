// The page: choosing a material fills in what the library knows; the answer to another view of the same part is offered as a start;
// every step can be done with the keyboard alone.
const at = (id) => document.getElementById(id);
let place = 0;

/* In a served page, what is recorded is answered, even if this browser does not have it, and nothing else is: neither what gprop
   refused, nor what was not sent yet. */
const isRecorded = (query) => Boolean(served?.recorded.includes(query.query));
const refused = new Set();
const isLacking = (query) => !isRecorded(query) && isIncomplete(entryOf(query));
const isOpen = (query) => refused.has(query.query) || (served ? !isRecorded(query) : isLacking(query));

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
  showOthers(query);
  keep();
}

const nameOf = (query) => [answerTo(query).caption, answerTo(query).material].filter(Boolean).join(": ");

/* Offers the last answer about the same part, or else those about other parts, as long as this question has none. */
function offer(query) {
  const given = Object.values(answerTo(query)).flat().length ? [] : queries.filter((other) => other !== query && other.text === query.text && !isIncomplete(entryOf(other)));
  const last = given.findLast((other) => other.part === query.part);
  const take = (from, properties, text) => {
    const button = make("button", { type: "button", ...properties }, text);
    button.addEventListener("click", () => { Object.assign(answerTo(query), structuredClone(answerTo(from))); show(); at("done").focus(); });
    return button;
  };
  at("offer").hidden = !given.length;
  if (last) {
    at("offer").replaceChildren(`The same part as in question ${queries.indexOf(last) + 1}: `, make("b", {}, nameOf(last)), ". ", take(last, { id: "use" }, "Start from that answer"));
    return;
  }
  const distinct = [...new Map(given.map((other) => [nameOf(other), other])).values()].slice(-MOST_OFFERS);
  at("offer").replaceChildren("The same as: ", ...distinct.flatMap((other) => [take(other, {}, nameOf(other)), " "]));
}
const MOST_OFFERS = 8;

/* The pictures of open questions to which the answer that is being given holds as well: a click marks one. The same part in other views
   comes first, then what is of the likest colour. */
function showOthers(query) {
  const isSame = (other) => other.part === query.part;
  const unlikeness = (other) => Math.hypot(...other.color.map((channel, n) => channel - query.color[n]));
  const others = queries.filter((other) => other !== query && other.text === query.text && isOpen(other))
    .sort((a, b) => isSame(b) - isSame(a) || unlikeness(a) - unlikeness(b));
  const button = (other) => {
    const one = make("button", { type: "button", ariaPressed: "false" }, make("img", { src: other.sheet, loading: "lazy", alt: `the picture of question ${queries.indexOf(other) + 1}` }));
    one.query = other;
    one.addEventListener("click", () => { one.ariaPressed = String(one.ariaPressed !== "true"); });
    return one;
  };
  at("others").hidden = !others.length;
  at("others").open = false;
  at("others").firstElementChild.textContent = "The same answer for other pictures (those that look alike first)";
  at("others").lastElementChild.replaceChildren(...others.slice(0, MOST_OTHERS).map(button));
  at("all").hidden = others.length < 2;
}
const marks = () => [...at("others").querySelectorAll("[aria-pressed]")];

/* Marks all of the pictures, or none if all are marked. */
function markAll() {
  const to = String(marks().some((one) => one.ariaPressed !== "true"));
  for (const one of marks()) one.ariaPressed = to;
}
const MOST_OTHERS = 60;

/* Gives the answer to the marked pictures too. */
function share(query) {
  for (const { query: other } of marks().filter((one) => one.ariaPressed === "true")) {
    answers[other.query] = structuredClone(answerTo(query));
    leave(other);
  }
}

function start() {
  show();
  scrollTo(0, 0);
  focusOn(at("offer").hidden ? stops()[0] : at("use") || stops()[0]);
}

function go(step) {
  if (!leave(queries[place])) return;
  place = Math.min(Math.max(place + step, 0), queries.length - 1);
  start();
}

/* The next question, if this one is complete; otherwise what it lacks. After the last, the first that is open. */
function next() {
  if (served && !hasName()) return;
  if (isLacking(queries[place])) {
    const rows = [...document.querySelectorAll("#fields .field")];
    for (const row of rows) row.classList.toggle("lacking", row.lacks());
    const row = rows.find((row) => row.lacks());
    row?.closest("details")?.setAttribute("open", "");
    focusOn(row?.querySelector(".options") || row?.querySelector("input, button"));
    return;
  }
  if (!leave(queries[place])) return;
  share(queries[place]);
  keep();
  const left = queries.findIndex(isOpen);
  if (left < 0 && served) return;
  if (left < 0) { (at("name").value ? at("save") : at("name")).focus(); return; }
  const after = queries.findIndex((query, number) => number > place && isOpen(query));
  place = after < 0 ? left : after;
  start();
}

// --- What is saved.

function lineWith(query) {
  const model = at("name").value.trim() || undefined;
  return JSON.stringify({ query: query.query, answer: isIncomplete(entryOf(query)) ? null : complete(entryOf(query)), model, by_hand: true });
}

const lines = () => queries.map((query) => lineWith(query) + "\n");

function hasName() {
  const has = Boolean(at("name").value.trim());
  at("nameless").hidden = has;
  if (!has) at("name").focus();
  return has;
}

function save() {
  if (!hasName()) return;
  const link = make("a", { href: URL.createObjectURL(new Blob(lines(), { type: "application/jsonl" })), download: "answers.jsonl" });
  link.click();
  URL.revokeObjectURL(link.href);
}

// --- What a served page sends and learns.

/* The lines that were sent, by question. */
const sent = new Map();

/* Whether another question may be shown: an answer that is complete is recorded first, for which it needs a name. */
function leave(query) {
  if (!served || isIncomplete(entryOf(query))) return true;
  if (!hasName()) return false;
  record(query);
  return true;
}

/* Sends an answer unless it was sent, and goes on with the questions that follow from it. */
async function record(query) {
  const line = lineWith(query);
  if (sent.get(query.query) === line) return;
  sent.set(query.query, line);
  refused.delete(query.query);
  if (!isRecorded(query)) served.recorded.push(query.query);
  tell(["Recording the answer and weighing the object ..."]);
  try {
    const reply = await fetch("answers", { method: "POST", headers: { "Content-Type": "application/json" }, body: line });
    if (!reply.ok) throw new Error(`gprop replied ${reply.status}`);
    learn(query, await reply.json());
  } catch (error) {
    reopen(query);
    tell([`The answer to question ${queries.indexOf(query) + 1} is not recorded (${error.message}). Is gprop still running? What you typed is kept in this browser.`]);
  }
}

function reopen(query) {
  sent.delete(query.query);
  refused.add(query.query);
  served.recorded = without(served.recorded, query.query);
  keep();
}

function learn(query, reply) {
  const wasDone = !queries.some(isOpen);
  for (const text of reply.texts.slice(texts.length)) { texts.push(text); choices.push(choicesOf(text)); }
  for (const one of reply.queries) if (!queries.some((known) => known.query === one.query)) queries.push(one);
  const onTheWay = served.recorded.filter((name) => sent.has(name));
  served = { ...reply.served, recorded: [...new Set([...reply.served.recorded, ...onTheWay])] };
  tell(served.standing);
  if (reply.problem) {
    reopen(query);
    tell([`The answer to question ${queries.indexOf(query) + 1} cannot be used: ${reply.problem}`, ...served.standing]);
  }
  for (const part of document.querySelectorAll("main, details, body > .soft, .go")) part.hidden = served.done;
  at("place").textContent = `${place + 1} / ${queries.length}`;
  keep();
  if (wasDone && !served.done) { place = queries.findIndex(isOpen); start(); }
}

const tell = (sentences) => at("standing").replaceChildren(...sentences.map((text) => make("p", {}, text)));

at("back").addEventListener("click", () => go(-1));
at("next").addEventListener("click", () => go(1));
at("save").addEventListener("click", save);
at("all").addEventListener("click", markAll);
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
at("name").value = localStorage.getItem("gprop name") || served?.name || "";
if (served) tell(served.standing);
at("name").addEventListener("input", () => {
  localStorage.setItem("gprop name", at("name").value);
  at("nameless").hidden = true;
});
if (queries.length) start(); else at("place").textContent = "no questions are left";
