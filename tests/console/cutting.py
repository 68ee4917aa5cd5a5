"""A TCP proxy whose links are cut: at random instants, in the middle of anything, for a moment or for long."""

import asyncio
import random
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress


class Cutter:
    """The proxy. cuts: number of times that all links were cut."""

    def __init__(self, upstream: int, rng: random.Random) -> None:
        self._upstream = upstream
        self._rng = rng
        self._writers: set[asyncio.StreamWriter] = set()
        self._serving: set[asyncio.Task[None]] = set()
        self.is_down = False
        self.is_stuck = False
        self.cuts = 0

    def cut(self) -> None:
        """Cut all links, without a word to either side."""
        self.cuts += 1
        for writer in list(self._writers):
            writer.transport.abort()

    async def cut_at_random(self, pause: float, longest: float) -> None:
        """Cut again and again. pause: mean seconds between two cuts. longest: of the time without any link."""
        while True:
            await asyncio.sleep(self._rng.expovariate(1 / pause))
            self.is_stuck = self._rng.random() < 0.5  # bytes that were sent are lost with the link
            if self.is_stuck:
                await asyncio.sleep(self._rng.random() * 0.4)
            self.is_down = True
            self.cut()
            self.is_stuck = False
            await asyncio.sleep(self._rng.random() ** 4 * longest)
            self.is_down = False

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one link."""
        task = asyncio.current_task()
        assert task is not None
        self._serving.add(task)
        try:
            await self._serve(reader, writer)
        finally:
            self._serving.discard(task)

    async def end(self) -> None:
        """Cut all links, and wait until nothing serves them."""
        self.is_down = True
        self.cut()
        while self._serving:
            await asyncio.wait(self._serving)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self.is_down:
            writer.transport.abort()
            return
        there, to = await asyncio.open_connection("127.0.0.1", self._upstream)
        self._writers |= {writer, to}
        try:
            await asyncio.gather(self._pump(reader, to), self._pump(there, writer))
        finally:
            self._writers -= {writer, to}

    async def _pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            while data := await reader.read(65536):
                if self.is_stuck:
                    data = data[: self._rng.randrange(len(data) + 1)]
                    writer.write(data)
                    await asyncio.sleep(0.5)  # the rest is never delivered: the link is cut before
                    break
                writer.write(data)
                await writer.drain()
        writer.transport.abort()


@asynccontextmanager
async def cutting(upstream: int, seed: int) -> AsyncIterator[tuple[Cutter, int]]:
    """A proxy before a port of this machine. Gives it and its own port."""
    cutter = Cutter(upstream, random.Random(seed))
    async with await asyncio.start_server(cutter.serve, "127.0.0.1", 0) as server:
        try:
            yield cutter, server.sockets[0].getsockname()[1]
        finally:
            await cutter.end()
