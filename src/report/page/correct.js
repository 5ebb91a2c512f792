// Corrections: what is typed about parts, with what is corrected already, becomes the scene's file of corrections.
"use strict";
(() => {
  const byId = (id) => document.getElementById(id);
  const box = byId("correct"), rows = [...box.querySelectorAll("tr[data-part]")], text = byId("corrections"), link = byId("corrections-file"), copy = byId("corrections-copy");
  const materials = new Set([...byId("materials").options].map((option) => option.value));
  /* A number alone is in this unit. */
  const units = { wall: "mm", density: "kg/m3" };

  const onOneLine = (words) => words.replace(/\p{Cc}+/gu, " ");
  const valueOf = ({ name, value }) => {
    const typed = onOneLine(value).trim();
    return units[name] && /^[\d.\s-]+$/.test(typed) ? typed.replaceAll(" ", "") + units[name] : typed;
  };
  /* The table of a part, if anything was typed about it. */
  function table(row) {
    const keys = [...row.querySelectorAll("input")].filter(({ value }) => value.trim());
    const lines = keys.map((input) => `${input.name} = ${JSON.stringify(valueOf(input))}`);
    return lines.length ? [`[part.${row.dataset.part}] # ${onOneLine(row.dataset.name)}`, ...lines, ""].join("\n") : "";
  }
  const begunWith = rows.map(table).join("");
  function write() {
    text.textContent = rows.map(table).join("");
    link.href = "data:text/plain;charset=utf-8," + encodeURIComponent(text.textContent);
    // Without any, an empty file takes the place of the one that there is.
    byId("corrections-made").hidden = !text.textContent && !begunWith;
    for (const input of box.querySelectorAll("input[name=material]")) {
      input.parentElement.querySelector("small").hidden = !input.value.trim() || materials.has(input.value.trim());
    }
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
      box.querySelector(`tr[data-part="${opener.dataset.part}"] input`).focus();
    });
  }
})();
