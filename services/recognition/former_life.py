"""The last states of one life of recognition, kept in a file for the next one.

States on the bus end with the process that told them, so that nobody could give them back to it (decision 0183).
"""

import os
from pathlib import Path

import msgspec

from engage_hri.schemas.messages import Message
from engage_hri.schemas.recognition import OpenEvents, SamePeople, Statistics

State = Statistics | OpenEvents | SamePeople


class FormerLife:
    """The last states of recognition. path: of the file; empty: nothing is kept."""

    def __init__(self, path: str) -> None:
        self._path = Path(path) if path else None
        self._kept: dict[str, bytes] = {}
        """States as they are in the file, by key."""

    def recall(self) -> list[State]:
        """Read what a former life has kept, the counts first, the open pairs last.

        Raises OSError or `msgspec.DecodeError`.
        """
        if self._path is None or not self._path.exists():
            return []
        states = [msgspec.json.decode(line, type=State) for line in self._path.read_bytes().splitlines()]
        return sorted(states, key=lambda state: (Statistics, SamePeople, OpenEvents).index(type(state)))

    def keep(self, key: str, message: Message) -> None:
        """Keep a state in place of the one before; other messages are not kept."""
        if self._path is not None and isinstance(message, State):
            self._kept[key] = msgspec.json.encode(message)
            self._write(self._path)

    def forget(self, keys: tuple[str, ...]) -> None:
        """Keep no state of these keys any longer."""
        if self._path is not None and [self._kept.pop(key) for key in keys if key in self._kept]:
            self._write(self._path)

    def _write(self, path: Path) -> None:
        """Write all states. Who is killed while writing leaves the file as it was."""
        whole = path.with_name(path.name + ".new")
        whole.write_bytes(b"\n".join(self._kept.values()))
        os.replace(whole, path)
