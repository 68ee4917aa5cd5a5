// The microphone of the one who sits at this page: on at a press, with a light, and off at the next. Never unasked.
import { element } from "./look.js";
import { timed } from "./timed.js";

const RATE = 16000;
const HEADER = 12; // bytes: the instant, and the number of the frame
const FULL = RATE * 2; // bytes that may wait for the link: a second of sound; what comes then is lost
const SILENT = 1500; // ms without any sound from the microphone, or any word from the window, after which something is wrong
const LOOK = 250; // ms between two looks at how it goes
const LAG = 8; // windows of sound, a quarter of a second, of which the one that came quickest says how the clocks of context and page stand

const GONE = "The microphone is off: it was unplugged, or taken away.";
const REFUSED = {
  NotAllowedError: "your browser, or you, did not let this page have it: its settings for this page say so, beside the address",
  NotFoundError: "this computer has none, or none is plugged in",
  NotReadableError: "another program has it, or the system does not give it",
  OverconstrainedError: "none of this computer gives such sound",
};

// Why no page at this address can have a microphone; empty: it can.
function lacking() {
  if (navigator.mediaDevices?.getUserMedia && window.AudioWorkletNode) return "";
  if (isSecureContext) return "this browser gives no page a microphone";
  return "browsers give one only to https and to localhost, and this page came by http: start the window with --https FILE, and open the address that it prints";
}

export function microphone(panel, session) {
  const button = element("button", { type: "button", "aria-pressed": "false", id: "microphone" });
  const level = element("meter", { min: 0, max: 1, "aria-label": "how loud the microphone is", hidden: true });
  const why = element("span", { class: "why", role: "status" });
  const place = panel.querySelector(".microphone");
  place.replaceChildren(button, level, why);
  place.hidden = true;
  let on = null; // what is open while it is on, or asked for

  const tell = (text) => why.textContent !== text && (why.textContent = text);
  function show() {
    const state = on === null ? "off" : on.ear ? "on" : "asked";
    button.setAttribute("aria-pressed", String(state !== "off"));
    button.classList.toggle("light", state === "on");
    button.textContent = { off: "Microphone", asked: "Microphone: ask no more", on: "Microphone is on: switch it off" }[state];
    level.hidden = state !== "on";
  }
  function off(text = "") {
    const { stream, context, link, timer } = on ?? {};
    on = null;
    clearInterval(timer);
    stream?.getTracks().forEach((track) => track.stop());
    context?.close();
    link?.close();
    tell(text);
    show();
  }

  async function begin() {
    const own = (on = { number: 0, lost: 0, lags: [], heard: performance.now() });
    show();
    tell("Your browser asks you whether this page may have it.");
    let stream;
    try {
      stream = await navigator.mediaDevices.getUserMedia({ audio: { channelCount: 1, echoCancellation: true } });
    } catch (error) {
      if (on === own) off(`The microphone is off: ${REFUSED[error.name] ?? error.message}.`);
      return;
    }
    if (on !== own) return stream.getTracks().forEach((track) => track.stop());
    own.stream = stream;
    const [track] = stream.getAudioTracks();
    track.onended = () => on === own && off(GONE);
    try {
      await listen(own, track);
    } catch (error) {
      if (on === own) off(`The microphone is off: ${error.message}.`);
    }
  }

  async function listen(own, track) {
    tell("");
    own.heard = performance.now();
    own.timer = setInterval(() => look(own, track), LOOK);
    const address = new URL(`microphone?session=${encodeURIComponent(session())}`, document.baseURI);
    own.link = timed(address, {
      ended: (reason) => on === own && off(`The microphone is off: ${reason || "the link to the window is broken"}.`),
    });
    own.context = context(own.stream);
    await own.context.audioWorklet.addModule(new URL("page/ear.js", document.baseURI));
    if (on !== own) return;
    own.ear = new AudioWorkletNode(own.context, "ear", { numberOfOutputs: 0 });
    own.ear.port.onmessage = ({ data }) => on === own && send(own, track, data);
    new MediaStreamAudioSourceNode(own.context, { mediaStream: own.stream }).connect(own.ear);
    show();
  }
  // Of our rate if the browser has the sound so; else the ear takes the mean of what it gets.
  function context(stream) {
    const made = new AudioContext({ sampleRate: RATE, sinkId: { type: "none" } }); // it plays nothing: no device is to hold it up
    try {
      new MediaStreamAudioSourceNode(made, { mediaStream: stream }).disconnect();
      return made;
    } catch {
      made.close();
      return new AudioContext();
    }
  }

  function send(own, track, { frame, samples, ended }) {
    const { lags } = own;
    const here = performance.now();
    own.isSound ||= samples.some(Boolean); // one that is muted gives nothing but zeros
    if (own.isSound) own.heard = here;
    lags.push(ended - (Date.now() - here) - (1000 * frame) / own.context.sampleRate - (1000 * samples.length) / RATE);
    if (lags.length > LAG) lags.shift();
    const latency = 1000 * (track.getSettings().latency ?? 0);
    const at = own.link.there((1000 * frame) / own.context.sampleRate + Math.min(...lags) - latency);
    level.value = samples.reduce((most, each) => Math.max(most, Math.abs(each)), 0) / 32768;
    if (at === null) return; // the link is being made: nobody waits for what is said before the light
    own.number += 1;
    if (own.link.socket.readyState !== WebSocket.OPEN || own.link.socket.bufferedAmount > FULL) {
      own.lost += samples.length / RATE;
      return;
    }
    const message = new ArrayBuffer(HEADER + samples.byteLength);
    const view = new DataView(message);
    view.setFloat64(0, at, true);
    view.setUint32(8, own.number, true);
    new Int16Array(message, HEADER).set(samples);
    own.link.socket.send(message);
  }

  function look(own, track) {
    if (track.readyState === "ended") off(GONE);
    else if (performance.now() - own.heard > SILENT) tell("The microphone gives no sound: is it muted, or held by another program?");
    else if (performance.now() - own.link.answered() > SILENT) tell("The window does not answer: nobody knows whether you are heard.");
    else if (own.link.unheard()) tell(`Nobody hears you: ${own.link.unheard()}.`);
    else if (own.lost) tell(`Your link is slow: ${own.lost.toFixed(1)} s of your voice were lost.`);
    else if (track.muted) tell("The system has muted the microphone.");
    else tell("");
  }

  document.addEventListener("visibilitychange", () => {
    if (document.hidden && on) off("The microphone went off as this page was hidden: press to go on.");
  });
  button.addEventListener("click", () => {
    if (on) return off();
    const reason = lacking();
    if (reason) return tell(`There is no microphone: ${reason}.`);
    begin();
  });
  show();
  return {
    take(state, changed) {
      if (!changed.has("you")) return;
      place.hidden = !state.you.person;
      if (!state.you.person && on) off();
    },
  };
}
