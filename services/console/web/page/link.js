// The WebSocket with frames. The next one comes only when we say that we have drawn the last.
const AGAIN = 1000; // ms from a broken link to the next try
const SILENCE = 4000; // ms without any frame after which the window is away

export function follow(take, tell) {
  let socket = null;
  let ended = false;
  let heard = performance.now();

  function open() {
    socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/frames${location.search}`);
    let isFirst = true;
    socket.onopen = () => tell(true);
    socket.onmessage = (message) => {
      heard = performance.now();
      tell(true);
      take(JSON.parse(message.data), isFirst);
      isFirst = false;
      requestAnimationFrame(() => socket.readyState === WebSocket.OPEN && socket.send('{"do":"drawn"}'));
    };
    socket.onclose = () => {
      if (ended) return;
      tell(false);
      setTimeout(open, AGAIN);
    };
  }
  const watch = setInterval(() => {
    if (!document.hidden && performance.now() - heard > SILENCE) tell(false);
  }, 1000);
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
