"""The end of a recording, which waits in a file of its own, and channels of lines that were forgotten."""

import asyncio
import io
import tracemalloc
from pathlib import Path
from random import Random

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer as PlainWriter

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.recording import disk
from engage_hri.services.recording.disk import RecordingFile, read
from engage_hri.services.recording.writing import Line, Writer
from engage_hri.services.runtime.absent import FORGOTTEN_AFTER
from tests.random_cases import share_of
from tests.recording.files import FACTS
from tests.recording.runs import recording_to
from tests.recording.test_recorder import FullDisk, faults_in


def line(number: int) -> Line:
    return Line(topic=f"r/{number}", form="json", key=f"engage/v1/evt/there{number}/x", sender=f"there{number}")


def opened(path: Path) -> RecordingFile:
    return RecordingFile(path, FACTS, lambda text: None)


def test_channels_messages_and_their_index_are_those_of_the_plain_library_whatever_is_forgotten_or_dropped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(disk, "WAITING", 700)
    for seed in range(share_of(200, 10)):
        random, full = Random(seed), FullDisk(monkeypatch)
        file = opened(tmp_path / f"{seed}.mcap")
        added: list[tuple[str, int]] = []
        for at in range(1, 200):
            one = random.randrange(12)
            file.writer.add(line(one), b"{}", at, at)
            added.append((f"r/{one}", at))
            if random.random() < 0.3:
                file.writer.forget(line(random.randrange(12)))
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
        assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (
            added[0][1],
            added[-1][1],
        )
        assert [channel.topic for _, channel, _ in reader.iter_messages(starting_at=150)] == [
            topic for topic, at in found if at >= 150
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
    disk.repair(tmp_path / "a.mcap")
    assert (len(read(tmp_path / "a.mcap")), read(tmp_path / "a.mcap").is_whole) == (50, True)


def test_beyond_the_room_for_channels_those_that_are_known_stay_in_use_when_forgotten(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("engage_hri.services.recording.writing.MOST_CHANNELS", 3)
    writer = Writer()
    for number in range(2):
        writer.add(line(number), b"{}", 1, 1)
    writer.forget(line(0))

    assert writer.knows(line(0))
    assert not writer.knows(line(2))


async def test_who_comes_back_after_long_speaks_in_the_same_channel(tmp_path: Path) -> None:
    async with MemoryHub() as hub, recording_to(tmp_path / "a.mcap", hub) as recorder:
        there = hub.join("there")
        for number in range(3):
            there.publish(keys.fault("there"), Fault(reason=str(number)))
            await asyncio.sleep(FORGOTTEN_AFTER + 5)
            assert recorder._lines == {}

    recording = read(tmp_path / "a.mcap")
    topics = [each.topic for each in recording.contents.channels]
    assert faults_in(recording) == ["0", "1", "2"]
    assert len(topics) == len(set(topics))


def test_the_statistics_of_a_file_without_messages_are_those_of_the_plain_library(tmp_path: Path) -> None:
    file, plain = opened(tmp_path / "a.mcap"), PlainWriter(str(tmp_path / "plain.mcap"))
    plain.start("engage", "engage")
    plain.add_metadata("engage", FACTS)
    plain.finish()

    assert file.close({})

    found = []
    for name in ("a.mcap", "plain.mcap"):
        with (tmp_path / name).open("rb") as data:
            summary = make_reader(data).get_summary()
        assert summary is not None
        found.append(summary.statistics)
    ours, theirs = found
    assert ours is not None
    assert theirs is not None
    ours.metadata_count = theirs.metadata_count  # that of the end is more
    assert ours == theirs
