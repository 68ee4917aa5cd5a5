// The seat: whoever looks at the page becomes a person before the robot.
import { gate } from "./gate.js";
import { element, news, prose } from "./look.js";

export function part(panel, order) {
  const place = panel.querySelector(".part");
  let speaking = false;
  const told = news(panel);
  const close = gate(panel, (text) => told([{ panel: panel.id, text }]));

  const button = (text, attributes, act) => {
    const made = element("button", { type: "button", ...attributes }, text);
    made.addEventListener("click", act);
    return made;
  };
  const name = element("input", { type: "text", id: "your-name", maxlength: "40", autocomplete: "off", placeholder: "visitor" });
  const sit = element("button", { type: "submit", class: "main" }, "Take a seat");
  const there = element("p", { class: "why there" });
  const away = element("form", {}, there,
    element("div", { class: "row" }, element("label", { for: "your-name" }, "Your name"), name, sit));
  away.addEventListener("submit", (event) => {
    event.preventDefault();
    if (isSitting) return;
    isSitting = true; // until it is known what became of it; a disabled button would lose the focus
    sit.setAttribute("aria-disabled", "true");
    sit.textContent = "Sitting down…";
    order({ do: "sit", name: name.value.trim() });
  });
  let seat = "Take a seat";
  let isSitting = false;
  const rise = () => {
    isSitting = false;
    if (!sit.dataset.why) sit.removeAttribute("aria-disabled");
    sit.textContent = seat;
  };

  const hold = button("Hold to speak", { "aria-pressed": "false" }, () => {});
  const speak = (on) => {
    if (speaking === on) return;
    speaking = on;
    hold.setAttribute("aria-pressed", String(on));
    order({ do: "speak", on });
  };
  hold.addEventListener("pointerdown", () => speak(true));
  for (const end of ["pointerup", "pointercancel", "pointerleave", "blur"]) hold.addEventListener(end, () => speak(false));
  hold.addEventListener("keydown", (event) => event.key === " " && !event.repeat && speak(true));
  hold.addEventListener("keyup", (event) => event.key === " " && speak(false));
  const words = element("input", { type: "text", id: "your-words", maxlength: "400", autocomplete: "off" });
  const form = element("form", { class: "row" }, element("label", { for: "your-words" }, "Say"), words,
    element("button", { type: "submit" }, "Send"));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    if (words.value.trim()) order({ do: "type", text: words.value.trim() });
    words.value = "";
  });
  const pointing = button("Point by clicking", { "aria-pressed": "false", id: "points" }, () => {
    const on = pointing.getAttribute("aria-pressed") !== "true";
    pointing.setAttribute("aria-pressed", String(on));
    panel.ownerDocument.body.classList.toggle("pointing", on);
  });
  const who = element("p", { class: "owner" });
  const here = element("div", {}, who,
    element("p", { class: "why" }, "Click something in a picture to look at it. Drag a piece from above to move it. With the keyboard: Tab to a piece or a person, Enter looks, P points, arrows move a piece."),
    element("div", { class: "row" },
      button("Look at the robot", {}, () => order({ do: "look", target: here.dataset.robot })),
      button("Look away", {}, () => order({ do: "look", target: "" })),
      button("Nod", {}, () => order({ do: "head", how: "nod" })),
      button("Shake", {}, () => order({ do: "head", how: "shake" })), hold, pointing,
      button("Leave", {}, () => order({ do: "leave" }))),
    form);
  const refused = element("p", { class: "why" });
  const closed = element("p", { class: "why", role: "status" });
  place.replaceChildren(away, here, refused, closed);
  here.hidden = true;

  return {
    take(state, changed) {
      here.dataset.robot = state.robot;
      if (changed.has("away") || changed.has("health")) {
        for (const each of place.querySelectorAll("button")) if (each !== pointing) close(each, state.away);
        const isAlone = state.health && !state.health.some((each) => each.service && each.here);
        close(sit, state.away || (isAlone ? "no robot is on the bus" : ""));
        closed.textContent = sit.dataset.why ? `Nobody can take part now: ${sit.dataset.why}.` : "";
      }
      if (changed.has("you")) {
        const { person, denied, there: company } = state.you;
        seat = state.you.sit || seat;
        if (person) rise();
        const reason = denied?.seat ?? "";
        refused.replaceChildren(...prose(reason ? `You only look on: ${reason}.` : ""));
        const [before, after] = person ? [away, here] : [here, away];
        const keepsFocus = before.contains(document.activeElement);
        away.hidden = Boolean(reason || person);
        if (!isSitting) sit.textContent = seat;
        if (there.dataset.text !== (company ?? "")) {
          there.dataset.text = company ?? "";
          there.replaceChildren(...prose(company ?? ""));
        }
        here.hidden = !person;
        if (keepsFocus && before.hidden && !after.hidden) after.querySelector(person ? "button" : "input").focus();
        who.replaceChildren("You are ", element("strong", {}, person), ".");
        document.body.classList.toggle("seated", Boolean(person));
      }
      if (changed.has("told")) {
        if (state.told.some((each) => each.panel === panel.id)) rise();
        told(state.told);
      }
    },
  };
}
