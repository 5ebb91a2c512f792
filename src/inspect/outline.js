// The box around the object: drawn over the splat from three sides and over photos, dragged there or typed, printed as an option.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("outline").textContent);
  const AXES = ["x", "y", "z"];
  const COLORS = ["#d0342c", "#2b8a3e", "#2864d8"];
  const ENDS = ["min", "max"];
  const REACH = 14; // pixels from an edge or a handle within which it is taken
  const bytes = (base64) => Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
  const points = new Float32Array(bytes(data.points).buffer);
  const colors = bytes(data.colors);
  const count = points.length / 3;
  const box = { min: [...data.box.min], max: [...data.box.max] };
  const longest = Math.max(...data.box.size) || 1;
  // As many decimals as tell apart a thousandth of the longest side.
  const decimals = Math.max(0, Math.ceil(3 - Math.log10(longest)));
  const written = (value) => String(Number(value.toFixed(decimals)));
  const drawings = [];

  const isInside = (n) => AXES.every((_, axis) => {
    const value = points[3 * n + axis];
    return box.min[axis] <= value && value <= box.max[axis];
  });

  // Moves a side of the box, never past the other.
  function move(axis, end, value) {
    box[end][axis] = end === "min" ? Math.min(value, box.max[axis]) : Math.max(value, box.min[axis]);
  }

  const sidesOf = (axis) => ENDS.map((end) => document.querySelector(`[data-axis="${axis}"][data-end=${end}]`));

  // Says what is wrong with the sides that were typed for an axis, or nothing.
  function mark(axis, problem) {
    for (const input of sidesOf(axis)) input.ariaInvalid = String(problem !== "");
    const shown = document.getElementById("reversed");
    shown.hidden = !problem;
    shown.textContent = problem;
  }

  // Takes the sides that were typed for an axis, unless the first is beyond the second: the box stays as it is until they are in order.
  function take(axis) {
    const typed = sidesOf(axis).map(({ value }) => value);
    if (typed.includes("")) return;
    const [from, to] = typed.map(Number);
    const isReversed = from > to;
    mark(axis, isReversed ? `${AXES[axis]} from ${from} to ${to}: the lower number comes first. The box is as before until they are in order.` : "");
    if (!isReversed) [box.min[axis], box.max[axis]] = [from, to];
  }

  function show() {
    const corner = (end) => box[end].map(written).join(",");
    document.getElementById("option").textContent = `--object-box=${corner("min")}:${corner("max")}`;
    let inside = 0;
    for (let n = 0; n < count; n++) inside += isInside(n);
    document.getElementById("inside").textContent = `${inside} of the ${count} points drawn are in the box.`;
    for (const input of document.querySelectorAll("[data-axis]")) {
      const isReversed = input.ariaInvalid === "true";
      if (input !== document.activeElement && !isReversed) input.value = written(box[input.dataset.end][input.dataset.axis]);
    }
    drawings.forEach((draw) => draw());
  }

  // A canvas of that size in pixels of its own, with a caption. `grab` returns what a pointer at a place drags, a function of its
  // later places, or nothing.
  function canvasOf(caption, [width, height], grab) {
    const figure = document.createElement("figure");
    const canvas = document.createElement("canvas");
    Object.assign(canvas, { width, height });
    const text = document.createElement("figcaption");
    text.textContent = caption;
    figure.append(canvas, text);
    document.getElementById("drawings").append(figure);
    const place = (event) => {
      const bounds = canvas.getBoundingClientRect();
      return [(event.clientX - bounds.left) * width / bounds.width, (event.clientY - bounds.top) * height / bounds.height];
    };
    const perPixel = () => width / canvas.getBoundingClientRect().width;
    let drag = null;
    canvas.addEventListener("pointerdown", (event) => {
      drag = grab(place(event), REACH * perPixel());
      if (drag) event.preventDefault();
      if (drag && event.isTrusted) canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (drag) {
        AXES.forEach((_, axis) => mark(axis, ""));
        drag(place(event));
        show();
      } else {
        canvas.style.cursor = grab(place(event), REACH * perPixel()) ? "grab" : "default";
      }
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { drag = null; });
    return canvas.getContext("2d");
  }

  function line(context, [x0, y0], [x1, y1]) {
    context.beginPath();
    context.moveTo(x0, y0);
    context.lineTo(x1, y1);
    context.stroke();
  }

  // The splat along one axis, with the other two to the right and upwards.
  function plan(right, upwards) {
    const SIZE = 480;
    const MARGIN = 44;
    const span = (axis) => {
      let low = data.box.min[axis];
      let high = data.box.max[axis];
      for (let n = 0; n < count; n++) {
        low = Math.min(low, points[3 * n + axis]);
        high = Math.max(high, points[3 * n + axis]);
      }
      return [low, high];
    };
    const spans = [span(right), span(upwards)];
    const scale = (SIZE - MARGIN - 12) / (Math.max(...spans.map(([low, high]) => high - low)) || 1);
    const toX = (value) => MARGIN + (value - spans[0][0]) * scale;
    const toY = (value) => SIZE - MARGIN - (value - spans[1][0]) * scale;
    const valueOf = ([x, y]) => [(x - MARGIN) / scale + spans[0][0], (SIZE - MARGIN - y) / scale + spans[1][0]];
    const grab = ([x, y], reach) => {
      const near = [];
      const within = (value, low, high) => low - reach <= value && value <= high + reach;
      const inRows = within(y, toY(box.max[upwards]), toY(box.min[upwards]));
      const inColumns = within(x, toX(box.min[right]), toX(box.max[right]));
      // Of two opposite edges that are both near, the nearer.
      const nearest = (axis, distance) => {
        const [end] = ENDS.filter((one) => distance(one) <= reach).sort((a, b) => distance(a) - distance(b));
        if (end) near.push([axis, end]);
      };
      if (inRows) nearest(right, (end) => Math.abs(x - toX(box[end][right])));
      if (inColumns) nearest(upwards, (end) => Math.abs(y - toY(box[end][upwards])));
      if (near.length > 0) {
        return (to) => near.forEach(([axis, end]) => move(axis, end, valueOf(to)[axis === right ? 0 : 1]));
      }
      if (!inRows || !inColumns) return null;
      let last = valueOf([x, y]);
      return (to) => {
        const now = valueOf(to);
        [right, upwards].forEach((axis, n) => ENDS.forEach((end) => { box[end][axis] += now[n] - last[n]; }));
        last = now;
      };
    };
    const context = canvasOf(`${AXES[right]} to the right, ${AXES[upwards]} upwards`, [SIZE, SIZE], grab);
    const step = 10 ** Math.floor(Math.log10((SIZE - MARGIN) / scale / 2));
    drawings.push(() => {
      const ink = getComputedStyle(document.body).color;
      context.clearRect(0, 0, SIZE, SIZE);
      for (let n = 0; n < count; n++) {
        const [r, g, b] = colors.subarray(3 * n, 3 * n + 3);
        context.fillStyle = isInside(n) ? `rgb(${r} ${g} ${b})` : "rgb(150 150 150 / 0.35)";
        context.fillRect(toX(points[3 * n + right]) - 1, toY(points[3 * n + upwards]) - 1, 2, 2);
      }
      context.font = "13px system-ui, sans-serif";
      context.lineWidth = 1;
      context.strokeStyle = context.fillStyle = ink;
      for (const [axis, horizontal] of [[right, true], [upwards, false]]) {
        const [low, high] = spans[horizontal ? 0 : 1];
        for (let n = Math.ceil(low / step); n * step <= high; n++) {
          const at = horizontal ? [toX(n * step), SIZE - MARGIN + 8] : [MARGIN - 8, toY(n * step)];
          line(context, at, horizontal ? [at[0], at[1] + 5] : [at[0] - 5, at[1]]);
          const text = String(Number((n * step).toPrecision(6)));
          context.textAlign = horizontal ? "center" : "right";
          context.fillText(text, horizontal ? at[0] : at[0] - 7, horizontal ? at[1] + 18 : at[1] + 4);
        }
        context.fillStyle = COLORS[axis];
        context.textAlign = "left";
        context.fillText(AXES[axis], horizontal ? SIZE - 12 : 6, horizontal ? SIZE - 6 : 14);
        context.fillStyle = ink;
      }
      context.strokeStyle = "#e6007a";
      context.lineWidth = 2;
      const [x, y] = [toX(box.min[right]), toY(box.max[upwards])];
      context.strokeRect(x, y, toX(box.max[right]) - x, toY(box.min[upwards]) - y);
    });
  }

  // The box on a photo, with a handle in the middle of each face.
  function photo(view) {
    const project = (point) => {
      const [x, y, z] = view.camera_from_input.map((row) => row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + row[3]);
      if (z <= 1e-6 * longest) return null;
      return [view.focal[0] * x / z + view.center[0], view.focal[1] * y / z + view.center[1]];
    };
    const middle = () => AXES.map((_, axis) => (box.min[axis] + box.max[axis]) / 2);
    const handle = (axis, end) => Object.assign(middle(), { [axis]: box[end][axis] });
    const handles = () => AXES.flatMap((_, axis) => ENDS.map((end) => ({ axis, end, at: project(handle(axis, end)) })))
      .filter(({ at }) => at);
    const grab = ([x, y], reach) => {
      const distance = ({ at }) => Math.hypot(x - at[0], y - at[1]);
      const [taken] = handles().filter((one) => distance(one) <= reach).sort((a, b) => distance(a) - distance(b));
      if (!taken) return null;
      const { axis, end, at } = taken;
      const start = box[end][axis];
      const beside = handle(axis, end);
      beside[axis] += 1e-3 * longest;
      const next = project(beside);
      const perUnit = next && [0, 1].map((n) => (next[n] - at[n]) / (1e-3 * longest));
      const square = perUnit && perUnit[0] ** 2 + perUnit[1] ** 2;
      if (!square) return null;
      return (to) => move(axis, end, start + ((to[0] - x) * perUnit[0] + (to[1] - y) * perUnit[1]) / square);
    };
    const context = canvasOf(view.name, view.size, grab);
    const picture = new Image();
    const corners = [...Array(8).keys()].map((n) => [n & 1, (n >> 1) & 1, (n >> 2) & 1]);
    const draw = () => {
      context.clearRect(0, 0, ...view.size);
      if (picture.complete) context.drawImage(picture, 0, 0, ...view.size);
      const unit = Math.max(...view.size) / 480;
      const projected = corners.map((corner) => project(corner.map((end, axis) => box[ENDS[end]][axis])));
      corners.forEach((_, from) => AXES.forEach((name, axis) => {
        const to = from | (1 << axis);
        if (to === from || !projected[from] || !projected[to]) return;
        // The three edges from the corner with the least coordinates are the axes.
        context.strokeStyle = from === 0 ? COLORS[axis] : "#e6007a";
        context.lineWidth = (from === 0 ? 3 : 1.5) * unit;
        line(context, projected[from], projected[to]);
      }));
      context.font = `${13 * unit}px system-ui, sans-serif`;
      for (const { axis, end, at } of handles()) {
        context.fillStyle = COLORS[axis];
        context.beginPath();
        context.arc(...at, 5 * unit, 0, 2 * Math.PI);
        context.fill();
        context.strokeStyle = "#fff";
        context.lineWidth = 3 * unit;
        const text = `${AXES[axis]} ${written(box[end][axis])}`;
        context.strokeText(text, at[0] + 7 * unit, at[1] + 4 * unit);
        context.fillText(text, at[0] + 7 * unit, at[1] + 4 * unit);
      }
    };
    drawings.push(draw);
    picture.onload = draw;
    picture.src = view.picture;
  }

  for (const input of document.querySelectorAll("[data-axis]")) {
    input.addEventListener("input", () => {
      take(Number(input.dataset.axis));
      show();
    });
    input.addEventListener("blur", show);
  }
  document.getElementById("copy").addEventListener("click", () => {
    navigator.clipboard?.writeText(document.getElementById("option").textContent);
  });
  data.photos.forEach(photo);
  [[0, 1], [0, 2], [1, 2]].forEach(([right, upwards]) => plan(right, upwards));
  show();
})();
