// Photo against splat, both from the photo's camera, with a slider between them. Both pictures are among those of the views.
"use strict";
(() => {
  const [over, photo, splat, view, cut] = ["over", "over-photo", "over-splat", "over-view", "cut"].map((id) => document.getElementById(id));
  const views = [...document.querySelectorAll("details[data-view]")];
  for (const { dataset } of views) view.add(new Option(dataset.view, dataset.view));
  const show = () => {
    const [from, drawn] = views[view.selectedIndex].querySelectorAll(".pictures img");
    [[photo, from], [splat, drawn]].forEach(([to, { src, alt }]) => Object.assign(to, { src, alt }));
  };
  const move = () => over.style.setProperty("--cut", `${cut.value}%`);
  const follow = ({ clientX, buttons }) => {
    if (!buttons) return;
    const { left, width } = over.getBoundingClientRect();
    cut.value = (100 * (clientX - left)) / width;
    move();
  };
  view.addEventListener("change", show);
  cut.addEventListener("input", move);
  over.addEventListener("pointerdown", follow);
  over.addEventListener("pointermove", follow);
  if (views.length) show();
})();
