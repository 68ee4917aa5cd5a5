// What stands at the heads: bubbles with words as they are said, names, and how much each person takes part.
import { element } from "../page/look.js";
import { part } from "./visit.js";

const STAYS = 5; // seconds that a bubble stays after its words
const EACH = 0.28; // and for each word
const GAP = 8; // pixels between two bubbles, and to the edge
const NEWEST = 26; // words that a bubble shows at most: of a long turn the newest

// spoken: the language of what is said, as a tag.
export function heads(overlay, spoken) {
  const bubbles = new Map(); // by actor: the newest turn only
  const names = new Map();

  function bubble(actor) {
    const text = element("p", {});
    const made = element("div", { class: "bubble" }, text);
    overlay.append(made);
    bubbles.set(actor, { made, text, words: [], since: null, over: null });
    return bubbles.get(actor);
  }

  function say(known, turn, at) {
    if (known.since !== turn.since) {
      known.text.replaceChildren();
      known.words = [];
      known.since = turn.since;
      known.over = null;
    }
    const words = turn.words.split(/\s+/).filter(Boolean);
    const same = words.findIndex((word, index) => known.words[index] !== word);
    const from = same < 0 ? words.length : same;
    for (const node of [...known.text.children].slice(from)) node.remove();
    for (const word of words.slice(from)) known.text.append(element("span", { lang: spoken }, `${word} `));
    known.words = words;
    [...known.text.children].forEach((node, index) => (node.hidden = words.length - index > NEWEST));
    known.text.classList.toggle("long", words.length > NEWEST);
    known.over = turn.open ? null : known.over ?? at;
  }

  return {
    // talk, scene: sections. you: id of who looks at this page. now: seconds of the picture; at: of the page's own clock.
    // where: place on the page of a place of the world.
    draw({ talk, scene, you, text, now, at, where, box }) {
      const latest = new Map();
      for (const turn of talk.bubbles) latest.set(turn.actor, turn);
      for (const [actor, turn] of latest) {
        const known = bubbles.get(actor) ?? bubble(actor);
        const isOld = known.since === null && !turn.open && now - turn.since > STAYS; // from before this page looked
        say(known, turn, at);
        if (isOld) known.over = -Infinity;
      }
      const anchors = new Map();
      if (scene.body?.eyes) anchors.set(scene.robot, scene.body.eyes);
      for (const each of scene.people) if (each.at && each.present) anchors.set(each.id, each.at);
      const isWide = box.width > 1.2 * innerHeight; // there is more room beside the heads than above them
      const taken = [];
      for (const [actor, known] of [...bubbles].sort(([a], [b]) => (b === scene.robot) - (a === scene.robot))) {
        const anchor = anchors.get(actor);
        const stays = STAYS + EACH * known.words.length;
        const isOn = known.words.length > 0 && (known.over === null || at - known.over < stays) && (anchor || actor === you);
        known.made.classList.toggle("on", Boolean(isOn));
        known.made.classList.toggle("robot", actor === scene.robot);
        known.made.classList.toggle("you", actor === you);
        if (!isOn) {
          if (!latest.has(actor)) {
            known.made.remove();
            bubbles.delete(actor);
          }
          continue;
        }
        const { offsetWidth: width, offsetHeight: height } = known.made;
        const head = actor === you ? { x: box.width - GAP, y: box.bottom - GAP } : where(raised(anchor, 0.16));
        const middle = actor === you ? head : where(anchor);
        const far = Math.max(24, (middle.y - head.y) * 1.1) + GAP; // from the middle of the head to the bubble
        const fits = { right: middle.x + far + width < box.width - GAP, left: middle.x - far - width > GAP };
        const order = actor === scene.robot ? ["right", "left"] : ["left", "right"];
        if (!fits[known.side]) known.side = order.find((each) => fits[each]) ?? ""; // where it is, it stays
        const side = isWide && actor !== you ? known.side : "";
        const wanted = side ? middle.x + (side === "right" ? far : -far - width) : head.x - width / 2;
        let left = Math.min(Math.max(wanted, GAP), box.width - width - GAP);
        let top = Math.min(Math.max(side ? middle.y - height / 2 : head.y - height - 14, box.top), box.bottom - height - GAP);
        known.made.dataset.side = side;
        for (const other of taken) {
          if (overlaps({ left, top, width, height }, other, GAP)) top = Math.min(other.top + other.height + GAP, box.bottom - height - GAP);
        }
        taken.push({ left, top, width, height });
        known.made.style.transform = `translate(${Math.round(left)}px, ${Math.round(top)}px)`;
        known.made.style.setProperty("--tail", side ? `${Math.round(Math.min(Math.max(middle.y - top, 22), height - 22))}px` : `${Math.round(Math.min(Math.max(head.x - left, 22), width - 22))}px`);
      }
      const shown = scene.people.filter((each) => each.at && each.present && each.id !== you);
      for (const [id, { made }] of names) {
        if (shown.some((each) => each.id === id)) continue;
        made.remove();
        names.delete(id);
      }
      overlay.classList.toggle("crowd", shown.length > 1);
      const faces = shown.map(({ at: face }) => {
        const { x, y } = where(face);
        const far = Math.abs(y - where(raised(face, 0.14)).y);
        return { left: x - far, top: y - far, width: 2 * far, height: 2 * far };
      });
      for (const person of shown) {
        if (!names.has(person.id)) {
          const [name, level] = [element("b", {}), element("span", { class: "level" })];
          const made = element("div", { class: "name" }, element("i", { class: "ring" }), name, level);
          overlay.append(made);
          names.set(person.id, { made, name, level });
        }
        const { made, name, level } = names.get(person.id);
        const takes = part(talk, scene, person.id);
        put(made, takes, person.speaks);
        name.textContent = text.called(person.id);
        level.textContent = person.speaks ? text.speaks : text.levels[takes.level];
        const place = where([person.at[0], person.at[1], person.at[2] - 0.26]);
        const { offsetWidth: width, offsetHeight: height } = made;
        const tag = { left: Math.min(Math.max(place.x - width / 2, GAP), box.width - width - GAP), top: place.y, width, height };
        // No name lies on another one, or on somebody's face.
        for (const other of faces.sort((a, b) => a.top - b.top)) if (overlaps(tag, other)) tag.top = other.top + other.height + GAP / 2;
        faces.push(tag);
        made.style.transform = `translate(${Math.round(tag.left)}px, ${Math.round(tag.top)}px)`;
      }
    },
  };
}

function overlaps(one, other, gap = 0) {
  const [right, below] = [(each) => each.left + each.width + gap, (each) => each.top + each.height + gap];
  return one.left < right(other) && other.left < right(one) && one.top < below(other) && other.top < below(one);
}

function raised([x, y, z], by) {
  return [x, y, z + by];
}

// How much somebody takes part, as a ring that fills.
export function put(made, { level, value }, speaks) {
  made.dataset.level = level;
  made.style.setProperty("--part", value ?? 0);
  made.classList.toggle("speaks", Boolean(speaks));
}
