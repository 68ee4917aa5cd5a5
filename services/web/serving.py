"""Server of an application over HTTP and WebSockets, on the loop of the process."""

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import uvicorn

from engage_hri.services.web.guard import App

LARGEST_TEXT = 2**16
"""Bytes of one text that comes over a WebSocket."""


class _Quiet(uvicorn.Server):
    """The server without its own ways with signals: the process has its own. stands: set when it serves."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self.stands = asyncio.Event()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self.stands.set()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Wait for no connection, but let the application end in order: its task would be left behind."""
        await super().shutdown(sockets)
        if self.force_exit:
            await self.lifespan.shutdown()

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


@contextlib.asynccontextmanager
async def serving(app: App, host: str, port: int, keys: tuple[Path, Path] | None = None) -> AsyncIterator[int]:
    """Serve while the body of `async with` runs. port: 0: any that is free. Returns the port.

    keys: files of a certificate and of its private key, to speak TLS. Raises OSError if the port is taken.
    """
    certificate, private = keys or (None, None)
    # With a configuration of its own for the log, it would close the handlers of ours.
    config = uvicorn.Config(
        app, log_config=None, log_level="warning", access_log=False, lifespan="on", timeout_graceful_shutdown=1,
        ws="websockets-sansio", ws_per_message_deflate=False, ws_max_size=LARGEST_TEXT,
        ssl_certfile=certificate, ssl_keyfile=private,
    )  # fmt: skip
    listening = _bound(host, port)
    server = _Quiet(config)
    running = asyncio.create_task(server.serve(sockets=[listening]), name="web server")
    try:
        standing = asyncio.create_task(server.stands.wait())
        await asyncio.wait((standing, running), return_when=asyncio.FIRST_COMPLETED)
        standing.cancel()
        if running.done():
            running.result()
        yield listening.getsockname()[1]
    finally:
        server.should_exit = True
        server.force_exit = True
        await asyncio.wait([running])
        if server.stands.is_set():  # an end by force leaves this out, and the loop then ends it by a traceback
            await server.lifespan.shutdown()


def _bound(host: str, port: int) -> socket.socket:
    """A socket that listens there. Raises OSError if it cannot."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    return socket.create_server((host, port), family=family)
