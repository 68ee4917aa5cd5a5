// The camera of the one who sits at this page. Its pictures go to a worker of this page, and no further.
import { device } from "./device.js";

const RATE = 15; // pictures in a second

// session, face: as of a device. face.level: gets 1 while somebody is seen, else 0.
export const camera = (session, face) => device({
  wants: { video: { width: { ideal: 640 }, height: { ideal: 480 }, frameRate: { ideal: RATE }, facingMode: "user" } },
  has: () => window.VideoFrame && window.OffscreenCanvas,
  worker: "page/camera-link.js",
  isModule: false, // the runtime of the models is a script
  link: "camera",
  begin: look,
  end: ({ video }) => video && (video.srcObject = null),
}, session, face);

async function look(own, track) {
  if (window.MediaStreamTrackProcessor) {
    const { readable } = new MediaStreamTrackProcessor({ track, maxBufferSize: 1 }); // past this page, whatever it does meanwhile
    own.worker.postMessage({ pictures: readable, rate: RATE }, [readable]);
    return;
  }
  own.video = Object.assign(document.createElement("video"), { muted: true, playsInline: true, srcObject: own.stream });
  await own.video.play();
  const wait = () => own.video.requestVideoFrameCallback((now, { captureTime = now }) => {
    if (!own.video.srcObject) return;
    const picture = new VideoFrame(own.video, { timestamp: 0 });
    own.worker.postMessage({ picture, taken: performance.timeOrigin + captureTime, rate: RATE }, [picture]);
  });
  own.worker.addEventListener("message", ({ data }) => data.next && wait()); // the newest, once the last one was looked at
  wait();
}
