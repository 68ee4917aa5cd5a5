// A device of the one who sits at this page, as a microphone: on at a press, with a light, and off at the next. Never unasked.

// kind.wants: what the browser is asked for. kind.has: whether this browser has what that needs. kind.worker: the script of the worker that sends to the window,
// and kind.isModule: as a module. kind.link: place of its link there. kind.begin: gets what is open (its stream and worker), the track, and what tells that it is on.
// kind.end: gets what was open. session: gives that of the page's link to the window.
// face.show: gets the state (off, asked, on), and news: what is to be told, made of words in a language, or null; isLacking: no page at this address can have it, it could not be had since it was last pressed, or it has ended by itself.
// face.level: gets how strong what it gives is, 0 to 1, while it is on.
export function device(kind, session, face) {
  let on = null; // what is open while it is on, or asked for
  let news = null;
  let isLacking = false; // it could not be had since the last press, or has ended by itself
  let isCut = false; // it has ended as its link was away for too long: it is on again by itself with the link

  // Why no page at this address can have it, in words; null: it can.
  const lacking = () => (navigator.mediaDevices?.getUserMedia && kind.has() ? null : (words) => words.none(isSecureContext ? words.unable : words.plain));
  const show = () => face.show({ state: on === null ? "off" : on.isOn ? "on" : "asked", news, isLacking: isLacking || lacking() !== null });
  function tell(what) {
    news = what;
    show();
  }
  function off(what = null, why = {}) {
    if (on === null && what === null && !isLacking && !isCut) return;
    const was = on ?? {};
    on = null;
    ({ isLacking = false, isCut = false } = why);
    was.stream?.getTracks().forEach((track) => track.stop());
    was.worker?.terminate(); // and with it the link
    kind.end(was);
    face.level(0);
    tell(what);
  }
  const failed = (reason, why) => off((words) => words.off(reason(words)), why);
  const gone = () => failed((words) => words.gone);

  async function begin() {
    const own = (on = {});
    isLacking = isCut = false;
    tell((words) => words.asks);
    let stream;
    try {
      stream = await navigator.mediaDevices.getUserMedia(kind.wants);
    } catch (error) {
      if (on !== own) return;
      failed((words) => words[error.name] ?? error.message, { isLacking: true });
      return;
    }
    if (on !== own) return stream.getTracks().forEach((track) => track.stop());
    own.stream = stream;
    const [track] = stream.getTracks();
    track.onended = () => on === own && gone();
    try {
      tell(null);
      own.worker = new Worker(new URL(kind.worker, document.baseURI), { type: kind.isModule ? "module" : "classic" });
      own.worker.onerror = () => on === own && failed((words) => words.worker);
      own.worker.onmessage = ({ data }) => on === own && take(data, track);
      own.worker.postMessage({ place: new URL(`${kind.link}?session=${encodeURIComponent(session())}`, document.baseURI).href });
      await kind.begin(own, track);
      if (on !== own) return;
      own.isOn = true;
      show();
    } catch (error) {
      if (on === own) failed(() => error.message);
    }
  }

  // What the worker tells: how strong it is, what is wrong, or that it has ended, with the name of a text or words.
  function take({ level, wrong, ended }, track) {
    if (level !== undefined) return face.level(level);
    if (ended !== undefined) return failed((words) => words[ended] ?? (ended || words.broken), { isLacking: Boolean(ended), isCut: !ended });
    if (wrong === undefined) return;
    if (track.readyState === "ended") return gone();
    const [name, about] = wrong ?? (track.muted ? ["muted"] : []);
    tell(name ? (words) => (about === undefined ? words[name] : words[name](about)) : null);
  }

  document.addEventListener("visibilitychange", () => {
    if (document.hidden && on) off((words) => words.hidden);
  });
  show();
  return {
    // The seat was left.
    off: () => off(),
    // The window answers, and the one who pressed has their seat.
    back: () => isCut && !document.hidden && begin(),
    press() {
      const reason = lacking();
      if (on) return off();
      isLacking = Boolean(reason);
      if (reason) tell(reason);
      else begin();
    },
  };
}
