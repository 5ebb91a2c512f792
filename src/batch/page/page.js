// The index's own script: sorts the rows by a column and hides those that do not contain the typed words.
"use strict";
(() => {
  const body = document.querySelector("tbody"), heads = [...document.querySelectorAll("thead th")];
  const rows = [...body.rows], count = document.getElementById("count"), filter = document.getElementById("filter");
  const collator = new Intl.Collator("en", { numeric: true });
  const words = rows.map((row) => row.textContent.toLowerCase());

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
    body.append(...keyed.map(({ row }) => row));
  }
  heads.forEach((head, column) => head.querySelector("button")?.addEventListener("click", () => {
    const turned = head.ariaSort === "ascending";
    heads.forEach((other) => other.removeAttribute("aria-sort"));
    head.ariaSort = turned ? "descending" : "ascending";
    sort(column, turned ? -1 : 1);
  }));

  sort(heads.findIndex((head) => head.ariaSort), 1);

  filter.addEventListener("input", () => {
    const wanted = filter.value.toLowerCase().split(/\s+/);
    let shown = 0;
    rows.forEach((row, at) => {
      row.hidden = !wanted.every((word) => words[at].includes(word));
      shown += !row.hidden;
    });
    const scenes = `${rows.length} scene${rows.length === 1 ? "" : "s"}`;
    count.textContent = shown === rows.length ? scenes : `${shown} of ${scenes}`;
  });
})();
