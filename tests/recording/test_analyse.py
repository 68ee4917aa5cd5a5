"""Numbers of recordings: those of the live run, to the last bit; conditions compared; and what is said of doubts."""

import random
from pathlib import Path

import numpy as np
import pytest

from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.recognition import Statistics
from engage_hri.schemas.units import Seconds
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.commandline.study.analyse import Session, compare, found, numbered, sessions
from engage_hri.services.recording.disk import read
from engage_hri.services.study.permutation import separate
from engage_hri.services.study.records import SessionRecorder as Record
from engage_hri.services.tangram.people.config import SimulationConfig
from tests.recording.files import bytes_of
from tests.recording.runs import tangram
from tests.study.sessions import session as made


async def test_the_numbers_of_a_recording_are_those_of_the_live_run(tmp_path: Path) -> None:
    config = Config(simulation=SimulationConfig(human="stochastic", seed=3))
    live, last = Record("robot"), list[Statistics]()

    def watch(message: Message, at: Seconds) -> None:
        if isinstance(message, Statistics) and message.actor == "":
            last.append(message)

    await tangram(tmp_path / "a.mcap", config, live, watch)

    (again,) = sessions(read(tmp_path / "a.mcap"))

    expected = live.session(session=0, condition="recorded", seed=0)
    assert again.record.statistics == last[-1].session == expected.statistics
    assert again.published == last[-1].session
    assert again.record.statistics.events > 50
    assert again.events == live.events(session=0, condition="recorded")
    assert again.record.completion_time == pytest.approx(expected.completion_time, abs=1e-6)
    assert again.record.adjacency_pairs_every == pytest.approx(expected.adjacency_pairs_every, abs=1e-6)
    assert again.record.eye_contact is not None
    assert expected.eye_contact is not None
    for third in ("first", "second", "last"):
        assert getattr(again.record.eye_contact, third) == pytest.approx(
            getattr(expected.eye_contact, third), abs=1e-6
        )
    assert again.doubts == ()


def of(condition: str, participant: str, number: float = 1.0) -> Session:
    record = made(condition, 0, completion=number, pairs=number, face=(0.5, 0.5, 0.5 - number / 100))
    return Session(
        path=Path(f"{participant}-{condition}.mcap"), condition=condition, participant=participant, record=record,
        events=(), published=None, doubts=(),
    )  # fmt: skip


def test_sessions_of_the_same_people_are_paired_by_participant() -> None:
    given = [of(condition, f"p{n}", n) for n in range(8) for condition in ("a", "b")]
    random.Random(0).shuffle(given)

    sessions, is_within = numbered(given)
    findings, tables = compare(sessions, "a", is_within=is_within)

    assert is_within
    assert {(one.participant, one.record.session) for one in sessions} == {
        (name, number) for name, number in {one.participant: one.record.session for one in sessions}.items()
    }
    assert {(one.condition, one.n) for one in findings} == {("b", 8), ("b", 0)}
    assert "Sessions of the same participant are compared as pairs" in tables[1].markdown()


@pytest.mark.parametrize(
    "given",
    [
        [of("a", "p1"), of("b", "p2"), of("b", "p3")],  # different people
        [of("a", "p1"), of("a", "p1"), of("b", "p1")],  # one of them twice
        [of("a", ""), of("b", "")],  # nobody says who
    ],
)
def test_other_sessions_are_not_paired(given: list[Session]) -> None:
    sessions, is_within = numbered(given)

    assert not is_within
    assert [one.record.session for one in sessions] == [*range(len(given))]


def test_different_people_are_compared_as_separate_samples() -> None:
    given = [of("a", f"a{n}", 10.0 + n) for n in range(8)] + [of("b", f"b{n}", 20.0 + n) for n in range(7)]

    sessions, is_within = numbered(given)
    findings, tables = compare(sessions, "a", is_within=is_within)

    eight = next(one for one in findings if one.hypothesis == "8")
    assert (eight.n, eight.operational, eight.degraded) == (15, 13.5, 23.0)
    assert eight.difference == pytest.approx(9.5)
    assert eight.verdict == "supported"
    assert "Sessions of different people are compared" in tables[1].markdown()
    assert "this command cannot know" in tables[1].markdown().replace("\n", " ")


def test_without_a_baseline_nothing_is_compared_and_that_is_said() -> None:
    sessions, is_within = numbered([of("x", "p1"), of("y", "p2")])

    findings, tables = compare(sessions, None, is_within=is_within)

    assert not findings
    assert "nothing is compared: name one by --baseline" in tables[-1].markdown()
    with pytest.raises(InputRefused, match="no recording has the condition 'z'"):
        compare(sessions, "z", is_within=is_within)


def test_a_folder_stands_for_the_recordings_in_it(tmp_path: Path) -> None:
    for name in ("b.mcap", "a.mcap", "notes.txt"):
        (tmp_path / name).write_bytes(bytes_of([]))

    assert found([tmp_path]) == [tmp_path / "a.mcap", tmp_path / "b.mcap"]
    with pytest.raises(InputRefused, match="no recordings"):
        found([tmp_path / "none"] if (tmp_path / "none").mkdir() is None else [])


def naive_p(first: list[float], second: list[float]) -> float:
    """By drawing every division anew."""
    from itertools import combinations

    both = first + second
    observed = abs(sum(second) / len(second) - sum(first) / len(first))
    count = extreme = 0
    for chosen in combinations(range(len(both)), len(second)):
        inside = [both[n] for n in chosen]
        outside = [both[n] for n in range(len(both)) if n not in chosen]
        count += 1
        extreme += abs(sum(inside) / len(inside) - sum(outside) / len(outside)) >= observed - 1e-9
    return extreme / count


@pytest.mark.parametrize("sizes", [(1, 1), (3, 3), (4, 6), (7, 2)])
def test_the_test_of_separate_samples_counts_all_divisions(sizes: tuple[int, int]) -> None:
    chance = np.random.default_rng(sum(sizes))
    first, second = (list(map(float, chance.normal(n, 1.0, size))) for n, size in enumerate(sizes))

    result = separate(first, second)

    assert result.n == sum(sizes)
    assert result.p == pytest.approx(naive_p(first, second))
    if result.low is not None and result.high is not None and result.mean is not None:
        assert result.low <= result.mean <= result.high


def test_an_interval_holds_the_true_difference_as_often_as_it_says() -> None:
    chance, held = np.random.default_rng(1), 0
    for _ in range(100):
        first, second = chance.normal(0.0, 1.0, 7), chance.normal(1.0, 1.0, 8)
        result = separate(list(first), list(second))
        assert result.low is not None
        assert result.high is not None
        held += result.low <= 1.0 <= result.high

    assert 88 <= held <= 100


def test_many_people_are_compared_by_a_sample_of_the_divisions() -> None:
    chance = np.random.default_rng(2)
    result = separate(list(chance.normal(0.0, 1.0, 30)), list(chance.normal(2.0, 1.0, 30)))

    assert result.p is not None
    assert 0 < result.p < 0.001
    assert separate([], [1.0]).mean is None
