// Engagement, MTBCE and delays over the whole time.
import { clock, color, element, KINDS, sized } from "./look.js";

export function measures(panel) {
  const canvas = panel.querySelector("canvas");
  const reasons = panel.querySelector(".reasons");
  panel.querySelector(".legend").replaceChildren(
    ...KINDS.map(([, name, , shade, mark]) => element("span", {}, element("b", { style: `color: var(${shade})` }, mark), ` ${name}`)));
  let stale = true;
  new ResizeObserver(() => (stale = true)).observe(canvas);
  let theme = null;
  return {
    take(state, changed) {
      if (changed.has("delays")) stale = true;
      if (!changed.has("measures")) return;
      stale = true;
      const people = [...state.measures.values()].filter((each) => each.actor);
      reasons.textContent = people.map((each) => `${each.actor}: ${each.level}${each.reasons.length ? ` (${each.reasons.join("; ")})` : ""}`).join(". ");
    },
    tick(state) {
      const dark = document.body.classList.contains("body--dark");
      if (dark !== theme) stale = true;
      if (!stale || !state.delays || panel.offsetParent === null) return;
      stale = false;
      theme = dark;
      draw(canvas, state);
    },
  };
}

function draw(canvas, state) {
  const { context, width, height } = sized(canvas);
  const { delays } = state;
  const everyone = state.measures.get("");
  const persons = [...state.measures.values()].filter((each) => each.actor);
  const end = Math.max(10, state.now());
  const part = height / 3;
  context.font = "12px system-ui, sans-serif";
  const left = 38;
  const x = (time) => left + (Math.max(0, time) / end) * (width - left - 8); // what was before the window is at its edge
  const charts = [
    ["engagement, from 0 to 1", 1, persons.map((each, index) => [each.engagement, ["--gaze", "--pair", "--point"][index % 3]])],
    ["mean time between connection events, MTBCE (s)", ceiling(everyone?.mtbce ?? [], 5), [[everyone?.mtbce ?? [], "--mutual"]]],
  ];
  charts.forEach(([name, most, courses], index) => {
    const y = frame(context, name, most, index * part, part, left, width);
    for (const [course, shade] of courses) curve(context, course, x, y, color(shade));
    if (!index) persons.forEach((each, number) => signed(context, each, x, y, color(courses[number][1]), number));
  });
  const most = ceiling(delays, 2);
  const y = frame(context, "delay of each event (s)", most, 2 * part, part, left, width);
  const looks = new Map(KINDS.map(([kind, , , shade, mark]) => [kind, [shade, mark]]));
  context.textAlign = "center";
  for (const [at, delay, kind] of delays) {
    const [shade, mark] = looks.get(kind);
    context.fillStyle = color(shade);
    context.fillText(mark, x(at), y(Math.min(delay, most)) + 4);
  }
  context.fillStyle = color("--quiet");
  context.textAlign = "right";
  context.fillText(clock(end), width - 6, height - 3);
  const told = persons.map((each) => `${each.actor} ${each.level}, ${each.engagement.at(-1)?.[1].toFixed(2) ?? "unknown"}`).join("; ");
  canvas.setAttribute("aria-label", `Engagement: ${told || "of nobody yet"}. MTBCE: ${everyone?.mtbce.at(-1)?.[1].toFixed(2) ?? "-"} s.`);
}

const ceiling = (course, least) => Math.max(least, Math.ceil(Math.max(0, ...course.map((each) => each[1]))));

function frame(context, name, most, top, size, left, width) {
  const [high, low] = [top + 18, top + size - 16];
  context.strokeStyle = color("--line");
  context.fillStyle = color("--quiet");
  context.lineWidth = 1;
  for (const value of [0, most / 2, most]) {
    const y = low - (value / most) * (low - high);
    context.beginPath();
    context.moveTo(left, y);
    context.lineTo(width - 8, y);
    context.stroke();
    context.textAlign = "right";
    context.fillText(String(value), left - 5, y + 4);
  }
  context.fillStyle = color("--ink");
  context.textAlign = "left";
  context.fillText(name, left, top + 12);
  return (value) => low - (Math.max(0, value) / most) * (low - high);
}

// The name of a person at the end of their curve; several take turns above and below.
function signed(context, { actor, engagement }, x, y, shade, number) {
  if (!engagement.length) return;
  const [at, value] = engagement.at(-1);
  context.fillStyle = shade;
  context.textAlign = "right";
  context.fillText(actor, Math.max(x(at) - 3, 90), y(value) + (number % 2 ? 13 : -4));
}

function curve(context, course, x, y, shade) {
  context.strokeStyle = shade;
  context.lineWidth = 2;
  context.beginPath();
  course.forEach(([at, value], index) => (index ? context.lineTo(x(at), y(value)) : context.moveTo(x(at), y(value))));
  context.stroke();
}
