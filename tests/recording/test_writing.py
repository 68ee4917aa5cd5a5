"""The end of a recording, whose index waits in a file of its own, as the plain library reads it."""

import asyncio
import io
import tracemalloc
from pathlib import Path
from random import Random

import pytest
from mcap.reader import make_reader

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.recording import disk
from engage_hri.services.recording.disk import RecordingFile, read
from engage_hri.services.recording.writing import Line
from tests.random_cases import share_of
from tests.recording.files import FACTS, WALL
from tests.recording.runs import recording_to
from tests.recording.test_recorder import FullDisk, faults_in


def line(number: int) -> Line:
    return Line(topic=f"r/{number}", form="json", key=f"engage/v1/evt/there{number}/x", sender=f"there{number}")


def opened(path: Path) -> RecordingFile:
    return RecordingFile(path, FACTS, lambda text: None)


def test_channels_messages_and_their_index_are_those_of_the_plain_library_whatever_is_dropped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(disk, "WAITING", 700)
    for seed in range(share_of(200, 10)):
        random, full = Random(seed), FullDisk(monkeypatch)
        file = opened(tmp_path / f"{seed}.mcap")
        added: list[tuple[str, int]] = []
        for at in range(WALL, WALL + 199):
            one = random.randrange(12)
            file.writer.add(line(one), b"{}", at, at)
            added.append((f"r/{one}", at))
            if random.random() < 0.3:
                full.is_full = random.random() < 0.4
                before = file.dropped
                file.write()
                del added[len(added) - (file.dropped - before) :]
        full.is_full, before = False, file.dropped
        assert file.close({})
        del added[len(added) - (file.dropped - before) :]  # the limit is looked at before there is room again

        data = (tmp_path / f"{seed}.mcap").read_bytes()
        reader = make_reader(io.BytesIO(data), validate_crcs=True)
        found = [(channel.topic, message.log_time) for _, channel, message in reader.iter_messages()]
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        marks = [topic for topic, _ in found if topic == "recording/chunk"]
        assert [one for one in found if one[0] != "recording/chunk"] == added, seed
        assert len({channel.topic for channel in summary.channels.values()}) == len(summary.channels), seed
        assert len(marks) == len(summary.chunk_indexes) == summary.statistics.chunk_count, seed
        assert summary.statistics.message_count == len(found), seed
        assert sum(summary.statistics.channel_message_counts.values()) == len(found), seed
        assert summary.statistics.channel_count == len(summary.channels), seed
        assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (WALL, added[-1][1])
        assert [channel.topic for _, channel, _ in reader.iter_messages(starting_at=WALL + 150)] == [
            topic for topic, at in found if at >= WALL + 150
        ]
        assert read(tmp_path / f"{seed}.mcap").damaged == []


def test_a_file_of_many_chunks_takes_no_more_memory_than_one_of_few(tmp_path: Path) -> None:
    def grown(file: RecordingFile, chunks: range) -> int:
        before = tracemalloc.get_traced_memory()[0]
        for at in chunks:
            file.writer.add(line(at % 20), b"{}", at, at)
            file.write()
        return tracemalloc.get_traced_memory()[0] - before

    file = opened(tmp_path / "a.mcap")
    tracemalloc.start()
    try:
        grown(file, range(100))
        assert grown(file, range(100, 2100)) < 20_000
    finally:
        tracemalloc.stop()
    assert file.close({})
    assert len(read(tmp_path / "a.mcap")) == 2100


def test_a_full_disk_at_the_end_leaves_a_file_that_can_be_repaired(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, full = opened(tmp_path / "a.mcap"), FullDisk(monkeypatch)
    for at in range(50):
        file.writer.add(line(at), b"{}", at, at)
        file.write()
    finish = file.writer.finish

    def filled(offset: int, checksum: int) -> object:
        for number, piece in enumerate(finish(offset, checksum)):
            full.is_full = number == 2
            yield piece

    monkeypatch.setattr(file.writer, "finish", filled)
    assert not file.close({})
    full.is_full = False

    assert (len(read(tmp_path / "a.mcap")), read(tmp_path / "a.mcap").is_whole) == (50, False)
    assert read(tmp_path / "a.mcap").lost_bytes == 0
    disk.repair(read(tmp_path / "a.mcap"), tmp_path / "b.mcap", print)
    assert (len(read(tmp_path / "b.mcap")), read(tmp_path / "b.mcap").is_whole) == (50, True)


async def test_beyond_the_room_for_channels_messages_are_kept_whole_and_those_that_are_known_stay_in_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("engage_hri.services.recording.writing.MOST_CHANNELS", 3)
    async with MemoryHub() as hub, recording_to(tmp_path / "a.mcap", hub):
        for number in range(5):
            hub.join(f"there-{number}").publish(keys.fault(f"there-{number}"), Fault(reason=str(number)))
        await asyncio.sleep(1.0)

    recording = read(tmp_path / "a.mcap")
    with (tmp_path / "a.mcap").open("rb") as data:
        topics = [channel.topic for _, channel, _ in make_reader(data).iter_messages()]
    assert faults_in(recording) == ["0", "1", "2", "3", "4"]
    assert {"recording/more", "robot/" + keys.fault("there-0")} <= {*topics}
    assert "robot/" + keys.fault("there-4") not in topics
