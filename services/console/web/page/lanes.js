// Lanes over time: who speaks, connection events, and behaviors as planned and as measured. The present is near the right edge.
import { clock, color, element, KINDS, seconds, sized } from "./look.js";
import { list } from "./tell.js";

const PAST = 26; // seconds in view
const AHEAD = 5;
const LABEL = 13; // px, size of letters
const AXIS = 20;

function lanes(panel, told, draw) {
  const canvas = panel.querySelector("canvas");
  let summary = -9999;
  let at = 0;
  return {
    take() {},
    tick(state) {
      if (panel.offsetParent === null || performance.now() - at < 40) return;
      at = performance.now();
      if (at - summary > 2000) {
        summary = at;
        canvas.setAttribute("aria-label", told(state));
      }
      const rect = canvas.getBoundingClientRect();
      if (rect.bottom < 0 || rect.top > window.innerHeight) return;
      const { context, width, height } = sized(canvas);
      const names = Math.min(190, Math.max(112, width * 0.24));
      const narrow = width < 600;
      const [past, ahead] = narrow ? [PAST / 2, AHEAD / 2] : [PAST, AHEAD];
      const now = state.now();
      const x = (time) => names + ((time - now + past) / (past + ahead)) * (width - names);
      context.font = `${LABEL}px system-ui, sans-serif`;
      axis(context, { x, now, past, ahead, names, width, height });
      draw({ context, state, x, names, width, height, now, first: now - past, last: now + ahead });
    },
  };
}

function axis(context, { x, now, past, ahead, names, width, height }) {
  context.strokeStyle = color("--line");
  context.fillStyle = color("--quiet");
  context.textAlign = "center";
  context.lineWidth = 1;
  for (let time = Math.ceil((now - past) / 5) * 5; time <= now + ahead; time += 5) {
    if (time < 0) continue;
    context.beginPath();
    context.moveTo(x(time), 0);
    context.lineTo(x(time), height - AXIS);
    context.stroke();
    if (x(time) > names + 12 && x(time) < width - 16) context.fillText(clock(time), x(time), height - 5);
  }
  context.fillStyle = color("--ahead");
  context.fillRect(x(now), 0, width - x(now), height - AXIS);
}

function present(context, x, now, height) {
  context.strokeStyle = color("--ink");
  context.lineWidth = 1.5;
  context.beginPath();
  context.moveTo(x(now), 0);
  context.lineTo(x(now), height - AXIS);
  context.stroke();
}

function row(context, { names, width }, top, size, name, shaded) {
  if (shaded) {
    context.fillStyle = color("--stripe");
    context.fillRect(0, top, width, size);
  }
  context.fillStyle = color("--ink");
  context.textAlign = "left";
  context.textBaseline = "middle";
  const [who, what] = name.split(": ");
  if (what && size > 26 && context.measureText(name).width > names - 10) {
    context.fillText(fitting(context, who, names - 10), 4, top + size / 2 - 7);
    context.fillText(fitting(context, what, names - 10), 4, top + size / 2 + 7);
  } else {
    context.fillText(fitting(context, name, names - 10), 4, top + size / 2);
  }
  context.textBaseline = "alphabetic";
}

function fitting(context, text, width) {
  if (context.measureText(text).width <= width) return text;
  let cut = text;
  while (cut.length > 1 && context.measureText(`${cut}…`).width > width) cut = cut.slice(0, -1);
  return `${cut}…`;
}

// Text in a bar, or right of it where there is room.
function caption(context, text, from, to, middle, room, inside) {
  context.textBaseline = "middle";
  context.textAlign = "left";
  const width = context.measureText(text).width;
  if (width < to - from - 6) {
    if (inside) context.fillStyle = color("--onbar");
    context.fillText(text, from + 4, middle);
  } else if (width < room - to - 8) {
    context.fillText(text, to + 5, middle);
  }
  context.textBaseline = "alphabetic";
}

// -- who speaks ------------------------------------------------------------------------------------------------------

export function floorLanes(panel) {
  panel.querySelector(".legend").replaceChildren(
    element("span", {}, element("i", { style: "background: var(--speech)" }), "speaks"),
    element("span", {}, element("i", { style: "background: var(--back)" }), "into the robot's turn"),
  );
  return lanes(panel, tellFloor, (view) => {
    const { context, state, x, width, height, now, first } = view;
    const names = speakers(state);
    const size = (height - AXIS) / Math.max(names.length, 3);
    const levels = new Map([...state.measures.values()].map((each) => [each.actor, each.level]));
    context.font = `${Math.min(LABEL, size * 0.62)}px system-ui, sans-serif`;
    names.forEach((name, index) => row(context, view, index * size, size, levels.has(name) ? `${name}: ${levels.get(name)}` : name, index % 2));
    context.save();
    context.beginPath();
    context.rect(view.names, 0, width - view.names, height);
    context.clip();
    const next = new Map(); // where the speech that follows begins, by row
    for (const speech of [...(state.floor ?? [])].reverse()) {
      if (speech.until !== null && speech.until < first - 8) continue;
      const index = names.indexOf(speech.actor);
      const [from, to, middle] = [x(speech.since), Math.max(x(speech.until ?? now), x(speech.since) + 3), (index + 0.5) * size];
      context.fillStyle = color(speech.taken ? "--back" : "--speech");
      context.fillRect(from, middle - size * 0.34, to - from, size * 0.68);
      context.fillStyle = color("--ink");
      const [begins, room] = [Math.max(from, view.names), next.get(index) ?? width];
      const text = fitting(context, said(speech, state), Math.max(to - begins - 8, room - to - 10));
      if (to > view.names && text.length > 3) caption(context, text, begins, to, middle, room, true);
      next.set(index, from);
    }
    context.restore();
    present(context, x, now, height);
  });
}

// The robot, those who are measured, and those who speak, each once.
const speakers = (state) => [...new Set([state.robot, ...[...state.measures.keys()].filter(Boolean).sort(), ...(state.floor ?? []).map((each) => each.actor)])];

function said({ to, taken, words }, { robot }) {
  const whom = to.length ? `to ${to.map((each) => (each === robot ? "the robot" : each)).join(" and ")}` : "";
  return [taken || whom, words && `“${words}”`].filter(Boolean).join(": ");
}

function tellFloor(state) {
  const open = (state.floor ?? []).filter((each) => each.until === null);
  const levels = [...state.measures.values()].filter((each) => each.actor).map((each) => `${each.actor} is ${each.level}`);
  return `Speaking: ${open.map((each) => `${each.actor} ${said(each, state)}`.trim()).join(", ") || "nobody"}. ${levels.join(", ") || "Nobody's engagement is known"}.`;
}

// -- connection events ---------------------------------------------------------------------------------------------

// States of an event in plain words, where the term says little.
const MEANT = { superseded: "another one took its place", preempted: "another one came first" };
const GOOD = new Set(["succeeded", "completed"]);

export function eventLanes(panel) {
  panel.querySelector(".legend").replaceChildren(
    ...KINDS.map(([, name, , shade]) => element("span", {}, element("i", { style: `background: var(${shade})` }), name)),
    element("span", {}, element("i", { class: "hollow" }), "waits for the other"),
    element("span", {}, "✕ failed"), element("span", {}, "– dropped"), element("span", {}, "(…) optional"),
  );
  return lanes(panel, tellEvents, (view) => {
    const { context, state, x, width, height, now, first } = view;
    const rows = [];
    for (const [kind, name, isAnswered] of KINDS) {
      if (isAnswered) rows.push({ kind, mine: true, name: `${state.robot}: ${name}` });
      rows.push({ kind, mine: false, name: `people: ${name}` });
    }
    const size = (height - AXIS) / rows.length;
    const shades = new Map(KINDS.map(([kind, , , shade]) => [kind, shade]));
    context.font = `${Math.min(LABEL, size * 0.62)}px system-ui, sans-serif`;
    rows.forEach((each, index) => row(context, view, index * size, size, each.name, index % 2));
    context.save();
    context.beginPath();
    context.rect(view.names, 0, width - view.names, height);
    context.clip();
    const next = new Map(); // where the event that follows begins, by row
    for (const event of [...(state.events ?? [])].reverse()) {
      if (event.until !== null && event.until < first - 8) continue;
      const index = rows.findIndex((each) => each.kind === event.kind && each.mine === (event.by === state.robot));
      drawEvent(view, event, index * size, size, color(shades.get(event.kind)), next.get(index) ?? width);
      next.set(index, x(event.since));
    }
    context.restore();
    present(context, x, now, height);
  });
}

function drawEvent({ context, x, now, names }, event, top, size, shade, room) {
  const [high, low] = [top + size * 0.16, size * 0.68];
  const decided = event.decided ?? now;
  const end = event.until ?? now;
  const from = x(event.since);
  context.strokeStyle = shade;
  context.fillStyle = shade;
  context.lineWidth = 1.5;
  if (x(decided) - from > 1) {
    context.globalAlpha = 0.25;
    context.fillRect(from, high, x(decided) - from, low);
    context.globalAlpha = 1;
    context.strokeRect(from, high, x(decided) - from, low);
  }
  const to = Math.max(x(end), x(decided) + 4);
  let text = "";
  if (GOOD.has(event.state)) {
    context.fillRect(x(decided), high, to - x(decided), low);
    text = event.delay === null ? "" : event.delay < 0 ? `had begun ${seconds(-event.delay)} before` : `after ${seconds(event.delay)}`;
  } else if (event.state !== "started") {
    context.fillStyle = color(event.state === "failed" ? "--bad" : "--quiet");
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(event.state === "failed" ? "✕" : "–", x(decided), top + size / 2);
    context.textBaseline = "alphabetic";
    text = event.state === "failed" && event.optional ? "(failed)" : MEANT[event.state] ?? event.state;
  } else {
    text = `waits ${(now - event.since).toFixed(1)} s`;
  }
  const about = event.about.length ? `${list(event.about, event.one_of ? "or" : "and")} ` : "";
  context.fillStyle = color("--ink");
  const begins = Math.max(x(decided), names);
  caption(context, `${about}${text}`, begins, to + (event.state === "failed" ? 6 : 0), top + size / 2, room, GOOD.has(event.state));
}

function tellEvents(state) {
  const open = (state.events ?? []).filter((event) => event.until === null);
  const latest = (state.events ?? []).slice(-3).map((event) => `${event.kind.replaceAll("_", " ")} by ${event.by}: ${event.state}`);
  return `Connection events. Open: ${open.length}. The last: ${latest.join("; ") || "none"}.`;
}

// -- behaviors -----------------------------------------------------------------------------------------------------

const PARTS = [
  ["speech", ["speech"]], ["gaze", ["gaze", "gazeShift"]], ["pointing", ["pointing", "gesture"]],
  ["head", ["head", "headDirectionShift"]], ["face", ["face", "faceLexeme", "faceFacs", "faceShift"]],
  ["posture", ["posture", "postureShift", "pose", "locomotion"]], ["events, turns", ["event", "turn", "wait", "constraint"]],
];
const SHADES = ["--speech", "--gaze", "--point", "--back", "--pair", "--mutual", "--quiet"];

export function behaviorLanes(panel) {
  panel.querySelector(".legend").replaceChildren(
    element("span", {}, element("i", { class: "hollow" }), "planned at first"),
    element("span", {}, element("i", { class: "full" }), "measured, with sync points"),
    element("span", {}, element("i", { class: "ahead" }), "still to come, as planned now"),
    element("span", {}, element("i", { class: "sync" }), "one instant of several behaviors"),
  );
  return lanes(panel, tellBehaviors, (view) => {
    const { context, state, x, width, height, now, first } = view;
    const blocks = [...state.blocks.values()].filter((block) => (block.until ?? now + 99) > first - 4);
    const seen = PARTS.map(([name, types], index) => ({ name, types, shade: SHADES[index] }))
      .filter(({ name, types }) => ["speech", "gaze", "pointing"].includes(name)
        || blocks.some((block) => block.behaviors.some((each) => types.includes(each.type))));
    const size = (height - AXIS) / seen.length;
    seen.forEach((each, index) => row(context, view, index * size, size, each.name, index % 2));
    context.save();
    context.beginPath();
    context.rect(view.names, 0, width - view.names, height);
    context.clip();
    for (const block of blocks) {
      const at = new Map();
      for (const behavior of block.behaviors) {
        const index = seen.findIndex((each) => each.types.includes(behavior.type));
        if (index < 0) continue;
        at.set(behavior.id, index);
        drawBehavior(view, behavior, block, index * size, size, color(seen[index].shade));
      }
      ties(view, block, at, size);
    }
    context.restore();
    present(context, x, now, height);
  });
}

function extent(points, key, other) {
  const times = points.map((point) => point[key] ?? (other ? point[other] : null)).filter((time) => time !== null);
  return times.length ? [Math.min(...times), Math.max(...times)] : null;
}

function drawBehavior({ context, x, now, names }, behavior, block, top, size, shade) {
  const planned = extent(behavior.points, "first");
  const real = extent(behavior.points, "measured");
  const over = block.until !== null || behavior.points.every((point) => point.measured !== null);
  const coming = extent(behavior.points.filter((point) => point.measured === null), "planned");
  context.lineWidth = 1.2;
  if (planned) {
    context.strokeStyle = shade;
    context.globalAlpha = 0.8;
    context.strokeRect(x(planned[0]), top + size * 0.1, Math.max(2, x(planned[1]) - x(planned[0])), size * 0.24);
    context.globalAlpha = 1;
  }
  const [high, low] = [top + size * 0.42, size * 0.42];
  context.fillStyle = shade;
  if (real) {
    const end = over ? real[1] : now;
    context.fillRect(x(real[0]), high, Math.max(2, x(end) - x(real[0])), low);
  }
  if (!over && coming) {
    context.globalAlpha = 0.22;
    const from = real ? now : coming[0];
    context.fillRect(x(from), high, Math.max(0, x(Math.max(coming[1], from)) - x(from)), low);
    context.globalAlpha = 1;
  }
  context.strokeStyle = color("--paper");
  for (const point of behavior.points) {
    if (point.measured === null) continue;
    context.beginPath();
    context.moveTo(x(point.measured), high);
    context.lineTo(x(point.measured), high + low);
    context.stroke();
  }
  if (real && size > 30) {
    context.fillStyle = color("--onbar");
    const [from, to] = [x(real[0]), x(over ? real[1] : now)];
    const begins = Math.max(from, names);
    const text = fitting(context, behavior.id, to - begins - 6);
    if (text.length > 3) caption(context, text, begins, to, high + low / 2, 0);
  }
}

// Lines through the behaviors that share an instant: as measured, or as planned where it is still to come.
function ties({ context, x, first, last }, block, at, size) {
  const times = new Map();
  for (const behavior of block.behaviors) {
    for (const point of behavior.points) times.set(`${behavior.id}:${point.sync}`, point.measured ?? point.planned);
  }
  context.strokeStyle = color("--sync");
  context.lineWidth = 1.5;
  for (const tie of block.ties) {
    const rows = tie.map(([behavior]) => at.get(behavior)).filter((index) => index !== undefined);
    const when = tie.map(([behavior, sync]) => times.get(`${behavior}:${sync}`)).filter((time) => time !== undefined && time !== null);
    if (new Set(rows).size < 2 || !when.length) continue;
    const time = Math.max(...when);
    if (time < first || time > last) continue;
    context.beginPath();
    context.moveTo(x(time), Math.min(...rows) * size + size * 0.3);
    context.lineTo(x(time), Math.max(...rows) * size + size * 0.9);
    context.stroke();
  }
}

function tellBehaviors(state) {
  const running = [...state.blocks.values()].filter((block) => block.until === null);
  const names = running.flatMap((block) => block.behaviors.filter((each) =>
    each.points.some((point) => point.measured !== null) && each.points.some((point) => point.measured === null)).map((each) => each.id));
  return `Behaviors. Blocks that run: ${running.map((block) => block.id).join(", ") || "none"}. Under way: ${names.join(", ") || "nothing"}.`;
}
