"""`engage record`, `replay`, `export` and `analyse` as people type them; two of them as processes."""

import asyncio
import json
import sys
from pathlib import Path

import msgspec
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.participants import ServiceSettings, Taken, text_of
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.interface import Sample
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recording.disk import read
from engage_hri.services.recording.settings import flat
from tests.bus.places import PATIENCE, free_endpoint
from tests.cli.command import Engage, engage, start
from tests.cli.test_processes import line
from tests.recording.files import bytes_of, sample, saved
from tests.recording.test_reading import told


@pytest.fixture(name="run")
def _run(capsys: pytest.CaptureFixture[str]) -> Engage:
    return engage(capsys)


@pytest.mark.real_time
async def test_what_is_recorded_comes_again_on_another_bus(tmp_path: Path) -> None:
    path, endpoint = tmp_path / "a.mcap", free_endpoint()
    async with await open_hub("told", listen=[endpoint]) as hub:
        there = hub.join("there")
        there.declare_alive()
        there.publish(keys.HEAD_OWNER, Fault(reason="state"))
        recorder = await start("record", path, "--robot", "told", "--connect", endpoint, "--participant", "p1")
        await line(recorder, "recording told into")
        with there.subscribe(keys.ANY_ALIVE) as presence:
            async for received in presence:
                if received.source.startswith("record-"):
                    break
        for number in range(50):
            there.publish(keys.fault("there"), Fault(reason=str(number)))
        while not _recorded(path, 50):
            await _soon()
        recorder.terminate()
        assert await asyncio.wait_for(recorder.wait(), PATIENCE) == 0

    recording = read(path)
    assert recording.is_whole
    assert (recording.robot, recording.facts["participant"]) == ("told", "p1")

    elsewhere = free_endpoint()
    async with await open_hub("told", listen=[elsewhere]) as hub:
        bus = hub.join("listener")
        with bus.subscribe(keys.ANY_FAULT, keys.HEAD_OWNER, keys.ANY_ALIVE) as inbox:
            replay = await start("replay", path, "--connect", elsewhere, "--speed", "10")
            found = []
            while len(found) < 51:
                received = await inbox.next(bus.now() + PATIENCE)
                assert received is not None, f"only {len(found)} have come"
                if isinstance(received.message, Fault):
                    found.append((received.source, received.message.reason))
            assert found == [("there", "state"), *(("there", str(number)) for number in range(50))]
            assert await asyncio.wait_for(replay.wait(), PATIENCE) == 0

        control = hub.join("control")
        control.declare_alive()
        refused = await start("replay", path, "--connect", elsewhere)
        _, said = await asyncio.wait_for(refused.communicate(), PATIENCE)
        assert refused.returncode == 75
        assert b"has this on the bus already" in said


def _recorded(path: Path, count: int) -> bool:
    recording = read(path)
    return sum(recording.key(number) == keys.fault("there") for number in range(len(recording))) >= count


async def _soon() -> None:
    done = asyncio.Event()
    asyncio.get_running_loop().call_later(0.05, done.set)
    await done.wait()


def test_a_folder_that_is_read_only_and_a_file_that_is_there_are_refused(run: Engage, tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_text("mine")

    taken = run("record", tmp_path / "a.mcap", "--robot", "nobody", "--seconds", 0)
    nowhere = run("record", tmp_path / "none" / "a.mcap", "--robot", "nobody", "--seconds", 0)

    assert (taken.code, nowhere.code) == (2, 2)
    assert "there is such a file" in taken.err
    assert "cannot write: No such file or directory" in nowhere.err
    assert (tmp_path / "a.mcap").read_text() == "mine"


def test_a_replay_from_behind_the_end_is_refused_with_the_length(run: Engage, tmp_path: Path) -> None:
    path = saved(tmp_path / "a.mcap", told())
    result = run("replay", path, "--at", read(path).duration + 0.1)
    assert result.code == 2
    assert f"the recording ends after {read(path).duration:.2f} s" in result.err


def test_without_the_library_its_extra_is_named(run: Engage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mcap.records", None)

    result = run("export", saved(tmp_path / "a.mcap", told()), "--csv")

    assert result.code == 2
    assert "[record]'" in result.err


def test_a_cut_file_is_read_and_repaired_and_that_is_said(run: Engage, tmp_path: Path) -> None:
    path, copy = tmp_path / "a.mcap", tmp_path / "a.repaired.mcap"
    path.write_bytes(bytes_of(told(), is_whole=False)[:-80])

    shown = run("export", path, "--csv")
    repaired = run("record", path, "--repair")
    again = run("record", path, "--repair")
    copied = run("record", copy, "--repair")

    assert shown.code == 0
    assert "its end is missing or damaged; 49 messages until 7.00 s are whole" in shown.err
    assert (repaired.code, copied.code) == (0, 0)
    assert repaired.out == f"{copy}: 49 messages\n{copy}: what came after 7.00 s is missing\n"
    assert copied.out == f"{copy}: nothing to repair\n"
    assert (again.code, "there is such a file" in again.err) == (2, True)
    assert read(copy).is_whole


def test_a_damaged_index_is_told_from_a_missing_end(run: Engage, tmp_path: Path) -> None:
    path, data = tmp_path / "a.mcap", bytes_of(told())
    path.write_bytes(data[:-30] + bytes([data[-30] ^ 1]) + data[-29:])

    shown = run("export", path, "--csv")
    repaired = run("record", path, "--repair")

    assert shown.err.splitlines()[0].endswith(
        "the index at its end is damaged, or more stands behind it; its data is there, 50 messages"
    )
    assert repaired.out == f"{tmp_path / 'a.repaired.mcap'}: 50 messages\n"


def test_of_a_recording_behind_another_only_that_is_said(run: Engage, tmp_path: Path) -> None:
    path, data = tmp_path / "a.mcap", bytes_of(told())
    path.write_bytes(data + data)

    (shown,) = run("export", path, "--csv").err.splitlines()

    assert shown.endswith("or more stands behind it; its data is there, 50 messages")


def test_of_a_file_that_ends_between_two_chunks_no_bytes_are_said_to_be_lost(run: Engage, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(bytes_of(told(), is_whole=False))

    shown = run("export", path, "--csv")

    assert "its end is missing or damaged" in shown.err
    assert shown.err.splitlines()[0].endswith(" are whole")


@pytest.mark.real_time
def test_exports_lie_beside_the_recording_and_are_not_overwritten(run: Engage, tmp_path: Path) -> None:
    path = saved(tmp_path / "a.mcap", told())

    made = run("export", path, "--elan", "--csv", "--lines")
    twice = run("export", path, "--elan")
    named = run("export", path, "--elan", "--csv", "--out", tmp_path / "x.eaf")
    nothing = run("export", path)
    dash = run("export", path, "--elan", "--out", "-")

    names = ["a.eaf", "a.csv", "a.jsonl"]
    assert sorted(made.out.split()) == sorted(str(tmp_path / name) for name in names)
    assert all((tmp_path / name).stat().st_size for name in names)
    assert [json.loads(one)["type"] for one in (tmp_path / "a.jsonl").read_text().splitlines()] == ["fault"] * 47
    assert (twice.code, named.code, nothing.code) == (2, 2, 2)
    assert "there is such a file" in twice.err
    assert "nothing is to be made" in nothing.err
    assert (dash.code, dash.out) == (2, "")
    assert dash.err.startswith("--out: `-` is no file")


def test_tables_of_a_folder_are_printed_and_written(run: Engage, tmp_path: Path) -> None:
    saved(tmp_path / "a.mcap", told())
    saved(tmp_path / "b.mcap", told())

    result = run("analyse", tmp_path, "--out", tmp_path / "out")

    assert result.code == 0
    assert "finished" in result.out
    assert "there is no connection event in it" in " ".join(result.out.split())
    written = (tmp_path / "out" / "recordings.csv").read_text().splitlines()
    assert written[1:] == [
        f"{number},recorded,{name}.mcap,,there is no connection event in it" for number, name in enumerate("ab")
    ]
    assert (tmp_path / "out" / "summary.md").read_text().startswith("## Sessions")


def test_again_without_a_ledger_is_refused_and_settings_are_for_it_alone(run: Engage, tmp_path: Path) -> None:
    path = saved(tmp_path / "a.mcap", told())

    again = run("analyse", path, "--again")
    settings = run("analyse", path, "--set", "recognition.window=1")

    assert (again.code, settings.code) == (2, 2)
    assert "told nothing of what they took" in again.err
    assert "is for --again" in settings.err


def test_settings_that_nobody_can_read_are_told_in_words_and_all_else_is_read(run: Engage, tmp_path: Path) -> None:
    message = ServiceSettings(
        participant="recognition", run="1", version="0.0.1", at=Stamp("loop", 0.0), settings='{"recognition"'
    )
    taken = Taken(service="recognition", session="1", at=Stamp("loop", 1.0), first=1, steps=())
    path = saved(
        tmp_path / "a.mcap",
        [sample(keys.settings("recognition"), message, 0.5), sample(keys.taken("recognition"), taken, 1.0, number=2)],
    )

    exported = run("export", path, "--settings")
    analysed = run("analyse", path, "--out", tmp_path / "out")
    again = run("analyse", path, "--again")

    reason = "recognition, life 1: not read: settings are not JSON: "
    assert (exported.code, analysed.code, again.code) == (0, 0, 0)
    assert reason in (tmp_path / "a.settings.toml").read_text()
    assert f"a.mcap: {reason}" in " ".join(analysed.out.split())
    assert len((tmp_path / "out" / "settings.csv").read_text().splitlines()) == 1
    assert "or cannot be read: again it has those by default" in again.out


def test_settings_are_exported_and_those_that_changed_are_printed(run: Engage, tmp_path: Path) -> None:
    def settings(life: str, window: float) -> Sample:
        message = ServiceSettings(
            participant="recognition", run=life, version="0.0.1", at=Stamp("loop", 0.0),
            settings=text_of({"recognition": msgspec.to_builtins(RecognitionConfig(window=window))}),
        )  # fmt: skip
        return sample(keys.settings("recognition"), message, float(life), source="recognition", life=life)

    path = saved(tmp_path / "a.mcap", [settings("1", 20.0), settings("2", 40.0)])

    exported = run("export", path, "--settings")
    analysed = run("analyse", path, "--out", tmp_path / "out")

    assert exported.code == 0
    assert load(tmp_path / "a.settings.toml").recognition == RecognitionConfig(window=40.0)
    assert (tmp_path / "a.settings.toml").read_text().splitlines()[:2] == [
        "# Settings of a.mcap, of Engage 0.0.1.",
        "# recognition, life 1, from 1.000 s: recognition.window = 20.0",
    ]
    printed = [line.split() for line in analysed.out.splitlines() if "recognition.window" in line]
    assert printed == [
        ["a.mcap", "recognition", "recognition.window", "=", "20.0"],
        ["a.mcap", "recognition", "life", "2,", "from", "2.0", "s", "recognition.window", "=", "40.0"],
    ]
    written = (tmp_path / "out" / "settings.csv").read_text().splitlines()
    assert "0,recorded,recognition,2,2.0,recognition.window,40.0" in written
    assert len(written) == 1 + 2 * len(list(flat(msgspec.to_builtins(RecognitionConfig()))))
