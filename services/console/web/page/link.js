// The link to the window: frames come, one when we say that we have drawn the last, and orders go.
import { early } from "./early.js";
import { KEPT, linkTo } from "./place.js";
import { queue } from "./queue.js";

const AGAIN = 1000; // ms from a broken link to the next try
const LOOK = 250; // ms between two looks at how the link is
const SILENCE = 16; // looks without any frame after which the window is away
const DEAD = 60; // looks without any frame after which the link is given up: that of a computer that changes its network never ends by itself
const NOTED = 0.5; // seconds after which an order without an answer is shown
const SHUTS = 1012; // code of RFC 6455 with which a window ends the links of all pages as it is shut
export const ENDED = "the window has ended"; // the reason in this case, until there is a window again
const LEAVES = 4001; // code with which the link of a page ends that may be loaded anew: its session stays for a while
const OVER = 1000; // and of one that is over: its session ends
const clock = () => Date.now() / 1000; // goes on while a computer sleeps

// take: gets each frame, and whether it is the first of a link. tell: whether the window is there, and why not. report: what was not done. wait: names of orders without an answer.
export function follow({ take, tell, report, wait }) {
  let socket = null;
  let ended = false;
  let silent = 0; // looks since the last frame: time in which this page does not run, as that of a computer that sleeps, does not count
  let reason = ""; // why the window has closed the link itself
  let told = 0; // number of the last news of orders
  let last = null; // the last frame's time and ours, once the link is open
  const orders = queue(JSON.parse(sessionStorage.getItem(KEPT) ?? "null"));
  sessionStorage.removeItem(KEPT); // with the orders that were left over

  const say = (reports) => reports.length && report(reports);
  function flush() {
    if (last === null || socket.readyState !== WebSocket.OPEN) return;
    say(orders.expire(clock()));
    for (const message of orders.next(last)) socket.send(message);
  }

  function open() {
    const own = new WebSocket(linkTo(orders.session));
    socket = own;
    last = null;
    own.onmessage = (message) => {
      if (own !== socket) return;
      const frame = JSON.parse(message.data);
      const isFirst = last === null;
      silent = 0;
      reason = "";
      last = { frame: frame.now, heard: clock() };
      early?.close(); // this link has taken its place
      if (isFirst && frame.session !== orders.session) told = 0;
      frame.told = frame.told?.filter((each) => each.number > told);
      told = frame.told?.at(-1)?.number ?? told;
      for (const each of frame.told ?? []) each.text = orders.refusal(each); // before it is known to be taken, and forgotten
      if (isFirst) say(orders.open(frame.session, frame.taken));
      else if (frame.taken !== undefined) orders.taken(frame.taken);
      tell(true);
      take(frame, isFirst);
      flush();
      requestAnimationFrame(() => own.readyState === WebSocket.OPEN && own.send('{"do":"drawn"}'));
    };
    own.onclose = (event) => {
      if (ended || own !== socket) return;
      reason = event.code === SHUTS || reason === ENDED ? ENDED : event.reason;
      last = null;
      if (reason) tell(false, reason);
      setTimeout(() => own === socket && open(), AGAIN);
    };
  }
  const watch = setInterval(() => {
    say(orders.expire(clock()));
    wait(orders.pending(clock() - NOTED));
    if (document.hidden && socket.readyState === WebSocket.OPEN) return (silent = 0); // it draws nothing, and so gets nothing
    silent += 1;
    if (silent < SILENCE) return;
    tell(false, reason);
    if (silent < DEAD || socket.readyState > WebSocket.OPEN) return; // closed: it is opened again already
    silent = 0;
    socket.close();
    open();
  }, LOOK);
  function end(code) {
    ended = true;
    clearInterval(watch);
    socket.close(code);
  }
  // Only while it is away is the session written down: a second tab that copies this one is somebody else.
  addEventListener("pagehide", () => {
    if (ended) return;
    sessionStorage.setItem(KEPT, JSON.stringify(orders.kept()));
    end(LEAVES);
  });
  addEventListener("pageshow", ({ persisted }) => persisted && location.reload()); // its link has ended
  open();
  return {
    get session() {
      return orders.session;
    },
    // Nobody who comes after this page has its seat.
    end: () => end(OVER),
    send(order) {
      say(orders.give(order, clock()));
      flush();
    },
  };
}
