"""A bug that shows with one person costs that person's open events, and nobody anything else."""

import random
from collections import Counter
from typing import Any

import pytest
from msgspec.structs import replace

from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorLost
from engage_hri.schemas.recognition import ConnectionEvent, EventOutcome
from engage_hri.schemas.requests import Accepted
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.gazes import Gazes
from engage_hri.services.recognition.events.machine import Mishap, UndefinedTransition
from engage_hri.services.recognition.events.mutual_facial_gaze import MutualFacialGaze
from engage_hri.services.recognition.events.person import PersonRecognition
from engage_hri.services.recognition.events.session import Session
from engage_hri.services.recognition.perceive.manipulation import Manipulation
from engage_hri.services.recognition.perceive.onsets import Looking
from engage_hri.services.recognition.recognizer import Recognizer
from tests.random_cases import share_of
from tests.recognition.observations import ROBOT, request_event, stamp, world
from tests.recognition.raw import pose, table, voice
from tests.recognition.test_random_streams import Chance

PEOPLE = ("ann", "bob", "eve")


class Broken(MutualFacialGaze):
    """A recognizer with a bug: from `breaks_at` on everything raises."""

    breaks_at = 0.0

    def human_begins(self, *event: Any, at: float, **given: Any) -> None:
        self._break(at)
        super().human_begins(*event, at=at, **given)

    def gazes(self, *, at: float, **given: Any) -> None:
        self._break(at)
        super().gazes(at=at, **given)

    def _break(self, at: float) -> None:
        if at >= self.breaks_at:
            raise ZeroDivisionError("a bug")


def meeting(*, strict: bool = False) -> Session:
    session = Session(ROBOT, RecognitionConfig(), strict=strict)
    session.feed(world(*PEOPLE), 0.0)
    return session


def break_gaze(session: Session, name: str, breaks_at: float) -> None:
    person = session.persons[name]
    person.gazes.facial = Broken(session._writer)
    person.gazes.facial.breaks_at = breaks_at


def looks(actor: str, at: float, *targets: str) -> ActionBegan:
    return ActionBegan(actor=actor, action="look", at=stamp(at), targets=targets)


def run(*, broken: bool) -> list[object]:
    """Three people look at the robot, ask and are asked; the robot looks at one after the other."""
    session = meeting()
    if broken:
        break_gaze(session, "bob", 3.0)
    effects: list[object] = []
    for number, name in enumerate(PEOPLE):
        effects += session.feed(looks(name, 1.0 + 0.1 * number, ROBOT), 1.0 + 0.1 * number)
        asked = request_event("directed_gaze", 2.5, "blue-square", request=f"dg-{name}", responder=name)
        effects += session.feed(asked, 2.5)
    for number, name in enumerate(PEOPLE):
        at = 2.7 + 0.2 * number
        effects += session.feed(looks(ROBOT, at, name, "blue-square"), at)
    for number, name in enumerate(PEOPLE):
        at = 4.0 + 0.1 * number
        effects += session.feed(looks(name, at, "blue-square"), at)
    return effects + session.advance(30.0)


def events_of(effects: list[object], *names: str) -> Counter[ConnectionEvent]:
    events = (effect for effect in effects if isinstance(effect, ConnectionEvent))
    return Counter(replace(event, id="") for event in events if event.person(ROBOT) in names)


def test_the_events_of_the_others_are_the_same():
    whole, damaged = run(broken=False), run(broken=True)

    assert events_of(damaged, "ann", "eve") == events_of(whole, "ann", "eve")
    assert events_of(damaged, "bob") != events_of(whole, "bob")


def test_the_persons_open_events_are_lost_and_the_requests_answered():
    effects = run(broken=True)
    mishaps = [effect for effect in effects if isinstance(effect, Mishap)]
    lives: dict[str, list[str]] = {}
    for effect in effects:
        if isinstance(effect, ConnectionEvent) and effect.person(ROBOT) == "bob":
            lives.setdefault(effect.id, []).append(effect.state)

    assert [(mishap.actor, mishap.at, str(mishap.error)) for mishap in mishaps] == [("bob", 3.1, "a bug")]
    assert ["lost" in states for states in lives.values()] == [True, True, False]
    assert [states[-1] for states in lives.values()][:2] == ["lost", "lost"]
    accepted = Counter(effect.id for effect in effects if isinstance(effect, Accepted))
    outcomes = Counter(effect.id for effect in effects if isinstance(effect, EventOutcome))
    assert accepted == outcomes
    answers = [one.state for one in effects if isinstance(one, EventOutcome) and one.id == "dg-bob"]
    assert answers == ["lost"]


def test_the_person_goes_on_with_fresh_recognizers():
    session = meeting()
    break_gaze(session, "bob", 0.0)
    session.feed(looks("bob", 1.0, ROBOT), 1.0)
    effects = session.feed(looks("bob", 2.0, ROBOT), 2.0)

    assert [effect.state for effect in effects if isinstance(effect, ConnectionEvent)] == ["started"]
    assert session.deadline == pytest.approx(3.9)


def test_a_bug_that_shows_by_the_passing_of_time_does_not_show_for_ever(monkeypatch: pytest.MonkeyPatch):
    session = meeting()
    session.feed(looks("bob", 1.0, ROBOT), 1.0)
    session.feed(looks("eve", 1.0, ROBOT), 1.0)
    session.persons["bob"].gazes.facial.expire = lambda at: 1 / 0  # type: ignore[method-assign, assignment]
    effects = session.advance(10.0)

    assert [effect.actor for effect in effects if isinstance(effect, Mishap)] == ["bob"]
    assert [(one.initiator, one.state) for one in effects if isinstance(one, ConnectionEvent)] == [
        ("bob", "lost"), ("eve", "failed"),
    ]  # fmt: skip
    assert session.deadline is None


def test_a_bug_while_a_request_is_taken_answers_it_all_the_same(monkeypatch: pytest.MonkeyPatch):
    session = meeting()
    monkeypatch.setattr(Gazes, "robot_asks", lambda *given: 1 / 0)
    effects = session.feed(request_event("directed_gaze", 1.0, "blue-square", responder="bob"), 1.0)

    assert [type(effect).__name__ for effect in effects] == [
        "Accepted", "Mishap", "ConnectionEvent", "ConnectionEvent", "EventOutcome",
    ]  # fmt: skip
    assert isinstance(effects[-1], EventOutcome)
    assert effects[-1].state == "lost"


def test_who_spoke_when_it_happened_does_not_keep_the_others_from_directing():
    session = meeting()
    session.feed(ActionBegan(actor="bob", action="speak", at=stamp(1.0)), 1.0)
    session.feed(looks("eve", 1.0, "blue-square"), 1.0)
    break_gaze(session, "bob", 0.0)
    session.feed(looks("bob", 1.5, ROBOT), 1.5)
    effects = session.advance(10.0)

    assert [one.at.seconds for one in effects if isinstance(one, ConnectionEvent) and one.initiator == "eve"][:1] == [
        2.1
    ]


def test_strict_a_bug_is_raised():
    session = meeting(strict=True)
    break_gaze(session, "bob", 0.0)

    with pytest.raises(ZeroDivisionError):
        session.feed(looks("bob", 1.0, ROBOT), 1.0)


def test_an_undefined_transition_is_such_a_bug():
    session = meeting()
    session.feed(looks("bob", 1.0, ROBOT), 1.0)
    session.persons["bob"].gazes.facial.state = "somewhere"
    session._people.apply("bob", 1.5, lambda person: person.gazes.facial.step("limit", 1.5))
    (mishap, lost) = session.advance(1.5)

    assert isinstance(mishap, Mishap)
    assert isinstance(mishap.error, UndefinedTransition)
    assert isinstance(lost, ConnectionEvent)
    assert lost.state == "lost"


def test_track_of_a_person_can_be_lost_from_outside():
    recognizer = Recognizer(ROBOT, RecognitionConfig())
    recognizer.feed(world(*PEOPLE), 0.0, 0.0)
    for name in PEOPLE:
        recognizer.feed(looks(name, 1.0, ROBOT), 1.0, 1.0)
    effects = recognizer.lose_track("bob", 1.5)
    late = recognizer.advance(10.0)

    assert [(one.initiator, one.state) for one in effects if isinstance(one, ConnectionEvent)] == [("bob", "lost")]
    assert [(one.initiator, one.state) for one in late if isinstance(one, ConnectionEvent)] == [
        ("ann", "failed"), ("eve", "failed"),
    ]  # fmt: skip
    assert recognizer.lose_track("nobody", 11.0) == []


@pytest.mark.parametrize("seed", range(share_of(30)))
def test_every_event_ends_and_every_request_is_answered_whatever_breaks(monkeypatch: pytest.MonkeyPatch, seed: int):
    chance = random.Random(seed)
    for name in ("gaze_changed", "begins", "tell", "leave", "pass_time"):
        monkeypatch.setattr(PersonRecognition, name, _sometimes(getattr(PersonRecognition, name), chance))
    session = Session(ROBOT, RecognitionConfig(), strict=False)
    session.feed(world("ann", "bob"), 0.0)
    effects: list[object] = []
    asked = set()
    for at, observation in Chance(random.Random(seed).choice).stream(200):
        if hasattr(observation, "event"):
            if observation.id in asked:
                continue
            asked.add(observation.id)
        effects += session.feed(observation, at)
    for name in ("ann", "bob"):
        effects += session.feed(ActorLost(actor=name, at=stamp(500.0)), 500.0)
    effects += session.advance(1000.0)

    assert any(isinstance(effect, Mishap) for effect in effects)
    last = {effect.id: effect.state for effect in effects if isinstance(effect, ConnectionEvent)}
    assert set(last.values()) <= {"failed", "preempted", "withdrawn", "superseded", "completed", "lost"}
    accepted = Counter(effect.id for effect in effects if isinstance(effect, Accepted))
    assert accepted == Counter(effect.id for effect in effects if isinstance(effect, EventOutcome))
    assert session.deadline is None


def _sometimes(method, chance):  # type: ignore[no-untyped-def]
    def happen(*given, **named):  # type: ignore[no-untyped-def]
        if chance.random() < 0.05:
            raise ZeroDivisionError("a bug")
        return method(*given, **named)

    return happen


# -- raw perception -----------------------------------------------------------------------------------------------


def filmed(monkeypatch: pytest.MonkeyPatch, place: type, name: str) -> list[object]:
    """ann looks at the blue piece and speaks; from 1.0 to 1.1 s a bug shows with every measurement."""
    recognizer = Recognizer(ROBOT, RecognitionConfig(), strict=False)
    results: list[object] = [*recognizer.feed(table(), 0.0, 0.0)]
    method, broken = getattr(place, name), False

    def happen(*given, **named):  # type: ignore[no-untyped-def]
        if broken:
            raise ZeroDivisionError("a bug")
        return method(*given, **named)

    monkeypatch.setattr(place, name, happen)
    for frame in range(60):
        at = 0.1 * frame
        broken = 1.0 <= at < 1.15
        results += recognizer.feed(table() if frame % 2 else table(without="red"), at, at)
        for seen in (pose("blue", at, actor="ann"), voice(0.5 < at < 2.0, at, actor="ann")):
            results += recognizer.feed(seen, at, at)
        results += recognizer.advance(at)
    return results + recognizer.advance(20.0)


@pytest.mark.parametrize(("place", "name"), [(Looking, "feed"), (Manipulation, "feed"), (Manipulation, "advance")])
def test_a_bug_in_raw_perception_costs_what_it_had_found_out(monkeypatch: pytest.MonkeyPatch, place: type, name: str):
    results = filmed(monkeypatch, place, name)

    assert any(isinstance(result, Mishap) for result in results)
    speech = [one for one in results if isinstance(one, ActionBegan | ActionEnded) and one.action == "speak"]
    assert [isinstance(one, ActionBegan) for one in speech] == [True, False, True, False]
    last = {one.id: one.state for one in results if isinstance(one, ConnectionEvent)}
    assert last
    assert "lost" not in last.values()
    assert set(last.values()) <= {"failed", "withdrawn", "completed"}
