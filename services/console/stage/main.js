// The stage: what a visitor sees of the robot, and how they sit down and talk with it.
import { ENDED, follow } from "../page/link.js";
import { bar as bars } from "./bar.js";
import { heads as atHeads } from "./heads.js";
import { scene as space } from "./scene.js";
import { touch as hands } from "./touch.js";
import { ASK, moment, part, visit } from "./visit.js";
import { another, language, texts } from "./words.js";

const TOLD = 4; // seconds for which news of an order are shown
const SEAT = `engage-seat ${location.pathname}`; // who one is, while the page is loaded anew
const at = (what) => document.querySelector(what);
const asked = new URLSearchParams(location.search);
const isKiosk = asked.has("kiosk");
const { language: robotSpeaks, examples } = document.body.dataset;
const state = { robot: document.body.dataset.robot, person: sessionStorage.getItem(SEAT) ?? "", scene: null, talk: null, text: null, denied: "", link: "" };
sessionStorage.removeItem(SEAT);
const clock = () => performance.now() / 1000;

let spoken = asked.get("lang") ?? (isKiosk ? null : localStorage.getItem("engage-language"));
spoken = language([spoken, ...navigator.languages].filter(Boolean));
let idle = clock(); // when somebody did something last
let touched = false;
let news = { text: "", until: 0 };

const order = (what) => link.send(what);
const bar = bars({
  top: at(".top"), bottom: at(".bar"), order, session: () => link.session, examples: JSON.parse(examples), spoken: robotSpeaks,
  turn() {
    spoken = another(spoken);
    if (!isKiosk) localStorage.setItem("engage-language", spoken);
    speak();
  },
});
const box = { top: 0, bottom: 0, width: 0 };
function measure() {
  box.width = innerWidth;
  box.top = at(".top").getBoundingClientRect().bottom + 4;
  box.bottom = at(".bar").getBoundingClientRect().top;
}
new ResizeObserver(measure).observe(at(".bar"));
addEventListener("resize", measure);

let shown = null;
try {
  // The scene has the room that bars, bubbles and the words of the welcome leave: these are above it, or to its left.
  const insets = () => {
    const side = Math.max(10, innerWidth * 0.03);
    const words = at(".welcome").getBoundingClientRect(); // without any size once one sits
    const isWide = innerWidth > 1.2 * innerHeight;
    return {
      top: isWide ? box.top + 8 : words.width ? words.bottom + 16 : box.top + Math.min(150, innerHeight * 0.15),
      bottom: innerHeight - box.bottom + 14,
      left: isWide && words.width ? words.right + side : side,
      right: side,
    };
  };
  shown = space(at(".scene"), insets);
} catch (error) {
  console.warn(error);
  at(".stage").classList.add("flat");
}
const touch = shown && hands({ place: at(".scene"), list: at(".pieces"), scene: shown, state, order, bar });
const heads = atHeads(at(".heads"), robotSpeaks);

function speak() {
  state.text = texts(spoken, robotSpeaks);
  document.documentElement.lang = spoken;
  document.title = state.text.title;
  at("h1").textContent = state.text.title;
  at(".scene").setAttribute("aria-label", state.text.scene);
  at(".pieces").setAttribute("aria-label", state.text.pieces);
  at(".read").setAttribute("aria-label", state.text.log);
  bar.speak(state.text);
  tell();
}

// Who looks at this page talks: by the button, or heard by the microphone.
const isTalking = () => bar.isSpeaking || Boolean(state.scene?.people.find((each) => each.id === state.person)?.speaks);

function tell() {
  const { talk, scene, person } = state;
  const present = scene?.people.filter((each) => each.at && each.present && each.id !== person) ?? [];
  bar.take({
    person, denied: state.denied, linked: !state.link, ready: talk?.state === "ready" && !state.link && Boolean(scene?.body), company: present.map(({ id }) => id),
    part: part(talk, scene, person), speaks: isTalking(), hears: talk?.hears, sees: talk?.sees,
  });
  document.body.classList.toggle("seated", Boolean(person));
  if (shown && scene) shown.take(scene, person);
}

// A screen reader hears each turn once, when it is over, and none from before: the words of a visitor are not for the next.
const read = new Set();
function readOut(isBefore) {
  for (const turn of state.talk.bubbles) {
    const key = `${turn.actor} ${turn.since}`;
    if (turn.open || read.has(key)) continue;
    read.add(key);
    if (isBefore) continue;
    const line = document.createElement("p");
    line.lang = robotSpeaks;
    line.textContent = `${turn.actor === state.person ? state.text.you : turn.actor === state.robot ? state.text.robot : state.text.called(turn.actor)}: ${turn.words}`;
    at(".read").append(line);
    while (at(".read").children.length > 12) at(".read").firstChild.remove();
  }
}

let offset = null; // from our clock to seconds of the picture
const link = follow({
  take(frame, isFirst) {
    const behind = clock() - frame.now;
    offset = offset === null || isFirst || behind < offset ? behind : offset + (behind - offset) * 0.002; // frames come late, never early
    const isBefore = !state.talk;
    if (frame.sections?.scene) state.scene = frame.sections.scene;
    if (frame.sections?.talk) {
      if (isKiosk && state.talk?.task && !frame.sections.talk.task) idle = Math.min(idle, clock() - ASK); // goodbye is said: are they still there?
      state.talk = frame.sections.talk;
    }
    if (frame.you) {
      if (state.person && !frame.you.person && isFirst) note(state.text.gone, Infinity);
      if (state.person !== (frame.you.person ?? "")) at(".read").replaceChildren();
      state.person = frame.you.person ?? "";
      if (state.person && news.until === Infinity) note("", 0); // they sit again
      state.denied = frame.you.denied?.seat ?? "";
    }
    if (frame.told?.length) refuse(frame.told);
    if (frame.sections?.talk) readOut(isBefore);
    if (frame.sections || frame.you) tell();
    document.body.dataset.frames = Number(document.body.dataset.frames ?? 0) + 1;
  },
  tell(isThere, reason = "") {
    const now = isThere ? "" : reason === ENDED ? "ended" : reason ? "full" : "lost";
    if (state.link === now) return;
    state.link = now;
    tell();
  },
  report: refuse,
  wait() {},
});

function note(text, until = clock() + TOLD) {
  news = { text, until };
}
addEventListener("pagehide", () => state.person && sessionStorage.setItem(SEAT, state.person));
function refuse(told) {
  bar.rise();
  note(told.some(({ text }) => text.includes("on its way")) ? state.text.busy : state.text.refused);
}

// Somebody is there: what they do counts, whatever it is.
for (const kind of ["pointerdown", "pointermove", "keydown", "wheel", "touchstart"]) {
  addEventListener(kind, () => {
    idle = clock();
    touched = true;
  }, { capture: true, passive: true });
}

const ask = at(".ask");
function asks(left) {
  if (left === null) {
    if (ask.open) ask.close();
    return;
  }
  if (!ask.open) {
    const stay = document.createElement("button");
    ask.replaceChildren(document.createElement("h2"), document.createElement("p"), stay);
    ask.querySelector("h2").textContent = state.text.still;
    stay.textContent = state.text.stay;
    stay.addEventListener("click", () => ask.close());
    ask.showModal();
  }
  ask.querySelector("p").textContent = state.text.ending(left);
}

function hint(now) {
  const { text, talk, person } = state;
  if (state.link) return text[state.link];
  if (!talk || talk.state !== "ready") return text[talk?.state ?? "away"];
  if (now < news.until) return news.text;
  if (bar.trouble) return bar.trouble;
  if (!person) return "";
  if (isTalking()) return text.talks;
  if (bar.points) return text.pointing;
  const named = (id) => {
    const thing = state.scene.things.find((each) => each.id === id);
    return thing ? text.thing(thing.label) : text.called(id);
  };
  const met = moment(talk, state.scene.robot, person);
  const next = visit(now - idle, { seated: true, kiosk: isKiosk, touched });
  const tips = text.tips(bar.ear, bar.eye);
  if (next.do === "tip" && [undefined, "mutual", "meet"].includes(met?.text)) return tips[next.number % tips.length];
  if (met?.text === "looking" && ["off", "lacking", "wordless"].includes(bar.ear)) return tips[0];
  if (met) return typeof text[met.text] === "function" ? text[met.text](named(met.about)) : text[met.text];
  return tips[0];
}

const dark = matchMedia("(prefers-color-scheme: dark)");
let last = 0;
let before = clock();
function tick() {
  requestAnimationFrame(tick);
  const now = clock();
  if (isTalking() || bar.isSeen) idle = now;
  else if (state.talk?.voices.some(({ actor }) => actor === state.scene?.robot)) idle += now - before; // who listens does nothing else
  before = now;
  const next = visit(now - idle, { seated: Boolean(state.person), kiosk: isKiosk, touched });
  if (next.do === "anew") {
    touched = false;
    link.end();
    state.person = ""; // it is the next visitor's page
    location.replace(`${location.pathname}?kiosk`);
    return;
  }
  asks(next.do === "ask" ? next.left : null);
  if (!state.scene || !state.talk) return bar.hint(state.text ? hint(now) : "");
  const drawn = shown?.draw(now, state.talk.bonds, dark.matches);
  if (!drawn && now - last < 0.1) return;
  last = now;
  bar.hint(hint(now));
  touch?.draw();
  const where = shown ? (place) => shown.onPage(place) : () => ({ x: box.width / 2, y: box.top });
  heads.draw({ talk: state.talk, scene: state.scene, you: state.person, text: state.text, now: now - offset, at: now, where, box });
}

speak();
measure();
requestAnimationFrame(tick);
window.stage = { state, send: order, shown, box }; // for who looks into the page with the browser's tools
