// The Petri net of a block, with its tokens. A token that moves is shown on its way through the transition.
import { drawn, element, seconds } from "./look.js";

const COLUMN = 46;
const ROW = 34;
const NAMES = 138;
const LEFT = 34; // with the tokens at rest
const TOP = 40;
const LEGEND = ["s start", "r ready", "[ stroke start", "* stroke", "] stroke end", "x relax", "e end", "m mark", "● token", "above: seconds as planned"];
const WAY = 320; // ms that a token is shown on its way

export function net(panel) {
  const place = panel.querySelector(".net");
  const choose = panel.querySelector(".choose");
  panel.querySelector(".legend").replaceChildren(...LEGEND.map((each) => element("span", {}, each)));
  let shown = null; // { block, layout, svg, spots, bars }
  let wanted = ""; // the block that somebody has chosen
  const buttons = new Map();

  function pick(state) {
    const all = state.nets.map((id) => state.layouts.get(id)).filter(Boolean);
    const chosen = all.find((layout) => layout.block === wanted);
    if (chosen) return chosen;
    const newest = (own) => all.filter((layout) => layout.own === own).at(-1);
    return newest(false) ?? newest(true) ?? null;
  }

  function choices(state) {
    for (const [id, button] of buttons) {
      if (!state.nets.includes(id)) {
        button.remove();
        buttons.delete(id);
      }
    }
    for (const id of state.nets) {
      if (!buttons.has(id)) {
        const button = element("button", { type: "button" }, id);
        button.addEventListener("click", () => {
          wanted = wanted === id ? "" : id;
          update(state);
        });
        buttons.set(id, button);
        choose.append(button);
      }
      buttons.get(id).setAttribute("aria-pressed", String(shown?.layout.block === id));
    }
  }

  function update(state) {
    const layout = pick(state);
    if (layout && shown?.layout !== layout) {
      shown = draw(place, layout);
    }
    if (!layout && !shown) place.replaceChildren(element("p", { class: "none" }, "No block has run yet."));
    choices(state);
    const tokens = shown && state.tokens.find((each) => each.block === shown.layout.block);
    if (tokens) shown.mark(tokens);
  }

  return {
    take(state, changed) {
      if (!state.nets || !state.tokens) return;
      if (changed.has("nets") || changed.has("tokens") || changed.has("layouts")) update(state);
    },
  };
}

function draw(place, layout) {
  if (layout.waits_for.length) {
    place.replaceChildren(element("p", {}, `${layout.block} waits for the end of ${layout.waits_for.join(", ")}.`));
    return { layout, mark() {} };
  }
  const width = LEFT + layout.instants.length * COLUMN + 30;
  const height = TOP + layout.rows.length * ROW + 10;
  const svg = drawn("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img" });
  const names = drawn("svg", { class: "names", viewBox: `0 0 ${NAMES} ${height}`, width: NAMES, height, "aria-hidden": "true" });
  const across = (column) => LEFT + column * COLUMN + 20;
  const down = (row) => TOP + row * ROW + ROW / 2;
  layout.rows.forEach((row, index) => {
    if (index % 2) svg.append(drawn("rect", { class: "stripe", x: 0, y: TOP + index * ROW, width, height: ROW }));
    if (index % 2) names.append(drawn("rect", { class: "stripe", x: 0, y: TOP + index * ROW, width: NAMES, height: ROW }));
    names.append(drawn("text", { class: row.tie ? "tie" : "name", x: 4, y: down(index) + 4 }, drawn("title", {}, row.name), short(row.name)));
  });
  const arcs = svg.appendChild(drawn("g", { class: "arcs" }));
  const bars = layout.instants.map((instant, number) => bar(svg, instant, number, across, down));
  for (const row of layout.rows.keys()) labels(svg, layout.rows[row], row, across, down);
  const spots = layout.places.map((spot) => circle(svg, arcs, spot, across, down));
  const dots = svg.appendChild(drawn("g", { class: "tokens" }));
  place.replaceChildren(names, svg);
  return { layout, mark: marking(place, svg, layout, spots, bars, dots, across) };
}

const short = (name) => (name.length > 21 ? `${name.slice(0, 20)}…` : name);

function bar(svg, instant, number, across, down) {
  const [first, last] = instant.rows;
  const x = across(instant.column);
  const group = drawn("g", { class: "instant" }, drawn("title", {}, `${instant.name}, planned at ${seconds(instant.planned)}`),
    drawn("rect", { x: x - 3, y: down(first) - 13, width: 6, height: (last - first) * ROW + 26, rx: 2 }),
    drawn("text", { class: "time", x, y: 14 + (instant.column % 2) * 13 }, instant.planned.toFixed(2)));
  svg.append(group);
  return { group, x, y: down(first) + ((last - first) * ROW) / 2 };
}

const SHORT = { start: "s", ready: "r", stroke_start: "[", strokeStart: "[", stroke: "*", stroke_end: "]", strokeEnd: "]", relax: "x", end: "e", attackPeak: "p" };

function labels(svg, row, index, across, down) {
  for (const [column, syncs] of row.points) {
    const text = syncs.split(" = ").map((sync) => SHORT[sync.split(":")[0]] ?? "m").join("");
    svg.append(drawn("text", { class: "sync", x: across(column), y: down(index) - 6 }, drawn("title", {}, syncs), text));
  }
}

function circle(svg, arcs, spot, across, down) {
  const atRest = spot.source < 0;
  const x = atRest ? LEFT - 12 : (across(spot.source) + across(spot.target)) / 2;
  const y = down(spot.row) + 3;
  if (!atRest) arcs.append(drawn("line", { class: spot.kind, x1: across(spot.source), x2: across(spot.target), y1: y, y2: y }));
  const made = drawn("circle", { class: `place ${spot.kind}`, cx: x, cy: y, r: 7 }, drawn("title", {}, spot.words));
  svg.append(made);
  return { made, x, y, spot };
}

function marking(place, svg, layout, spots, bars, dots, across) {
  let before = new Set();
  let fired = new Set();
  let first = true;
  const token = (x, y) => drawn("circle", { class: "token", cx: x, cy: y, r: 5 });
  return (tokens) => {
    const now = new Set(tokens.marked);
    const newly = Object.keys(tokens.fired).map(Number).filter((number) => !fired.has(number));
    const came = [...now].filter((number) => !before.has(number));
    const went = [...before].filter((number) => !now.has(number));
    for (const number of newly) bars[number]?.group.classList.add("fired");
    dots.replaceChildren(...[...now].filter((number) => spots[number]).map((number) => token(spots[number].x, spots[number].y)));
    if (!first && newly.length && !matchMedia("(prefers-reduced-motion: reduce)").matches) {
      for (const number of newly) travel(dots, bars[number], spots, came, went, layout.instants[number].column, token);
    }
    if (newly.length) follow(place, across, layout, newly);
    svg.classList.toggle("over", tokens.over);
    svg.setAttribute("aria-label", told(layout, spots, now, fired.size + newly.length, tokens.over));
    before = now;
    fired = new Set([...fired, ...newly]);
    first = false;
  };
}

// Tokens on their way: from the places before the transition into it, and out of it to the places behind.
function travel(dots, bar, spots, came, went, column, token) {
  const move = (from, to, delay) => {
    const dot = token(from.x, from.y);
    dot.classList.add("moving");
    dots.append(dot);
    const way = [{ transform: "translate(0, 0)" }, { transform: `translate(${to.x - from.x}px, ${to.y - from.y}px)` }];
    dot.animate(way, { duration: WAY / 2, delay, easing: "ease-in-out", fill: "both" }).onfinish = () => dot.remove();
  };
  for (const number of went) if (spots[number]?.spot.target === column) move(spots[number], bar, 0);
  for (const number of came) if (spots[number]?.spot.source === column) move(bar, spots[number], WAY / 2);
}

// Keep what fires in sight.
function follow(place, across, layout, newly) {
  const x = Math.max(...newly.map((number) => across(layout.instants[number].column)));
  if (x < place.scrollLeft + 20 || x > place.scrollLeft + place.clientWidth - NAMES - 100) {
    place.scrollTo({ left: Math.max(0, x - place.clientWidth * 0.4), behavior: "smooth" });
  }
}

function told(layout, spots, marked, fired, over) {
  const words = [...marked].filter((number) => spots[number]?.spot.kind === "phase").slice(0, 4).map((number) => spots[number].spot.words);
  return `Petri net of ${layout.block}${over ? ", which is over" : ""}: ${fired} of ${layout.instants.length} instants have fired, ${marked.size} tokens. ${words.join("; ")}`;
}
