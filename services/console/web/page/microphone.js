// The microphone of the one who sits at this page: on at a press, with a light, and off at the next. Never unasked.
const RATE = 16000;

const GONE = (words) => words.off(words.gone);

// Why no page at this address can have a microphone, in words; null: it can.
function lacking() {
  if (navigator.mediaDevices?.getUserMedia && window.AudioWorkletNode) return null;
  return (words) => words.none(isSecureContext ? words.unable : words.plain);
}

// session: gives that of the page's link to the window. face.show: gets the state (off, asked, on), and news: what is to be
// told, made of words in a language, or null; isLacking: it could not be had when it was pressed. face.level: gets how loud it is, 0 to 1, while it is on.
export function microphone(session, face) {
  let on = null; // what is open while it is on, or asked for
  let news = null;
  let isLacking = false; // it could not be had at the last press

  const show = () => face.show({ state: on === null ? "off" : on.ear ? "on" : "asked", news, isLacking });
  function tell(what) {
    news = what;
    show();
  }
  function off(what = null) {
    if (on === null && what === null) return;
    const { stream, context, worker } = on ?? {};
    on = null;
    stream?.getTracks().forEach((track) => track.stop());
    context?.close();
    worker?.terminate(); // and with it the link
    face.level(0);
    tell(what);
  }
  const failed = (reason) => off((words) => words.off(reason(words)));

  async function begin() {
    const own = (on = {});
    tell((words) => words.asks);
    let stream;
    try {
      stream = await navigator.mediaDevices.getUserMedia({ audio: { channelCount: 1, echoCancellation: true } });
    } catch (error) {
      if (on !== own) return;
      isLacking = true;
      failed((words) => words[error.name] ?? error.message);
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
    own.worker = new Worker(new URL("page/microphone-link.js", document.baseURI), { type: "module" });
    own.worker.onerror = () => on === own && failed((words) => words.worker);
    own.worker.onmessage = ({ data }) => on === own && take(data, track);
    own.worker.postMessage({ place: new URL(`microphone?session=${encodeURIComponent(session())}`, document.baseURI).href });
    own.context = context(own.stream);
    await own.context.audioWorklet.addModule(new URL("page/ear.js", document.baseURI));
    if (on !== own) return;
    own.ear = new AudioWorkletNode(own.context, "ear", { numberOfOutputs: 0 });
    const { port1, port2 } = new MessageChannel();
    own.ear.port.postMessage(port1, [port1]);
    own.worker.postMessage({ port: port2, rate: own.context.sampleRate, latency: 1000 * (track.getSettings().latency ?? 0) }, [port2]);
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

  // What the worker tells: how loud it is, what is wrong, or that the link has ended.
  function take({ level, wrong, ended }, track) {
    if (level !== undefined) return face.level(level);
    if (ended !== undefined) return failed((words) => ended || words.broken);
    if (track.readyState === "ended") return off(GONE);
    const [name, about] = wrong ?? (track.muted ? ["muted"] : []);
    tell(name ? (words) => (about === undefined ? words[name] : words[name](about)) : null);
  }

  document.addEventListener("visibilitychange", () => {
    if (document.hidden && on) off((words) => words.hidden);
  });
  show();
  return {
    off: () => off(),
    press() {
      const reason = lacking();
      if (on) return off();
      isLacking = Boolean(reason);
      if (reason) tell(reason);
      else begin();
    },
  };
}
