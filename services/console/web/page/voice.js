// The robot's voice, heard in the page in step with its words, wherever else the robot's own sound goes.
import { element } from "./look.js";
import { timed } from "./timed.js";

const HEADER = 16; // bytes: the instant, the number of the frame, and the samples per second
const JOINS = 0.003; // seconds by which what follows may be beside what was before: then it follows without a gap
const SPEECH = 0.5; // seconds after which the clocks are compared anew; within them what follows keeps its distance
const LAG = 0.08; // seconds by which a speech may be late as a whole, so that what comes too late is still heard
const FADE = 0.004; // seconds in which sound ends that is cut
const AGAIN = 1000; // ms from a broken link to the next try

// What plays: pieces of sound at instants of the window's clock. late: gets seconds by which a piece came too late.
export function speaker(link, late) {
  let context = null;
  let last = null; // where the sound ends that came last: in the window's clock, and in the context's
  let lag = 0; // seconds by which what plays is late
  let playing = [];
  const open = (rate) => {
    if (context?.sampleRate === rate) return;
    context?.close();
    context = new AudioContext({ sampleRate: rate, latencyHint: "interactive" });
    last = null;
    playing = [];
  };
  // Time of the context that is heard at an instant of the window's clock.
  const place = (at) => {
    const stamp = context.getOutputTimestamp();
    const isKnown = stamp.performanceTime > 0;
    const heard = isKnown ? stamp.contextTime : context.currentTime - (context.outputLatency || context.baseLatency || 0);
    return heard + (link().here(at) - (isKnown ? stamp.performanceTime : performance.now())) / 1000;
  };
  const next = (at) => {
    const apart = last === null ? Infinity : at - last.at;
    if (Math.abs(apart) < JOINS) return last.time;
    const caught = Math.min(lag, apart); // silence makes good what is late
    lag = apart > 0 && apart < SPEECH ? lag - caught : 0;
    return apart > 0 && apart < SPEECH ? last.time + apart - caught : place(at);
  };

  function play(at, rate, samples) {
    open(rate);
    const seconds = samples.length / rate;
    let begin = next(at);
    const more = Math.max(0, Math.min(context.currentTime - begin, LAG - lag));
    lag += more;
    begin += more;
    last = { at: at + seconds, time: begin + seconds };
    const passed = Math.max(0, context.currentTime - begin);
    if (passed > 0) late(Math.min(passed, seconds));
    if (passed >= seconds) return;
    const buffer = context.createBuffer(1, samples.length, rate);
    const floats = buffer.getChannelData(0);
    for (let index = 0; index < samples.length; index += 1) floats[index] = samples[index] / 32768;
    const source = new AudioBufferSourceNode(context, { buffer });
    const gain = new GainNode(context);
    source.connect(gain).connect(context.destination);
    const one = { source, gain, begin, end: begin + seconds };
    source.onended = () => (playing = playing.filter((each) => each !== one));
    playing.push(one);
    source.start(Math.max(begin, context.currentTime), passed);
  }

  function cut(at) {
    if (!context || !last) return;
    const from = Math.max(last.at >= at ? last.time - (last.at - at) : place(at), context.currentTime + FADE);
    for (const each of playing) {
      if (each.end <= from) continue;
      if (each.begin < from) {
        each.gain.gain.setValueAtTime(1, from - FADE);
        each.gain.gain.linearRampToValueAtTime(0, from);
      }
      each.source.stop(Math.max(from, each.begin));
      if (each.begin >= from) each.gain.disconnect();
    }
    last = null;
  }

  return {
    open,
    take(data) {
      const head = new DataView(data);
      const at = head.getFloat64(0, true);
      const samples = new Int16Array(data.slice(HEADER));
      if (link().here(at) === null) return;
      if (samples.length) play(at, head.getUint32(12, true), samples);
      else cut(at);
    },
    close() {
      context?.close();
      context = null;
    },
    get state() {
      return context?.state;
    },
    resume: () => context?.resume(),
  };
}

export function voice(panel) {
  const button = element("button", { type: "button", "aria-pressed": "false", id: "voice" }, "Hear the robot");
  const why = element("span", { class: "why", role: "status" });
  panel.querySelector(".sound").replaceChildren(button, why);
  let link = null;
  let sound = null;
  let isOn = false;
  let missed = 0; // seconds of sound that came too late, since the voice is on
  const tell = (text) => why.textContent !== text && (why.textContent = text);
  const late = (seconds) => {
    missed += seconds;
    if (missed > 0.3) tell("Parts of the voice come too late to be heard: this page, or its link, is slow.");
  };

  function connect() {
    link = timed("voice", {
      heard: (data) => sound?.take(data),
      ready: () => tell(""),
      ended(reason) {
        if (!isOn) return;
        tell(reason ? `The voice is not heard: ${reason}.` : "The voice is not heard: the link to the window is broken. It is made again.");
        if (!reason) setTimeout(() => isOn && connect(), AGAIN);
        else off();
      },
    });
  }
  function off() {
    isOn = false;
    button.setAttribute("aria-pressed", "false");
    button.textContent = "Hear the robot";
    link?.close();
    sound?.close();
    link = sound = null;
  }
  button.addEventListener("click", () => {
    if (isOn) {
      tell("");
      return off();
    }
    isOn = true;
    missed = 0;
    button.setAttribute("aria-pressed", "true");
    button.textContent = "Mute the robot here";
    sound = speaker(() => link, late);
    sound.open(22050); // at the press: later a browser may not let it sound
    connect();
  });
  return {
    take(state, changed) {
      if (changed.has("place")) panel.querySelector(".sound").hidden = true; // a recording has no sound
    },
    tick() {
      if (sound?.state === "suspended" || sound?.state === "interrupted") sound.resume();
    },
  };
}
