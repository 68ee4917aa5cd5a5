"""A process with pipes, read and written on the loop: what may block, blocks there.

What it says and is told are messages: four bytes of length, little-endian, and MessagePack.
"""

import asyncio
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any, BinaryIO

import msgspec

from engage_hri.schemas.text import printable

HEAD = 4
"""Bytes of the length before each message."""

WORDS = 2000
"""Bytes that are kept of the last that it has said on standard error."""
STEP = 65536
PATIENCE = 0.5
"""Seconds for which the loop waits at most for one that was killed: the system ends it at once, or hangs itself."""


class PipedProcess:
    """A process. It is ended by `close`, or ends by itself.

    unsent: bytes that it has still to read.
    """

    def __init__(
        self, command: Sequence[str], on_output: Callable[[bytes], None], on_end: Callable[[str], None]
    ) -> None:
        """Start it. on_output: takes what it writes. on_end: told in words that it has ended by itself.

        Raises OSError: it does not start.
        """
        self._loop = asyncio.get_running_loop()
        self._on_output, self._on_end = on_output, on_end
        self._said = b""
        self._unsent = bytearray()
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        # Not asyncio's own: it starts a thread for each child in Python 3.11. A group: Ctrl-C is for us.
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0,
            env=environment, process_group=0,
        )  # fmt: skip
        pipes = (self._process.stdin, self._process.stdout, self._process.stderr)
        self._pipes = tuple(pipe for pipe in pipes if pipe is not None)
        self._in, self._out, self._errors = (pipe.fileno() for pipe in self._pipes)
        for pipe in (self._in, self._out, self._errors):
            os.set_blocking(pipe, False)
        self._loop.add_reader(self._out, self._read)
        self._loop.add_reader(self._errors, self._hear)
        self._is_open = True

    @property
    def unsent(self) -> int:
        return len(self._unsent)

    def write(self, content: bytes) -> None:
        """Let it have some bytes; once it has ended they are lost."""
        if self._is_open:
            self._unsent += content
            self._push()

    def kill(self) -> None:
        """Let it end as if the system had ended it: `on_end` is told."""
        self._process.kill()

    def close(self) -> None:
        """End it. It has no last words."""
        if not self._is_open:
            return
        self._is_open = False
        self._loop.remove_writer(self._in)
        for pipe in (self._out, self._errors):
            self._loop.remove_reader(pipe)
        for each in self._pipes:
            with suppress(OSError):
                each.close()
        self._process.kill()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(PATIENCE)

    def _push(self) -> None:
        with suppress(BlockingIOError, BrokenPipeError):  # that it is gone is seen where it answers
            del self._unsent[: os.write(self._in, self._unsent)]
        if self._unsent:
            self._loop.add_writer(self._in, self._push)
        else:
            self._loop.remove_writer(self._in)

    def _read(self) -> None:
        with suppress(BlockingIOError):
            if more := os.read(self._out, STEP):
                self._on_output(more)
                return
            self._hear()
            with suppress(subprocess.TimeoutExpired):  # it has closed its output: mostly it ends now
                self._process.wait(0.1)
            code = self._process.poll()
            lines = [line for line in self._said.decode(errors="replace").splitlines() if line.strip()]
            words = f": {printable(lines[-1].strip())[:200]}" if lines else ""
            self.close()
            self._on_end(f"{'has closed its output' if code is None else f'has ended with code {code}'}{words}")

    def _hear(self) -> None:
        with suppress(BlockingIOError):
            while more := os.read(self._errors, STEP):
                self._said = (self._said + more)[-WORDS:]
            self._loop.remove_reader(self._errors)


class PackedMessages:
    """Messages that come in pieces. kind: type of all of them."""

    def __init__(self, kind: Any) -> None:
        self._kind, self._buffer = kind, bytearray()

    def take(self, more: bytes) -> Iterator[Any]:
        """Take the next bytes. Returns the messages that are whole now."""
        self._buffer += more
        while len(self._buffer) >= HEAD:
            size = int.from_bytes(self._buffer[:HEAD], "little")
            if len(self._buffer) < HEAD + size:
                return
            content = bytes(self._buffer[HEAD : HEAD + size])
            del self._buffer[: HEAD + size]
            yield msgspec.msgpack.decode(content, type=self._kind)


def packed_message(message: msgspec.Struct) -> bytes:
    """Pack a message for a pipe."""
    content = msgspec.msgpack.encode(message)
    return len(content).to_bytes(HEAD, "little") + content


def next_message(file: BinaryIO, kind: Any) -> Any:
    """Read the next message, in the process itself; None: there is none any more."""
    head = file.read(HEAD)
    content = file.read(int.from_bytes(head, "little")) if len(head) == HEAD else b""
    return msgspec.msgpack.decode(content, type=kind) if content else None


def answering() -> Callable[[msgspec.Struct], None]:
    """Set the process itself up: Ctrl-C is for the service that asks, and what a library prints is no answer.

    Returns what sends an answer; once nobody reads it, the process ends.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)

    def answer(message: msgspec.Struct) -> None:
        try:
            out.write(packed_message(message))
            out.flush()
        except BrokenPipeError:
            os._exit(0)

    return answer
