// Fingers, the mouse and the keyboard on the scene: touch to look or point, drag to move, and a button for each thing.
import { element } from "../page/look.js";

const ROOM = 30; // pixels around a thing in which a touch means it
const STILL = 9; // pixels that a finger may shake
const STEP = 0.03; // metres of one arrow
const REST = 350; // ms after the last arrow until the piece is taken
const ARROWS = { ArrowUp: [-STEP, 0], ArrowDown: [STEP, 0], ArrowLeft: [0, -STEP], ArrowRight: [0, STEP] };

// scene: of scene.js. state: has the seat, the scene and the texts. order: sends one. bar: says whether one points.
export function touch({ place, list, scene, state, order, bar }) {
  const thing = (id) => state.scene?.things.find((each) => each.id === id);
  const act = (id, points) => {
    order({ do: points ? "point" : "look", target: id });
    if (points) bar.pointed();
  };

  let held = null; // what a finger holds
  const at = (event) => {
    const box = place.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  place.addEventListener("pointerdown", (event) => {
    if (!state.person || !event.isPrimary) return;
    const [x, y] = at(event);
    held = { x, y, id: scene.touched(x, y, ROOM), to: null };
    place.setPointerCapture(event.pointerId);
  });
  place.addEventListener("pointermove", (event) => {
    if (!held?.id || thing(held.id)?.kind !== "object") return;
    const [x, y] = at(event);
    if (!held.to && Math.hypot(x - held.x, y - held.y) < STILL) return;
    const height = thing(held.id).at[2];
    const to = scene.onTable(x, y, height);
    if (!to) return;
    held.to = [to[0], to[1], height];
    scene.drag(held.id, [to[0], to[1], height + 0.012]);
  });
  place.addEventListener("pointerup", () => {
    const was = held;
    held = null;
    if (!was?.id) return;
    if (was.to) order({ do: "move", thing: was.id, x: was.to[0], y: was.to[1] });
    else act(was.id, bar.points);
  });
  place.addEventListener("pointercancel", () => (held = null));

  const buttons = new Map();
  const moves = new Map(); // pieces that arrows push, before the hand takes them
  function push(id, by) {
    const known = moves.get(id) ?? { to: thing(id).at.slice(), timer: 0 };
    known.to = [known.to[0] + by[0], known.to[1] + by[1], known.to[2]];
    clearTimeout(known.timer);
    known.timer = setTimeout(() => {
      moves.delete(id);
      order({ do: "move", thing: id, x: known.to[0], y: known.to[1] });
    }, REST);
    moves.set(id, known);
    scene.drag(id, [known.to[0], known.to[1], known.to[2] + 0.012]);
  }
  function make(id) {
    const made = element("button", { type: "button", "data-id": id });
    made.addEventListener("click", () => act(id, bar.points));
    made.addEventListener("keydown", (event) => {
      if (event.key === "p" || event.key === "P") act(id, true);
      else if (ARROWS[event.key] && thing(id)) push(id, ARROWS[event.key]);
      else return;
      event.preventDefault();
    });
    list.append(made);
    return made;
  }
  return {
    get isHolding() {
      return held !== null || moves.size > 0;
    },
    // Put a button where each thing and head is.
    draw() {
      const { scene: now, person, text } = state;
      list.hidden = !person;
      if (!person || !now) return;
      const rows = [
        ...(now.body?.eyes ? [[now.robot, text.robot, now.body.eyes]] : []),
        ...now.people.filter((each) => each.at && each.present && each.id !== person).map(({ id, at: place }) => [id, text.called(id), place]),
        ...now.things.filter(({ kind }) => kind === "object").map(({ id, label, at: place }) => [id, text.thing(label), place]),
      ];
      for (const [id, made] of buttons) {
        if (rows.some(([other]) => other === id)) continue;
        made.remove();
        buttons.delete(id);
      }
      for (const [id, label, place] of rows) {
        if (!buttons.has(id)) buttons.set(id, make(id));
        const made = buttons.get(id);
        if (made.textContent !== label) made.textContent = label;
        const { x, y } = scene.onPage(place);
        made.style.transform = `translate(${Math.round(x)}px, ${Math.round(y)}px) translate(-50%, -50%)`;
      }
    },
  };
}
