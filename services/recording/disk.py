"""File of a recording: chunks go to its end, and are on the disk when `write` returns. Nothing here raises later on.

A disk that is full keeps chunks waiting, up to a limit; then the newest are dropped, and counted.
"""

import mmap
import os
import tempfile
import time
import zlib
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing
from pathlib import Path

from mcap.records import Metadata, MetadataIndex

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.recording import descriptor
from engage_hri.services.recording.reading import Recording
from engage_hri.services.recording.writing import REPAIRED, Sealed, Writer, end, written

MOST_PLACES = 10
"""Damaged places that the note of a repair tells one by one."""
WAITING = 32 * 1024 * 1024
"""Bytes of chunks that may wait for room on the disk."""
Tell = Callable[[str], None]


class RecordingFile:
    """A file that a recorder writes. dropped: messages that found no room. slowest: the longest wait for the disk.

    written: bytes in the file. path: its name, also when it was renamed. is_removed: it has none any more, and could
    not be written anew. tell: takes a line about trouble with the disk.
    """

    def __init__(self, path: Path, facts: Mapping[str, str], tell: Tell, *, overwrite: bool = False) -> None:
        """Raises InputRefused: it cannot be written, or there is one already."""
        self.path = path
        self.dropped = 0
        self.written = 0
        self.slowest: Seconds = 0.0
        self._checksum = 0
        self.tell = tell
        self._waiting: deque[Sealed] = deque()
        self._trouble = ""
        self.is_removed = False
        self._is_elsewhere = False
        self._asides = ExitStack()
        try:
            self._file = descriptor.opened(path, overwrite=overwrite)
        except BlockingIOError as error:
            fault = Fault(reason="another recorder writes this file", where=str(path), advice="give another one")
            raise InputRefused(fault) from error
        except FileExistsError as error:
            fault = Fault(reason="there is such a file", where=str(path), advice="another name, or --overwrite")
            raise InputRefused(fault) from error
        except OSError as error:
            raise InputRefused(Fault(reason=f"cannot write: {error.strerror}", where=str(path))) from error
        try:
            self._channels = self._asides.enter_context(closing(Aside(path.parent)))
            self._chunks = self._asides.enter_context(closing(Aside(path.parent)))
            self.writer = Writer(self._channels, self._chunks)
            self._append(self.writer.begin(facts))
            _sync_folder(path)
        except OSError as error:
            self._asides.close()
            os.close(self._file)
            path.unlink(missing_ok=True)  # else it would be in the way of the next attempt
            raise InputRefused(Fault(reason=f"cannot write: {error.strerror}", where=str(path))) from error

    def write(self) -> bool:
        """Put everything that waits on the disk. Returns False if some of it still waits, or the file has gone."""
        if (sealed := self.writer.seal()) is not None:
            if self._waiting and sum(len(each.data) for each in self._waiting) + len(sealed.data) > WAITING:
                self.dropped += sealed.messages
                self.writer.dropped(sealed)
            else:
                self._waiting.append(sealed)
        began = time.monotonic()
        try:
            while self._waiting:
                offset = self.written
                self._append(self._waiting[0].data)
                self.writer.placed(self._waiting.popleft(), offset)
            self._channels.flush()
            self._chunks.flush()
            os.fdatasync(self._file)
            if not self._stay():
                return False
        except OSError as error:
            self._complain(f"{error.strerror}; what comes waits in memory, at most {WAITING >> 20} MiB of it")
            return False
        finally:
            self.slowest = max(self.slowest, time.monotonic() - began)
        if self._trouble:
            self.tell(f"{self.path}: it is written again; messages lost: {self.dropped}")
            self._trouble = ""
        return True

    def _stay(self) -> bool:
        """Write a file that somebody has removed anew, and tell of one that was renamed. Returns False: it cannot."""
        self.is_removed = descriptor.is_removed(self._file)
        if self.is_removed:
            try:
                copy = descriptor.copied(self._file, self.written, self.path)
            except OSError as error:
                self._complain(f"removed while it is recorded, and not written anew: {error.strerror}")
                return False
            os.close(self._file)
            self._file, self.is_removed = copy, False
            _sync_folder(self.path)
            self.tell(f"{self.path}: removed while it is recorded; written anew, with all that was in it")
        elif not self._is_elsewhere and not descriptor.is_at(self._file, self.path):
            self._is_elsewhere = True
            now = descriptor.name(self._file)
            self.tell(f"{self.path}: renamed while it is recorded, which goes on{f' in {now}' if now else ''}")
            self.path = Path(now) if now else self.path
        return True

    def close(self, note: Mapping[str, str]) -> bool:
        """End the file in order, with a note about the recording. Returns False if it could not be written whole."""
        try:
            if not self.write():
                self.dropped += sum(each.messages for each in self._waiting)
                return False
            self._append(self.writer.told("end", note, self.written))
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
            self._asides.close()
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
        while piece := os.read(self._file, descriptor.PIECE):
            yield piece
        yield bytes(self._waiting)

    def close(self) -> None:
        os.close(self._file)


def read(path: Path) -> Recording:
    """Open a recording. Raises InputRefused: there is none."""
    try:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            data = mmap.mmap(file.fileno(), size, access=mmap.ACCESS_READ) if size else b""
    except OSError as error:
        raise InputRefused(Fault(reason=f"cannot read: {error.strerror}", where=str(path))) from error
    return Recording(data, str(path))  # type: ignore[arg-type]  # a map is read like bytes


def repair(path: Path) -> int:
    """Cut off what is no whole record, and write the end that is missing. Returns the bytes of data that it cut.

    Raises InputRefused: it is no recording, somebody writes it, it cannot be written, or another one is behind it.
    """
    recording = read(path)
    if recording.is_whole:
        return 0
    if (there := recording.another) is not None:
        reason = f"another recording begins at byte {there}, and would be cut off"
        advice = f"part them: `head -c {there} FILE > FIRST`, `tail -c +{there + 1} FILE > SECOND`"
        raise InputRefused(Fault(reason=reason, where=str(path), advice=advice))
    contents, until, tail = recording.contents, recording.end, b""
    if contents.chunks:
        last, indexes = contents.chunks[-1], recording.indexes(len(contents.chunks) - 1)
        if len(last.message_index_offsets) < len(indexes):  # so nothing is behind them
            until = last.chunk_start_offset + last.chunk_length
            last.message_index_offsets = {}
            for index in indexes:
                last.message_index_offsets[index.channel_id] = until + len(tail)
                tail += written(index)
            last.message_index_length = len(tail)
    if found := "; ".join(_found(recording)):
        note = written(Metadata(name=REPAIRED, metadata={"found": found}))
        contents.metadata.append(MetadataIndex(offset=until + len(tail), length=len(note), name=REPAIRED))
        tail += note
    checksum = zlib.crc32(tail, recording.checksum(until))
    channels, chunks = map(written, contents.channels), map(written, contents.chunks)
    try:
        with path.open("r+b") as file:
            descriptor.lock(file.fileno())
            if os.fstat(file.fileno()).st_size != recording.end + recording.lost_bytes:
                raise BlockingIOError  # it was written between the look and the lock
            file.truncate(until)
            file.seek(until)
            file.write(tail)
            file.writelines(end(contents, channels, chunks, until + len(tail), checksum))
            file.flush()
            os.fsync(file.fileno())
    except BlockingIOError as error:
        raise InputRefused(
            Fault(reason="a recorder writes it now", where=str(path), advice="end it first")
        ) from error
    except OSError as error:
        raise InputRefused(Fault(reason=f"cannot write: {error.strerror}", where=str(path))) from error
    return 0 if recording.has_all_data else recording.lost_bytes


def _found(recording: Recording) -> Iterator[str]:
    """Note of a repair, in parts: it takes away the signs itself, a missing end and a wrong checksum."""
    if recording.has_all_data and not recording.damaged:
        return
    if recording.repaired:
        yield recording.repaired
    if not recording.has_all_data:
        yield f"what came after {recording.duration:.2f} s is missing"
    for place in recording.damaged[:MOST_PLACES]:
        yield f"damaged at byte {place.offset}: {place.reason}"
    if (more := len(recording.damaged) - MOST_PLACES) > 0:
        yield f"and {more} more such places"


def _sync_folder(path: Path) -> None:
    """Put the name of the file on the disk, too."""
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    except OSError:
        pass
    finally:
        os.close(folder)
