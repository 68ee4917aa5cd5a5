"""A link that can be cut, for sessions that know each other only through it."""

import asyncio
import contextlib

from tests.bus.places import free_endpoint


class Cable:
    """A TCP proxy that can be cut: connections break, new ones are refused, until it is joined."""

    def __init__(self, end: str) -> None:
        self.endpoint = free_endpoint()
        self._end = end.removeprefix("tcp/").split(":")
        self._writers: set[asyncio.StreamWriter] = set()
        self._pumps: set[asyncio.Task[None]] = set()
        self._server: asyncio.Server | None = None

    async def join(self) -> None:
        host, port = self.endpoint.removeprefix("tcp/").split(":")
        self._server = await asyncio.start_server(self._connect, host, int(port))

    async def _connect(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        far_reader, far_writer = await asyncio.open_connection(*self._end)
        self._writers |= {writer, far_writer}
        for source, sink in ((reader, far_writer), (far_reader, writer)):
            self._pumps.add(asyncio.create_task(self._pump(source, sink), name="pump"))

    async def _pump(self, source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError):
            while data := await source.read(65536):
                sink.write(data)
                await sink.drain()
        sink.close()

    async def cut(self) -> None:
        assert self._server is not None
        self._server.close()
        for writer in self._writers:
            writer.transport.abort()
        for pump in self._pumps:
            pump.cancel()
        await asyncio.gather(*self._pumps, return_exceptions=True)
        self._writers, self._pumps = set(), set()
