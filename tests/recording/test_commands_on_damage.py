"""Every command that reads recordings, on damaged ones: no traceback, an exit code of the page, and damage is told.

The judge knows nothing of damage. It compares what a command makes of the damaged file with what it makes of the
whole one: where these differ, the command has said something on standard error, or has refused the file with exit
code 2.
"""

import re
from collections.abc import Callable, Coroutine, Sequence
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import pytest

from engage_hri.schemas import keys
from engage_hri.services import commandline
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.bus.subscription import Tap
from engage_hri.services.commandline.app import COMMANDS
from engage_hri.services.commandline.look import console
from engage_hri.services.commandline.study import replay
from engage_hri.services.console.web.played import PlayedPicture
from engage_hri.services.recording.disk import read
from engage_hri.services.recording.reading import Recording
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.cli.command import Engage, engage
from tests.random_cases import share_of
from tests.recording.conftest import Anchor
from tests.recording.files import all_of, bytes_of
from tests.recording.test_damage import DAMAGES

MESSAGES = 500
"""Of the scenario: enough for some turns, and few enough for thousands of files."""
Damage = Callable[[bytes, Random], bytes]


def _flipped(data: bytes, random: Random) -> bytes:
    bad = bytearray(data)
    bad[random.randrange(len(bad))] ^= 1 << random.randrange(8)
    return bytes(bad)


def _spliced(data: bytes, random: Random) -> bytes:
    """Another part of the file in the place of one."""
    size = random.choice((9, 64, 512, 4096))
    at, other = random.randrange(len(data)), random.randrange(len(data))
    return data[:at] + data[other : other + size] + data[at + size :]


def _several(data: bytes, random: Random) -> bytes:
    for damage in random.choices((_flipped, _spliced, *DAMAGES[:5]), k=random.randint(2, 5)):
        data = damage(data, random) if data else data
    return data


def _no_recording(data: bytes, random: Random) -> bytes:
    """Something else altogether: nothing, text, noise, or a beginning with something else behind it."""
    others = (b"", b"\n", b"a,b\n1,2\n" * random.randint(1, 99), random.randbytes(random.randint(1, 5000)))
    return data[: random.choice((0, 0, 1, 8, 9, 40))] + random.choice(others)


class Made(NamedTuple):
    """What came of a command. things: all that it made or said, beside standard error."""

    code: int
    things: list[object]
    err: str


class Commands:
    """Commands that read recordings, each as a function of the file. They run in this process and in virtual time."""

    def __init__(self, run: Engage, patched: pytest.MonkeyPatch) -> None:
        self._run = run
        self._seen: list[object] = []
        self._taps: list[Tap] = []
        patched.setattr(replay, "run_until_signal", lambda main: run_virtual(self._heard(main)))
        patched.setattr(console, "run_until_signal", run_virtual)
        patched.setattr(replay.Options, "open", self._hub)
        patched.setattr(console, "_play", self._look)

    async def _hub(self, *_: object) -> MemoryHub:
        hub = MemoryHub("robot")
        self._taps.append(hub.join("ear").tap(keys.EVERYTHING))
        return hub

    async def _heard(self, main: Coroutine[Any, Any, int]) -> int:
        """Note what is said on the bus, but for the lives of those who say it, which are new each time."""
        code = await main
        for tap in self._taps:
            while len(tap):
                one = await tap.next()
                if one is not None and not keys.is_presence(one.key):
                    self._seen.append((one.key, one.payload))
        self._taps.clear()
        return code

    async def _look(self, _: object, recording: Recording) -> None:
        """Look at a recording in the window: some places in it, to and fro."""
        shown = PlayedPicture(recording, 0.0)
        for number, at in enumerate((0.0, 0.9, 0.4, 1.0, 0.1)):
            shown.seek(at * recording.duration, 10.0 * number)
            shown.advance(10.0 * number + 9.0)
            self._seen += [shown.picture.section(name) for name in shown.picture.versions]

    def _made(self, *arguments: object) -> Made:
        self._seen.clear()
        result = self._run(*arguments)
        return Made(result.code, [result.out, *self._seen], result.err)

    def export(self, path: Path) -> Made:
        kinds = ("--elan", "--csv", "--lines", "--settings")
        made = self._made("export", path, *kinds, "--overwrite")
        if made.code == 0:
            made.things.extend(Path(name).read_bytes() for name in str(made.things[0]).split())
        return made

    def analyse(self, path: Path) -> Made:
        return self._made("analyse", path)

    def again(self, path: Path) -> Made:
        return self._made("analyse", path, "--again")

    def replay(self, path: Path) -> Made:
        return self._made("replay", path, "--speed", 100, "--commands")

    def console(self, path: Path) -> Made:
        return self._made("console", "--recording", path)

    def record(self, path: Path) -> Made:
        """Repair it: the copy is whole, and has all that could be read."""
        copy = path.with_suffix(".repaired.mcap")
        copy.unlink(missing_ok=True)
        made = self._made("record", path, "--repair")
        if made.code == 0 and copy.exists():
            repaired = read(copy)
            assert (repaired.is_whole, repaired.damaged) == (True, [])
            assert all_of(repaired) == all_of(read(path))
            assert "nothing to repair" in self._run("record", copy, "--repair").out
        return Made(made.code, [], made.err or str(made.things[0]))


ALL: tuple[Damage, ...] = (_flipped, *DAMAGES, _spliced, _several, _no_recording)
QUICK = ("export", "analyse", "again", "replay", "console", "record")


@pytest.fixture
def commands(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Commands:
    return Commands(engage(capsys), monkeypatch)


@pytest.fixture(scope="session")
def whole(anchor: Anchor) -> bytes:
    samples = [one for one in all_of(anchor.recording) if one.key]
    return bytes_of(samples[:MESSAGES], chunk=40)


def check(
    commands: Commands, names: Sequence[str], path: Path, data: bytes, usual: dict[str, Made], what: object
) -> None:
    """Check all these commands on a damaged file. usual: what they make of the whole one."""
    path.write_bytes(data)
    for name in names:
        made = getattr(commands, name)(path)

        assert made.code in (0, 2), (what, name, made.err)
        assert "Traceback" not in made.err, (what, name)
        if made.code == 2:
            assert made.err.splitlines()[-1].startswith(str(path.parent)), (what, name, made.err)
        else:
            assert made.err or made.things == usual[name].things, (what, name)


def made_of(commands: Commands, names: Sequence[str], path: Path, data: bytes) -> dict[str, Made]:
    path.write_bytes(data)
    usual = {name: getattr(commands, name)(path) for name in names}
    assert all(each.code == 0 and (name == "record" or not each.err) for name, each in usual.items()), usual
    return usual


def test_all_commands_that_open_recordings_are_tried() -> None:
    """The command line has a table of commands, each with a file of its own, and one way to open a recording."""
    folder = Path(commandline.__file__).parent
    places = {name: next(folder.glob(f"*/{name.replace('-', '_')}.py")) for name in COMMANDS}
    texts = {name: place.read_text(encoding="utf-8") for name, place in places.items()}
    reads = {name for name, text in texts.items() if re.search(r"recording\.(reading|disk) import", text)}
    opens = {name for name, text in texts.items() if re.search(r"recording_file import .*\bopened\b", text)}

    assert reads | opens == {"analyse", "console", "export", "record", "replay"} <= {*COMMANDS}
    assert reads | opens <= {*QUICK}


@pytest.mark.parametrize("damage", ALL, ids=lambda damage: damage.__name__.strip("_"))
def test_every_command_reads_a_damaged_recording_or_refuses_it_and_tells_of_what_differs(
    damage: Damage, commands: Commands, whole: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "a.mcap"
    usual = made_of(commands, QUICK, path, whole)
    for seed in range(share_of(60, 20)):
        check(commands, QUICK, path, damage(whole, Random(seed)), usual, (damage.__name__, seed))
