// The seat: whoever looks at the page becomes a person before the robot.
import { element, news } from "./look.js";

export function part(panel, order) {
  const place = panel.querySelector(".part");
  let speaking = false;
  const told = news(panel);

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
    order({ do: "sit", name: name.value.trim() });
  });

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
  const pointing = button("Click points", { "aria-pressed": "false", id: "points" }, () => {
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
  place.replaceChildren(away, here, refused);
  here.hidden = true;

  return {
    take(state, changed) {
      here.dataset.robot = state.robot;
      if (changed.has("you")) {
        const { person, denied, there: company, sit: seat } = state.you;
        const reason = denied?.seat ?? "";
        refused.textContent = reason ? `You only look on: ${reason}.` : "";
        away.hidden = Boolean(reason || person);
        if (seat && sit.textContent !== seat) sit.textContent = seat;
        if (there.textContent !== (company ?? "")) there.textContent = company ?? "";
        here.hidden = !person;
        who.replaceChildren("You are ", element("strong", {}, person), ".");
        document.body.classList.toggle("seated", Boolean(person));
      }
      if (changed.has("told")) told(state.told);
    },
  };
}
