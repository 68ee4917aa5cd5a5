"""Many people who pass by: they are forgotten, cost nothing when they have gone, and change no event of others."""

import random
from collections import Counter
from unittest import mock

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from engage_hri.schemas.perception import ActionBegan, ActorFound, ActorLost
from engage_hri.schemas.recognition import ConnectionEvent, EventOutcome, Statistics
from engage_hri.schemas.requests import Accepted, Refused
from engage_hri.services.bus.deadlines import FORGOTTEN_AFTER
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events import people
from engage_hri.services.recognition.events.gazes import AFTER_ROBOT_DIRECTED, DIRECT_BY_LOOK
from engage_hri.services.recognition.events.machine import PersonForgotten
from engage_hri.services.recognition.events.open_events import OpenEventTracker
from engage_hri.services.recognition.events.person import Part, PersonRecognition
from engage_hri.services.recognition.events.session import Session
from engage_hri.services.recognition.statistics.published import PublishedStatistics
from tests.random_cases import share_of
from tests.recognition.kept import kinds
from tests.recognition.observations import HUMAN, ROBOT, Log, request_event, stamp, world
from tests.recognition.passers import EVERY, Lobby, visit
from tests.recognition.test_random_streams import Chance, Stream

NEVER = 1e9


def forgotten(log: Log) -> list[str]:
    return [effect.actor for effect in log.effects if isinstance(effect, PersonForgotten)]


# -- who is forgotten ---------------------------------------------------------------------------------------------


def met_and_lost(**config: object) -> Log:
    log = Log("host", **config)
    log.found("ann", 1.0)
    log.looks("ann", ROBOT, 1.0)
    log.lost("ann", 2.0)
    return log


def test_who_has_been_gone_for_long_is_forgotten():
    log = met_and_lost()
    log.until(1.9 + FORGOTTEN_AFTER)
    assert "ann" in log.session.persons
    log.until(2.0 + FORGOTTEN_AFTER)

    assert forgotten(log) == ["ann"]
    assert "ann" not in log.session.persons
    log.requests_event("mutual_facial_gaze", 3.0 + FORGOTTEN_AFTER, responder="ann")
    faults = [effect.fault for effect in log.effects if isinstance(effect, Refused)]
    assert [(fault.reason, fault.advice) for fault in faults] == [("unknown actor 'ann'", "known: host")]


def test_a_request_of_a_robot_that_has_met_nobody_is_refused_in_these_words():
    session = Session(ROBOT, RecognitionConfig())

    (refused,) = session.feed(request_event("mutual_facial_gaze", 0.0, responder="ann", request="r-1"), 0.0)

    assert isinstance(refused, Refused)
    assert refused.fault.advice == "known: nobody"


def test_nothing_waits_for_forgetting():
    log = met_and_lost()
    log.until(5.0)

    assert log.session.deadline is None


def test_who_comes_back_in_time_is_not_forgotten():
    log = met_and_lost()
    log.found("ann", FORGOTTEN_AFTER)
    log.until(3 * FORGOTTEN_AFTER)

    assert forgotten(log) == []


def test_who_is_in_the_world_is_not_forgotten_though_the_face_is_lost():
    log = Log("ann")
    log.lost("ann", 2.0)
    log.until(1000.0)
    assert forgotten(log) == []
    log.feed(world("host"), 1001.0)
    log.until(1001.0 + FORGOTTEN_AFTER)

    assert forgotten(log) == ["ann"]


def test_who_is_missing_in_the_world_and_told_of_by_nobody_has_gone():
    log = Log("ann")
    log.looks("ann", ROBOT, 1.0)
    log.looks(ROBOT, "ann", 1.5)
    log.feed(world("host"), 10.0)
    log.until(9.9 + FORGOTTEN_AFTER)
    assert log.states("mfg-1") == ["started", "succeeded"]
    log.until(10.0 + FORGOTTEN_AFTER)

    assert forgotten(log) == ["ann"]
    assert log.told()[-1] == ("mfg-1", "completed", 10.0 + FORGOTTEN_AFTER)
    assert log.last("mfg-1").duration == pytest.approx(8.5)


def test_whom_only_their_actions_tell_of_are_forgotten_after_the_last():
    log = Log("host")
    log.begins("voice-1", "speak", 1.0)
    log.ends("voice-1", "speak", 30.0)
    log.until(29.9 + FORGOTTEN_AFTER)
    assert forgotten(log) == []
    log.until(30.0 + FORGOTTEN_AFTER)

    assert forgotten(log) == ["voice-1"]


def test_who_has_been_found_is_there_however_quiet():
    log = Log("host")
    log.found("ann", 1.0)
    log.until(5000.0)

    assert forgotten(log) == []


def test_who_comes_back_later_is_somebody_new_and_the_totals_stay():
    log, published = met_and_lost(), PublishedStatistics(ROBOT, RecognitionConfig())
    log.until(700.0)
    log.found("ann", 700.0)
    log.looks("ann", ROBOT, 700.0)
    changes = [effect for effect in log.effects if isinstance(effect, ConnectionEvent | PersonForgotten)]
    published.feed(changes, set(), 700.0)
    (first, everybody) = sorted(published.told(700.0), key=lambda one: one.session.events)

    assert (first.actor, first.session.events) == ("ann", 1)
    assert (everybody.actor, everybody.session.events) == ("", 2)
    assert everybody.session.max_gap == 699.0


def test_the_book_of_open_events_keeps_nobody_without_one():
    book = OpenEventTracker(ROBOT, "s")
    log = met_and_lost()
    log.until(10.0)
    told = book.feed(log.events, stamp(10.0))

    assert [(one.actor, one.events) for one in told] == [("ann", ())]
    assert kinds(book)["OpenEvents"] == 0
    assert book._open == {}


def test_nobody_is_forgotten_who_may_still_count():
    assert max(AFTER_ROBOT_DIRECTED, DIRECT_BY_LOOK) < FORGOTTEN_AFTER


# -- what they cost -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("raw", [False, True], ids=["symbolic", "raw"])
def test_what_is_kept_does_not_grow_with_those_who_have_passed(raw: bool):
    lobby = Lobby(RecognitionConfig())
    sizes = []
    for number in range(600):
        for at, observation in visit(number, raw=raw):
            lobby.feed(observation, at)
        if number in (299, 599):  # later than what is remembered of the robot's looks
            sizes.append(kinds(*lobby.kept()))
    early, late = sizes

    assert len(lobby.recognizer.session.persons) <= FORGOTTEN_AFTER / EVERY + 2
    for kind, count in late.items():
        assert count <= 1.1 * early[kind] + 40, kind


def asks(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The persons who are asked when they are due, from now on."""
    asked: list[str] = []
    settle = PersonRecognition.settle

    def ask(person: PersonRecognition, part: Part) -> None:
        asked.append(person.id)
        settle(person, part)

    monkeypatch.setattr(PersonRecognition, "settle", ask)
    return asked


def test_a_step_asks_nobody_who_has_gone(monkeypatch: pytest.MonkeyPatch):
    asked = asks(monkeypatch)
    lobby = Lobby(RecognitionConfig())
    for number in range(60):
        asked.clear()
        for at, observation in visit(number, raw=False):
            lobby.feed(observation, at)
        if number > 0:
            assert set(asked) <= {"host", f"track-{number - 1}", f"track-{number}"}
            assert len(asked) < 60

    assert len(lobby.recognizer.session.persons) == 61


def test_a_step_asks_no_more_than_one_of_many_who_are_here(monkeypatch: pytest.MonkeyPatch):
    log = Log(*(f"person-{number}" for number in range(50)))
    asked = asks(monkeypatch)
    log.looks("person-7", ROBOT, 1.0)
    log.until(2.0)

    assert asked == ["person-7"]


# -- what they change ---------------------------------------------------------------------------------------------


class Crowd(Stream):
    """Two who are in the world, and passers-by, some of whom come again; told by its seed."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        chance = Chance(random.Random(seed).choice)
        pick, at = chance.pick, 0.0
        super().__init__()
        here: dict[str, float] = {}
        names = [f"track-{number}" for number in range(12)]
        gone = dict.fromkeys(names, -NEVER)
        while len(self) < 250:
            at += pick((0.0, 0.1, 0.1, 0.2, 0.3, 0.4, 0.7, 2.0))
            for name in [name for name, until in here.items() if until <= at]:
                self.append((at, ActorLost(actor=name, at=stamp(at))))
                del here[name]
                gone[name] = at
            if len(here) < 3 and pick((True, False, False)):
                name = pick([name for name in names if name not in here])
                if at - gone[name] > 8.0:
                    here[name] = at + pick((0.5, 2.0, 5.0))
                    self.append((at, ActorFound(actor=name, at=stamp(at))))
            observation = chance.observation(at)
            if here and pick((True, False)):
                observation = _of(pick(tuple(here)), observation)
            self.append((at, observation))

    def __repr__(self) -> str:
        return f"Crowd({self._seed})"


def _of(name: str, observation: object) -> object:
    """The same, with somebody else instead of ann."""
    if getattr(observation, "actor", "") == "ann":
        return replace(observation, actor=name)
    if getattr(getattr(observation, "event", None), "responder", "") == "ann":
        return replace(observation, event=replace(observation.event, responder=name))
    if isinstance(observation, ActionBegan) and observation.targets == ("ann",):
        return replace(observation, targets=(name,))
    return observation


def told(stream: Stream, forgotten_after: float) -> tuple[Counter[object], Statistics, int]:
    """The effects, but for their numbers: at one instant it is whoever was met first; the totals; who is known.

    forgotten_after: in place of the bound of the house.
    """
    with mock.patch.object(people, "FORGOTTEN_AFTER", forgotten_after):
        return _told(stream, RecognitionConfig())


def _told(stream: Stream, config: RecognitionConfig) -> tuple[Counter[object], Statistics, int]:
    session, published = Session(ROBOT, config), PublishedStatistics(ROBOT, config)
    session.feed(world("ann", "bob"), 0.0)
    effects = []
    for at, observation in stream:
        new = session.feed(observation, at)
        published.feed((one for one in new if isinstance(one, ConnectionEvent | PersonForgotten)), session.busy, at)
        effects += new
    end = stream[-1][0]
    known = len(session.persons)
    effects += session.advance(end + 5.0)
    kept: Counter[object] = Counter()
    for effect in effects:
        match effect:
            case ConnectionEvent():
                kept[replace(effect, id="")] += 1
            case EventOutcome():
                kept[replace(effect, event="")] += 1
            case Accepted(id=id) | Refused(id=id):
                kept[type(effect), id] += 1
    return kept, published.overall(end), known


@settings(max_examples=share_of(60), deadline=None)
@given(st.integers(0, 10**6).map(Crowd))
def test_events_and_totals_are_the_same_as_if_nobody_were_forgotten(stream):
    events, totals, known = told(stream, 6.3)
    expected, expected_totals, all_known = told(stream, NEVER)

    assert events == expected
    for one, other in ((totals.session, expected_totals.session), (totals.recent, expected_totals.recent)):
        assert (one.mtbce, one.max_gap, one.events) == (other.mtbce, other.max_gap, other.events)
        for kind, other_kind in zip(one.kinds, other.kinds, strict=True):
            means = (kind.delay_mean, kind.failed_delay_mean)
            assert means == pytest.approx((other_kind.delay_mean, other_kind.failed_delay_mean))
            assert replace(kind, delay_mean=None, failed_delay_mean=None) == replace(
                other_kind, delay_mean=None, failed_delay_mean=None
            )
    assert known <= all_known


def test_in_such_streams_people_are_forgotten():
    fewer = [told(Crowd(seed), 6.3)[2] < told(Crowd(seed), NEVER)[2] for seed in range(10)]

    assert all(fewer)


def test_a_human_of_the_world_is_met_once():
    log = Log(HUMAN)
    for second in range(1, 5):
        log.feed(world(HUMAN), float(second))

    assert len(log.session.persons) == 1
