"""WebSockets of programs and pages: what comes over one as text, and messages that go out."""

import asyncio

from starlette.websockets import WebSocket, WebSocketDisconnect

from engage_hri.services.web.outbox import Outbox

NO_TEXT = 1003
"""Code of RFC 6455 with which a WebSocket is closed that sends bytes."""


async def text_of(socket: WebSocket) -> str:
    """Wait for a text. Raises WebSocketDisconnect when the other side has gone, or sends something else."""
    message = await socket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message["code"])
    text = message.get("text")
    if text is None:
        await socket.close(NO_TEXT, "send text, not bytes")
        raise WebSocketDisconnect(NO_TEXT)
    return str(text)


async def sent(program: WebSocket, outbox: Outbox, news: asyncio.Event) -> None:
    """Send what is in the outbox, until the program has gone. Raises WebSocketDisconnect then.

    news: set whenever something was put there. What the program says means nothing.
    """

    async def listen() -> None:
        while True:
            await text_of(program)

    listening = asyncio.create_task(listen(), name="program")
    try:
        while not listening.done():
            waiting = asyncio.ensure_future(news.wait())
            await asyncio.wait((waiting, listening), return_when=asyncio.FIRST_COMPLETED)
            waiting.cancel()
            news.clear()
            for text in outbox.take():
                await program.send_text(text)
        listening.result()
    finally:
        listening.cancel()
