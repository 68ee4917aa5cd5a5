"""The player against a naive scan: wherever it goes, whatever the speed, it gives what was there then."""

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.services.bus.interface import Sample
from engage_hri.services.recording.player import Playback, Timeline
from tests.recording.files import recording, sample

NAMES = ("a", "b", "c")
TICK = 1 / 512
"""Seconds: a number that files and floats hold exactly."""
STATES = (keys.WORLD, keys.HEAD_OWNER, keys.statistics("all"))


def ticks(most: int) -> st.SearchStrategy[float]:
    return st.integers(0, most).map(lambda number: number * TICK)


@st.composite
def stories(draw: st.DrawFn) -> list[Sample]:
    """Participants come and go, and say things; some share a process."""
    found: list[Sample] = []
    runs = {name: "shared" if name != "c" else "own" for name in NAMES}
    at = 0.0
    for number in range(draw(st.integers(0, 25))):
        at += draw(st.sampled_from([0.0, TICK, 0.5]))
        name = draw(st.sampled_from(NAMES))
        kind = draw(st.sampled_from(["come", "go", "state", "event", "state"]))
        if kind == "come":
            found.append(
                sample(keys.alive(name), PeerAlive(participant=name, run=runs[name]), at, source=name, life="")
            )
        elif kind == "go":
            found.append(sample(keys.alive(name), PeerGone(participant=name), at, source=name, life=""))
        else:
            key = draw(st.sampled_from(STATES)) if kind == "state" else keys.fault(name)
            found.append(sample(key, Fault(reason=str(number)), at, source=name, life=runs[name], number=number + 1))
    return found


def standing(samples: Sequence[Sample]) -> list[Sample]:
    """What stands after these messages, by going through all of them. A life that comes back has its states still."""
    there: dict[str, int] = {}
    runs: dict[str, str] = {}
    states: dict[str, int] = {}
    silent_since: dict[str, int] = {}
    for number, one in enumerate(samples):
        if keys.is_presence(one.key) and b"peer_alive" in one.payload:
            there[one.source] = number
            runs[one.source] = "own" if one.source == "c" else "shared"
            silent_since.pop(runs[one.source], None)
        elif keys.is_presence(one.key):
            if there.pop(one.source, None) is not None:
                run = runs.pop(one.source)
                if run not in runs.values():
                    silent_since[run] = number
        elif keys.key_class(one.key) == "state":
            states[one.key] = number
    standing = [number for number in states.values() if number > silent_since.get(samples[number].life, -1)]
    return [samples[number] for number in sorted([*there.values(), *standing])]


@given(stories(), st.lists(st.tuples(ticks(8000), ticks(1500)), max_size=6))
def test_wherever_it_goes_it_gives_what_a_scan_gives(samples: list[Sample], ways: list[tuple[float, float]]) -> None:
    player = Playback(recording(samples, chunk=4), 0.0)
    now = 0.0
    for to, while_ in ways:
        place = min(to, player.end)
        stood = player.seek(to, now)
        assert stood == standing([one for one in samples if one.at < place])

        now += while_
        until = min(player.end, place + while_)
        assert player.advance(now) == [one for one in samples if place <= one.at <= until]


@given(stories(), st.sampled_from([0.25, 1.0, 3.0, 7.0]))
def test_from_deadline_to_deadline_each_message_comes_once_in_order(samples: list[Sample], speed: float) -> None:
    player = Playback(recording(samples), 100.0, speed=speed)
    found: list[Sample] = []
    while (due := player.deadline) is not None:
        before = len(found)
        found += player.advance(due)
        assert len(found) > before, "the deadline came, and nothing was due"
        assert found[-1].at / speed == pytest.approx(due - 100.0, abs=1e-6)

    assert found == samples
    assert player.is_over


def test_a_pause_stops_time_and_a_change_of_speed_keeps_the_place() -> None:
    samples = [sample(keys.fault("a"), Fault(reason=str(at)), float(at), number=at + 1) for at in range(10)]
    player = Playback(recording(samples), 0.0)

    assert [one.at for one in player.advance(2.5)] == [0.0, 1.0, 2.0]
    player.pause(2.5)
    assert (player.at(60.0), player.deadline, player.advance(60.0)) == (2.5, None, [])
    player.play(60.0, speed=2.0)
    assert player.deadline == 60.25
    assert [one.at for one in player.advance(61.0)] == [3.0, 4.0]
    player.play(61.0, speed=0.5)
    assert player.at(63.0) == 5.5
    assert [one.at for one in player.advance(1000.0)] == [5.0, 6.0, 7.0, 8.0, 9.0]
    assert (player.at(1000.0), player.is_over) == (9.0, True)


def test_it_ends_where_it_is_told_to() -> None:
    samples = [sample(keys.fault("a"), Fault(reason=str(at)), float(at), number=at + 1) for at in range(10)]
    player = Playback(recording(samples), 0.0, until=4.0)

    assert [one.at for one in player.advance(100.0)] == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert player.is_over
    assert player.seek(8.0, 100.0) == []
    assert player.at(200.0) == 4.0


def test_the_number_until_a_time_is_that_of_a_count() -> None:
    samples = [sample(keys.fault("a"), Fault(reason="x"), at) for at in (0.0, 0.0, 0.5, 0.5, 0.5, 2.0)]
    timeline = Timeline(recording(samples))

    for at in (-1.0, 0.0, 0.25, 0.5, 1.0, 2.0, 3.0):
        assert timeline.until(at) == len([one for one in samples if one.at <= at])
        assert timeline.before(at) == len([one for one in samples if one.at < at])
