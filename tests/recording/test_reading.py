"""Files of recordings: read back whole, cut off anywhere, with damaged chunks; by our reader, and by mcap's own."""

import io
import json
import os
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.presence import PeerAlive
from engage_hri.services.bus.interface import Sample
from engage_hri.services.recording import disk, reading
from engage_hri.services.recording.descriptor import opened
from engage_hri.services.recording.disk import read, repair
from engage_hri.services.recording.reading import Recording
from tests.recording.files import FACTS, WALL, all_of, bytes_of, nanoseconds, sample, saved

XML = b"<bml id='b'/>"


def told() -> list[Sample]:
    """Fifty messages of every sort."""
    found = [sample(keys.alive("there"), PeerAlive(participant="there", run="1"), 0.25)]
    found += [
        sample(keys.fault(f"service-{number % 3}"), Fault(reason=str(number)), 0.5 + number / 8, number=number)
        for number in range(47)
    ]
    found.append(Sample(keys.FEEDBACK, b"\x00not a message", "application/json", "", 7.0, past=True, life="x"))
    found.append(Sample(keys.command(keys.BLOCK, "manager", "there"), XML, "application/xml", "", 7.5))
    return found


def test_all_messages_come_back_as_they_came() -> None:
    recording = Recording(bytes_of(told()))

    assert all_of(recording) == told()
    assert (recording.is_whole, recording.lost_bytes, recording.damaged) == (True, 0, [])
    assert (recording.robot, recording.clock, recording.began, recording.wall) == ("robot", "loop", 0.0, WALL)
    assert recording.notes == {"end": {"messages": "50", "lost": "0"}}
    assert recording.duration == 7.5


def test_what_nobody_can_read_is_none_and_the_rest_is_decoded() -> None:
    recording = Recording(bytes_of(told()))

    unread = [number for number in range(len(recording)) if recording.received(number) is None]
    assert [recording.sample(number).payload for number in unread] == [b"\x00not a message"]
    first = recording.received(0)
    assert first is not None
    assert first.message == PeerAlive(participant="there", run="1")


def test_the_library_of_mcap_reads_it_and_finds_its_checksums_right() -> None:
    reader = make_reader(io.BytesIO(bytes_of(told())), validate_crcs=True)

    summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert (summary.statistics.message_count, summary.statistics.chunk_count) == (50 + 8, 8)
    marks, found = [], []
    for one in reader.iter_messages():
        (marks if one[1].topic == "recording/chunk" else found).append(one)
    assert [json.loads(message.data)["number"] for _, _, message in marks] == [*range(8)]
    assert [message.log_time for _, _, message in found] == sorted(nanoseconds(one.at) for one in told())
    assert {channel.topic for _, channel, _ in found} == {f"robot/{one.key}" for one in told()}
    middle = reader.iter_messages(starting_at=nanoseconds(2.0), ending_before=nanoseconds(3.0))
    of_bus = [message for _, channel, message in middle if channel.topic != "recording/chunk"]
    assert len(of_bus) == len([one for one in told() if 2.0 <= one.at < 3.0])
    assert next(each.metadata for each in reader.iter_metadata()) == FACTS


def test_its_schema_describes_the_messages_in_it() -> None:
    reader = make_reader(io.BytesIO(bytes_of(told())))

    checked = 0
    for schema, channel, message in reader.iter_messages():
        if channel.message_encoding == "json" and schema is not None:
            assert (schema.name, schema.encoding) == ("engage.Message", "jsonschema")
            Draft202012Validator(json.loads(schema.data)).validate(json.loads(message.data))
            checked += 1
    assert checked == 48


def test_a_file_cut_off_anywhere_gives_every_whole_chunk() -> None:
    whole = told()
    data = bytes_of(whole, is_whole=False)
    ends = [0]
    for count in range(1, len(whole) + 1):
        if count % 7 == 0 or count == len(whole):
            ends.append(len(bytes_of(whole[:count], is_whole=False)))
    begin = ends[1] - 1
    for cut in [*range(begin, len(data), 37), *(end + by for end in ends[1:] for by in (-1, 0, 1))]:
        if cut > len(data):
            continue
        recording = Recording(data[:cut])
        complete = max(number for number, end in enumerate(ends) if _chunk_ends(data, end) <= cut)

        assert not recording.is_whole
        assert all_of(recording) == whole[: min(7 * complete, len(whole))]
        assert recording.end + recording.lost_bytes == cut


def _chunk_ends(data: bytes, end: int) -> int:
    """Where the chunk before this place ends: the indexes behind it may be missing."""
    chunks = Recording(data).contents.chunks
    return max(
        (one.chunk_start_offset + one.chunk_length for one in chunks if one.chunk_start_offset < end), default=0
    )


def test_a_whole_file_cut_off_in_its_end_has_all_messages() -> None:
    data, body = bytes_of(told()), bytes_of(told(), is_whole=False)
    for cut in range(len(body), len(data), 991):
        recording = Recording(data[:cut])

        assert len(recording) == 50
        assert not recording.is_whole


def test_a_repaired_file_is_whole_for_everybody(tmp_path: Path) -> None:
    data = bytes_of(told(), is_whole=False)
    second = Recording(data).contents.chunks[1]
    for cut in (
        len(data),
        len(data) - 3,
        second.chunk_start_offset + second.chunk_length + 5,
        second.chunk_start_offset + 9,
    ):
        path = tmp_path / f"{cut}.mcap"
        path.write_bytes(data[:cut])
        before = all_of(read(path))

        lost = repair(path)

        assert lost == cut - Recording(data[:cut]).end
        assert read(path).is_whole
        assert all_of(read(path)) == before
        with path.open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            assert len(_of_bus(reader)) == len(before)
            assert len(_of_bus(reader, starting_at=nanoseconds(1.0))) == len([b for b in before if b.at >= 1])
            statistics = reader.get_summary().statistics
            assert statistics.message_count == len(list(reader.iter_messages()))
        assert repair(path) == 0


def _of_bus(reader: Any, **bounds: int) -> list[Any]:
    return [one for one in reader.iter_messages(**bounds) if one[1].topic != "recording/chunk"]


def test_a_damaged_chunk_is_left_out_and_told(tmp_path: Path) -> None:
    data = bytearray(bytes_of(told()))
    second = Recording(bytes(data)).contents.chunks[1]
    data[second.chunk_start_offset + 80] ^= 0xFF

    recording = Recording(bytes(data))

    assert [each.offset for each in recording.damaged] == [second.chunk_start_offset]
    assert all_of(recording) == told()[:7] + told()[14:]
    assert recording.is_whole


@pytest.mark.parametrize("name", ["began", "wall"])
def test_a_beginning_that_is_damaged_and_that_no_chunk_tells_again_is_refused_in_words(name: str) -> None:
    with pytest.raises(InputRefused, match="what it says of its beginning is damaged"):
        Recording(_with_bad(name, bytes_of([])))


@pytest.mark.parametrize("name", ["began", "wall"])
def test_a_beginning_that_is_damaged_is_taken_from_the_first_chunk_and_told(name: str) -> None:
    recording = Recording(_with_bad(name, bytes_of(told())))

    assert (recording.facts, all_of(recording)) == (FACTS, told())
    assert len(recording.damaged) == 1


def _with_bad(name: str, data: bytes) -> bytes:
    """The file with letters in place of a number at its beginning."""
    value = FACTS[name].encode()
    before = name.encode() + len(value).to_bytes(4, "little")
    assert data.count(before + value) == 1
    return data.replace(before + value, before + b"x" * len(value))


def test_a_chunk_that_says_that_it_is_huge_is_damaged_and_takes_no_memory() -> None:
    data = bytearray(bytes_of(told()))
    second = Recording(bytes(data)).contents.chunks[1]
    data[second.chunk_start_offset + 25 : second.chunk_start_offset + 33] = (2**40).to_bytes(8, "little")

    recording = Recording(bytes(data))

    assert all_of(recording) == told()[:7] + told()[14:]
    assert [each.offset for each in recording.damaged] == [second.chunk_start_offset]


def test_zeros_behind_a_crash_are_no_records() -> None:
    recording = Recording(bytes_of(told(), is_whole=False) + bytes(4096))

    assert len(recording) == 50
    assert (recording.is_whole, recording.lost_bytes) == (False, 4096)


@pytest.mark.parametrize(
    ("data", "reason"),
    [(b"", "no MCAP file"), (b"hello, world", "no MCAP file"), (bytes_of([])[:8], "nothing in it can be read")],
)
def test_what_is_no_recording_is_refused(tmp_path: Path, data: bytes, reason: str) -> None:
    path = tmp_path / "some.mcap"
    path.write_bytes(data)

    with pytest.raises(InputRefused, match=reason):
        read(path)


@pytest.mark.parametrize("byte", [0, 2, 7])
def test_a_changed_byte_in_the_mark_of_the_format_costs_no_message(byte: int) -> None:
    data = bytearray(bytes_of(told()))
    data[byte] ^= 1

    recording = Recording(bytes(data))

    assert all_of(recording) == told()
    assert [(each.offset, each.reason) for each in recording.damaged] == [(0, "the mark of its format is damaged")]


@pytest.mark.parametrize("cut", [80, 700])
def test_a_repaired_recording_tells_for_ever_what_was_missing(tmp_path: Path, cut: int) -> None:
    path, data = tmp_path / "a.mcap", bytes_of(told(), is_whole=False)
    path.write_bytes(data[:-cut])
    before = read(path)

    repair(path)

    after = read(path)
    assert (after.is_whole, after.damaged, all_of(after)) == (True, [], all_of(before))
    assert after.repaired == f"what came after {before.duration:.2f} s is missing"
    with path.open("rb") as file:
        assert [each.name for each in make_reader(file).iter_metadata()] == ["engage", "engage-repaired"]

    path.write_bytes(path.read_bytes()[:-10])  # its index is damaged: another repair forgets nothing
    repair(path)
    assert read(path).repaired == after.repaired


def test_a_repair_of_a_recording_without_a_message_leaves_a_note_of_it(tmp_path: Path) -> None:
    """The index says that all is well, but for the checksum of the data, which a repair writes anew."""
    path, whole = tmp_path / "a.mcap", bytes_of(told())
    first, second = Recording(whole).contents.chunks[1:3]
    path.write_bytes(whole[: first.chunk_start_offset] + whole[second.chunk_start_offset :])
    before = read(path)
    assert before.damaged

    repair(path)

    assert before.damaged[0].reason in read(path).repaired


def test_a_repair_that_takes_away_nothing_leaves_no_note(tmp_path: Path) -> None:
    path, data = tmp_path / "a.mcap", bytes_of(told())
    path.write_bytes(data[:-10])

    repair(path)

    assert (path.read_bytes(), read(path).repaired) == (data, "")


def test_a_recording_of_nothing_opens(tmp_path: Path) -> None:
    recording = read(saved(tmp_path / "empty.mcap", []))

    assert (len(recording), recording.duration, recording.is_whole) == (0, 0.0, True)


def test_a_chunk_is_read_up_to_the_largest_size_and_no_larger_one_is_unpacked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    data = bytes_of(told(), chunk=100)
    summary = make_reader(io.BytesIO(data)).get_summary()
    assert summary is not None
    (chunk,) = summary.chunk_indexes

    monkeypatch.setattr(reading, "LARGEST_CHUNK", chunk.uncompressed_size)
    assert all_of(Recording(data)) == told()
    monkeypatch.setattr(reading, "LARGEST_CHUNK", chunk.uncompressed_size - 1)
    assert f"a chunk says that it has {chunk.uncompressed_size} bytes" in " ".join(map(str, Recording(data).damaged))


def test_a_repair_never_cuts_off_another_recording_and_says_where_it_begins(tmp_path: Path) -> None:
    whole = bytes_of(told())
    for first in (whole, whole[:-3], bytes_of(told(), is_whole=False)):
        path = tmp_path / f"{len(first)}.mcap"
        path.write_bytes(first + whole)

        with pytest.raises(InputRefused, match=f"another recording begins at byte {len(first)}"):
            repair(path)

        assert path.read_bytes() == first + whole
        assert read(path).another == len(first)
    assert Recording(whole).another is None


def test_a_recording_that_is_written_now_is_not_repaired(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(b"")
    file = opened(path, overwrite=True)
    os.write(file, bytes_of(told(), is_whole=False))
    with pytest.raises(InputRefused, match="a recorder writes it now"):
        repair(path)
    os.close(file)

    assert repair(path) == 0
    assert read(path).is_whole


def test_what_is_written_between_the_look_and_the_repair_is_not_cut_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, data = tmp_path / "a.mcap", bytes_of(told(), is_whole=False)
    path.write_bytes(data[:-500])

    def looked(path: Path) -> Recording:
        before = read(path)
        path.write_bytes(data)
        return before

    monkeypatch.setattr(disk, "read", looked)
    with pytest.raises(InputRefused, match="a recorder writes it now"):
        repair(path)

    assert path.read_bytes() == data


def test_an_end_of_the_data_in_its_middle_is_damage_and_all_behind_it_is_read() -> None:
    whole = bytes_of(told())
    second = Recording(whole).contents.chunks[1].chunk_start_offset
    assert second
    records, at = [], len(MCAP0_MAGIC)
    while at < len(whole) - len(MCAP0_MAGIC):
        length = 9 + int.from_bytes(whole[at + 1 : at + 9], "little")
        records.append((at, whole[at : at + length]))
        at += length
    end = next(record for _, record in records if record[0] == Opcode.DATA_END)
    # In place of the indexes behind the first chunk, so that nothing moves.
    index, old = next((place, record) for place, record in records if record[0] == Opcode.MESSAGE_INDEX)
    filler = len(old) - len(end) - 9
    data = (
        whole[:index] + end + bytes([0x80]) + filler.to_bytes(8, "little") + bytes(filler) + whole[index + len(old) :]
    )

    recording = Recording(data)

    assert recording.is_whole
    assert all_of(recording) == all_of(Recording(whole))
    assert any("the data does not end here" in each.reason for each in recording.damaged)
