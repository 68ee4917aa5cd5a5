// The robot's voice, heard in the page in step with its words, wherever else the robot's own sound goes.
const LOOK = 200; // ms between two looks at how the clocks of page and context stand
const USUAL = 22050; // samples per second, until a voice has others
const MISSED = 0.3; // seconds of sound that came too late, from which on that is told
const LATELY = 5000; // ms for which it is told

// What plays at a rate. worker: what hands it the sound. late: gets seconds that came too late.
async function speaker(rate, worker, late) {
  const context = new AudioContext({ sampleRate: rate, latencyHint: "interactive" });
  await context.audioWorklet.addModule(new URL("page/speech.js", document.baseURI));
  const node = new AudioWorkletNode(context, "speech", { numberOfInputs: 0, outputChannelCount: [1] });
  node.connect(context.destination);
  node.port.onmessage = ({ data }) => late(data);
  const { port1, port2 } = new MessageChannel();
  node.port.postMessage(port1, [port1]);
  worker.postMessage({ port: port2, rate }, [port2]);
  return {
    context,
    look() {
      const { contextTime, performanceTime } = context.getOutputTimestamp();
      if (context.state !== "running") return;
      const heard = performanceTime > 0 ? contextTime : context.currentTime - (context.outputLatency || context.baseLatency || 0);
      worker.postMessage({ stands: [heard, performance.timeOrigin + (performanceTime || performance.now())] });
    },
  };
}

const LATE = (words) => words.late;

// show: gets the state (off, on), and news: what is to be told, made of words in a language, or null.
export function voice(show) {
  let on = null; // what is open while it is on
  let news = null;
  const tell = (what = null) => {
    news = what;
    show({ state: on ? "on" : "off", news });
  };

  async function open(own, rate) {
    if (own.rate === rate) return;
    own.rate = rate;
    own.speaker?.context.close();
    try {
      const made = await speaker(rate, own.worker, (seconds) => {
        own.missed += seconds;
        if (own.missed < MISSED) return;
        [own.missed, own.lateAt] = [0, performance.now()];
        tell(LATE);
      });
      if (on === own && own.rate === rate) own.speaker = made;
      else made.context.close();
    } catch (error) {
      if (on === own) off((words) => words.mute(error.message));
    }
  }
  function off(what) {
    on?.worker.terminate();
    on?.speaker?.context.close();
    clearInterval(on?.timer);
    on = null;
    tell(what);
  }
  function begin() {
    if (!isSecureContext) return tell((words) => words.mute(words.plain)); // without an audio worklet
    const own = (on = { missed: 0, worker: new Worker(new URL("page/voice-link.js", document.baseURI), { type: "module" }) });
    tell();
    own.worker.onmessage = ({ data }) => {
      if (on !== own) return;
      if (data.rate) open(own, data.rate);
      if (data.ready) tell();
      if (data.broken) tell((words) => words.again);
      if (data.ended) off((words) => words.mute(data.ended));
    };
    own.worker.onerror = () => on === own && off((words) => words.mute(words.worker));
    own.timer = setInterval(() => {
      if (["suspended", "interrupted"].includes(own.speaker?.context.state)) own.speaker.context.resume();
      own.speaker?.look();
      if (news === LATE && performance.now() - own.lateAt > LATELY) tell();
    }, LOOK);
    open(own, USUAL); // at the press: later a browser may not let it sound
    own.worker.postMessage({ place: new URL("voice", document.baseURI).href });
  }
  tell();
  return {
    press: () => (on ? off() : begin()),
    get isOn() {
      return on !== null;
    },
  };
}
