"""Plays that several test files look at are played once in a run of pytest, by whichever worker comes first."""

import fcntl
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import pytest

T = TypeVar("T")


def once(factory: pytest.TempPathFactory, name: str, play: Callable[[Path], T]) -> tuple[Path, T]:
    """A folder, and what `play` has returned, which could write into it. Who asks meanwhile waits.

    name: of the play. play: is called with the folder, once in a run. What it returns is pickled.
    """
    folder = factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent  # each worker has a folder in that of the run
    folder /= f"play-{name}"
    folder.mkdir(exist_ok=True)
    kept = folder / "returned.pickle"
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not kept.exists():
            kept.write_bytes(pickle.dumps(play(folder)))
    return folder, pickle.loads(kept.read_bytes())
