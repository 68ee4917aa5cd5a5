// The table from above, as the person sees it who sits opposite the robot: the robot is at the top.
import { drawn, pieceColor } from "./look.js";
import { described, sceneInWords } from "./tell.js";

// How a place is seen, as the scene says (services/console/web/scene.py): x and y of the robot, in metres, and of the screen, in millimetres.
let axes = { right: [0, 0], down: [0, 0] };
const along = ([a, b], x, y) => (a * x + b * y) * 1000;
const place = ([x, y]) => [along(axes.right, x, y), along(axes.down, x, y)];
const back = (right, down) => [0, 1].map((at) => (axes.right[at] * right + axes.down[at] * down) / 1000); // they are at right angles
const turned = (direction) => { // degrees, clockwise from the right
  const [right, down] = place(direction);
  return (Math.atan2(down, right) * 180) / Math.PI;
};
const points = (outline) => outline.map((corner) => place(corner).map((v) => v.toFixed(1)).join(",")).join(" ");

export function map(panel, order) {
  const svg = panel.querySelector("svg");
  const layers = {};
  for (const name of ["surfaces", "cones", "objects", "labels", "lines", "hands", "bodies"]) {
    layers[name] = svg.appendChild(drawn("g", { class: name }));
  }
  const held = hands(svg, order);
  const describe = described(svg, (state) => `The table from above. ${sceneInWords(state)}`);
  return {
    take(state, changed) {
      held.robot = state.robot;
      if (!changed.has("scene") || panel.offsetParent === null) return;
      describe(state);
      const { body, things, people, robot } = state.scene;
      ({ right: axes.right, down: axes.down } = state.scene.above);
      frame(svg, state.scene.above.frame);
      const places = new Map(things.map((thing) => [thing.id, thing.at]));
      for (const person of people) if (person.at) places.set(person.id, person.at);
      if (body?.eyes) places.set(robot, body.eyes);
      surfaces(layers.surfaces, things);
      objects(layers, things, body);
      layers.lines.replaceChildren();
      layers.cones.replaceChildren();
      layers.hands.replaceChildren(...things.filter((thing) => thing.kind === "hand").map(hand));
      const there = people.filter((each) => each.at && each.present);
      for (const person of there) drawPerson(layers, person, places, robot);
      if (body) drawRobot(layers, body, places, robot);
      const ids = [...there.map((each) => each.id), ...(body?.eyes && body.gaze ? [robot] : [])];
      for (const each of [...layers.bodies.children]) if (!ids.includes(each.dataset.key)) each.remove();
    },
  };
}

// Show everybody and everything. It changes in steps, so that it stands still while somebody moves a little.
function frame(svg, edges) {
  const [left, top, right, bottom] = edges.map((each) => each * 1000);
  const box = `${left} ${top} ${right - left} ${bottom - top}`;
  if (svg.getAttribute("viewBox") !== box) svg.setAttribute("viewBox", box);
}

const seated = () => document.body.classList.contains("seated");
const STEP = 0.02; // metres that an arrow key moves a piece
const SLIP = 0.012; // metres below which a press is a click

// What a person does with the map: a click looks or points, a drag moves a piece; so do keys.
function hands(svg, order) {
  const held = { robot: "" };
  let drag = null;
  const at = (event) => {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    return back(point.x, point.y);
  };
  const mean = (id, points) => order({ do: points ? "point" : "look", target: id });
  svg.addEventListener("pointerdown", (event) => {
    const shape = event.target.closest("[data-id]");
    if (!seated() || !shape) return;
    const from = at(event);
    drag = { id: shape.dataset.id, shape, from, to: from, moves: shape.classList.contains("object") };
    svg.setPointerCapture(event.pointerId);
    event.preventDefault();
  });
  svg.addEventListener("pointermove", (event) => {
    if (!drag?.moves) return;
    drag.to = at(event);
    const way = place([drag.to[0] - drag.from[0], drag.to[1] - drag.from[1]]);
    drag.shape.setAttribute("transform", `translate(${way.join(" ")})`);
  });
  const end = (event) => {
    if (!drag) return;
    const { id, shape, from, to, moves } = drag;
    drag = null;
    shape.removeAttribute("transform");
    if (event.type === "pointercancel") return;
    if (moves && Math.hypot(to[0] - from[0], to[1] - from[1]) > SLIP) {
      const [x, y] = shape.dataset.at.split(",").map(Number);
      order({ do: "move", thing: id, x: x + to[0] - from[0], y: y + to[1] - from[1] });
    } else {
      mean(id, event.shiftKey || document.body.classList.contains("pointing"));
    }
  };
  svg.addEventListener("pointerup", end);
  svg.addEventListener("pointercancel", end);
  svg.addEventListener("keydown", (event) => {
    const shape = event.target.closest("[data-id]");
    if (!seated() || !shape) return;
    const pressed = { ArrowUp: [0, -STEP], ArrowDown: [0, STEP], ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0] }[event.key];
    const way = pressed && back(...pressed.map((each) => each * 1000));
    if (way && shape.classList.contains("object")) {
      const [x, y] = shape.dataset.at.split(",").map(Number);
      order({ do: "move", thing: shape.dataset.id, x: x + way[0], y: y + way[1] });
    } else if (event.repeat) {
      return; // a key that is held means one thing once
    } else if (event.key === "Enter" || event.key === " ") {
      mean(shape.dataset.id, false);
    } else if (event.key.toLowerCase() === "p") {
      mean(shape.dataset.id, true);
    } else return;
    event.preventDefault();
  });
  return held;
}

function keyed(layer, key, make) {
  const found = [...layer.children].find((each) => each.dataset.key === key);
  if (found) return found;
  const made = make();
  made.dataset.key = key;
  return layer.appendChild(made);
}

function surfaces(layer, things) {
  for (const thing of things.filter((each) => each.kind === "surface")) {
    keyed(layer, thing.id, () => drawn("polygon", { class: "surface" })).setAttribute("points", points(thing.outline));
  }
}

function objects(layers, things, body) {
  const ids = new Set();
  for (const thing of things.filter((each) => each.kind === "object")) {
    ids.add(thing.id);
    const shape = keyed(layers.objects, thing.id, () => drawn(thing.outline.length ? "polygon" : "circle", {
      class: "object", "data-id": thing.id, fill: pieceColor(thing.color), tabindex: "0", role: "button", "aria-label": thing.label,
    }, drawn("title", {}, thing.label)));
    shape.dataset.at = thing.at.slice(0, 2).join(",");
    if (thing.outline.length) {
      shape.setAttribute("points", points(thing.outline));
    } else {
      const [x, y] = place(thing.at);
      for (const [name, value] of Object.entries({ cx: x, cy: y, r: Math.max(thing.radius, 0.02) * 1000 })) shape.setAttribute(name, value);
    }
    shape.classList.toggle("looked", body?.looks_at === thing.id);
    shape.classList.toggle("pointed", Boolean(body?.points.includes(thing.id)));
    const label = keyed(layers.labels, thing.id, () => drawn("text", { class: "name" }, thing.label));
    const [x, y] = place(thing.at);
    label.classList.toggle("meant", shape.classList.contains("looked") || shape.classList.contains("pointed"));
    label.setAttribute("x", x);
    label.setAttribute("y", y + Math.max(thing.radius, 0.02) * 1000 * 0.72 + 44);
  }
  for (const layer of [layers.objects, layers.labels]) {
    for (const each of [...layer.children]) if (!ids.has(each.dataset.key)) each.remove();
  }
}

const hand = (thing) => drawn("circle", { class: "hand", cx: place(thing.at)[0], cy: place(thing.at)[1], r: 32 });

function line(from, to, kind) {
  const [x1, y1] = place(from);
  const [x2, y2] = place(to);
  return drawn("line", { class: kind, x1, y1, x2, y2 });
}

// A head from above, with the direction in which it faces. It stays the same element, so that it keeps the focus.
function face(layer, at, direction, kind, id, name, speaks) {
  const [x, y] = place(at);
  const shape = keyed(layer, id, () => drawn("g", { "data-id": id, tabindex: "0", role: "button" },
    drawn("ellipse", { class: "shoulders", rx: 190, ry: 75 }),
    drawn("g", { class: "turned" }, drawn("ellipse", { class: "skull", rx: 100, ry: 78 }),
      drawn("circle", { class: "nose", cx: 98, cy: 0, r: 17 })),
    drawn("text", { class: "name", y: kind === "robot" ? -105 : 150 })));
  const text = speaks ? `${name} speaks` : name;
  shape.setAttribute("class", `${kind}${speaks ? " speaks" : ""}`);
  shape.setAttribute("transform", `translate(${x} ${y})`);
  shape.querySelector(".turned").setAttribute("transform", `rotate(${turned(direction)})`);
  const label = shape.querySelector(".name");
  if (label.textContent !== text) {
    label.textContent = text;
    shape.setAttribute("aria-label", text);
  }
}

function towards(from, to) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(dx, dy) || 1;
  return [dx / length, dy / length];
}

function drawPerson(layers, person, places, robot) {
  const target = person.looks?.length ? places.get(person.looks[0]) : null;
  const direction = target ? towards(person.at, target) : person.looks ? [-0.3, 0.95] : [-1, 0];
  for (const id of target ? person.looks.slice(0, person.one_of ? undefined : 1) : []) {
    const kind = person.one_of ? "look maybe" : id === robot ? "look eye" : "look";
    if (places.has(id)) layers.lines.append(line(person.at, places.get(id), kind));
  }
  for (const id of person.points) if (places.has(id)) layers.lines.append(line(person.at, places.get(id), "ray"));
  const nods = person.nods ? ` (${person.nods}s)` : "";
  face(layers.bodies, person.at, direction, "person", person.id, `${person.id}${nods}`, person.speaks);
}

function drawRobot(layers, body, places, robot) {
  if (body.eyes && body.gaze) {
    const target = places.get(body.looks_at);
    const reach = target ? Math.hypot(target[0] - body.eyes[0], target[1] - body.eyes[1]) : 1.2;
    const middle = Math.atan2(body.gaze[1], body.gaze[0]);
    const end = (angle) => [body.eyes[0] + reach * Math.cos(angle), body.eyes[1] + reach * Math.sin(angle)];
    layers.cones.append(drawn("polygon", {
      class: "cone", points: points([body.eyes, end(middle - body.spread), end(middle), end(middle + body.spread)]),
    }));
    face(layers.bodies, body.eyes, body.gaze, "robot", robot, robot, Boolean(body.speaking));
  }
  for (const arm of body.arms) {
    layers.lines.append(line(arm.elbow, arm.hand, "arm"));
    const aimed = body.points.map((id) => places.get(id)).filter(Boolean);
    const [ax, ay] = towards(arm.elbow, arm.hand);
    for (const target of aimed) {
      const [tx, ty] = towards(arm.hand, target);
      if (ax * tx + ay * ty > 0.9) layers.lines.append(line(arm.hand, target, "ray"));
    }
  }
}
