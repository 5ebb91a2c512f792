// The table with its objects in 3D: names and masses stand above the objects, and a click on an object leads to its report.
// Without WebGL 2 the page keeps its photo and table.
"use strict";
(() => {
  const byId = (id) => document.getElementById(id);
  const { cloud, tops } = JSON.parse(byId("scene").textContent);
  const canvas = byId("object"), frame = canvas.parentElement, reading = byId("reading");
  // How much of an object's own colour is left while it is pointed at.
  const KEPT = 0.45, GAP_PIXELS = 3;
  // By number; nothing is 0.
  const labels = [...frame.querySelectorAll(".label")];
  const colors = [null, ...labels.map((label) => label.dataset.color.match(/../g).map((hex) => parseInt(hex, 16)))];
  const say = (text) => { if (reading.textContent !== text) reading.textContent = text; };
  const first = reading.textContent;

  let pointed = 0, redraw = () => {};
  function point(number) {
    if (number === pointed) return;
    pointed = number;
    for (const element of document.querySelectorAll("[data-object]")) element.classList.toggle("lit", Number(element.dataset.object) === number);
    say(number ? labels[number - 1].dataset.text : first);
    redraw();
  }
  const numberOf = (event) => Number(event.target.closest?.("[data-object]")?.dataset.object ?? 0);
  for (const kind of ["mouseover", "focusin"]) document.addEventListener(kind, (event) => { if (event.target !== canvas) point(numberOf(event)); });

  const look = {
    color(i, splat) {
      const number = splat.part(i), color = splat.color(i);
      return number && number === pointed ? color.map((own, c) => KEPT * own + (1 - KEPT) * colors[number][c]) : color;
    },
    opacity: (i, splat) => splat.opacity(i),
    place: () => true,
  };

  // Labels stand above their objects; one that would cover another that is lower moves up.
  function layLabels(camera, place) {
    const { clientWidth: width, clientHeight: height } = frame, laid = [];
    const seen = labels.map((label, at) => {
      place.set(...tops[at]).project(camera);
      return { label, x: ((place.x + 1) / 2) * width, y: ((1 - place.y) / 2) * height, isShown: place.z < 1 };
    });
    for (const one of seen.sort((a, b) => b.y - a.y)) {
      const half = one.label.offsetWidth / 2, tall = one.label.offsetHeight;
      const x = Math.min(Math.max(one.x, half), width - half);
      let y = one.y;
      for (const other of laid) if (Math.abs(x - other.x) < half + other.half && y > other.y - other.tall && y - tall < other.y) y = other.y - other.tall - GAP_PIXELS;
      one.label.hidden = !one.isShown || y - tall < 0;
      one.label.style.transform = `translate(${x - half}px, ${y - tall}px)`;
      if (one.isShown) laid.push({ x, y, half, tall });
    }
  }

  async function showTable() {
    let stage = null, place = null;
    stage = await stageOf({
      canvas, cloud, look,
      reach: cloud.sphere.radius,
      frame() { if (stage) layLabels(stage.camera, place); },
      point(i, splat) { point(i === null ? 0 : splat.part(i)); },
      pick(i, splat) {
        const label = labels[(i === null ? 0 : splat.part(i)) - 1];
        if (label?.href) location.href = label.href;
      },
    });
    place = new Splats.Vector3();
    redraw = () => stage.redraw();
    frame.classList.add("ready");
  }
  if (cloud.count && canShowSplats()) showTable().catch((error) => { say(`The table cannot be shown in 3D here: ${error.message}`); console.error(error); });
  else say("This browser cannot show the table in 3D (it lacks WebGL 2 or DecompressionStream); the photo below shows it.");
})();
