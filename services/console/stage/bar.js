// The bars: above the language, below the one large button, and what a person at the table can do.
import { camera } from "../page/camera.js";
import { element } from "../page/look.js";
import { microphone } from "../page/microphone.js";
import { voice } from "../page/voice.js";
import { put } from "./heads.js";

const icon = (path) => `<svg viewBox="0 0 24 24" width="26" height="26" fill="none" stroke="currentColor" stroke-width="2" stroke-linecap="round" stroke-linejoin="round" aria-hidden="true">${path}</svg>`;
const STAYS = 12000; // ms of a page that one sees for which it is told why microphone, camera or voice went off
const ICONS = {
  mic: icon('<rect x="9" y="3" width="6" height="11" rx="3"/><path d="M5 11a7 7 0 0 0 14 0M12 18v3"/>'),
  loud: icon('<path d="M4 9.5v5h3.5L12 18.5v-13L7.5 9.5zM15.5 9a4 4 0 0 1 0 6M18 6.5a8 8 0 0 1 0 11"/>'),
  mute: icon('<path d="M4 9.5v5h3.5L12 18.5v-13L7.5 9.5zM16 9.5l5 5m0-5-5 5"/>'),
  eye: icon('<rect x="3" y="7" width="12.5" height="10.5" rx="2.5"/><path d="m15.5 11.5 5.5-3v8l-5.5-3z"/>'),
  send: icon('<path d="M4 12 20 4l-4 16-4-7z"/>'),
  nod: icon('<circle cx="12" cy="12" r="8"/><path d="M12 8v7m-3-3 3 3 3-3"/>'),
  point: icon('<path d="M9 12V5a1.5 1.5 0 0 1 3 0v5l4 1a3 3 0 0 1 2 3l-.5 3a4 4 0 0 1-4 3H12a4 4 0 0 1-3.2-1.6L5.5 14A1.6 1.6 0 0 1 8 12z"/>'),
  leave: icon('<path d="M14 4h4a2 2 0 0 1 2 2v12a2 2 0 0 1-2 2h-4M3 12h11m-4-4 4 4-4 4"/>'),
};

// order: sends one. turn: takes the other language. session: gives that of the page's link to the window.
// examples: what one may say to the robot, in the language `spoken`.
export function bar({ top, bottom, order, turn, session, examples, spoken }) {
  let text = null;
  let isSitting = false;
  let isSpeaking = false;
  let isMuted = false; // by who looks at this page
  let isSeen = false; // by the camera
  const sounds = { voice: { state: "off" }, microphone: { state: "off" }, camera: { state: "off" } }; // as they were shown last, and since when
  const paint = (made, name) => {
    made.innerHTML = ICONS[name];
    return made;
  };
  const drawing = (name) => paint(element("span", { class: "icon" }), name);
  const button = (kind, act, ...inside) => {
    const made = element("button", { type: "button", class: kind }, ...inside);
    if (act) made.addEventListener("click", act);
    return made;
  };
  const shows = (name) => (now) => {
    const was = sounds[name];
    sounds[name] = { ...now, since: was.state === now.state && was.news === now.news ? was.since : performance.now() };
    draw();
  };
  let hidden = 0; // when the page was
  document.addEventListener("visibilitychange", () => {
    if (document.hidden) return (hidden = performance.now());
    for (const each of Object.values(sounds)) each.since += performance.now() - Math.max(hidden, each.since);
  });
  const other = button("other", turn);
  const loud = button("loud", () => {
    isMuted = sounds.voice.state === "on";
    robot.press();
  }, drawing("mute"));
  const who = element("p", { class: "who" }, element("i", { class: "ring" }), element("b", {}), element("span", { class: "level" }));
  top.append(who, loud, other);

  const hint = element("p", { class: "hint", role: "status" });
  const sit = button("sit", () => {
    if (isSitting || sit.getAttribute("aria-disabled")) return;
    isSitting = true;
    if (!isMuted && sounds.voice.state === "off") robot.press(); // browsers let a page sound from a press on
    draw();
    order({ do: "sit", name: "" });
  });
  const welcome = element("div", { class: "welcome" }, element("p", { class: "hello" }), element("p", { class: "what" }));
  const away = element("div", { class: "away" }, sit);
  top.after(welcome);

  // Where the robot hears, this is the microphone; else one talks without words while it is held.
  const hold = button("hold", () => isEar() && ear.press(), drawing("mic"));
  const isEar = () => Boolean(last?.hears) || sounds.microphone.state !== "off";
  const speak = (on) => {
    if (isSpeaking === on) return;
    isSpeaking = on;
    order({ do: "speak", on });
    draw();
  };
  hold.addEventListener("pointerdown", (event) => {
    if (isEar()) return;
    hold.setPointerCapture(event.pointerId);
    speak(true);
  });
  for (const end of ["pointerup", "pointercancel", "blur"]) hold.addEventListener(end, () => speak(false));
  hold.addEventListener("keydown", (event) => {
    if (isEar() || (event.key !== " " && event.key !== "Enter")) return;
    event.preventDefault();
    if (!event.repeat) speak(true);
  });
  hold.addEventListener("keyup", () => speak(false));
  hold.addEventListener("contextmenu", (event) => event.preventDefault());
  const words = element("input", { type: "text", maxlength: "400", autocomplete: "off", enterkeyhint: "send" });
  const send = element("button", { type: "submit", class: "send" }, drawing("send"));
  const see = button("see", () => eye.press(), drawing("eye"));
  const form = element("form", { class: "say" }, hold, see, words, send);
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    if (words.value.trim()) order({ do: "type", text: words.value.trim() });
    words.value = "";
  });
  const quick = [0, 1, 2].map((index) => button("quick", () => {
    const [, said, how] = text.quick[index];
    if (how) order({ do: "head", how });
    order({ do: "type", text: said });
  }));
  const named = (kind, name, act) => button(kind, act, drawing(name), element("span", {}));
  const nod = named("do", "nod", () => order({ do: "head", how: "nod" }));
  const point = named("do", "point", () => {
    point.setAttribute("aria-pressed", String(point.getAttribute("aria-pressed") !== "true"));
    draw();
  });
  point.setAttribute("aria-pressed", "false");
  const leave = named("do", "leave", () => order({ do: "leave" }));
  const sayings = element("div", { class: "sayings", role: "group" }, ...examples.map((line) => {
    const made = button("saying", () => order({ do: "type", text: line }), line);
    made.lang = spoken;
    return made;
  }));
  sayings.hidden = !examples.length;
  // As many as there is room for: nobody has to scroll.
  new ResizeObserver(() => {
    if (!sayings.clientWidth) return;
    const { paddingLeft, paddingRight, columnGap } = getComputedStyle(sayings);
    let left = sayings.clientWidth - parseFloat(paddingLeft) - parseFloat(paddingRight);
    for (const each of sayings.children) {
      each.hidden = false;
      left -= each.offsetWidth;
      each.hidden = left < 0;
      left -= parseFloat(columnGap);
    }
  }).observe(sayings);
  const here = element("div", { class: "here" }, sayings, form, element("div", { class: "quickly" }, ...quick, nod, point, leave));
  bottom.append(hint, away, here);

  const had = (isOf, { state, isLacking }) => (!isOf ? "none" : state === "on" ? "on" : isLacking ? "lacking" : "off"); // a device
  let last = null;
  const robot = voice(shows("voice"));
  const ear = microphone(session, {
    show: shows("microphone"),
    level: (value) => hold.style.setProperty("--loud", value.toFixed(2)),
  });
  // Who was seated as the page was loaded anew hears the robot from their first press on.
  const soundsAgain = ({ target }) => !loud.contains(target) && sounds.voice.state === "off" && robot.press();
  const eye = camera(session, { show: shows("camera"), level(value) {
    isSeen = value > 0;
    see.style.setProperty("--loud", 0.3 * value);
  } });
  function draw() {
    if (!text) return;
    const seen = sounds.camera.state;
    see.setAttribute("aria-label", text.camera[seen]);
    see.title = text.camera[seen];
    see.setAttribute("aria-pressed", String(seen !== "off"));
    see.classList.toggle("light", seen === "on");
    see.classList.toggle("asks", seen === "asked");
    see.hidden = !last?.person || !(last.sees || seen !== "off");
    const [isLoud, heard] = [sounds.voice.state === "on", sounds.microphone.state];
    if (loud.getAttribute("aria-pressed") !== String(isLoud)) paint(loud.firstChild, isLoud ? "loud" : "mute");
    loud.setAttribute("aria-pressed", String(isLoud));
    loud.setAttribute("aria-label", text.loud);
    hold.setAttribute("aria-label", isEar() ? text.microphone[heard] : text.hold);
    hold.setAttribute("aria-pressed", String(isSpeaking || heard !== "off"));
    hold.classList.toggle("on", isSpeaking);
    hold.classList.toggle("light", heard === "on");
    hold.classList.toggle("asks", heard === "asked");
    if (!last) return;
    const { person, denied, ready, company } = last;
    const isFree = ready && !denied;
    here.hidden = !person;
    away.hidden = welcome.hidden = Boolean(person);
    sit.hidden = Boolean(denied);
    isFree ? sit.removeAttribute("aria-disabled") : sit.setAttribute("aria-disabled", "true"); // it keeps the focus
    sit.textContent = isSitting ? text.sitting : company.length ? text.beside(text.listed(company)) : text.sit;
    welcome.classList.toggle("company", company.length > 0);
    welcome.firstChild.textContent = text.hello;
    welcome.lastChild.textContent = denied ? text.onlooker : company.length ? `${text.others(text.listed(company), company.length)} ${text.welcome}` : text.welcome;
  }
  return {
    // language: its texts.
    speak(language) {
      text = language;
      other.textContent = text.other;
      other.setAttribute("aria-label", text.language);
      words.placeholder = text.type;
      words.setAttribute("aria-label", text.type);
      send.setAttribute("aria-label", text.send);
      sayings.setAttribute("aria-label", text.sayings);
      quick.forEach((each, index) => (each.textContent = text.quick[index][0]));
      for (const [made, name] of [[nod, "nod"], [point, "point"], [leave, "leave"]]) made.lastChild.textContent = text[name];
      draw();
    },
    // person: id of who looks; empty: no seat. linked: the window answers. ready: the robot can be talked with. company: ids of others. hears, sees: the
    // robot hears people, and sees them.
    take(state) {
      const was = last?.person;
      if (!last && state.person) addEventListener("click", soundsAgain, { capture: true, once: true });
      last = state;
      if (isEar()) speak(false);
      if (state.person) isSitting = false;
      if (was && !state.person) {
        isSpeaking = false;
        ear.off();
        eye.off();
        point.setAttribute("aria-pressed", "false");
      } else if (state.person && state.linked) {
        ear.back();
        eye.back();
      }
      const hadFocus = (state.person ? away : here).contains(document.activeElement);
      draw();
      if (hadFocus) (state.person ? words : sit).focus({ preventScroll: true });
      who.hidden = !state.person;
      who.children[1].textContent = text?.you ?? "";
      put(who, state.part, state.speaks);
      who.lastChild.textContent = text?.mine[state.part.level] ?? "";
    },
    // Say one line; urgent: it stays before others for a while.
    hint(line) {
      if (hint.textContent !== line) hint.textContent = line;
      hint.classList.toggle("empty", !line);
    },
    // Something was not done.
    rise() {
      isSitting = false;
      draw();
    },
    get points() {
      return point.getAttribute("aria-pressed") === "true";
    },
    pointed() {
      point.setAttribute("aria-pressed", "false");
    },
    get isSeen() {
      return isSeen;
    },
    get isSpeaking() {
      return isSpeaking;
    },
    // The microphone, for who wants to talk: none (the robot hears nobody), wordless (it understands no words), off, on, or lacking, until it is pressed again.
    get ear() {
      return last?.hears === "voices" ? "wordless" : had(last?.hears, sounds.microphone);
    },
    // The camera, in the same words.
    get eye() {
      return had(last?.sees, sounds.camera);
    },
    // What is wrong with microphone, camera or voice, in words; empty: nothing.
    get trouble() {
      const told = Object.entries(sounds).filter(([, each]) => each.news && (each.state !== "off" || performance.now() - each.since < STAYS));
      return told.map(([name, each]) => each.news(name === "camera" ? text.seen : text.sound)).find(Boolean) ?? "";
    },
  };
}
