// The microphone of the one who sits at this page: on at a press, with a light, and off at the next. Never unasked.
import { timed } from "./timed.js";

const RATE = 16000;
const HEADER = 12; // bytes: the instant, and the number of the frame
const FULL = 3 * RATE * 2; // bytes that may wait for the link: 3 s of sound, as while the page draws; what comes then is lost
const SILENT = 1500; // ms without any sound from the microphone, or any word from the window, after which something is wrong
const LATELY = 5000; // ms for which it is told that sound was lost
const LOOK = 250; // ms between two looks at how it goes
const LAG = 8; // windows of sound, a quarter of a second, of which the one that came quickest says how the clocks of context and page stand

const GONE = (words) => words.off(words.gone);

// Why no page at this address can have a microphone, in words; null: it can.
function lacking() {
  if (navigator.mediaDevices?.getUserMedia && window.AudioWorkletNode) return null;
  return (words) => words.none(isSecureContext ? words.unable : words.plain);
}

// session: gives that of the page's link to the window. face.show: gets the state (off, asked, on), and news: what is to be
// told, made of words in a language, or null. face.level: gets how loud it is, 0 to 1, while it is on.
export function microphone(session, face) {
  let on = null; // what is open while it is on, or asked for
  let news = null;

  const show = () => face.show({ state: on === null ? "off" : on.ear ? "on" : "asked", news });
  function tell(what) {
    news = what;
    show();
  }
  function off(what = null) {
    if (on === null && what === null) return;
    const { stream, context, link, timer } = on ?? {};
    on = null;
    clearInterval(timer);
    stream?.getTracks().forEach((track) => track.stop());
    context?.close();
    link?.close();
    face.level(0);
    tell(what);
  }
  const failed = (reason) => off((words) => words.off(reason(words)));

  async function begin() {
    const own = (on = { number: 0, lost: 0, lostAt: -Infinity, lags: [], heard: performance.now() });
    tell((words) => words.asks);
    let stream;
    try {
      stream = await navigator.mediaDevices.getUserMedia({ audio: { channelCount: 1, echoCancellation: true } });
    } catch (error) {
      if (on === own) failed((words) => words[error.name] ?? error.message);
      return;
    }
    if (on !== own) return stream.getTracks().forEach((track) => track.stop());
    own.stream = stream;
    const [track] = stream.getAudioTracks();
    track.onended = () => on === own && off(GONE);
    try {
      await listen(own, track);
    } catch (error) {
      if (on === own) failed(() => error.message);
    }
  }

  async function listen(own, track) {
    tell(null);
    own.heard = performance.now();
    own.timer = setInterval(() => look(own, track), LOOK);
    const address = new URL(`microphone?session=${encodeURIComponent(session())}`, document.baseURI);
    own.link = timed(address, {
      ended: (reason) => on === own && failed((words) => reason || words.broken),
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
    face.level(samples.reduce((most, each) => Math.max(most, Math.abs(each)), 0) / 32768);
    if (at === null) return; // the link is being made: nobody waits for what is said before the light
    own.number += 1;
    if (own.link.socket.readyState !== WebSocket.OPEN || own.link.socket.bufferedAmount > FULL) {
      own.lost += samples.length / RATE;
      own.lostAt = here;
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
    const here = performance.now();
    if (track.readyState === "ended") off(GONE);
    else if (here - own.heard > SILENT) tell((words) => words.silent);
    else if (here - own.link.answered() > SILENT) tell((words) => words.unanswered);
    else if (own.link.unheard()) tell((words) => words.unheard(own.link.unheard()));
    else if (here - own.lostAt < LATELY) tell((words) => words.slow(own.lost.toFixed(1)));
    else tell(track.muted ? (words) => words.muted : null);
  }

  document.addEventListener("visibilitychange", () => {
    if (document.hidden && on) off((words) => words.hidden);
  });
  show();
  return {
    off: () => off(),
    press() {
      const reason = lacking();
      if (on) off();
      else if (reason) tell(reason);
      else begin();
    },
  };
}
