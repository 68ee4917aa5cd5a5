"""Events of a stream that a model's server sends: bytes cut anywhere are put together. Pure.

Server-sent events as the HTML standard has them: lines end in LF, CR or both, an event ends with an empty line, of
its fields only `data` counts here, several of them are lines of one text. Or one JSON object a line, as of Ollama.
"""

import re
from collections.abc import Iterator
from typing import Literal

Framing = Literal["events", "lines"]
_LINE_END = re.compile(rb"\r\n|\n|\r(?!$)")


class Frames:
    """Reader of a stream of bytes; `feed` gives the text of each event that is complete."""

    def __init__(self, framing: Framing) -> None:
        self._framing = framing
        self._bytes = b""
        self._data: list[str] = []
        self._is_first = True

    def feed(self, data: bytes) -> Iterator[str]:
        """Take bytes as they come. A CR at their end waits for what follows: it may be half of a line's end."""
        self._bytes += data
        *lines, self._bytes = _LINE_END.split(self._bytes)
        for line in lines:
            yield from self._line(line)

    def end(self) -> Iterator[str]:
        """Take the end of the stream: servers leave out the last line's end."""
        rest, self._bytes = self._bytes.rstrip(b"\r"), b""
        yield from self._line(rest)
        yield from self._line(b"")

    def _line(self, line: bytes) -> Iterator[str]:
        text = line.decode(errors="replace")
        if self._is_first:
            text, self._is_first = text.removeprefix("\ufeff"), False
        if self._framing == "lines":
            if text.strip():
                yield text
        elif not text:
            if self._data:
                yield "\n".join(self._data)
            self._data.clear()
        else:
            name, _, value = text.partition(":")
            if name == "data":
                self._data.append(value.removeprefix(" "))
