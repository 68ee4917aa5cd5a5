// The robot by hand: words, references, questions, signs of listening, its gaze, what is held, conditions of a study, faults of the body.
import { gate } from "./gate.js";
import { element, news, prose } from "./look.js";

export function wizard(panel, order) {
  const place = panel.querySelector(".wizard");
  const told = news(panel);
  const close = gate(panel, (text) => told([{ panel: panel.id, text }]));
  const by = input("by", "Your name, for the log", { maxlength: "40" });
  const send = (what) => order({ ...what, by: by.field.value.trim() });
  const button = (text, act, attributes = {}) => {
    const made = element("button", { type: "button", ...attributes }, text);
    made.addEventListener("click", act);
    return made;
  };

  const text = input("tell", "Say", { maxlength: "1000" });
  const target = choice("target", "about");
  const whom = element("span", { class: "field", role: "group", "aria-label": "To" });
  const addressee = () => [...whom.querySelectorAll("input:checked")].map((each) => each.value);
  const who = choice("who", "may interrupt", [["", "who is addressed"], ["*", "anybody"], ["false", "nobody"]]);
  const after = choice("after", "", [[0, "at once"], [1, "after 1 s"], [2, "after 2 s"], [4, "after 4 s"]]);
  after.field.setAttribute("aria-label", "When they interrupt");
  who.parts[0].append(after.field);
  const tell = (asks) => {
    const interruptible = who.field.value === "false" ? false : who.field.value;
    send({ do: "tell", text: text.field.value.trim(), target: target.field.value, addressee: addressee(), asks,
      interruptible, interruptible_after: Number(after.field.value) });
    text.field.value = "";
  };
  const form = element("form", { class: "row" }, ...text.parts, ...target.parts, whom, ...who.parts,
    element("button", { type: "submit", class: "main" }, "Say it"), button("Ask it", () => tell(true)));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    tell(false);
  });
  const gaze = choice("keep", "Keep the gaze");
  const inhibit = button("Keep", () => {
    const on = inhibit.getAttribute("aria-pressed") !== "true";
    const at = gaze.field.value;
    send({ do: "inhibit", on, mode: at ? "target" : "hold", target: at });
  }, { "aria-pressed": "false" });
  const signs = element("div", { class: "row" }, button("Nod", () => send({ do: "backchannel", how: "nod", addressee: addressee() })),
    button("Uh-huh", () => send({ do: "backchannel", how: "uh-huh", addressee: addressee() })), ...gaze.parts, inhibit);
  const steer = element("div", { class: "row", role: "group", "aria-label": "What the robot performs" },
    button("Stop", () => send({ do: "steer", to: "stop" }), { class: "stop" }),
    button("Hold", () => send({ do: "steer", to: "hold" })), button("Go on", () => send({ do: "steer", to: "continue" })));
  const script = element("ol", { class: "script" });
  const faults = element("div", { class: "row faults", role: "group", "aria-label": "Faults of the body" });
  const condition = input("condition", "Condition of a study", { maxlength: "40" });
  const alone = element("input", { type: "checkbox", id: "wizard-alone" });
  const study = element("form", { class: "row study" }, ...condition.parts, labelled("speech only", alone, "field"),
    element("button", { type: "submit" }, "Begin it"));
  study.addEventListener("submit", (event) => {
    event.preventDefault();
    send({ do: "condition", name: condition.field.value.trim(), speech_only: alone.checked });
  });
  const named = element("div", { class: "row" }, ...by.parts);
  const speaks = element("div", {}, form, signs, script);
  const refused = element("p", { class: "why" });
  const closed = element("p", { class: "why", role: "status" }); // what cannot be ordered now, and why
  place.replaceChildren(refused, closed, named, speaks, steer, study, faults);
  const served = [[speaks, "generation", "the robot cannot be told what to say"], [steer, "realizer", "Stop, Hold and Go on have nothing to act on"],
    [study, "generation", "no condition can begin"], [faults, "control", "no fault can be switched"]];
  const shut = (state) => {
    const missing = new Set(state.health?.filter((each) => each.service && !each.here).map((each) => each.name));
    const told = [];
    for (const [group, service, what] of served) {
      const why = state.away || (missing.has(service) ? `${service} is not on the bus` : "");
      for (const each of group.querySelectorAll("button")) close(each, each === inhibit && inhibit.getAttribute("aria-pressed") === "true" ? state.away : why);
      if (why && !state.away && !group.hidden) told.push(`${what}: ${why}.`);
    }
    const text = state.away ? `Nothing can be ordered from here, no Stop either: ${state.away}. \`engage steer stop\` in a terminal stops the robot.` : told.map((each) => each[0].toUpperCase() + each.slice(1)).join(" ");
    if (closed.dataset.text !== text) closed.replaceChildren(...prose(text));
    closed.dataset.text = text;
  };
  document.addEventListener("keydown", (event) => {
    const busy = event.target.closest?.("input, select, textarea") || event.repeat || event.ctrlKey || event.metaKey || event.altKey;
    const number = Number(event.key) - 1;
    if (!busy && !speaks.hidden && number >= 0 && number < script.children.length) script.children[number].querySelector("button").click();
  });

  let on = []; // kinds of faults that the body has
  const ordered = new Map(); // kinds that were ordered here and are not so yet, and whether they are to be on: the next click goes on from these
  return {
    take(state, changed) {
      if (changed.has("you")) {
        const { denied = {}, script: titles = [], faults: kinds = [], inhibits } = state.you;
        refused.replaceChildren(...prose(denied.steer ? `Only watched here: ${denied.steer}.` : ""));
        speaks.hidden = Boolean(denied.speak);
        steer.hidden = Boolean(denied.steer);
        study.hidden = Boolean(denied.condition);
        named.hidden = speaks.hidden && steer.hidden && study.hidden;
        faults.hidden = Boolean(denied.faults) || !kinds.length;
        inhibit.setAttribute("aria-pressed", String(Boolean(inhibits)));
        inhibit.textContent = inhibits ? "Let go" : "Keep";
        script.replaceChildren(...titles.map((title, number) => element("li", {},
          button(`${number < 9 ? `${number + 1}  ` : ""}${title}`, () => send({ do: "prepared", number, addressee: addressee() })))));
        switches(kinds);
      }
      if (changed.has("switched")) {
        on = state.switched.kinds;
        for (const [kind, isOn] of ordered) if (on.includes(kind) === isOn) ordered.delete(kind);
        for (const each of faults.querySelectorAll("button")) each.setAttribute("aria-pressed", String(on.includes(each.dataset.kind)));
      }
      if (["you", "away", "health"].some((each) => changed.has(each))) shut(state);
      if (changed.has("told")) {
        ordered.clear(); // it may have been refused
        told(state.told);
      }
      if (changed.has("scene")) {
        const { things, people } = state.scene;
        options(target.field, "(nothing)", things.filter((each) => each.kind === "object").map((each) => each.id));
        boxes(whom, people.filter((each) => each.at).map((each) => each.id));
        options(gaze.field, "where it is", [...people.filter((each) => each.at), ...things.filter((each) => each.kind === "object")].map((each) => each.id));
      }
    },
  };

  function switches(kinds) {
    if (faults.dataset.kinds === kinds.join()) return;
    faults.dataset.kinds = kinds.join();
    faults.replaceChildren(element("span", { class: "label" }, "Faults of the body"), ...kinds.map((kind) => button(kind, () => {
      const off = ordered.get(kind) ?? on.includes(kind);
      ordered.set(kind, !off);
      send({ do: "faults", off, fault: off ? { kind } : { kind, ...PARTS[kind] } });
    }, { "aria-pressed": String(on.includes(kind)), "data-kind": kind })));
  }
}

// What a fault needs to be told besides its kind, where the kind has no usual one.
const PARTS = { stall: { amount: 2 }, displaced: { part: "neck_yaw", amount: 15 } };

function input(id, name, attributes) {
  const field = element("input", { type: "text", id: `wizard-${id}`, autocomplete: "off", ...attributes });
  return { field, parts: [labelled(name, field, "field wide")] };
}

function choice(id, name, values = []) {
  const field = element("select", { id: `wizard-${id}` }, ...values.map(([value, text]) => element("option", { value }, text)));
  return { field, parts: [labelled(name, field, "field")] };
}

// A field and its name, which stay together where a line is broken.
function labelled(name, field, kind) {
  return element("span", { class: kind }, element("label", { for: field.id }, name), field);
}

// A box for each person: who is ticked is spoken to. With none ticked it is whoever is there.
function boxes(group, ids) {
  const key = ids.join();
  if (group.dataset.ids === key) return;
  group.dataset.ids = key;
  const chosen = [...group.querySelectorAll("input:checked")].map((each) => each.value);
  const person = (id) => {
    const box = element("input", { type: "checkbox", id: `wizard-to-${id}`, value: id, checked: chosen.includes(id) });
    return element("span", { class: "field" }, box, element("label", { for: box.id }, id));
  };
  group.hidden = ids.length < 2;
  group.replaceChildren(element("span", { class: "label" }, "to"), ...ids.map(person));
}

function options(field, none, ids) {
  const key = ids.join();
  if (field.dataset.ids === key) return;
  field.dataset.ids = key;
  const chosen = field.value;
  field.replaceChildren(element("option", { value: "" }, none), ...ids.map((id) => element("option", { value: id }, id)));
  field.value = ids.includes(chosen) ? chosen : "";
}
