"""Files of recordings: read back whole, cut off anywhere, with damaged chunks; by our reader, and by mcap's own."""

import io
import json
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from mcap.opcode import Opcode
from mcap.reader import make_reader

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.participants import PeerAlive
from engage_hri.services.bus.interface import Sample
from engage_hri.services.recording import reading
from engage_hri.services.recording.disk import read, repair
from engage_hri.services.recording.reading import Recording
from tests.recording.files import FACTS, WALL, all_of, bytes_of, chunks_of, nanoseconds, records, sample, saved

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
    assert (summary.statistics.message_count, summary.statistics.chunk_count) == (50 + 9, 9)
    marks, found = [], []
    for one in reader.iter_messages():
        (marks if one[1].topic == "recording/chunk" else found).append(one)
    assert [json.loads(message.data)["number"] for _, _, message in marks] == [*range(9)]
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
    whole, data = told(), bytes_of(told(), is_whole=False)
    chunks = chunks_of(bytes_of(told()))
    for cut in [*range(chunks[0][0], len(data), 37), *(end + by for _, end in chunks for by in (-1, 0, 1))]:
        recording = Recording(data[:cut])
        complete = sum(end <= cut for _, end in chunks)

        assert not recording.is_whole
        assert all_of(recording) == whole[: min(7 * complete, len(whole))]
        assert recording.damaged == []


def test_a_whole_file_cut_off_in_its_end_has_all_messages() -> None:
    data, body = bytes_of(told()), bytes_of(told(), is_whole=False)
    for cut in range(len(body), len(data), 991):
        recording = Recording(data[:cut])

        assert len(recording) == 50
        assert not recording.is_whole


def test_a_repaired_copy_is_whole_for_everybody_and_the_file_stays_as_it_was(tmp_path: Path) -> None:
    data = bytes_of(told(), is_whole=False)
    begin, end = chunks_of(bytes_of(told()))[1]
    damaged = data[: begin + 80] + bytes([data[begin + 80] ^ 0xFF]) + data[begin + 81 :]
    for number, bad in enumerate((data, data[:-3], data[: end + 5], data[: begin + 9], damaged)):
        path = tmp_path / f"{number}.mcap"
        path.write_bytes(bad)

        copy = repaired(path)

        assert (path.read_bytes(), copy.is_whole, copy.damaged) == (bad, True, [])
        assert all_of(copy) == all_of(read(path))
        with Path(copy.name).open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            assert len(_of_bus(reader)) == len(copy)
            assert len(_of_bus(reader, starting_at=nanoseconds(1.0))) == len([b for b in all_of(copy) if b.at >= 1])
            statistics = reader.get_summary().statistics
            assert statistics.message_count == len(list(reader.iter_messages()))


def repaired(path: Path) -> Recording:
    """A repaired copy, which lies beside the file."""
    copy = path.with_suffix(".repaired.mcap")
    assert repair(read(path), copy, print)
    return read(copy)


def _of_bus(reader: Any, **bounds: int) -> list[Any]:
    return [one for one in reader.iter_messages(**bounds) if one[1].topic != "recording/chunk"]


def test_a_damaged_chunk_is_left_out_and_told() -> None:
    data = bytearray(bytes_of(told()))
    begin, _ = chunks_of(data)[1]
    data[begin + 80] ^= 0xFF

    recording = Recording(bytes(data))

    assert [each.offset for each in recording.damaged] == [begin]
    assert all_of(recording) == told()[:7] + told()[14:]
    assert recording.is_whole


@pytest.mark.parametrize("name", ["began", "wall"])
def test_a_beginning_that_is_damaged_and_that_no_chunk_tells_again_is_refused_in_words(name: str) -> None:
    bad = bytearray(_with_bad(name, bytes_of([])))
    (begin, end), *_ = ((begin, end) for begin, end in records(bad) if bad[begin] == Opcode.CHUNK)
    bad[(begin + end) // 2] ^= 0xFF

    with pytest.raises(InputRefused, match="what it says of its beginning is damaged"):
        Recording(bytes(bad))


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
    begin, _ = chunks_of(data)[1]
    data[begin + 25 : begin + 33] = (2**40).to_bytes(8, "little")

    recording = Recording(bytes(data))

    assert all_of(recording) == told()[:7] + told()[14:]
    assert [each.offset for each in recording.damaged] == [begin]


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


@pytest.mark.parametrize("cut", [80, 700])
def test_a_repaired_recording_tells_for_ever_what_was_missing(tmp_path: Path, cut: int) -> None:
    path, data = tmp_path / "a.mcap", bytes_of(told(), is_whole=False)
    path.write_bytes(data[:-cut])
    before = read(path)

    after = repaired(path)

    assert (after.is_whole, after.damaged, all_of(after)) == (True, [], all_of(before))
    assert after.repaired == f"what came after {before.duration:.2f} s is missing"
    with Path(after.name).open("rb") as file:
        assert [each.name for each in make_reader(file).iter_metadata()] == ["engage", "engage-repaired"]

    copy = Path(after.name)
    copy.write_bytes(copy.read_bytes()[:-10])  # its index is damaged: another repair forgets nothing
    assert repaired(copy).repaired == after.repaired


def test_a_copy_of_a_recording_without_a_message_has_a_note_of_it(tmp_path: Path) -> None:
    path, whole = tmp_path / "a.mcap", bytes_of(told())
    (begin, _), (end, _) = chunks_of(whole)[1:3]
    path.write_bytes(whole[:begin] + whole[end:])

    (damage,) = read(path).damaged

    assert damage.reason in repaired(path).repaired


def test_a_copy_of_a_recording_with_all_its_data_has_no_note(tmp_path: Path) -> None:
    path, data = tmp_path / "a.mcap", bytes_of(told())
    path.write_bytes(data[:-10])

    assert (all_of(repaired(path)), repaired_notes(path)) == (told(), ["engage", "end"])


def repaired_notes(path: Path) -> list[str]:
    with path.with_suffix(".repaired.mcap").open("rb") as file:
        return [each.name for each in make_reader(file).iter_metadata()]


def test_a_copy_never_replaces_a_file(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.mcap", told())

    with pytest.raises(InputRefused, match="there is such a file"):
        repair(read(path), path, print)

    assert read(path).is_whole


def test_a_recording_of_nothing_opens(tmp_path: Path) -> None:
    recording = read(saved(tmp_path / "empty.mcap", []))

    assert (len(recording), recording.duration, recording.is_whole) == (0, 0.0, True)


def test_a_chunk_is_read_up_to_the_largest_size_and_no_larger_one_is_unpacked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    data = bytes_of(told(), chunk=100)
    summary = make_reader(io.BytesIO(data)).get_summary()
    assert summary is not None
    _, chunk = summary.chunk_indexes

    monkeypatch.setattr(reading, "LARGEST_CHUNK", chunk.uncompressed_size)
    assert all_of(Recording(data)) == told()
    monkeypatch.setattr(reading, "LARGEST_CHUNK", chunk.uncompressed_size - 1)
    assert f"a chunk says that it has {chunk.uncompressed_size} bytes" in " ".join(map(str, Recording(data).damaged))


def test_of_a_recording_behind_another_nothing_is_read_and_that_is_told() -> None:
    whole = bytes_of(told())
    other = bytes_of(told()[::-1], wall=WALL + 10**12)
    for first in (whole, whole[:-3], bytes_of(told(), is_whole=False)):
        recording = Recording(first + other)

        assert all_of(recording) == told()
        assert not recording.is_whole
