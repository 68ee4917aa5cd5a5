// A worker: takes the robot's voice from the window, and hands it on to where it sounds, whatever the page does meanwhile.
import { timed } from "./timed.js";

const HEADER = 16; // bytes: the instant, the number of the frame, and the samples per second
const WAITING = 64; // pieces that wait until it is known where they sound

let link = null;
let port = null; // to the one that plays, at its rate
let rate = 0;
let stands = null; // a time of the context, in seconds, and when it is heard, in ms of our clock
let waiting = [];

function heard(data) {
  const head = new DataView(data);
  const samples = Float32Array.from(new Int16Array(data.slice(HEADER)), (each) => each / 32768);
  waiting.push({ at: head.getFloat64(0, true), rate: head.getUint32(12, true), samples });
  if (waiting.length > WAITING) waiting.shift();
  flush();
}

function flush() {
  while (waiting.length) {
    const [{ at, rate: needed, samples }] = waiting;
    if (samples.length && needed !== rate) return postMessage({ rate: needed });
    const here = link.here(at);
    if (!port || !stands || here === null) return;
    waiting.shift();
    port.postMessage({ at, place: stands.time + (here - stands.ms) / 1000, samples }, [samples.buffer]);
  }
}

onmessage = ({ data }) => {
  if (data.place) {
    link = timed(data.place, {
      patience: Infinity, // a browser lets a page sound after a press only, so what was pressed once stays on
      heard,
      broken: () => postMessage({ broken: true }),
      ready: () => postMessage({ ready: true }),
      ended: (reason) => postMessage({ ended: reason }),
    });
  } else if (data.port) {
    [port, rate, stands] = [data.port, data.rate, null];
  } else if (data.stands) {
    const [time, ms] = data.stands;
    stands = { time, ms: ms - performance.timeOrigin };
    flush();
  }
};
