"""Recordings that a disk, or somebody, has changed: whatever differs from what was recorded is told, always.

Two judges, which know nothing of our reader: the messages that were recorded, and the plain `mcap` library, which
compares checksums. What our reader gives without a word is what was recorded; and where the library complains, or
gives other messages, our reader says something, too.
"""

import io
from collections.abc import Callable
from functools import cache
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as PlainWriter

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.bus.samples import Sample
from engage_hri.services.recording.reading import Recording
from tests.random_cases import share_of
from tests.recording.files import FACTS, WALL, all_of, bytes_of, records
from tests.recording.test_reading import told

COMPRESSIONS = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}


def rewritten(data: bytes, compression: str) -> bytes:
    """The same recording as the plain library writes it."""
    output, reader = io.BytesIO(), make_reader(io.BytesIO(data))
    writer = PlainWriter(output, chunk_size=1500, compression=COMPRESSIONS[compression], enable_data_crcs=True)
    writer.start("engage", "engage")
    writer.add_metadata("engage", next(each.metadata for each in reader.iter_metadata() if each.name == "engage"))
    ids: dict[int, int] = {}
    schemas = {0: 0}
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        if schema is not None and schema.id not in schemas:
            schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
        if channel.id not in ids:
            ids[channel.id] = writer.register_channel(
                channel.topic, channel.message_encoding, schemas[channel.schema_id], channel.metadata
            )
        writer.add_message(
            ids[channel.id], message.log_time, message.data, message.publish_time, message.sequence
        )  # fmt: skip
    writer.add_attachment(0, 0, "notes.txt", "text/plain", b"what somebody wrote down")
    writer.finish()
    return output.getvalue()


@cache
def file(name: str) -> bytes:
    match name:
        case "whole":
            return bytes_of(told())
        case "without an end":
            return bytes_of(told(), is_whole=False)
    return rewritten(bytes_of(told()), name)


NAMES = ("whole", "without an end", *COMPRESSIONS)


def plain(data: bytes) -> tuple[list[Any], str]:
    """Messages as the plain library gives them, and its complaint."""
    found: list[Any] = []
    try:
        for _, channel, message in NonSeekingReader(io.BytesIO(data), validate_crcs=True).iter_messages(
            log_time_order=False
        ):
            found.append((channel.topic, channel.message_encoding, channel.metadata, message))
    except Exception as error:  # whatever it is, it is a complaint
        return found, type(error).__name__
    return found, ""


@cache
def plain_of(name: str) -> tuple[list[Any], str]:
    return plain(file(name))


def signs(recording: Recording) -> tuple[object, ...]:
    """All that the reader says about damage."""
    return recording.is_whole, recording.lost_bytes, tuple(recording.damaged)


@cache
def truth(name: str) -> tuple[list[Sample], tuple[object, ...]]:
    recording = Recording(file(name))
    assert (all_of(recording), recording.facts) == (told(), FACTS)
    return told(), signs(recording)


def check(name: str, data: bytes, what: object) -> None:
    """Check that whatever differs is told. name: of the file that was damaged. what: was done to it."""
    recorded, usual = truth(name)
    try:
        recording = Recording(data)
    except InputRefused:
        return
    given = all_of(recording)  # of everything that it numbers, whatever is told
    if signs(recording) != usual:
        return
    is_same = given == recorded or (not recording.is_whole and given == recorded[: len(given)])
    assert is_same, what
    assert recording.facts == FACTS, what
    if len(given) == len(recorded):
        (found, complaint), (others, usual_complaint) = plain(data), plain_of(name)
        assert found == others[: len(found)], what
        if recording.is_whole:  # else there is no checksum of what stands outside of chunks
            assert (len(found), complaint) == (len(others), usual_complaint), what


def changed(data: bytes, place: int, by: int) -> bytes:
    bad = bytearray(data)
    bad[place] ^= by
    return bytes(bad)


@pytest.mark.parametrize("name", NAMES)
def test_one_changed_byte_anywhere_is_told_if_anything_differs(name: str) -> None:
    data, random = file(name), Random(name)
    places = [*range(len(data))]
    if (share := share_of(len(data), 600)) < len(data):
        places = random.sample(places, share)
    for place in places:
        for by in (1 << random.randrange(8), 0xFF):
            check(name, changed(data, place, by), (name, place, by))


def _zeroed(data: bytes, random: Random) -> bytes:
    at, size = random.randrange(len(data)), random.choice((1, 4, 9, 64, 512, 4096))
    return data[:at] + bytes(len(data[at : at + size])) + data[at + size :]


def _noisy(data: bytes, random: Random) -> bytes:
    at, size = random.randrange(len(data)), random.choice((2, 9, 64, 512))
    return data[:at] + random.randbytes(len(data[at : at + size])) + data[at + size :]


def _cut(data: bytes, random: Random) -> bytes:
    return data[: random.randrange(len(data))]


def _without(data: bytes, random: Random) -> bytes:
    at, size = random.randrange(len(data)), random.choice((1, 9, 64, 512))
    return data[:at] + data[at + size :]


def _with_more(data: bytes, random: Random) -> bytes:
    at, size = random.randrange(len(data)), random.choice((1, 9, 64, 512))
    more = random.choice((bytes(size), random.randbytes(size), data[at : at + size]))
    return data + more if random.random() < 0.5 else data[:at] + more + data[at:]


def _record_twice(data: bytes, random: Random) -> bytes:
    all_of_them = [*records(data)]
    begin, end = random.choice(all_of_them)
    place, _ = random.choice(all_of_them)
    return data[:place] + data[begin:end] + data[place:]


def _record_gone(data: bytes, random: Random) -> bytes:
    begin, end = random.choice([*records(data)])
    return data[:begin] + data[end:]


def _records_swapped(data: bytes, random: Random) -> bytes:
    (begin, end), (other, last) = sorted(random.sample([*records(data)], 2))
    return data[:begin] + data[other:last] + data[end:other] + data[begin:end] + data[last:]


@cache
def _another() -> bytes:
    """A recording of other messages in channels of the same ids, made a day later."""
    return bytes_of(told()[::-1], wall=WALL + 86_400 * 10**9)


def _joined(data: bytes, random: Random) -> bytes:
    cut = random.choice((len(data), random.randrange(len(data))))
    return data[:cut] + random.choice((_another(), data))


DAMAGES = (_zeroed, _noisy, _cut, _without, _with_more, _record_twice, _record_gone, _records_swapped, _joined)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.__name__.strip("_"))
def test_other_damage_is_told_if_anything_differs(name: str, damage: Callable[[bytes, Random], bytes]) -> None:
    for seed in range(share_of(1000, 60)):
        check(name, damage(file(name), Random(seed)), (name, damage.__name__, seed))


@given(seed=st.integers(0, 2**32), name=st.sampled_from(NAMES), count=st.integers(2, 4))
def test_several_damages_at_once_are_told_if_anything_differs(seed: int, name: str, count: int) -> None:
    random = Random(seed)
    data = file(name)
    kinds = [random.choice((_zeroed, _noisy, _cut, _without, _with_more, _joined)) for _ in range(count)]
    for damage in kinds:
        data = damage(data, random) if data else data
    check(name, data, (name, seed, kinds))


@pytest.mark.parametrize("name", ["without an end", "zstd"])
def test_a_chunk_of_a_recording_is_at_its_place_once_or_that_is_told(name: str) -> None:
    data = file(name)
    chunks = [(begin, end) for begin, end in records(data) if data[begin] == 6]
    for begin, end in chunks[:-1]:
        for bad in (data[:begin] + data[end:], data[:end] + data[begin:]):
            recording = Recording(bad)
            numbers = [told().index(each) for each in all_of(recording)]

            assert recording.damaged
            assert numbers == sorted(set(numbers))


def test_a_damaged_byte_in_a_chunk_costs_that_chunk_at_most() -> None:
    data, whole, random = file("without an end"), told(), Random(3)
    chunks = [(begin, end) for begin, end in records(data) if data[begin] == 6]
    for begin, end in chunks:
        for place in {*range(begin, begin + 60), *random.sample(range(begin, end), share_of(60))}:
            found = all_of(Recording(changed(data, place, 1 << random.randrange(8))))

            assert found == [one for one in whole if one in found]
            assert len(whole) - len(found) <= (0 if begin == chunks[0][0] else 7), place


@pytest.mark.parametrize("name", ["without an end", "whole"])
@pytest.mark.parametrize("by", [-(10**18), -(10**17), 10**15, 10**18])
def test_a_replay_does_not_wait_for_a_beginning_that_only_a_damaged_part_tells_of(name: str, by: int) -> None:
    """The first chunk is damaged, and a digit of the beginning in the facts is, which have no checksum."""
    data = file(name)
    begin, end = next((begin, end) for begin, end in records(data) if data[begin] == 6)
    bad = changed(data, (begin + end) // 2, 0xFF)
    recording = Recording(bad.replace(str(WALL).encode(), str(WALL + by).encode(), 1))
    times = [recording.time(number) for number in range(len(recording))]

    assert recording.damaged
    assert times
    assert all(0.0 <= each <= told()[-1].at for each in times)
