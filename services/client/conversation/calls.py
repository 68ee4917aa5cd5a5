"""Calls of the robot's own tool as words, while the model still writes them. Pure.

The JSON so far is read by `jiter`, which the clients of OpenAI and Pydantic use for the same: it reads what is there,
and the beginning of the last string. Words of a `say` are handed on as they grow; all other parts when they are
complete, which the next part shows, or the end.
"""

from collections.abc import Iterator
from typing import Any

import jiter
import msgspec

from engage_hri.schemas.tool import PARTS, Part, Say

_KINDS = {kind.__struct_fields__[0]: kind for kind in PARTS}


class CallReader:
    """The input of one call of `perform_turn_fragment` that is being written."""

    def __init__(self) -> None:
        self.json = ""
        self._part = 0
        """Number of the part that is being written."""
        self._said = 0
        """Letters of it that were handed on."""
        self.fields: dict[str, Any] = {}
        """Fields of the call besides its parts, as far as they are known."""

    def feed(self, json: str) -> Iterator[str | Part]:
        """Take more of the JSON; returns what can be said or done now."""
        self.json += json
        yield from self._read(is_whole=False)

    def end(self) -> Iterator[str | Part]:
        """Take the end of the call; returns what is left."""
        yield from self._read(is_whole=True)

    def _read(self, *, is_whole: bool) -> Iterator[str | Part]:
        try:
            read = jiter.from_json(self.json.encode(errors="replace"), partial_mode="trailing-strings")
        except ValueError:
            return  # not yet, or never: then the model is told
        if not isinstance(read, dict):
            return
        self.fields = {name: value for name, value in read.items() if name != "parts"}
        parts = read.get("parts")
        if not isinstance(parts, list):
            return
        for number in range(self._part, len(parts)):
            is_complete = is_whole or number < len(parts) - 1
            yield from self._grown(parts[number], is_complete=is_complete)
            if is_complete:
                self._part, self._said = number + 1, 0

    def _grown(self, part: Any, *, is_complete: bool) -> Iterator[str | Part]:
        if not isinstance(part, dict):
            return
        if isinstance(said := part.get(next(iter(Say.__struct_fields__))), str):
            if len(said) > self._said:
                yield said[self._said :]
                self._said = len(said)
            if is_complete and said:
                yield " "
        elif is_complete and (kind := next((_KINDS[name] for name in part if name in _KINDS), None)):
            try:
                yield msgspec.convert({name: value for name, value in part.items() if value is not None}, kind)
            except msgspec.ValidationError:
                return  # the model is told so in the result
