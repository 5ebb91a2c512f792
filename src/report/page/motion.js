// How the Gaussians of the cloud move in the simulation: parts along a path, the others on tracks of their own
// (src/report/motion says how both are stored). `Splats` is three.js and Spark.
"use strict";

/* The motion of `count` Gaussians: `pose(seconds)` returns a function that moves Gaussian `i` of part `p` from where it is at
   rest, and returns false if it is not shown while the object moves. */
function motionOf({ times_s: times, paths, tracks, corners, log_scales }, middle, count, buffer) {
  const { Quaternion, Vector3 } = Splats;
  const TRACK = 1, HIDDEN = 2, COLUMNS = 10;
  const bytes = new Uint8Array(buffer), kinds = bytes.subarray(0, count);
  const trackOf = new Uint32Array(count);
  for (let i = 0, next = 0; i < count; i++) if (kinds[i] === TRACK) trackOf[i] = next++;

  // Columns x y z (u16), log scales, quaternion (bytes), each the sum of the differences so far.
  const frames = [];
  for (let f = 0, at = count, last = new Uint16Array(COLUMNS * tracks); f < times.length; f++) {
    const now = new Uint16Array(COLUMNS * tracks);
    for (let column = 0; column < COLUMNS; column++) {
      const isWide = column < 3, mask = isWide ? 0xffff : 0xff;
      for (let k = 0, to = column * tracks; k < tracks; k++, to++)
        now[to] = (last[to] + bytes[at + k] + (isWide ? bytes[at + tracks + k] << 8 : 0)) & mask;
      at += isWide ? 2 * tracks : tracks;
    }
    frames.push((last = now));
  }

  const mixed = (a, b, share) => a + share * (b - a);
  const signed = (byte) => (byte > 127 ? byte - 256 : byte);
  const poses = paths.map((path) => path.map(([x, y, z, w, ...to]) => ({ turn: new Quaternion(x, y, z, w), to: new Vector3(...to) })));
  const duration = times[times.length - 1];

  function pose(seconds) {
    let from = 0;
    while (from + 2 < times.length && times[from + 1] <= seconds) from++;
    const to = Math.min(from + 1, times.length - 1), span = times[to] - times[from];
    const share = span > 0 ? Math.min(Math.max((seconds - times[from]) / span, 0), 1) : 0;
    const bodies = poses.map((path) => ({
      turn: path[from].turn.clone().slerp(path[to].turn, share),
      to: path[from].to.clone().lerp(path[to].to, share),
    }));
    const a = frames[from], b = frames[to];
    const number = (column, k) => mixed(a[column * tracks + k], b[column * tracks + k], share);
    const axis = (column, k) => mixed(signed(a[column * tracks + k]), signed(b[column * tracks + k]), share);
    return (i, p, center, scales, turn) => {
      if (kinds[i] === HIDDEN) return false;
      if (kinds[i] === TRACK) {
        const k = trackOf[i];
        center.set(...[0, 1, 2].map((c) => mixed(corners[0][c], corners[1][c], number(c, k) / 65535)));
        scales.set(...[3, 4, 5].map((c) => Math.exp(mixed(log_scales[0], log_scales[1], number(c, k) / 255))));
        turn.set(axis(6, k), axis(7, k), axis(8, k), axis(9, k)).normalize();
      } else {
        center.sub(middle).applyQuaternion(bodies[p].turn).add(bodies[p].to);
        turn.premultiply(bodies[p].turn);
      }
      return true;
    };
  }
  return { duration, pose };
}
