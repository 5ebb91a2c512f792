// The index's own script: sorts the rows by a column and shows those that contain the typed words, have the chosen mark and
// lie in the chosen bar of a histogram. Only the rows near the visible ones are in the table, so that thousands are quick.
"use strict";
(() => {
  const BATCH = 100;
  const body = document.querySelector("tbody"), heads = [...document.querySelectorAll("thead th")];
  const count = document.getElementById("count"), filter = document.getElementById("filter"), more = document.getElementById("more");
  const everything = document.getElementById("all");
  const collator = new Intl.Collator("en", { numeric: true });
  const words = new Map([...body.rows].map((row) => [row, row.textContent.toLowerCase()]));
  let rows = [...body.rows], wanted = rows, bar = null;

  // A number if the column has numbers, else the text that comes first in the cell: the name of the scene without its error.
  // Undefined if the scene has no value, which sorts last in both directions.
  function value(row, column) {
    const cell = row.cells[column];
    if (cell.dataset.v !== undefined) return Number(cell.dataset.v);
    return heads[column].className === "n" ? undefined : cell.firstChild?.textContent || undefined;
  }
  const compare = (a, b) => (typeof a === "number" ? a - b : collator.compare(a, b));
  function sort(column, sign) {
    const keyed = rows.map((row) => ({ row, key: value(row, column) }));
    keyed.sort((a, b) => (a.key === undefined) - (b.key === undefined) || (a.key === undefined ? 0 : sign * compare(a.key, b.key)));
    rows = keyed.map(({ row }) => row);
    choose();
  }
  heads.forEach((head, column) => head.querySelector("button")?.addEventListener("click", () => {
    const turned = head.ariaSort === "ascending";
    heads.forEach((other) => other.removeAttribute("aria-sort"));
    head.ariaSort = turned ? "descending" : "ascending";
    sort(column, turned ? -1 : 1);
  }));

  const pressed = (selector) => document.querySelector(`${selector}[aria-pressed=true]`);
  const range = ({ dataset }) => [Number(dataset.from), dataset.to === "inf" ? Infinity : Number(dataset.to)];
  function choose() {
    const typed = filter.value.toLowerCase().split(/\s+/), mark = pressed(".mark")?.dataset.mark;
    const column = bar && Number(bar.closest("figure").dataset.column), [from, to] = bar ? range(bar) : [];
    wanted = rows.filter((row) => {
      const number = bar && value(row, column);
      return (!bar || (number !== undefined && number >= from && number < to))
        && (!mark || row.dataset.marks.split("|").includes(mark)) && typed.every((word) => words.get(row).includes(word));
    });
    const scenes = `${rows.length} scene${rows.length === 1 ? "" : "s"}`;
    count.textContent = wanted.length === rows.length ? scenes : `${wanted.length} of ${scenes}`;
    everything.hidden = !bar;
    everything.textContent = bar ? `× ${bar.getAttribute("aria-label").split(": ")[1]}` : "";
    body.replaceChildren();
    extend();
  }
  function extend() {
    body.append(...wanted.slice(body.rows.length, body.rows.length + BATCH));
    more.hidden = body.rows.length >= wanted.length;
  }
  // Observed anew after each batch: a short one may leave the end in view.
  const end = new IntersectionObserver((seen) => {
    if (!seen.some((entry) => entry.isIntersecting)) return;
    extend();
    end.unobserve(more);
    end.observe(more);
  }, { rootMargin: "1500px" });
  end.observe(more);
  window.addEventListener("beforeprint", () => { body.append(...wanted.slice(body.rows.length)); more.hidden = true; });

  // Pressing one of a kind releases the others; pressing it again releases it.
  function press(button, selector) {
    const on = button?.ariaPressed === "false";
    document.querySelectorAll(selector).forEach((other) => { other.ariaPressed = "false"; });
    if (on) button.ariaPressed = "true";
    bar = pressed("rect");
    choose();
  }
  document.querySelectorAll(".mark").forEach((button) => button.addEventListener("click", () => press(button, ".mark")));
  document.querySelectorAll("rect").forEach((rect) => {
    rect.addEventListener("click", () => press(rect, "rect"));
    rect.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      press(rect, "rect");
    });
  });
  everything.addEventListener("click", () => press(null, "rect"));
  filter.addEventListener("input", choose);

  sort(heads.findIndex((head) => head.ariaSort), 1);
})();
