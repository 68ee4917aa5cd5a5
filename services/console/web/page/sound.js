// The robot's voice, the microphone and the camera in the workshop: a button each, and beside it why there is nothing of it.
import { element } from "./look.js";
import { camera } from "./camera.js";
import { CAMERA_WORDS } from "./camera-words.js";
import { microphone } from "./microphone.js";
import { SOUND_WORDS } from "./sound-words.js";
import { voice } from "./voice.js";

// Fill a place with a button, and what is more; returns what shows a state of it. words: of what is told.
function face(place, id, names, words, ...more) {
  const button = element("button", { type: "button", "aria-pressed": "false", id });
  const why = element("span", { class: "why", role: "status" });
  place.replaceChildren(button, ...more, why);
  return {
    button,
    show({ state, news }) {
      button.setAttribute("aria-pressed", String(state !== "off"));
      button.textContent = names[state];
      const text = news?.(words) ?? "";
      if (why.textContent !== text) why.textContent = text;
    },
  };
}

export function voicePart(panel) {
  const place = panel.querySelector(".sound");
  const { button, show } = face(place, "voice", { off: "Hear the robot", on: "Mute the robot here" }, SOUND_WORDS.en);
  const sound = voice(show);
  button.addEventListener("click", sound.press);
  return {
    take(state, changed) {
      if (changed.has("place")) place.hidden = true; // a recording has no sound
    },
  };
}

// A device of the one who has a seat here, who is asked for it at a press. make: of its session and its face. tell: gets how strong what it gives is, and whether it is on.
function devicePart(panel, id, session, { names, words, make, more = [], tell = () => {} }) {
  const place = panel.querySelector(`.${id}`);
  const { button, show } = face(place, id, names, words, ...more);
  const own = make(session, {
    show(now) {
      show(now);
      button.classList.toggle("light", now.state === "on");
      tell({ isOn: now.state === "on" });
    },
    level: (level) => tell({ level }),
  });
  button.addEventListener("click", own.press);
  place.hidden = true;
  return {
    take(state, changed) {
      if (changed.has("you")) place.hidden = !state.you.person;
      if (state.you?.person) own.back();
      else own.off();
    },
  };
}

// session: gives that of the page's link to the window.
export function microphonePart(panel, session) {
  const meter = element("meter", { min: 0, max: 1, "aria-label": SOUND_WORDS.en.level, hidden: true });
  return devicePart(panel, "microphone", session, {
    names: { off: "Microphone", asked: "Microphone: ask no more", on: "Microphone is on: switch it off" },
    words: SOUND_WORDS.en, make: microphone, more: [meter],
    tell({ level, isOn }) {
      if (level !== undefined) meter.value = level;
      else meter.hidden = !isOn;
    },
  });
}

export const cameraPart = (panel, session) => devicePart(panel, "camera", session, {
  names: { off: "Camera", asked: "Camera: ask no more", on: "Camera is on: switch it off" }, words: CAMERA_WORDS.en, make: camera,
});
