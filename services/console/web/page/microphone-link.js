// A worker: takes the sound of a microphone from the ear, and sends it to the window with its instants, whatever the page does meanwhile.
import { SEAT_KEPT, timed } from "./timed.js";

const RATE = 16000;
const HEADER = 12; // bytes: the instant, and the number of the frame
const FULL = 3 * RATE * 2; // bytes that may wait for the link: 3 s of sound; what comes then is lost
const SILENT = 1500; // ms without any sound from the microphone, or any word from the window, after which something is wrong
const LATELY = 5000; // ms for which it is told that sound was lost
const LOOK = 250; // ms between two looks at how it goes
const LAG = 8; // windows of sound, a quarter of a second, of which the one that came quickest says how the clocks of context and worker stand

let link = null;
let rate = RATE; // of the context
let latency = 0; // of the microphone, in ms
let heard = performance.now(); // when there was sound last
let isSound = false; // one that is muted gives nothing but zeros
let number = 0;
let lost = 0; // seconds
let lostAt = -Infinity;
const lags = [];

function send({ frame, samples, ended }) {
  const here = performance.now();
  isSound ||= samples.some(Boolean);
  if (isSound) heard = here;
  postMessage({ level: samples.reduce((most, each) => Math.max(most, Math.abs(each)), 0) / 32768 });
  lags.push(ended - (Date.now() - here) - (1000 * frame) / rate - (1000 * samples.length) / RATE);
  if (lags.length > LAG) lags.shift();
  const at = link.there((1000 * frame) / rate + Math.min(...lags) - latency);
  if (at === null && !number) return; // the link is being made: nobody waits for what is said before the light
  number += 1;
  if (at === null || link.socket.readyState !== WebSocket.OPEN || link.socket.bufferedAmount > FULL) {
    lost += samples.length / RATE;
    lostAt = here;
    return;
  }
  const message = new ArrayBuffer(HEADER + samples.byteLength);
  const view = new DataView(message);
  view.setFloat64(0, at, true);
  view.setUint32(8, number, true);
  new Int16Array(message, HEADER).set(samples);
  link.socket.send(message);
}

// What is wrong: the name of a text and what is in it; null: nothing.
function look() {
  const here = performance.now();
  if (here - heard > SILENT) return ["silent"];
  if (here - link.answered() > SILENT) return ["unanswered"];
  if (link.unheard()) return ["unheard", link.unheard()];
  return here - lostAt < LATELY ? ["slow", lost.toFixed(1)] : null;
}

onmessage = ({ data }) => {
  if (data.place) {
    link = timed(data.place, { patience: SEAT_KEPT, ended: (reason) => postMessage({ ended: reason }) });
    setInterval(() => postMessage({ wrong: look() }), LOOK);
  } else {
    ({ rate, latency } = data);
    data.port.onmessage = (sound) => send(sound.data);
  }
};
