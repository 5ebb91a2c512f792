// The page's main script: the colours and the motion of the object in 3D; highlighting of the rows that belong to a part.
// Without WebGL 2 the page keeps its pictures and tables.
"use strict";
(() => {
  const byId = (id) => document.getElementById(id);
  const scene = JSON.parse(byId("scene").textContent);
  const { cloud, parts, properties, motion } = scene;
  const canvas = byId("object"), reading = byId("reading"), legend = byId("legend"), details = byId("details"), choice = byId("color-by");

  // Viridis, from low to high.
  const RAMP = [[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37]];
  const NO_VALUE = [150, 150, 150];
  // Height of the camera above the moving object at first, as an angle: a fall is seen from the side.
  const LOOK_DOWN = Math.PI / 9;

  const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
  const css = (color) => `rgb(${color.map(Math.round).join(" ")})`;
  const ramp = (share) => {
    const at = Math.min(Math.max(share, 0), 1) * (RAMP.length - 1), low = Math.min(Math.floor(at), RAMP.length - 2);
    return RAMP[low].map((channel, c) => channel + (at - low) * (RAMP[low + 1][c] - channel));
  };
  const short = (value) => (value === 0 ? "0" : Math.abs(value) >= 1e4 || Math.abs(value) < 1e-3 ? value.toExponential(1) : String(+value.toPrecision(3)));

  // --- Colour modes: the colour of part `p` with confidence `c`, and its text.
  const partColors = parts.map((part) => rgb(part.color)), materialColors = parts.map((part) => rgb(part.material_color));
  const scaleOf = ({ values, log }) => {
    const known = values.filter(Boolean).map(({ value }) => value), f = log ? Math.log : (x) => x;
    const low = Math.min(...known), high = Math.max(...known);
    return { low, high, share: (value) => (high > low ? (f(value) - f(low)) / (f(high) - f(low)) : 0.5) };
  };
  const modes = [
    { name: "photo", note: "colours of the splat, without view-dependent shading" },
    { name: "material", color: (p) => materialColors[p], entries: () => unique(parts.map((part, p) => [part.material, materialColors[p], [p]])) },
    { name: "part", color: (p) => partColors[p], entries: () => parts.map((part, p) => [`${part.id} ${part.name}`, partColors[p], [p]]) },
    ...properties.map((property) => {
      const { low, high, share } = scaleOf(property), { values, unit } = property;
      return {
        name: property.name,
        color: (p) => (values[p] ? ramp(share(values[p].value)) : NO_VALUE),
        words: (p) => `${property.name} ${values[p] ? values[p].text : "no value on this scale"}`,
        range: [`${short(low)} ${unit}`, `${short(high)} ${unit}`, property.log ? "logarithmic" : ""],
        missing: values.some((value) => !value),
      };
    }),
    { name: "confidence", color: (_, c) => ramp(c), words: (_, c) => `confidence ${c.toFixed(2)}`, range: ["0: no votes", "1: all votes agree", ""] },
  ];
  function unique(entries) {
    const found = new Map();
    for (const [name, color, [p]] of entries) found.has(name) ? found.get(name)[2].push(p) : found.set(name, [name, color, [p]]);
    return [...found.values()];
  }
  modes.forEach((mode, at) => choice.add(new Option(mode.name, at)));
  choice.value = 1;
  const mode = () => modes[choice.value];

  // The list beside the object has the colours of the object.
  function colorList() {
    const { name, color } = mode();
    for (const button of document.querySelectorAll("button[data-parts]")) {
      const [p] = partsOf(button);
      button.querySelector(".swatch").style.background = css(color && name !== "confidence" ? color(p) : partColors[p]);
    }
  }

  function showLegend() {
    const { entries, range, note, missing } = mode();
    colorList();
    legend.replaceChildren();
    const add = (text, kind, style) => {
      const item = legend.appendChild(document.createElement("span"));
      item.className = kind;
      if (style) item.appendChild(document.createElement("i")).style.background = style;
      item.append(text);
      return item;
    };
    for (const [name, color, places] of entries ? entries() : []) add(name, "item", css(color)).dataset.parts = places.map((p) => parts[p].id).join(" ");
    if (range) {
      add(range[0], "soft");
      add("", "ramp").style.background = `linear-gradient(90deg, ${RAMP.map(css).join()})`;
      add(range[1], "soft");
      if (range[2]) add(range[2], "soft");
    }
    if (missing) add("no value on this scale", "item", css(NO_VALUE));
    if (note) add(note, "soft");
  }

  // --- Rows, legend and object highlight each other's parts.
  let pinned = null, pointed = null;
  // Elements name parts by their numbers; all else is by place, from 0.
  const partsOf = (element) => element?.dataset.parts.split(" ").map((id) => parts.findIndex((part) => part.id === Number(id))) ?? null;
  const same = (a, b) => String(a) === String(b);
  const lit = () => pointed ?? pinned;
  let recolor = () => {};
  function light() {
    const shown = lit();
    for (const element of document.querySelectorAll("[data-parts]")) {
      const listed = partsOf(element);
      element.classList.toggle("lit", !!shown && listed.some((p) => shown.includes(p)));
      if (element.matches("button")) element.setAttribute("aria-pressed", String(!!pinned && same(listed, pinned)));
    }
    recolor();
  }
  const say = (text) => { if (reading.textContent !== text) reading.textContent = text; };
  const words = (p, c) => {
    const { words } = mode();
    return `${parts[p].name}: ${parts[p].material}` + (words && (c !== undefined || mode().name !== "confidence") ? `, ${words(p, c)}` : "");
  };
  const point = (places) => { if (!same(pointed, places)) { pointed = places; light(); } };
  const pin = (places) => {
    pinned = same(pinned, places) ? null : places;
    const only = pinned?.length === 1 ? pinned[0] : null;
    if (only !== null) say(words(only));
    showDetails(only);
    light();
  };
  function showDetails(p) {
    const rows = p === null ? [] : [["", parts[p].caption], ...properties.filter(({ values }) => values[p]).map(({ name, values }) => [name, values[p].text])];
    details.replaceChildren(...rows.flatMap(([name, text]) => ["dt", "dd"].map((tag, at) => Object.assign(document.createElement(tag), { textContent: at ? text : name }))));
  }
  const linked = (event) => partsOf(event.target.closest?.("[data-parts]"));
  for (const [kind, act] of [["mouseover", linked], ["focusin", linked], ["mouseout", () => null], ["focusout", () => null]])
    document.addEventListener(kind, (event) => { if (linked(event)) point(act(event)); });
  // A caption that unfolds highlights nothing.
  document.addEventListener("click", (event) => { const places = linked(event); if (places && !event.target.closest("details.caption, a")) pin(places); });
  document.addEventListener("keydown", (event) => { if (event.key === "Escape" && pinned) pin(pinned); });

  // --- Large pictures.
  const large = byId("large");
  document.addEventListener("click", (event) => {
    const picture = event.target.closest?.("button.picture")?.querySelector("img");
    if (!picture) return;
    large.querySelector("img").src = picture.src;
    large.querySelector("img").alt = picture.alt;
    large.showModal();
  });
  large.addEventListener("click", () => large.close());

  // --- The object.
  // Opacity factor of parts that are not highlighted.
  const FADED = 0.12;
  const look = {
    color(i, splat) {
      const { color } = mode();
      return color ? color(splat.part(i), splat.confidence(i)) : splat.color(i);
    },
    opacity(i, splat) {
      const places = lit();
      return splat.opacity(i) * (places && !places.includes(splat.part(i)) ? FADED : 1);
    },
    place: () => true,
  };
  async function showObject() {
    let moves = null, timeline = null, ground = null;
    const stage = await stageOf({
      canvas, cloud, look,
      reach: Math.max(cloud.sphere.radius, motion ? motion.sphere.radius : 0),
      keys: { p: () => timeline?.toggle() },
      frame: (elapsed) => timeline?.tick(elapsed),
      point(i, splat) { if (i !== null) say(words(splat.part(i), splat.confidence(i))); },
      pick(i, splat) {
        if (i === null) { if (pinned) pin(pinned); return; }
        const places = [splat.part(i)];
        if (!same(pinned, places)) pin(places);
        say(words(places[0], splat.confidence(i)));
      },
    });
    const { Vector3 } = Splats;
    if (motion) moves = motionOf(motion, new Vector3(...cloud.sphere.center), cloud.count, await (await unpacked("motion")).arrayBuffer());
    recolor = () => {
      ground?.begin();
      stage.redraw((...gaussian) => ground?.under(...gaussian));
      ground?.end();
    };

    // --- The simulation.
    timeline = moves && timelineOf(moves.duration, (seconds) => {
      const isMoving = seconds !== null;
      const pose = isMoving && moves.pose(seconds);
      look.place = isMoving ? (i, center, scales, turn, splat) => pose(i, splat.part(i), center, scales, turn) : () => true;
      if (isMoving !== !!ground) {
        const from = stage.away();
        if (isMoving) {
          stage.setSpin(false);
          ground = groundOf(motion, cloud.count);
          stage.world.add(ground.group);
          from.z = Math.tan(LOOK_DOWN) * Math.hypot(from.x, from.y);
        } else {
          stage.world.remove(ground.group);
          ground = null;
        }
        stage.aim(isMoving ? motion.sphere : cloud.sphere, from);
      }
      recolor();
    });
    choice.addEventListener("change", () => recolor());
    canvas.parentElement.classList.add("ready");
  }

  choice.addEventListener("change", () => { showLegend(); if (pinned?.length === 1) say(words(pinned[0])); });
  showLegend();
  if (cloud.count && canShowSplats()) showObject().catch((error) => { say(`The object cannot be shown in 3D here: ${error.message}`); console.error(error); });
  else say(cloud.count ? "This browser cannot show the object in 3D (it lacks WebGL 2 or DecompressionStream); the pictures below show it." : "No Gaussian is visible.");
})();
