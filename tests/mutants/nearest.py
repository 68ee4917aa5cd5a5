"""Which test files run a line, the likeliest to notice a change first; from the map that `contexts.py` has made."""

import json
from pathlib import Path

from coverage import CoverageData

from tests.mutants.operators import Change
from tests.mutants.places import MAP, SECONDS


class Nearest:
    """seconds: how long each file of tests took. doubtful: files of which a test may fail without any mutant, too.

    That is what is in real time, and what was red when the map was made: some tests want more than the few cases that
    a map tries.
    """

    def __init__(self, root: Path) -> None:
        self._root = root
        self._data = CoverageData(str(root / MAP))
        self._data.read()
        measured = json.loads((root / SECONDS).read_text())
        self.seconds: dict[str, float] = measured["seconds"]
        self.doubtful = {
            *measured["red"],
            *(name for name in self.seconds if "real_time" in (root / name).read_text()),
        }

    def tests(self, file: str, change: Change, source: bytes) -> list[str]:
        """Files that run the statement of this change; those that run anything of its file if that is not known.

        What stands outside of functions runs once, for whoever imports it first: its tests are those of the file. So
        are those of what Zenoh calls on a thread of its own, which the tracer does not see.
        """
        lines = self._data.contexts_by_lineno(file)
        last = source[: change.end].count(b"\n") + 1
        found = {name for line in range(change.statement, last + 1) for name in lines.get(line, ())} - {""}
        if change.alone or not found:
            found = {name for names in lines.values() for name in names} - {""}
        if not found:  # nothing but definitions, which are read when the tests are collected
            found = {name for name in self.seconds if set(Path(name).parent.parts[1:]) & set(Path(file).parent.parts)}
        return sorted(found & self.seconds.keys(), key=lambda name: self._distance(name, file))

    def _distance(self, test: str, file: str) -> tuple[bool, bool, bool, float]:
        """What is sure before what is doubtful; what has the file's name, and its folder's; quick before slow."""
        folders, stem = Path(file).parent.parts, Path(file).stem
        return (
            test in self.doubtful,
            stem not in Path(test).stem.removeprefix("test_").split("_") and f"test_{stem}" != Path(test).stem,
            not set(Path(test).parent.parts[1:]) & set(folders),
            self.seconds[test],
        )
