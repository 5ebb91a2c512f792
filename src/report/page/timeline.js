// The controls of the simulation: play and pause, time, speed, and back to the object at rest.
"use strict";

/* `moved(seconds)` is called when the time changes; null is the object at rest, as in the photos. */
function timelineOf(duration, moved) {
  const [bar, play, slider, clock, speed, rest] = ["timeline", "play", "time", "clock", "speed", "rest"].map((id) => document.getElementById(id));
  let seconds = null, playing = false;
  const at = (time) => `${time.toFixed(2)} s`;
  function set(time) {
    seconds = time;
    slider.value = time ?? 0;
    clock.textContent = `${at(time ?? 0)} of ${at(duration)}`;
    slider.setAttribute("aria-valuetext", clock.textContent);
    rest.disabled = time === null;
    moved(time);
  }
  function setPlaying(on) {
    playing = on;
    play.textContent = on ? "Pause" : "Play";
    play.setAttribute("aria-pressed", String(on));
  }
  function toggle() {
    if (!playing && (seconds === null || seconds >= duration)) set(0);
    setPlaying(!playing);
  }
  play.addEventListener("click", toggle);
  slider.addEventListener("input", () => { setPlaying(false); set(Number(slider.value)); });
  rest.addEventListener("click", () => { setPlaying(false); set(null); });
  slider.max = duration;
  slider.step = duration / 500;
  clock.textContent = `${at(0)} of ${at(duration)}`;
  bar.hidden = false;
  return {
    toggle,
    /* Advances the motion after `elapsed` seconds of real time. */
    tick(elapsed) {
      if (!playing) return;
      set(Math.min(seconds + elapsed * Number(speed.value), duration));
      if (seconds === duration) setPlaying(false);
    },
  };
}
