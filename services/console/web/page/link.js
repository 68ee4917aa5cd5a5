// The WebSocket with frames. The next one comes only when we say that we have drawn the last.
const AGAIN = 1000; // ms from a broken link to the next try
const LOOK = 1000; // ms between two looks at whether frames come
const SILENCE = 4; // looks without any frame after which the window is away
const DEAD = 15; // looks without any frame after which the link is given up: that of a computer that changes its network never ends by itself

export function follow(take, tell) {
  let socket = null;
  let ended = false;
  let silent = 0; // looks since the last frame: time in which this page does not run, as that of a computer that sleeps, does not count
  let reason = ""; // why the window has closed the link itself

  function open() {
    const own = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/frames${location.search}`);
    socket = own;
    let isFirst = true;
    own.onmessage = (message) => {
      if (own !== socket) return;
      silent = 0;
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
    if (document.hidden) return (silent = 0); // it draws nothing, and so gets nothing
    silent += 1;
    if (silent < SILENCE) return;
    tell(false, reason);
    if (silent < DEAD || socket.readyState > WebSocket.OPEN) return; // closed: it is opened again already
    silent = 0;
    socket.close();
    open();
  }, LOOK);
  open();
  return {
    send(order) {
      if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(order));
    },
    end() {
      ended = true;
      clearInterval(watch);
      socket.close();
    },
  };
}
