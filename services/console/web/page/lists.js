// Panels of text: words, the owner of the head, references, services, notes, and what is wrong.
import { clock, element, prose, seconds } from "./look.js";

// Why some words of a turn were not said, for who reads them apart from the others.
const LEFT = {
  held: "held, still to come:", stopped: "stopped, not said:", failed: "failed, not said:", lost: "broken off, not said:", left: "not said:",
};

// A turn: the words that were said, and between them those that were not, each apart.
function turnWords(said) {
  const parts = [];
  let from = 0;
  for (const { before, words: left } of said.left) {
    parts.push(said.words.slice(from, before));
    parts.push(element("span", { class: `left ${said.state}` }, element("span", { class: "mark" }, ` ${LEFT[said.state] ?? LEFT.left} `), element(said.state === "held" ? "span" : "s", {}, left)));
    from = before;
  }
  return [...parts, said.words.slice(from)].filter(Boolean);
}

export function words(panel) {
  const list = panel.querySelector(".words");
  let follows = true; // until somebody scrolls up
  list.addEventListener("scroll", () => (follows = list.scrollHeight - list.scrollTop - list.clientHeight < 40));
  new ResizeObserver(() => follows && (list.scrollTop = list.scrollHeight)).observe(list);
  const announce = announcing(panel.querySelector("[role=log]"));

  return {
    take(state, changed) {
      if (!changed.has("words")) return;
      const shown = state.words.filter((said) => said.words || (said.open && said.actor !== state.robot) || said.left.length); // of a robot that has begun, the first word comes
      while (list.children.length > shown.length) list.lastChild.remove();
      shown.forEach((said, index) => {
        const item = list.children[index] ?? list.appendChild(element("li"));
        const key = JSON.stringify(said);
        if (item.dataset.key === key) return;
        item.dataset.key = key;
        item.className = `${said.actor === state.robot ? "robot" : "person"}${said.open ? " open" : ""}`;
        const text = turnWords(said);
        item.replaceChildren(
          element("span", { class: "who" }, `${said.actor} ${clock(said.since)}`),
          element("span", { class: "text" }, ...(text.length ? text : [said.open ? "speaks" : "(spoke)"])),
        );
      });
      if (follows) list.scrollTop = list.scrollHeight;
      announce(state.words, state.place?.visit);
    },
  };
}

const HEARD = 10000; // ms after which words that a screen reader has read are no part of the page: they stand in the list

// A screen reader hears words once: of a turn that grows the speeches that have ended since, and at its end what was not said.
function announcing(log) {
  const told = new Map(); // characters that were read of each turn, and what was said to be left
  let last; // visit of a recording
  let isFirst = true; // who opens the page, or jumps in a recording, hears no past
  return (turns, visit) => {
    if (visit !== last) isFirst = true;
    last = visit;
    const keys = new Set();
    for (const said of turns) {
      const key = `${said.actor}|${said.since}`;
      keys.add(key);
      const known = told.get(key);
      const isOver = !said.open && said.left.length && said.state !== "held";
      const left = isOver ? said.left.map((each) => each.words).join(" … ") : "";
      const news = said.words.slice(known?.read ?? 0, Math.max(said.settled, known?.read ?? 0)).trim();
      told.set(key, { read: Math.max(said.settled, known?.read ?? 0), left: left || known?.left || "" });
      if (isFirst) continue;
      const text = [news && `${known?.read ? "" : `${said.actor}: `}${news}`, left && left !== known?.left ? `${LEFT[said.state] ?? LEFT.left} ${left}` : ""].filter(Boolean).join(". ");
      if (!text) continue;
      const line = log.appendChild(element("p", {}, text));
      setTimeout(() => line.remove(), HEARD);
    }
    for (const key of [...told.keys()]) if (!keys.has(key)) told.delete(key);
    isFirst = false;
  };
}

// The claim as the arbiter has it, for researchers.
const claim = (each) => `claim ${each.kind}${each.priority ? `, priority ${each.priority} (1 is the strongest)` : ""}${each.target ? `, target ${each.target}` : ""}${each.reason ? `: ${each.reason}` : ""}`;

export function head(panel) {
  const place = panel.querySelector(".head");
  const told = element("p", { class: "owner" });
  const since = element("span", { class: "since" });
  const waiting = element("ol", { class: "waiting" });
  const terms = element("ol");
  place.replaceChildren(told, waiting, element("details", { class: "terms" },
    element("summary", {}, "For researchers: who owns the head"), terms));
  let from = 0;
  return {
    take(state, changed) {
      if (!changed.has("head")) return;
      const { owner } = state.head;
      from = state.head.since;
      const does = owner ? `${owner.does.replace(/^(look|keep)/, (verb) => `${verb}s`)}` : "";
      told.title = owner ? claim(owner) : "";
      told.replaceChildren(
        element("strong", {}, owner ? `It ${does}` : "Nobody says where it looks"), " ", since,
        element("span", { class: "why" }, owner ? `because ${owner.why}` : ""),
      );
      waiting.replaceChildren(...state.head.waiting.map((each, index) => element("li", { title: claim(each) },
        index ? "after that " : "otherwise it would ", element("strong", {}, each.does),
        element("span", { class: "why" }, `because ${each.why}`))));
      if (!state.head.waiting.length) waiting.replaceChildren(element("li", { class: "none" }, "nothing else calls for a look"));
      terms.replaceChildren(...[owner, ...state.head.waiting].filter(Boolean).map((each, index) =>
        element("li", {}, `${index ? "waits" : "owns it"}: ${claim(each)}`)));
    },
    tick(state) {
      const text = state.head?.owner ? `for ${Math.max(0, state.now() - from).toFixed(1)} s` : "";
      if (since.textContent !== text) since.textContent = text;
    },
  };
}

const GESTURES = {
  none: "words alone", gaze: "a glance", directed_gaze: "looking until they look", directed_gaze_with_pointing: "looking and pointing",
};

function table(choice) {
  const rows = choice.pairs.map((pair) => element("tr", { class: pair.chosen ? "chosen" : pair.feasible ? "" : "not" },
    element("td", {}, pair.chosen ? "▶" : ""), element("td", {}, GESTURES[pair.gesture] ?? pair.gesture),
    element("td", {}, pair.phrase || "(none)"),
    element("td", { title: pair.distractors.join(", ") }, String(pair.distractors.length)),
    element("td", {}, pair.channel.toFixed(2)), element("td", {}, pair.reliability.toFixed(3)),
    element("td", {}, pair.minimum.toFixed(2)), element("td", {}, seconds(pair.cost)),
    element("td", {}, pair.chosen ? `chosen: ${pair.reason ?? ""}` : pair.reason ?? "")));
  const names = [["", ""], ["gesture", ""], ["phrase", ""], ["|D|", "distractors: the other things that it could still mean"], ["r", "reliability of the gesture alone"],
    ["R", "reliability: how likely it is understood"], ["Rmin", "the least reliability that is allowed"], ["cost", "time that it takes"], ["verdict", ""]];
  return element("div", { class: "scroll", tabindex: "0" }, element("table", {},
    element("thead", {}, element("tr", {}, ...names.map(([name, title]) => element("th", { scope: "col", title: title || null }, name)))),
    element("tbody", {}, ...rows)));
}

export function references(panel) {
  const place = panel.querySelector(".references");
  const shown = new Map();
  return {
    take(state, changed) {
      if (!changed.has("references")) return;
      const keys = new Set();
      for (const choice of state.references) {
        const key = choice.number; // a fragment may come again under its name
        keys.add(key);
        if (shown.has(key)) continue;
        const details = element("details", {}, element("summary", {},
          element("strong", {}, choice.target), ` “${choice.phrase}” by ${GESTURES[choice.gesture] ?? choice.gesture}`,
          element("span", { class: "why" }, `understood with a likelihood of ${choice.reliability.toFixed(2)}, takes ${seconds(choice.cost)}; ${choice.fragment}:${choice.reference}`)));
        details.addEventListener("toggle", () => {
          if (details.open && details.children.length === 1) details.append(table(choice));
        });
        shown.set(key, details);
        place.prepend(details);
      }
      for (const [key, details] of shown) {
        if (!keys.has(key)) {
          details.remove();
          shown.delete(key);
        }
      }
      if (!shown.size) place.replaceChildren(element("p", { class: "none" }, "The table behind each reference, once one was made."));
      else place.querySelector(":scope > .none")?.remove();
    },
  };
}

export function health(panel) {
  const list = panel.querySelector(".health");
  return {
    take(state, changed) {
      if (!changed.has("health")) return;
      list.replaceChildren(...state.health.map((each) => {
        const fine = each.here && each.serves && !each.warnings.length;
        return element("li", { class: fine ? "fine" : each.here ? "doubtful" : "gone" },
          element("span", { class: "sign", "aria-hidden": "true" }, fine ? "✓" : each.here ? "!" : "✗"),
          element("strong", {}, each.name), " ",
          element("span", { class: "why" }, each.warnings.join("; ") || each.facts.join(", ") || "here"));
      }));
    },
  };
}

export function notes(panel) {
  const list = panel.querySelector(".notes");
  let items = new Map();
  return {
    take(state, changed) {
      if (!changed.has("notes")) return;
      const signs = { fault: "✗", warning: "!", news: "·" };
      const before = items;
      items = new Map();
      for (const note of state.notes) {
        let key = `${note.at}|${note.level}|${note.text}`;
        while (items.has(key)) key += "|";
        const known = before.get(key);
        items.set(key, known ?? element("li", { class: note.level },
          element("span", { class: "sign", "aria-hidden": "true" }, signs[note.level]),
          element("span", { class: "since" }, clock(note.at)), " ", note.text));
        if (!known) list.prepend(items.get(key)); // a screen reader says what is new, and only that
      }
      for (const [key, item] of before) if (!items.has(key)) item.remove();
    },
  };
}

export function switched(place) {
  return {
    take(state, changed) {
      if (!changed.has("switched")) return;
      const { held, faults, by, condition } = state.switched;
      const told = [
        condition ? `${condition[0].toUpperCase()}${condition.slice(1)}.` : "",
        held.length ? `Held: ${held.join(", ")}.` : "",
        faults.length ? `Faults of the body that are on: ${faults.join(", ")}${by ? ` (switched by ${by})` : ""}.` : "",
      ].filter(Boolean).join(" ");
      place.hidden = !told;
      place.textContent = told;
    },
  };
}

// What each service is for, and the panels that it alone tells of: without it they stand still.
const WITHOUT = {
  generation: ["nobody rules the head, and what it is to say waits", ["head"]],
  realizer: ["it performs nothing", ["behaviors", "net"]],
  recognition: ["it notices no connection events", ["floor", "events", "measures"]],
  control: ["its body is shown as it was last", ["scene", "above"]],
};

// Say in the heading of a panel that nobody tells it anything any more. service: who did; empty: it is there.
function stale(panel, service) {
  if (panel.classList.toggle("stale", Boolean(service))) {
    const said = panel.querySelector("h2 .stays") ?? panel.querySelector("h2").appendChild(element("span", { class: "stays" }));
    said.textContent = ` as it was last: ${service} is not on the bus`;
  } else {
    panel.querySelector("h2 .stays")?.remove();
  }
}

// What is wrong with the window itself: no link to it, or none of it to the robot.
export function away(place) {
  let linked = true;
  let refusal = ""; // why the window has closed the link itself
  let missing = null;
  function show() {
    let text = "";
    if (!linked && refusal) {
      text = `The window answers, but not here: ${refusal}. It is called again every second.`;
    } else if (!linked) {
      text = "The window does not answer: `engage console` has ended, or this page cannot reach it. The picture below is the last one. It is called again every second.";
    } else if (missing?.length) {
      text = missing.length === 4
        ? "No robot is on the bus. The picture below is the last one. `engage up` starts a robot; a robot elsewhere takes `engage console --connect`; `engage doctor` tells why none is seen."
        : `Not on the bus: ${missing.map((each) => `${each} (${WITHOUT[each][0]})`).join(", ")}.`;
    }
    for (const [service, [, panels]] of Object.entries(WITHOUT)) {
      for (const id of panels) stale(document.getElementById(id), missing?.includes(service) ? service : "");
    }
    if (place.dataset.text !== text) place.replaceChildren(...prose(text));
    place.dataset.text = text;
    place.hidden = !text;
  }
  return {
    link(there, reason = "") {
      linked = there;
      refusal = reason;
      show();
    },
    take(state, changed) {
      if (!changed.has("health")) return;
      missing = state.health.filter((each) => each.service && !each.here).map((each) => each.name);
      show();
    },
  };
}
