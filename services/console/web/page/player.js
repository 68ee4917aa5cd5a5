// The bar of a recording: play and pause, a place to go to, and how fast.
import { gate } from "./gate.js";
import { clock, element, news } from "./look.js";

const SPEEDS = [0.25, 0.5, 1, 2, 4, 10];
const STEP = 5; // seconds that an arrow key goes
const EACH = 250; // ms between two places while the slider is dragged

export function player(bar, order) {
  let place = null;
  let asked = 0;
  const go = (more) => order({ do: "play", on: !place.paused, ...more });
  const button = element("button", { type: "button", class: "main" }, "Pause");
  button.addEventListener("click", () => order({ do: "play", on: place.paused }));
  const slider = element("input", { type: "range", min: "0", step: "0.1", "aria-label": "Place in the recording" });
  const dragged = (isLast) => {
    if (!isLast && performance.now() - asked < EACH) return;
    asked = performance.now();
    go({ at: Number(slider.value) });
  };
  slider.addEventListener("input", () => dragged(false));
  slider.addEventListener("change", () => dragged(true));
  slider.addEventListener("keydown", (event) => {
    const way = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    if (!way) return;
    event.preventDefault(); // the browser would go on by a tenth of a second
    slider.value = String(Number(slider.value) + way * STEP);
    dragged(true);
  });
  const speed = element("select", { "aria-label": "Speed" },
    ...SPEEDS.map((each) => element("option", { value: String(each) }, `${each} x`)));
  speed.value = "1";
  speed.addEventListener("change", () => go({ speed: Number(speed.value) }));
  const where = element("span", { class: "where" });
  bar.replaceChildren(button, slider, where, speed, element("p", { class: "told", role: "status" }));
  const told = news(bar);
  const close = gate(bar, (text) => told([{ panel: bar.id, text }]));

  return {
    take(state, changed) {
      if (changed.has("told")) told(state.told);
      if (changed.has("away")) close(button, state.away);
      if (!changed.has("place")) return;
      place = state.place;
      bar.hidden = false;
      for (const id of ["part", "wizard"]) document.querySelector(`#${id}`).hidden = true; // nobody takes part
      button.textContent = place.paused || place.at >= place.end ? "Play" : "Pause";
      slider.max = String(place.end);
      if (performance.now() - asked > 2 * EACH) slider.value = String(place.at);
      slider.setAttribute("aria-valuetext", clock(place.at));
      where.textContent = `${clock(place.at)} of ${clock(place.end)}`;
    },
  };
}
