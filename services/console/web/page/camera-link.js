// A worker: finds faces in the pictures of a camera, and sends their points to the window with the instant of each picture. No picture leaves it.
const HEADER = 17; // bytes: the instant, the number of the picture, its width and height, and the number of faces
const POINTS = 468;
const FACE = 4 + POINTS * 3 * 2; // bytes: the confidence, and the points
const EIGHTHS = 8; // steps in a pixel
const MOST = 4; // faces at once
const FULL = 20 * FACE; // bytes that may wait for the link; what is seen then is lost
const SILENT = 1500; // ms without any picture, or any word from the window, after which something is wrong
const LOOK = 250; // ms between two looks at how it goes
const ALONE = 2000; // ms without a face after which that is told
const LAG = 30; // pictures, two seconds, of which the one that came quickest says how the clock of the camera stands
const EARLY = 300; // ms, by the pictures in a second, by which one may come too early
const WIDEST = 1280; // pixels; a larger picture is made smaller
const [BLACK, GLIMMER, SPREAD] = [6, 40, 97]; // as in sources/pictures.py: mean and brightest of a black picture; every how many bytes are looked at
const place = (path) => new URL(path, self.location.href);
const canvas = new OffscreenCanvas(1, 1);
const drawing = canvas.getContext("2d", { willReadFrequently: true });

let link = null;
let find = null; // null: the models are being loaded
let came = performance.now(); // when there was a picture last that can be looked at
let blind = null; // why the last one cannot: black, frozen
let seen = performance.now(); // when there was a face last
let due = -Infinity;
let number = 0;
let before = 0; // of the last picture, by which one that is the same is known
const lags = [];

// What no camera gives twice: no noise is the same.
function blindness({ data }) {
  let [sum, most, count, print] = [0, 0, 0, 0];
  for (let at = 0; at < data.length; at += SPREAD) {
    if (at % 4 === 3) continue; // how opaque it is
    sum += data[at];
    most = Math.max(most, data[at]);
    count += 1;
    print = (Math.imul(print, 31) + data[at]) | 0;
  }
  const isSame = print === before;
  before = print;
  return sum / count < BLACK && most < GLIMMER ? "black" : isSame ? "frozen" : null;
}

// taken: when, in ms of our clock; undefined: its own clock says when, which began at some time.
function look(picture, taken, rate) {
  const here = performance.now();
  const own = picture.timestamp / 1000;
  lags.push(here - own);
  if (lags.length > LAG) lags.shift();
  const at = taken ?? own + Math.min(...lags);
  if (!find || at < due - EARLY / rate) return picture.close();
  due = Math.max(due + 1000 / rate, at);
  const scale = Math.min(1, WIDEST / picture.displayWidth);
  const [width, height] = [picture.displayWidth, picture.displayHeight].map((each) => Math.round(each * scale));
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  drawing.drawImage(picture, 0, 0, width, height);
  picture.close();
  const pixels = drawing.getImageData(0, 0, width, height);
  blind = blindness(pixels);
  if (blind) return;
  const faces = find(pixels);
  came = performance.now();
  if (faces.length) seen = came;
  postMessage({ level: Number(faces.length > 0) });
  send(link.there(at), width, height, faces);
}

function send(at, width, height, faces) {
  number += 1;
  if (at === null || link.socket.readyState !== WebSocket.OPEN || link.socket.bufferedAmount > FULL) return; // old points are of no use
  const message = new ArrayBuffer(HEADER + FACE * faces.length);
  const view = new DataView(message);
  view.setFloat64(0, at, true);
  view.setUint32(8, number, true);
  view.setUint16(12, width, true);
  view.setUint16(14, height, true);
  view.setUint8(16, faces.length);
  faces.forEach(({ points, confidence }, index) => {
    const begin = HEADER + FACE * index;
    view.setFloat32(begin, confidence, true);
    points.forEach((value, each) => view.setInt16(begin + 4 + 2 * each, Math.max(-32768, Math.min(32767, Math.round(value * EIGHTHS))), true));
  });
  link.socket.send(message);
}

// What is wrong: the name of a text and what is in it; null: nothing.
function wrong() {
  const here = performance.now();
  if (!find) return ["loading"];
  if (here - came > SILENT) return [blind ?? "silent"];
  if (here - link.answered() > SILENT) return ["unanswered"];
  if (link.unheard()) return ["unheard", link.unheard()];
  return here - seen > ALONE ? ["alone"] : null;
}

async function begin(address) {
  const [{ SEAT_KEPT, timed }, { finder }, { models }] = await Promise.all(["timed.js", "faces.js", "models.js"].map((name) => import(place(name))));
  link = timed(address, { patience: SEAT_KEPT, ended: (reason) => postMessage({ ended: reason }) });
  setInterval(() => postMessage({ wrong: wrong() }), LOOK);
  try {
    importScripts(place("../eyes/litert_wasm_compat_internal.js"));
    const [detect, mesh] = await models(self.ModuleFactory, place("../eyes/"), ["face_detection_short_range.tflite", "face_landmark.tflite"]);
    const own = finder(detect, mesh, MOST).find;
    own({ width: 160, height: 120, data: new Uint8Array(4 * 160 * 120) }); // the first time takes seconds, in which pictures would wait
    find = own;
    came = seen = performance.now();
  } catch (error) {
    console.warn(error);
    postMessage({ ended: "models" });
  }
}

onmessage = async ({ data }) => {
  if (data.place) return begin(data.place);
  if (data.picture) {
    look(data.picture, data.taken - performance.timeOrigin, data.rate);
    return postMessage({ next: true });
  }
  const reader = data.pictures.getReader();
  for (let next = await reader.read(); !next.done; next = await reader.read()) look(next.value, undefined, data.rate);
};
