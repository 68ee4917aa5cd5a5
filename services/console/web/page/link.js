// The WebSocket with frames. The next one comes only when we say that we have drawn the last.
const AGAIN = 1000; // ms from a broken link to the next try
const SILENCE = 4000; // ms without any frame after which the window is away
const DEAD = 15000; // ms without any frame after which the link is given up: that of a computer that has slept, or changed its network, never ends by itself

export function follow(take, tell) {
  let socket = null;
  let ended = false;
  let heard = performance.now();
  let reason = ""; // why the window has closed the link itself

  function open() {
    const own = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/frames${location.search}`);
    socket = own;
    let isFirst = true;
    own.onmessage = (message) => {
      if (own !== socket) return;
      heard = performance.now();
      reason = "";
      tell(true);
      take(JSON.parse(message.data), isFirst);
      isFirst = false;
      requestAnimationFrame(() => own.readyState === WebSocket.OPEN && own.send('{"do":"drawn"}'));
    };
    own.onclose = (event) => {
      if (ended || own !== socket) return;
      reason = event.reason;
      tell(false, reason);
      setTimeout(open, AGAIN);
    };
  }
  const watch = setInterval(() => {
    const silent = performance.now() - heard;
    if (document.hidden || silent < SILENCE) return;
    tell(false, reason);
    if (silent < DEAD || socket.readyState > WebSocket.OPEN) return; // closed: it is opened again already
    heard = performance.now();
    socket.close();
    open();
  }, 1000);
  const shown = () => (heard = performance.now()); // a hidden page has drawn nothing, and so got nothing
  document.addEventListener("visibilitychange", shown);
  open();
  return {
    send(order) {
      if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(order));
    },
    end() {
      ended = true;
      clearInterval(watch);
      document.removeEventListener("visibilitychange", shown);
      socket.close();
    },
  };
}
