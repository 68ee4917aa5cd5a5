"""An open file that others may remove, rename or want to write as well. All raise OSError as the system does."""

import os
from pathlib import Path

try:
    import fcntl
except ModuleNotFoundError:  # Windows, where an open file can be neither removed nor renamed
    fcntl = None  # type: ignore[assignment]

FLAGS = os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0)
PIECE = 2**20
"""Bytes that are copied at once."""


def opened(path: Path, *, overwrite: bool = False) -> int:
    """Open an empty file, which nobody else opens so at the same time.

    overwrite: also one that is there. Raises BlockingIOError: somebody writes it now.
    """
    file = os.open(path, FLAGS | (0 if overwrite else os.O_EXCL), 0o644)
    try:
        lock(file)
        os.ftruncate(file, 0)
    except OSError:
        os.close(file)
        raise
    return file


def lock(file: int) -> None:
    """Keep others from writing the file until it is closed. Raises BlockingIOError: somebody writes it now."""
    if fcntl is not None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def is_removed(file: int) -> bool:
    """True if the file has no name any more: it goes when it is closed."""
    return os.fstat(file).st_nlink == 0


def is_at(file: int, path: Path) -> bool:
    """True if it is the file of this name."""
    try:
        there = os.stat(path)
    except FileNotFoundError:
        return False
    return os.path.samestat(there, os.fstat(file))


def name(file: int) -> str:
    """Name that the file has now; empty: this system does not tell."""
    try:
        return os.readlink(f"/proc/self/fd/{file}")
    except OSError:
        return ""


def copied(file: int, size: int, path: Path) -> int:
    """Make a new file with the first bytes of this one, on the disk. Returns it, to be written at its end."""
    copy = opened(path)
    try:
        for offset in range(0, size, PIECE):
            view = memoryview(os.pread(file, min(PIECE, size - offset), offset))
            while view:
                view = view[os.write(copy, view) :]
        os.fsync(copy)
    except OSError:
        os.close(copy)
        path.unlink(missing_ok=True)
        raise
    return copy
