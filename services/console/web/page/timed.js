// A link for sound or pictures, and the window's clock as this page knows it: what goes over it is told with its instants.
const ASKED = [0, 50, 100, 200, 400, 800]; // ms after the link is open at which the time is asked
const EVERY = 500; // ms between two questions after that
const KEPT = 40; // answers of which the quickest counts: 20 s
const APART = 0.05; // seconds by which the clocks may drift apart meanwhile; what differs more has jumped: one of the machines was asleep
const AGAIN = 1000; // ms from a broken link to the next try

// address: of the WebSocket, as of a page. patience: ms for which a link that breaks without a word of the window is made again. ready: it stands, also again. heard: gets what
// comes in bytes. broken: it is made again. ended: gets why it is not, in words; empty: patience is over.
export function timed(address, { patience, ready = () => {}, heard = () => {}, broken = () => {}, ended }) {
  const place = new URL(address);
  place.protocol = place.protocol.replace("http", "ws");
  let socket = null;
  let answers = []; // how far the window's clock is ahead of ours, and how long the answer took, in seconds
  let answered = performance.now();
  let unheard = "";
  const best = () => answers.reduce((one, other) => (other.took < one.took ? other : one));

  function open() {
    const own = (socket = new WebSocket(place));
    const timers = [];
    own.binaryType = "arraybuffer";
    const ask = () => own.readyState === WebSocket.OPEN && own.send(JSON.stringify({ asked: performance.now() / 1000 }));
    own.onopen = () => {
      for (const at of ASKED) timers.push(setTimeout(ask, at));
      timers.push(setInterval(ask, EVERY));
    };
    own.onmessage = ({ data }) => {
      if (typeof data !== "string") return heard(data);
      answered = performance.now();
      const here = answered / 1000;
      const { asked, now, unheard: reason = "" } = JSON.parse(data);
      unheard = reason;
      const isFirst = !answers.length;
      const answer = { ahead: now - (asked + here) / 2, took: here - asked };
      if (answers.length && Math.abs(answer.ahead - best().ahead) > (answer.took + best().took) / 2 + APART) answers = [];
      answers.push(answer);
      if (answers.length > KEPT) answers.shift();
      if (isFirst) ready();
    };
    own.onclose = ({ reason }) => {
      timers.forEach(clearInterval);
      answers = []; // there may be another window next time
      if (reason || performance.now() - answered > patience) return ended(reason);
      broken();
      setTimeout(open, AGAIN);
    };
  }
  open();
  const ahead = () => (answers.length ? best().ahead : null);
  return {
    get socket() {
      return socket;
    },
    // Seconds of the window's clock for a time of ours in ms, and the other way; null: it is not known now.
    there: (ms) => (ahead() === null ? null : ms / 1000 + ahead()),
    here: (seconds) => (ahead() === null ? null : (seconds - ahead()) * 1000),
    unheard: () => unheard, // why nobody hears what is sent
    answered: () => answered, // when the window answered last, in ms
  };
}
// The window keeps a seat for so long whose page's link is broken, in ms: as long goes on what comes from who sits there.
export const SEAT_KEPT = 20000;
