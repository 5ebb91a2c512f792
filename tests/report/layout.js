// What a person would see as faults of the page's layout, as sentences; none if all is well.
(() => {
  const found = new Set(), width = document.documentElement.clientWidth;
  if (document.documentElement.scrollWidth > width) found.add(`the page scrolls sideways: ${document.documentElement.scrollWidth} px on ${width}`);
  const isShown = (element) =>
    element.checkVisibility({ visibilityProperty: true, opacityProperty: true }) && !element.closest(".unseen, dialog, script, style, select, title");
  const said = (text) => `"${text.trim().slice(0, 40)}"`;

  // Every line of text: where it is, what cuts it off, what it covers, whether it can be read.
  const lines = [], walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    if (!node.data.trim() || !isShown(node.parentElement)) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const box of range.getClientRects()) if (box.width > 1 && box.height > 1) lines.push({ node, box, text: said(node.data) });
  }
  for (const { node, box, text } of lines) {
    if (box.left < -1 || box.right > width + 1) found.add(`${text} runs out of the page`);
    for (let around = node.parentElement; around && around !== document.body; around = around.parentElement) {
      const { overflowX, overflowY } = getComputedStyle(around), edge = around.getBoundingClientRect();
      if (overflowX !== "visible" && (box.left < edge.left - 1 || box.right > edge.right + 1)) found.add(`${text} is cut off at the side`);
      if (overflowY === "hidden" && (box.top < edge.top - 1 || box.bottom > edge.bottom + 1)) found.add(`${text} is cut off above or below`);
    }
  }
  // Line boxes of neighbouring lines touch; letters fill the middle half.
  const letters = lines.map((line) => ({ ...line, top: line.box.top + line.box.height / 4, bottom: line.box.bottom - line.box.height / 4 }));
  letters.sort((a, b) => a.top - b.top);
  for (let i = 0; i < letters.length; i++)
    for (let j = i + 1; j < letters.length && letters[j].top < letters[i].bottom; j++) {
      const [a, b] = [letters[i], letters[j]];
      if (a.node !== b.node && Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left) > 2) found.add(`${a.text} and ${b.text} overlap`);
    }

  // Controls do not cover each other.
  const controls = [...document.querySelectorAll("a, button, input, select, summary")].filter(isShown).map((element) => ({ element, box: element.getBoundingClientRect() }));
  for (const [i, a] of controls.entries())
    for (const b of controls.slice(i + 1)) {
      if (a.element.contains(b.element) || b.element.contains(a.element)) continue;
      const across = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
      const down = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
      if (across > 1 && down > 1) found.add(`the controls ${said(a.element.textContent || a.element.id)} and ${said(b.element.textContent || b.element.id)} overlap`);
    }

  // Contrast of text with what is behind it, at least 4.5 to 1 (WCAG 2.2, 1.4.3).
  const channels = (color) => (color.match(/[\d.]+/g) || [0, 0, 0, 0]).map(Number);
  const luminance = ([r, g, b]) => [r, g, b].map((c) => c / 255).map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)).reduce((sum, c, at) => sum + c * [0.2126, 0.7152, 0.0722][at], 0);
  for (const { node, text } of lines) {
    if (node.parentElement.closest("svg, :disabled, .tag")) continue;
    let behind = node.parentElement;
    while (behind && (channels(getComputedStyle(behind).backgroundColor)[3] ?? 1) < 1) behind = behind.parentElement;
    const [a, b] = [getComputedStyle(node.parentElement).color, getComputedStyle(behind || document.body).backgroundColor].map((color) => luminance(channels(color)));
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (ratio < 4.5) found.add(`${text} has a contrast of only ${ratio.toFixed(1)}`);
  }
  return JSON.stringify([...found]);
})()
