// The Gaussians of a page in 3D: unpacked, drawn, turned with the mouse and the keyboard, and found under the pointer.
// `Splats` is three.js and Spark in one file (scripts/viewer).
"use strict";

async function unpacked(id) {
  const packed = Uint8Array.from(atob(document.getElementById(id).textContent.trim()), (char) => char.charCodeAt(0));
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip")));
}

const canShowSplats = () => typeof DecompressionStream === "function" && !!document.createElement("canvas").getContext("webgl2");

function columnsOf(cloud, buffer) {
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

// `look` says how Gaussian i is shown: `color(i)`, `opacity(i)`, and `place(i, center, scales, turn)`, which moves it from where it
// is at rest and returns false if it is not shown. `reach` is the radius of all that is ever shown. `pick(i)` is called on a click,
// `point(i)` if the pointer moves, with the Gaussian there or null; `frame(seconds)` before each picture.
async function stageOf({ canvas, cloud, look, reach, pick, point, frame, keys: moreKeys }) {
  const TURN_PER_KEY = Math.PI / 24, ZOOM_PER_KEY = 1.15, CLICK_PIXELS = 4;
  // Distance of the camera, in distances at which the sphere around the object just fits into the view.
  const MARGIN = 1.03;
  // A frame that took longer than this, in seconds, does not make the motion jump.
  const LONGEST_FRAME = 0.2;
  const byId = (id) => document.getElementById(id);
  const code = document.createElement("script");
  code.textContent = await (await unpacked("viewer-code")).text();
  document.head.append(code);
  const { Color, PerspectiveCamera, Quaternion, Raycaster, Scene, Vector2, Vector3, WebGLRenderer, OrbitControls, SparkRenderer, SplatMesh } = Splats;
  const splat = columnsOf(cloud, await (await unpacked("cloud")).arrayBuffer());

  const renderer = new WebGLRenderer({ canvas, alpha: true, antialias: false, preserveDrawingBuffer: true });
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
  function each(put) {
    for (let i = 0; i < cloud.count; i++) {
      const [red, green, blue] = look.color(i, splat);
      color.setRGB(red / 255, green / 255, blue / 255);
      splat.center(i, center); splat.scales(i, scales); splat.turn(i, turn);
      const isShown = look.place(i, center, scales, turn, splat);
      put(i, center, scales, turn, isShown ? look.opacity(i, splat) : 0, color);
    }
  }
  const mesh = new SplatMesh({ maxSplats: cloud.count, constructSplats: (splats) => each((_, ...rest) => splats.pushSplat(...rest)), minRaycastOpacity: 0.5 });
  world.add(mesh);
  await mesh.initialized;
  const redraw = (drawn) => {
    each((i, ...rest) => {
      mesh.packedSplats.setSplat(i, ...rest);
      drawn?.(rest[0], rest[3]);
    });
    mesh.packedSplats.needsUpdate = true;
    mesh.updateVersion();
    stale = true;
  };

  // --- The camera: a sphere around what is shown fits into the view in both directions.
  let ball = cloud.sphere, fitted = 1;
  function fit() {
    const up = (camera.fov * Math.PI) / 360, across = Math.atan(Math.tan(up) * camera.aspect);
    return (MARGIN * ball.radius) / Math.sin(Math.min(up, across));
  }
  function aim(sphere, from) {
    ball = sphere;
    fitted = fit();
    controls.target.set(...ball.center);
    camera.position.copy(controls.target).addScaledVector(from.normalize(), fitted);
    stale = true;
  }
  const away = () => camera.position.clone().sub(controls.target);
  function home() {
    const from = new Vector3(...cloud.eye).sub(new Vector3(...cloud.sphere.center));
    if (from.length() === 0) from.set(1, 1, 0.5);
    aim(ball, from);
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
    " ": () => setSpin(!controls.autoRotate), Home: home, ...moreKeys,
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
      const isShown = look.place(i, center, scales, turn, splat), distance = center.distanceToSquared(hits[0].point);
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
    if (still) pick(under(event), splat);
  });

  let visible = true, drawn = 0;
  new IntersectionObserver(([entry]) => { visible = entry.isIntersecting; }).observe(canvas);
  renderer.setAnimationLoop((now) => {
    const elapsed = Math.min((now - drawn) / 1000, LONGEST_FRAME);
    drawn = now;
    if (!visible) return;
    frame?.(elapsed);
    controls.update();
    if (moved) {
      const i = under(moved);
      moved = null;
      canvas.style.cursor = i === null ? "grab" : "pointer";
      point(i, splat);
    }
    if (!stale) return;
    stale = controls.autoRotate;
    renderer.render(world, camera);
  });
  return { world, camera, redraw, aim, away, setSpin };
}
