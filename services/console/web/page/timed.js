// A link for sound, and the window's clock as this page knows it: sound is told with its instants.
const ASKED = [0, 50, 100, 200, 400, 800]; // ms after the link is open at which the time is asked
const EVERY = 500; // ms between two questions after that
const KEPT = 40; // answers of which the quickest counts: 20 s

// address: of the WebSocket, as of a page. heard: gets what comes in bytes. ended: gets why it has closed, in words; empty: unknown.
export function timed(address, { ready = () => {}, heard = () => {}, ended }) {
  const place = new URL(address);
  place.protocol = place.protocol.replace("http", "ws");
  const socket = new WebSocket(place);
  socket.binaryType = "arraybuffer";
  const answers = []; // how far the window's clock is ahead of ours, and how long the answer took, in seconds
  const timers = [];
  let answered = performance.now();
  let unheard = "";
  const ask = () => socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify({ asked: performance.now() / 1000 }));
  socket.onopen = () => {
    for (const at of ASKED) timers.push(setTimeout(ask, at));
    timers.push(setInterval(ask, EVERY));
  };
  socket.onmessage = ({ data }) => {
    if (typeof data !== "string") return heard(data);
    answered = performance.now();
    const here = answered / 1000;
    const { asked, now, unheard: reason = "" } = JSON.parse(data);
    unheard = reason;
    answers.push({ ahead: now - (asked + here) / 2, took: here - asked });
    if (answers.length > KEPT) answers.shift();
    if (answers.length === 1) ready();
  };
  socket.onclose = (event) => {
    timers.forEach(clearInterval);
    ended?.(event.reason);
  };
  const ahead = () => (answers.length ? answers.reduce((one, other) => (other.took < one.took ? other : one)).ahead : null);
  return {
    socket,
    // Seconds of the window's clock for a time of ours in ms, and the other way; null: it is not known yet.
    there: (ms) => (ahead() === null ? null : ms / 1000 + ahead()),
    here: (seconds) => (ahead() === null ? null : (seconds - ahead()) * 1000),
    unheard: () => unheard, // why nobody hears what is sent
    answered: () => answered, // when the window answered last, in ms
    close() {
      ended = null;
      socket.close(1000);
    },
  };
}
