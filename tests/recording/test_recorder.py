"""The recorder on a bus in memory: all that a subscription gets is in the file, as it came."""

import asyncio
import errno
import os
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from engage_hri.schemas import keys
from engage_hri.schemas.body import Capabilities
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import AskStatus, PeerAlive, Status
from engage_hri.services.bus.interface import Bus, Received
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.recording import disk
from engage_hri.services.recording.disk import RecordingFile, read
from engage_hri.services.recording.reading import Recording
from engage_hri.services.recording.service import FLUSH
from tests.recording.conftest import Anchor
from tests.recording.files import FACTS, all_of
from tests.recording.runs import recording_to


def faults_in(recording: Recording) -> list[str]:
    """Reasons of all faults of `there`."""
    found = [one for number in range(len(recording)) if (one := recording.received(number)) is not None]
    return [one.message.reason for one in found if isinstance(one.message, Fault)]


def of_ledger(received: Received) -> bool:
    return keys.matches(keys.ANY_TAKEN, received.key)


def test_a_whole_task_is_in_the_file_message_for_message(anchor: Anchor) -> None:
    live, recording = anchor.live, anchor.recording

    kept = [received for number in range(len(recording)) if (received := recording.received(number)) is not None]
    heard = [one for one in kept if keys.key_class(one.key) != "rpc" and one.source not in ("viewer", "recorder")]
    numbers = {(one.life, one.number) for one in heard if one.number}
    assert len(live) > 2000
    # The last steps of a service come as it ends, when the viewer has gone.
    assert [(one.key, one.message, one.source) for one in heard if one.number and not of_ledger(one)] == [
        (one.key, one.message, one.source) for one in live if (one.life, one.number) in numbers and not of_ledger(one)
    ]
    assert not [one for one in live if one.number and (one.life, one.number) not in numbers and not of_ledger(one)]
    assert recording.is_whole
    assert recording.losses.total == 0


def test_status_and_capabilities_of_those_who_come_are_asked_for(task: Recording) -> None:
    recording = task

    told = [recording.received(number) for number in range(len(recording))]
    answers = [one for one in told if one is not None and keys.key_class(one.key) == "rpc"]
    assert {one.source for one in answers if isinstance(one.message, Status)} >= set(keys.SERVICES)
    assert [one.key for one in answers if isinstance(one.message, Capabilities)] == [keys.DESCRIBE]


async def test_what_has_come_is_on_the_disk_half_a_second_later(tmp_path: Path) -> None:
    async with MemoryHub() as hub, recording_to(tmp_path / "a.mcap", hub):
        there = hub.join("there")
        for number in range(20):
            there.publish(keys.fault("there"), Fault(reason=str(number)))
            await asyncio.sleep(0.1)

        on_disk = read(tmp_path / "a.mcap")  # as if the recorder were killed now
        last = on_disk.received(len(on_disk) - 1)
        assert last is not None
        assert isinstance(last.message, Fault)
        assert int(last.message.reason) >= 19 - round(FLUSH / 0.1)
        assert not on_disk.is_whole


async def test_a_late_recorder_has_the_states_and_who_is_there(tmp_path: Path) -> None:
    async with MemoryHub() as hub:
        there = hub.join("there")
        there.declare_alive()
        there.publish(keys.HEAD_OWNER, Fault(reason="old"))
        there.publish(keys.HEAD_OWNER, Fault(reason="new"))
        await asyncio.sleep(60)
        async with recording_to(tmp_path / "a.mcap", hub):
            await asyncio.sleep(0.1)

    token, state = all_of(read(tmp_path / "a.mcap"))[:2]
    assert (token.key, token.source) == (keys.alive("there", "client"), "there")
    assert token.encoding.endswith("PeerAlive/1")
    assert (state.key, state.past, state.life) == (keys.HEAD_OWNER, True, there.run)


async def test_a_name_that_is_taken_and_a_folder_that_is_not_there_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_text("mine")
    async with MemoryHub() as hub:
        with pytest.raises(InputRefused, match="there is such a file"):
            async with recording_to(tmp_path / "a.mcap", hub):
                pass
        await hub.close()
    async with MemoryHub() as hub:
        with pytest.raises(InputRefused, match="cannot write: No such file or directory"):
            async with recording_to(tmp_path / "none" / "a.mcap", hub):
                pass
    assert (tmp_path / "a.mcap").read_text() == "mine"


class FullDisk:
    """A disk that is full at times. Half of a chunk may still find room."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.is_full = False
        self._write = os.write
        monkeypatch.setattr(disk.os, "write", self.write)

    def write(self, file: int, data: Any) -> int:
        if self.is_full:
            self._write(file, bytes(data[: len(data) // 2]))
            raise OSError(errno.ENOSPC, "No space left on device")
        return self._write(file, data)


async def test_a_full_disk_keeps_messages_waiting_and_the_file_readable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    full = FullDisk(monkeypatch)
    async with MemoryHub() as hub, recording_to(tmp_path / "a.mcap", hub) as recorder:
        there = hub.join("there")
        for number in range(60):
            full.is_full = 20 <= number < 40
            there.publish(keys.fault("there"), Fault(reason=str(number)))
            await asyncio.sleep(0.1)
            if number == 39:
                assert len(read(tmp_path / "a.mcap")) <= 22

    recording = read(tmp_path / "a.mcap")
    assert faults_in(recording) == [str(number) for number in range(60)]
    assert recorder.losses.total == 0
    told = [record.message.removeprefix(str(tmp_path)) for record in caplog.records if "a.mcap" in record.message]
    assert told == [
        "/a.mcap: No space left on device; what comes waits in memory, at most 32 MiB of it",
        "/a.mcap: it is written again; messages lost: 0",
    ]


async def test_what_finds_no_room_for_long_is_lost_counted_and_told_in_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(disk, "WAITING", 1000)
    full = FullDisk(monkeypatch)
    async with MemoryHub() as hub, recording_to(tmp_path / "a.mcap", hub) as recorder:
        there, new = hub.join("there"), hub.join("new")
        for number in range(100):
            full.is_full = 20 <= number < 70
            (new if number >= 30 else there).publish(keys.fault("there"), Fault(reason=f"{number:0>500}"))
            await asyncio.sleep(0.1)

    recording = read(tmp_path / "a.mcap")
    found = [int(reason) for reason in faults_in(recording)]
    assert found[:20] == [*range(20)]
    assert found[-25:] == [*range(75, 100)]
    assert recording.losses == recorder.losses
    assert recording.losses.disk == 100 - len(found) > 0
    assert recording.is_whole


async def test_a_recorder_that_stood_still_says_so_and_its_file_does(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async with MemoryHub() as hub, recording_to(tmp_path / "a.mcap", hub):
        await asyncio.sleep(10.0)
        asyncio.get_running_loop()._virtual_now += 11.0  # type: ignore[attr-defined]  # no task has run meanwhile
        await asyncio.sleep(10.0)

    losses = read(tmp_path / "a.mcap").losses
    assert losses.still == pytest.approx(11.0, abs=0.4)
    assert losses.total == 0
    (told,) = [record.message.removeprefix(str(tmp_path)) for record in caplog.records if "a.mcap" in record.message]
    assert told == f"/a.mcap: the recorder stood still for {losses.still:.1f} s; motion of that time is missing"


async def test_presence_is_kept_though_it_is_never_sent(tmp_path: Path) -> None:
    async with MemoryHub() as hub, recording_to(tmp_path / "a.mcap", hub):
        there = hub.join("there")
        there.declare_alive()
        await asyncio.sleep(1.0)
        await there.leave()
        await asyncio.sleep(1.0)

    recording = read(tmp_path / "a.mcap")
    told = [one for number in range(len(recording)) if (one := recording.received(number)) is not None]
    came, gone = [one for one in told if one.key == keys.alive("there", "client")]
    assert came.message == PeerAlive(participant="there", run=there.run)
    assert gone.at - came.at == pytest.approx(1.0, abs=1e-9)


def test_a_file_that_could_not_be_begun_is_not_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*given: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(InputRefused, match="No space left on device"):
        RecordingFile(tmp_path / "a.mcap", FACTS, print)

    assert not list(tmp_path.iterdir())


async def test_a_file_that_was_ended_says_how_many_messages_have_come_and_how_many_are_lost(tmp_path: Path) -> None:
    async with MemoryHub() as hub, recording_to(tmp_path / "a.mcap", hub):
        there = hub.join("there")
        for number in range(20):
            there.publish(keys.fault("there"), Fault(reason=str(number)))
        await asyncio.sleep(1.0)

    recording = read(tmp_path / "a.mcap")
    with (tmp_path / "a.mcap").open("rb") as file:
        notes = {each.name: each.metadata for each in make_reader(file).iter_metadata()}
    assert len(recording) >= 20
    assert notes["end"] == {"messages": str(len(recording)), "lost": "0"}


async def test_only_services_are_asked_for_their_status_and_only_as_they_come(tmp_path: Path) -> None:
    asked: list[str] = []

    def answering(bus: Bus) -> None:
        def status(question: Message) -> Status:
            asked.append(bus.name)
            return Status(participant=bus.name, run=bus.run, version="1", at=bus.stamp(), joined=bus.stamp())

        bus.answer(keys.status(bus.name), status, empty=AskStatus())
        bus.declare_alive()

    async with MemoryHub() as hub, recording_to(tmp_path / "a.mcap", hub):
        service, page, beside = hub.join("generation"), hub.join("page"), hub.join("generation-beside")
        for each in (service, page, beside):
            answering(each)
        await asyncio.sleep(1.0)
        service.publish(keys.fault("generation"), Fault(reason="it goes on"))
        await page.leave()
        await asyncio.sleep(1.0)

    assert asked == ["generation"]
