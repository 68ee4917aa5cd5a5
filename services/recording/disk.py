"""File of a recording: chunks go to its end, and are on the disk when `write` returns. Nothing here raises later on.

A disk that is full keeps chunks waiting, up to a limit; then the newest are dropped, and counted.
"""

import mmap
import os
import tempfile
import zlib
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from engage_hri.schemas.faults import Fault, InputRefused, raised_as
from engage_hri.services.recording.reading import REPAIRED, Recording
from engage_hri.services.recording.writing import Sealed, Writer

try:
    import fcntl
except ModuleNotFoundError:  # Windows, where nobody else can write an open file
    fcntl = None  # type: ignore[assignment]

FULL_CHUNK = 1024 * 1024
"""Bytes, before compression, from which on a chunk goes to the disk at once."""
WAITING = 32 * 1024 * 1024
"""Bytes of chunks that may wait for room on the disk."""
MOST_LACKS = 10
"""Damaged places that the note in a repaired copy tells one by one."""
PIECE = 2**20
"""Bytes that are copied at once."""
Tell = Callable[[str], None]


class RecordingFile:
    """A file that a recorder writes. dropped: messages that found no room. written: bytes in the file.

    is_removed: it has no name any more, and goes with its recorder. tell: takes a line about trouble with the disk.
    """

    def __init__(self, path: Path, facts: Mapping[str, str], tell: Tell, *, overwrite: bool = False) -> None:
        """Raises InputRefused: it cannot be written, or there is one already."""
        self.path = path
        self.dropped = 0
        self.written = 0
        self.tell = tell
        self.is_removed = False
        self._checksum = 0
        self._waiting: deque[Sealed] = deque()
        self._trouble = ""
        try:
            self._file = _opened(path, overwrite=overwrite)
        except BlockingIOError as error:
            fault = Fault(reason="another recorder writes this file", where=str(path), advice="give another one")
            raise InputRefused(fault) from error
        except FileExistsError as error:
            fault = Fault(reason="there is such a file", where=str(path), advice="another name, or --overwrite")
            raise InputRefused(fault) from error
        except OSError as error:
            raise InputRefused(Fault(reason=f"cannot write: {error.strerror}", where=str(path))) from error
        try:
            self._index = Aside(path.parent)
            self.writer = Writer(self._index)
            self._append(self.writer.begin(facts))
            _sync_folder(path)
        except OSError as error:
            os.close(self._file)
            path.unlink(missing_ok=True)  # else it would be in the way of the next attempt
            raise InputRefused(Fault(reason=f"cannot write: {error.strerror}", where=str(path))) from error

    def write(self) -> bool:
        """Put everything that waits on the disk. Returns False if some of it still waits, or the file has gone."""
        if (sealed := self.writer.seal()) is not None:
            if self._waiting and sum(len(each.data) for each in self._waiting) + len(sealed.data) > WAITING:
                self.dropped += sealed.messages
                self.writer.dropped()
            else:
                self._waiting.append(sealed)
        try:
            while self._waiting:
                offset = self.written
                self._append(self._waiting[0].data)
                self.writer.placed(self._waiting.popleft(), offset)
            self._index.flush()
            os.fdatasync(self._file)
            self.is_removed = os.fstat(self._file).st_nlink == 0
        except OSError as error:
            self._complain(f"{error.strerror}; what comes waits in memory, at most {WAITING >> 20} MiB of it")
            return False
        if self.is_removed:
            self._complain("removed while it is recorded, and lost with the end of its recorder")
            return False
        if self._trouble:
            self.tell(f"{self.path}: it is written again; messages lost: {self.dropped}")
            self._trouble = ""
        return True

    def close(self, notes: Mapping[str, Mapping[str, str]]) -> bool:
        """End the file in order, with notes by name. Returns False if it could not be written whole."""
        try:
            if not self.write():
                self.dropped += sum(each.messages for each in self._waiting)
                return False
            for name, note in notes.items():
                self._append(self.writer.told(name, note, self.written))
            begun = self.written
            try:
                for piece in self.writer.finish(begun, self._checksum):
                    self._append(piece)
            except OSError:
                os.ftruncate(self._file, begun)
                raise
            os.fdatasync(self._file)
        except OSError as error:
            self._complain(f"{error.strerror}; the end of the file is missing")
            return False
        finally:
            os.close(self._file)
            self._index.close()
        return True

    def _append(self, data: bytes) -> None:
        """Write at the end, all of it or nothing."""
        view = memoryview(data)
        try:
            while view:
                view = view[os.write(self._file, view) :]
        except OSError:
            os.ftruncate(self._file, self.written)
            os.lseek(self._file, self.written, os.SEEK_SET)
            raise
        self.written += len(data)
        self._checksum = zlib.crc32(data, self._checksum)

    def _complain(self, trouble: str) -> None:
        if trouble != self._trouble:
            self._trouble = trouble
            self.tell(f"{self.path}: {trouble}")


class Aside:
    """Records that wait for the end of a recording, in a nameless file in its folder, which goes with the process."""

    def __init__(self, folder: Path) -> None:
        with tempfile.TemporaryFile(dir=folder) as file:
            self._file = os.dup(file.fileno())
        self._waiting = bytearray()

    def append(self, record: bytes) -> None:
        self._waiting += record

    def flush(self) -> None:
        """Put on the disk what waits. Raises OSError: some of it waits on."""
        while self._waiting:
            del self._waiting[: os.write(self._file, self._waiting)]

    def __iter__(self) -> Iterator[bytes]:
        """All of them, in pieces; then there is no more to append."""
        os.lseek(self._file, 0, os.SEEK_SET)
        while piece := os.read(self._file, PIECE):
            yield piece
        yield bytes(self._waiting)

    def close(self) -> None:
        os.close(self._file)


def read(path: Path) -> Recording:
    """Open a recording. Raises InputRefused: there is none."""
    with raised_as(InputRefused, OSError, path, "cannot read"), path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        data = mmap.mmap(file.fileno(), size, access=mmap.ACCESS_READ) if size else b""
    return Recording(data, str(path))  # type: ignore[arg-type]  # a map is read like bytes


def repair(recording: Recording, copy: Path, tell: Tell) -> bool:
    """Copy all that can be read of a recording into a new file, with a note of what the old one lacks.

    Returns False if the copy is not whole. Raises InputRefused: it cannot be written, or there is such a file.
    """
    lacks, notes = recording.lacks, dict(recording.notes)
    if lacks:
        more = [f"and {len(lacks) - MOST_LACKS} more such places"] if len(lacks) > MOST_LACKS else []
        notes[REPAIRED] = {"found": "; ".join([*lacks[:MOST_LACKS], *more])}
    file = RecordingFile(copy, recording.facts, tell)
    for number in range(len(recording)):
        file.writer.add(*recording.stored(number))
        if file.writer.size > FULL_CHUNK:
            file.write()
    return file.close(notes)


def _opened(path: Path, *, overwrite: bool) -> int:
    """Open an empty file that nobody else opens so at the same time. Raises BlockingIOError: somebody writes it now.

    overwrite: also one that is there.
    """
    flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0)
    file = os.open(path, flags | (0 if overwrite else os.O_EXCL), 0o644)
    try:
        if fcntl is not None:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.ftruncate(file, 0)
    except OSError:
        os.close(file)
        raise
    return file


def _sync_folder(path: Path) -> None:
    """Put the name of the file on the disk, too."""
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    except OSError:
        pass
    finally:
        os.close(folder)
