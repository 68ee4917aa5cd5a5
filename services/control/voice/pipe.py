"""A process that is fed through a pipe of the system, without ever waiting for it, and what it has taken."""

import asyncio
import os
import signal
import struct
import subprocess
from collections.abc import Callable, Sequence
from contextlib import suppress

from engage_hri.schemas.utf8 import printable

try:
    import fcntl
    import termios
except ImportError:  # on Windows the pipe keeps its size, and does not say what is in it
    fcntl = termios = None  # type: ignore[assignment]


WORDS = 1000
"""Bytes that are kept of the beginning and of the end of what it says."""


class FedProcess:
    """A process with a pipe to its standard input.

    What it has not taken is known: what is still here, and what is in the pipe. What it has taken and keeps is not.
    """

    def __init__(self, command: Sequence[str], pipe: int, on_end: Callable[[], None]) -> None:
        """Start it. pipe: bytes that the pipe is to hold. on_end: called when it closes its input, or ends.

        Raises:
            OSError: it does not start.
        """
        self._loop, self._on_end = asyncio.get_running_loop(), on_end
        self._unsent = bytearray()
        self._is_open = True
        # Not asyncio's own: it starts a thread for each child in Python 3.11. A group: to end its children, too.
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, process_group=0
        )
        assert self.process.stdin is not None
        assert self.process.stderr is not None
        self._said = b""
        """The first and the last that it has said on standard error, where players tell of every pause."""
        self._errors = self.process.stderr.fileno()
        os.set_blocking(self._errors, False)
        self._loop.add_reader(self._errors, self._hear)
        self._pipe = self.process.stdin.fileno()
        os.set_blocking(self._pipe, False)
        if fcntl is not None and hasattr(fcntl, "F_SETPIPE_SZ"):
            with suppress(OSError):
                fcntl.fcntl(self._pipe, fcntl.F_SETPIPE_SZ, pipe)
        self._loop.add_reader(self._pipe, self._closed)  # the end of a pipe that is written to wakes as it is closed

    @property
    def untaken(self) -> int:
        """Bytes that were written and that the process has not read."""
        if not self._is_open or termios is None:
            return len(self._unsent)
        count = bytearray(4)
        with suppress(OSError):
            fcntl.ioctl(self._pipe, termios.FIONREAD, count)
        return len(self._unsent) + int(struct.unpack("i", count)[0])

    @property
    def words(self) -> str:
        """Return what it has said last on standard error: before that come complaints of its libraries."""
        lines = [line.strip() for line in self._said.decode(errors="replace").splitlines() if line.strip()]
        return printable(lines[-1])[:200] if lines else ""

    def write(self, content: bytes) -> None:
        """Let it have some bytes, after those before; once it is gone they are lost."""
        if self._is_open:
            was_empty = not self._unsent
            self._unsent += content
            if was_empty:
                self._send()

    def kill(self) -> None:
        """End it, and all that it has started, with all that it has taken. It is dead when `is_dead`."""
        self._close()
        with suppress(OSError):
            os.killpg(self.process.pid, signal.SIGKILL)

    @property
    def is_dead(self) -> bool:
        return self.process.poll() is not None

    def _send(self) -> None:
        try:
            del self._unsent[: os.write(self._pipe, self._unsent)]
        except BlockingIOError:
            pass
        except OSError:  # `_closed` is called for that, too
            self._unsent.clear()
        if self._unsent:
            self._loop.add_writer(self._pipe, self._send)
        else:
            self._loop.remove_writer(self._pipe)

    def _hear(self) -> None:
        try:
            more = os.read(self._errors, 4096)
        except BlockingIOError:
            return
        if not more:
            self._loop.remove_reader(self._errors)
        self._said += more
        if len(self._said) > 2 * WORDS:
            self._said = self._said[:WORDS] + b"\n" + self._said[-WORDS:]

    def _closed(self) -> None:
        self._hear()
        self._close()
        self._on_end()

    def _close(self) -> None:
        if self._is_open:
            self._is_open = False
            self._loop.remove_reader(self._pipe)
            self._loop.remove_writer(self._pipe)
            assert self.process.stdin is not None
            with suppress(OSError):
                self.process.stdin.close()
            self._loop.remove_reader(self._errors)
            assert self.process.stderr is not None
            self.process.stderr.close()
