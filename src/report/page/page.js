// The page's main script: the object in 3D, its colours, picking and motion; highlighting of the rows that belong to a part.
// `Splats` is three.js and Spark in one file (scripts/viewer). Without WebGL 2 the page keeps its pictures and tables.
"use strict";
(() => {
  const byId = (id) => document.getElementById(id);
  const scene = JSON.parse(byId("scene").textContent);
  const { cloud, parts, properties, motion } = scene;
  const canvas = byId("object"), reading = byId("reading"), legend = byId("legend"), details = byId("details"), choice = byId("color-by");

  // Viridis, from low to high.
  const RAMP = [[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37]];
  const NO_VALUE = [150, 150, 150];
  const TURN_PER_KEY = Math.PI / 24, ZOOM_PER_KEY = 1.15, CLICK_PIXELS = 4;
  // Distance of the camera, in distances at which the sphere around the object just fits into the view.
  const MARGIN = 1.03;
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
  async function unpacked(id) {
    const packed = Uint8Array.from(atob(byId(id).textContent.trim()), (char) => char.charCodeAt(0));
    return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip")));
  }
  function columns(buffer) {
    const n = cloud.count, bytes = new Uint8Array(buffer), words = new DataView(buffer);
    const u16 = (column, i) => words.getUint16(column + 2 * i, true), u8 = (column, k, i) => bytes[n * (column + k) + i];
    const share = (i, axis) => u16(2 * n * axis, i) / 65535, mixed = ([low, high], share) => low + share * (high - low);
    // Numbers of each Gaussian, decoded once: while the object moves, all are read for every picture.
    const all = (width, value) => Float32Array.from({ length: width * n }, (_, at) => value(Math.floor(at / width), at % width));
    const centers = all(3, (i, a) => mixed([cloud.corners[0][a], cloud.corners[1][a]], share(i, a)));
    const scales = all(3, (i, a) => Math.exp(mixed(cloud.log_scales, u8(6, a, i) / 255)));
    const turns = all(4, (i, a) => words.getInt8(n * (9 + a) + i));
    return {
      center: (i, out) => out.fromArray(centers, 3 * i),
      scales: (i, out) => out.fromArray(scales, 3 * i),
      turn: (i, out) => out.fromArray(turns, 4 * i).normalize(),
      opacity: (i) => u8(13, 0, i) / 255,
      color: (i) => [0, 1, 2].map((c) => u8(14, c, i)),
      part: (i) => u16(17 * n, i),
      confidence: (i) => u8(19, 0, i) / 255,
    };
  }

  async function showObject() {
    const code = document.createElement("script");
    code.textContent = await (await unpacked("viewer-code")).text();
    document.head.append(code);
    const { Color, PerspectiveCamera, Quaternion, Raycaster, Scene, Vector2, Vector3, WebGLRenderer, OrbitControls, SparkRenderer, SplatMesh } = Splats;
    const splat = columns(await (await unpacked("cloud")).arrayBuffer());
    const moves = motion && motionOf(motion, new Vector3(...cloud.sphere.center), cloud.count, await (await unpacked("motion")).arrayBuffer());

    const renderer = new WebGLRenderer({ canvas, alpha: true, antialias: false, preserveDrawingBuffer: true });
    const reach = Math.max(cloud.sphere.radius, motion ? motion.sphere.radius : 0);
    const world = new Scene(), camera = new PerspectiveCamera(40, 1, cloud.sphere.radius / 100, reach * 100);
    camera.up.set(0, 0, 1);
    const controls = new OrbitControls(camera, canvas);
    controls.enableDamping = true;
    controls.enablePan = false;
    controls.minDistance = cloud.sphere.radius * 0.5;
    controls.maxDistance = reach * 20;
    let stale = true;
    const spark = new SparkRenderer({ renderer, onDirty: () => { stale = true; } });
    world.add(spark);

    const center = new Vector3(), scales = new Vector3(), turn = new Quaternion(), color = new Color();
    // Opacity factor of parts that are not highlighted.
    const FADED = 0.12;
    // Moves a Gaussian from where it is at rest to where it is shown; false if it is not shown.
    let place = () => true;
    function each(put) {
      const { color: colorOf } = mode(), places = lit();
      for (let i = 0; i < cloud.count; i++) {
        const p = splat.part(i), faded = places && !places.includes(p);
        const shown = colorOf ? colorOf(p, splat.confidence(i)) : splat.color(i);
        color.setRGB(shown[0] / 255, shown[1] / 255, shown[2] / 255);
        splat.center(i, center); splat.scales(i, scales); splat.turn(i, turn);
        const isShown = place(i, p, center, scales, turn);
        put(i, center, scales, turn, isShown ? splat.opacity(i) * (faded ? FADED : 1) : 0, color);
      }
    }
    const mesh = new SplatMesh({ maxSplats: cloud.count, constructSplats: (splats) => each((_, ...rest) => splats.pushSplat(...rest)), minRaycastOpacity: 0.5 });
    world.add(mesh);
    await mesh.initialized;
    let ground = null;
    recolor = () => {
      ground?.begin();
      each((i, ...rest) => {
        mesh.packedSplats.setSplat(i, ...rest);
        ground?.under(rest[0], rest[3]);
      });
      ground?.end();
      mesh.packedSplats.needsUpdate = true;
      mesh.updateVersion();
      stale = true;
    };

    // --- The camera: the sphere around the object, or around its whole motion, fits into the view in both directions.
    let ball = cloud.sphere, fitted = 1;
    function fit() {
      const up = (camera.fov * Math.PI) / 360, across = Math.atan(Math.tan(up) * camera.aspect);
      return (MARGIN * ball.radius) / Math.sin(Math.min(up, across));
    }
    function look(away) {
      fitted = fit();
      controls.target.set(...ball.center);
      camera.position.copy(controls.target).addScaledVector(away.normalize(), fitted);
      stale = true;
    }
    const away = () => camera.position.clone().sub(controls.target);
    function home() {
      const from = new Vector3(...cloud.eye).sub(new Vector3(...cloud.sphere.center));
      if (from.length() === 0) from.set(1, 1, 0.5);
      look(from);
    }
    function resize() {
      const { width, height } = canvas.parentElement.getBoundingClientRect();
      renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
      renderer.setSize(width, height, false);
      camera.aspect = width / height;
      camera.updateProjectionMatrix();
      // The part of the object that the user sees stays in view.
      const before = fitted, from = away();
      fitted = fit();
      camera.position.copy(controls.target).addScaledVector(from, fitted / before);
      stale = true;
    }
    new ResizeObserver(resize).observe(canvas.parentElement);
    resize();
    home();

    // --- Rotation, automatic and by hand.
    const spin = byId("spin");
    const setSpin = (on) => { controls.autoRotate = on; spin.setAttribute("aria-pressed", String(on)); stale = true; };
    const reduced = matchMedia("(prefers-reduced-motion: reduce)");
    reduced.addEventListener("change", () => setSpin(!reduced.matches));
    setSpin(!reduced.matches);
    controls.autoRotateSpeed = 1.5;
    controls.addEventListener("change", () => { stale = true; });
    controls.addEventListener("start", () => setSpin(false));
    spin.addEventListener("click", () => setSpin(!controls.autoRotate));
    byId("home").addEventListener("click", home);
    const orbit = (around, up, closer) => {
      setSpin(false);
      const from = away(), radius = from.length() / closer;
      const angle = Math.atan2(from.y, from.x) + around;
      const rise = Math.min(Math.max(Math.asin(from.z / from.length()) + up, -1.5), 1.5);
      camera.position.set(Math.cos(rise) * Math.cos(angle), Math.cos(rise) * Math.sin(angle), Math.sin(rise)).multiplyScalar(radius).add(controls.target);
    };
    const keys = {
      ArrowLeft: () => orbit(-TURN_PER_KEY, 0, 1), ArrowRight: () => orbit(TURN_PER_KEY, 0, 1),
      ArrowUp: () => orbit(0, TURN_PER_KEY, 1), ArrowDown: () => orbit(0, -TURN_PER_KEY, 1),
      "+": () => orbit(0, 0, ZOOM_PER_KEY), "=": () => orbit(0, 0, ZOOM_PER_KEY), "-": () => orbit(0, 0, 1 / ZOOM_PER_KEY),
      " ": () => setSpin(!controls.autoRotate), Home: home, p: () => timeline?.toggle(),
    };
    canvas.addEventListener("keydown", (event) => { if (keys[event.key]) { event.preventDefault(); keys[event.key](); } });

    // --- The Gaussian under the pointer: the one whose centre is nearest to the point where the ray enters the cloud.
    const caster = new Raycaster(), at = new Vector2();
    function under({ clientX, clientY }) {
      const box = canvas.getBoundingClientRect();
      at.set(((clientX - box.left) / box.width) * 2 - 1, 1 - ((clientY - box.top) / box.height) * 2);
      caster.setFromCamera(at, camera);
      const hits = caster.intersectObject(mesh);
      if (!hits.length) return null;
      let best = null, least = Infinity;
      for (let i = 0; i < cloud.count; i++) {
        splat.center(i, center); splat.scales(i, scales); splat.turn(i, turn);
        const isShown = place(i, splat.part(i), center, scales, turn), distance = center.distanceToSquared(hits[0].point);
        if (isShown && distance < least && splat.opacity(i) > 0.2) { least = distance; best = i; }
      }
      return best;
    }
    let moved = null, pressed = null;
    canvas.addEventListener("pointermove", (event) => { moved = event; });
    canvas.addEventListener("pointerleave", () => { moved = null; });
    canvas.addEventListener("pointerdown", (event) => { pressed = event; });
    canvas.addEventListener("pointerup", (event) => {
      const still = pressed && Math.hypot(event.clientX - pressed.clientX, event.clientY - pressed.clientY) < CLICK_PIXELS;
      if (!still) return;
      const i = under(event);
      if (i === null) { if (pinned) pin(pinned); return; }
      const places = [splat.part(i)];
      if (!same(pinned, places)) pin(places);
      say(words(places[0], splat.confidence(i)));
    });

    // --- The simulation.
    const timeline = moves && timelineOf(moves.duration, (seconds) => {
      const isMoving = seconds !== null;
      place = isMoving ? moves.pose(seconds) : () => true;
      if (isMoving !== !!ground) {
        const from = away();
        if (isMoving) {
          setSpin(false);
          ground = groundOf(motion, cloud.count);
          world.add(ground.group);
          from.z = Math.tan(LOOK_DOWN) * Math.hypot(from.x, from.y);
        } else {
          world.remove(ground.group);
          ground = null;
        }
        ball = isMoving ? motion.sphere : cloud.sphere;
        look(from);
      }
      recolor();
    });

    // A frame that took longer than this, in seconds, does not make the motion jump.
    const LONGEST_FRAME = 0.2;
    let visible = true, drawn = 0;
    new IntersectionObserver(([entry]) => { visible = entry.isIntersecting; }).observe(canvas);
    choice.addEventListener("change", recolor);
    renderer.setAnimationLoop((now) => {
      const elapsed = Math.min((now - drawn) / 1000, LONGEST_FRAME);
      drawn = now;
      if (!visible) return;
      timeline?.tick(elapsed);
      controls.update();
      if (moved) {
        const i = under(moved);
        moved = null;
        canvas.style.cursor = i === null ? "grab" : "pointer";
        if (i !== null) say(words(splat.part(i), splat.confidence(i)));
      }
      if (!stale) return;
      stale = controls.autoRotate;
      renderer.render(world, camera);
    });
    canvas.parentElement.classList.add("ready");
  }

  choice.addEventListener("change", () => { showLegend(); if (pinned?.length === 1) say(words(pinned[0])); });
  showLegend();
  const able = typeof DecompressionStream === "function" && document.createElement("canvas").getContext("webgl2");
  if (cloud.count && able) showObject().catch((error) => { say(`The object cannot be shown in 3D here: ${error.message}`); console.error(error); });
  else say(cloud.count ? "This browser cannot show the object in 3D (it lacks WebGL 2 or DecompressionStream); the pictures below show it." : "No Gaussian is visible.");
})();
