// The microphone of the one who sits at this page.
import { device } from "./device.js";

const RATE = 16000;

// session, face: as of a device. face.level: gets how loud it is.
export const microphone = (session, face) => device({
  wants: { audio: { channelCount: 1, echoCancellation: true } },
  has: () => window.AudioWorkletNode,
  worker: "page/microphone-link.js",
  isModule: true,
  link: "microphone",
  begin: listen,
  end: ({ context }) => context?.close(),
}, session, face);

async function listen(own, track) {
  own.context = context(own.stream);
  await own.context.audioWorklet.addModule(new URL("page/ear.js", document.baseURI));
  if (own.context.state === "closed") return; // it was switched off meanwhile
  const ear = new AudioWorkletNode(own.context, "ear", { numberOfOutputs: 0 });
  const { port1, port2 } = new MessageChannel();
  ear.port.postMessage(port1, [port1]);
  own.worker.postMessage({ port: port2, rate: own.context.sampleRate, latency: 1000 * (track.getSettings().latency ?? 0) }, [port2]);
  new MediaStreamAudioSourceNode(own.context, { mediaStream: own.stream }).connect(ear);
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
