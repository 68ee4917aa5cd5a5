// The robot's voice and the microphone in the workshop: a button each, and beside it why there is no sound.
import { element } from "./look.js";
import { microphone } from "./microphone.js";
import { SOUND_WORDS } from "./sound-words.js";
import { voice } from "./voice.js";

// Fill a place with a button, and what is more; returns what shows a state of the sound.
function face(place, id, names, ...more) {
  const button = element("button", { type: "button", "aria-pressed": "false", id });
  const why = element("span", { class: "why", role: "status" });
  place.replaceChildren(button, ...more, why);
  return {
    button,
    show({ state, news }) {
      button.setAttribute("aria-pressed", String(state !== "off"));
      button.textContent = names[state];
      const text = news?.(SOUND_WORDS.en) ?? "";
      if (why.textContent !== text) why.textContent = text;
    },
  };
}

export function voicePart(panel) {
  const place = panel.querySelector(".sound");
  const { button, show } = face(place, "voice", { off: "Hear the robot", on: "Mute the robot here" });
  const sound = voice(show);
  button.addEventListener("click", sound.press);
  return {
    take(state, changed) {
      if (changed.has("place")) place.hidden = true; // a recording has no sound
    },
  };
}

// session: gives that of the page's link to the window.
export function microphonePart(panel, session) {
  const place = panel.querySelector(".microphone");
  const level = element("meter", { min: 0, max: 1, "aria-label": SOUND_WORDS.en.level, hidden: true });
  const names = { off: "Microphone", asked: "Microphone: ask no more", on: "Microphone is on: switch it off" };
  const { button, show } = face(place, "microphone", names, level);
  const sound = microphone(session, {
    show(now) {
      show(now);
      button.classList.toggle("light", now.state === "on");
      level.hidden = now.state !== "on";
    },
    level: (value) => (level.value = value),
  });
  button.addEventListener("click", sound.press);
  place.hidden = true;
  return {
    take(state, changed) {
      if (!changed.has("you")) return;
      place.hidden = !state.you.person;
      if (!state.you.person) sound.off();
    },
  };
}
