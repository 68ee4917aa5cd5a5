"""Delays and durations of random streams equal what their definitions give of the raw observations.

delay: responder's start - initiator's start, of an adjacency pair from the end of the turn; duration: how long both
looked there. The oracle knows looks, words, gestures and signals; of recognition only which events there were.
"""

import random

from hypothesis import assume, given, settings
from hypothesis import strategies as st
from msgspec import Struct

from engage_hri.schemas.behaviors import Action, TurnSignal
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.recognition import ConnectionEvent, SignalTurn
from engage_hri.schemas.units import Seconds
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.session import Session
from tests.random_cases import share_of
from tests.recognition.observations import ROBOT, request_event, stamp, world
from tests.recognition.test_random_streams import Chance, Stream

PEOPLE = ("ann", "bob")
CONFIG = RecognitionConfig()
PLACES = (ROBOT, *PEOPLE, "blue-square", "blue-square", "rectangle", "table", "")


def orderly(chance: Chance, length: int) -> Stream:
    """In order and at an instant of its own each: looks, words and gestures that end, requests, ends of turns."""
    at, stream, busy, turns = 0.0, [], {}, []
    for number in range(length):
        at += chance.pick((0.05, 0.1, 0.1, 0.2, 0.3, 0.5, 0.9)) + number * 1e-6
        actor = chance.pick((ROBOT, *PEOPLE))
        what = chance.pick(("look", "look", "look", "act", "act", "act", "request", "request", "signal"))
        if what == "look":
            place = chance.pick(PLACES)
            targets = (place,) if place not in ("", actor) else ()
            stream.append((at, ActionBegan(actor=actor, action="look", at=stamp(at), targets=targets)))
        elif what == "act" and actor in busy:
            stream.append((at, ActionEnded(actor=actor, action=busy.pop(actor), at=stamp(at))))
        elif what == "act":
            busy[actor] = action = chance.pick(("speak", "speak", "speak", "nod", "shake", "point"))
            stream.append((at, ActionBegan(actor=actor, action=action, at=stamp(at))))
        elif what == "request":
            kind = chance.pick(("directed_gaze", "mutual_facial_gaze", "adjacency_pair"))
            objects = chance.pick((("blue-square",), ("rectangle", "blue-square"))) if kind == "directed_gaze" else ()
            turn = f"turn-{number}" if kind == "adjacency_pair" else ""
            turns += [turn] if turn else []
            stream.append(
                (at, request_event(kind, at, *objects, request=f"request-{number}", turn=turn,
                                   responder=chance.pick(PEOPLE)))
            )  # fmt: skip
        elif turns:
            signal = TurnSignal(id="end", turn=turns.pop(), signal="ended", actor="")
            stream.append((at, SignalTurn(id=f"s-{number}", requester="realizer", signal=signal, at=stamp(at))))
    return stream


class Seeded(Struct):
    """A stream that is told by its seed."""

    seed: int
    length: int

    @property
    def stream(self) -> Stream:
        return orderly(Chance(random.Random(self.seed).choice), self.length)


seeds = st.builds(Seeded, st.integers(0, 10**6), st.sampled_from((30, 150)))


class Life(Struct):
    """One event as published."""

    started: ConnectionEvent
    decided: ConnectionEvent
    completed: ConnectionEvent | None

    @property
    def since(self) -> Seconds:
        return self.started.started.seconds

    @property
    def by_robot(self) -> bool:
        return self.started.initiator == ROBOT

    @property
    def places(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """What the initiator and the responder look at."""
        if self.started.kind == "directed_gaze":
            return self.started.objects, self.started.objects
        return (self.started.responder,), (self.started.initiator,)


def lives(stream: Stream, *kinds: str, people: tuple[str, ...] = PEOPLE) -> list[Life]:
    session = Session(ROBOT, CONFIG)
    session.feed(world(*people), 0.0)
    effects = [effect for at, observation in stream for effect in session.feed(observation, at)]
    effects += session.advance(stream[-1][0] + 100.0)
    found: dict[str, list[ConnectionEvent]] = {}
    for effect in effects:
        is_adopted = isinstance(effect, ConnectionEvent) and effect.retold and effect.kind != "adjacency_pair"
        if isinstance(effect, ConnectionEvent) and effect.kind in kinds and not is_adopted:
            found.setdefault(effect.id, []).append(effect)
    changes = [life for life in found.values() if len(life) > 1]
    return [Life(life[0], life[1], life[2] if len(life) > 2 else None) for life in changes]


class Raw:
    """The observations, asked about."""

    def __init__(self, stream: Stream) -> None:
        self._stream = stream

    def looks(self, actor: str, places: tuple[str, ...]) -> list[tuple[Seconds, Seconds]]:
        """When `actor` looked at one of `places`: from, until."""
        looks: list[tuple[Seconds, tuple[str, ...]]] = []
        for at, seen in self._stream:
            is_look = isinstance(seen, ActionBegan) and (seen.actor, seen.action) == (actor, "look")
            if is_look and (not looks or looks[-1][1] != seen.targets):  # at the same again: it goes on
                looks.append((at, seen.targets))
        ends = [at for at, _ in looks[1:]] + [float("inf")]
        return [(at, end) for (at, targets), end in zip(looks, ends, strict=False) if set(targets) & set(places)]

    def arrival(self, actor: str, places: tuple[str, ...], known: Seconds) -> Seconds:
        """Since when the actor looks there at `known`, or when first after that."""
        return next((since for since, until in self.looks(actor, places) if until > known), float("inf"))

    def together(self, life: Life) -> Seconds:
        """For how long initiator and responder both looked there during the event's shared phase.

        What the responder looked at before the event could be known, and no longer then, is no response.
        """
        assert life.completed is not None
        first, second = life.places
        begin, end, known = life.since, life.completed.at.seconds, life.started.at.seconds
        return sum(
            max(0.0, min(until, other_until, end) - max(since, other_since, begin))
            for since, until in self.looks(life.started.initiator, first)
            for other_since, other_until in self.looks(life.started.responder, second)
            if other_until > known
        )


def close(one: float | None, other: float) -> bool:
    return one is not None and abs(one - other) < 1e-9


@settings(max_examples=share_of(60), deadline=None)
@given(seeds)
def test_the_delay_of_a_gaze_is_from_the_initiators_start_to_the_responders(seeded):
    raw = Raw(seeded.stream)
    for life in lives(seeded.stream, "directed_gaze", "mutual_facial_gaze"):
        arrival = raw.arrival(life.started.responder, life.places[1], life.started.at.seconds)
        if life.by_robot:  # what it asked for may have waited for the person's own event
            arrival = max(arrival, life.started.at.seconds)
        if life.decided.state == "succeeded":
            assert close(life.decided.delay, max(0.0, arrival - life.since))
            assert arrival <= life.since + life.started.limit
        else:
            assert life.decided.at.seconds <= arrival


@settings(max_examples=60, deadline=None)
@given(seeds)
def test_the_duration_of_a_gaze_is_how_long_both_looked_there(seeded):
    raw = Raw(seeded.stream)
    for life in lives(seeded.stream, "directed_gaze", "mutual_facial_gaze"):
        if life.completed is not None:
            assert close(life.completed.duration, raw.together(life)), life


@settings(max_examples=60, deadline=None)
@given(seeds)
def test_a_gaze_fails_at_its_limit_or_when_the_person_turns_away_first(seeded):
    raw = Raw(seeded.stream)
    for life in lives(seeded.stream, "directed_gaze", "mutual_facial_gaze"):
        if life.decided.state == "failed":
            failed = life.decided.at.seconds
            left = [until for _, until in raw.looks(life.started.initiator, life.places[0])]
            turned_away = not life.by_robot and life.started.kind == "mutual_facial_gaze" and failed in left
            assert turned_away or close(failed, life.since + life.started.limit)


class Act(Struct):
    """Something the listener does; at: from the beginning of the turn."""

    action: Action
    at: Seconds
    lasts: Seconds


class Round(Struct):
    """A first turn in words, and what the listener does meanwhile and after it. further: the robot's words then."""

    by_robot: bool
    lasts: Seconds
    acts: list[Act]
    further: list[Act]

    def floor_until(self, at: Seconds) -> Seconds | None:
        """When the floor that the speaker holds will be free; None if it is."""
        if at < self.lasts:
            return self.lasts
        held = (
            self.lasts + word.at + word.lasts for word in self.further if 0 <= at - self.lasts - word.at < word.lasts
        )
        return next(held, None) if self.by_robot else None

    @property
    def answer(self) -> Act | None:
        """The first that is no backchannel: no gesture, nor short speech that is over, while the floor is held."""
        for act in self.acts:
            free = self.floor_until(act.at)
            brief = act.lasts <= CONFIG.backchannel_limit and free is not None and act.at + act.lasts <= free
            gesture = act.action in ("nod", "shake") and free is not None
            if not gesture and not (act.action == "speak" and brief):
                return act if act.at <= self.lasts + CONFIG.adjacency_pair_limit else None
        return None

    def stream(self, turn: str, start: Seconds) -> Stream:
        speaker, listener = (ROBOT, "ann") if self.by_robot else ("ann", ROBOT)
        end = start + self.lasts
        seen: Stream = [(start, ActionBegan(actor=speaker, action="speak", at=stamp(start), behavior=turn))]
        if self.by_robot:
            ask = request_event("adjacency_pair", start, request=turn, turn=turn, responder="ann", block=turn)
            seen.append((start, ask))
        seen.append((end, ActionEnded(actor=speaker, action="speak", at=stamp(end), behavior=turn)))
        if self.by_robot:
            for number, word in enumerate(self.further):
                for kind, at in ((ActionBegan, end + word.at), (ActionEnded, end + word.at + word.lasts)):
                    seen.append(
                        (at, kind(actor=ROBOT, action="speak", at=stamp(at), behavior=f"{turn}/more-{number}"))
                    )
            signal = TurnSignal(id="end", turn=turn, signal="ended", actor="ann")
            seen.append((end, SignalTurn(id=f"{turn}/end", requester="realizer", signal=signal, at=stamp(end))))
        for number, act in enumerate(self.acts):
            for kind, at in ((ActionBegan, start + act.at), (ActionEnded, start + act.at + act.lasts)):
                behavior = f"{turn}/{number}"
                seen.append((at, kind(actor=listener, action=act.action, at=stamp(at), behavior=behavior)))
        return sorted(seen, key=lambda observed: observed[0])


def _one_after_the_other(drawn: list[tuple[Action, int, int]], odd: Seconds = 0.013) -> list[Act]:
    """Pauses and lengths in tenths of a second; at odd thousandths, so that no two things happen at once."""
    acts, at = [], 0.0
    for number, (action, pause, lasts) in enumerate(drawn):
        at += 0.1 * pause + odd
        acts.append(Act(action, at, 0.1 * lasts + 0.0007 * (number + 1)))
        at += acts[-1].lasts
    return acts


actions = st.sampled_from(("speak", "speak", "speak", "nod", "shake", "point"))
acts = st.lists(st.tuples(actions, st.integers(0, 25), st.integers(1, 15)), max_size=4).map(_one_after_the_other)
words = st.lists(st.tuples(st.just("speak"), st.integers(1, 12), st.integers(2, 20)), max_size=2)
further = words.map(lambda drawn: _one_after_the_other(drawn, odd=0.0191))
rounds = st.builds(Round, st.booleans(), st.integers(5, 40).map(lambda tenths: 0.1 * tenths), acts, further)


@settings(max_examples=share_of(150), deadline=None)
@given(st.lists(rounds, min_size=1, max_size=4))
def test_the_delay_of_an_answer_is_from_the_end_of_the_turn(rounds):
    stream = [seen for number, one in enumerate(rounds) for seen in one.stream(f"turn-{number}", 30.0 * number + 1.0)]
    for number, at in enumerate(30.0 * each + 29.0 for each in range(len(rounds))):
        # The robot says a word between the rounds: else the next turn of the person would be a late answer.
        for kind, when in ((ActionBegan, at), (ActionEnded, at + 0.3)):
            stream.append((when, kind(actor=ROBOT, action="speak", at=stamp(when), behavior=f"word-{number}")))
    stream.sort(key=lambda observed: observed[0])
    found = lives(stream, "adjacency_pair", people=("ann",))

    for number, one in enumerate(rounds):
        life = next(life for life in found if close(life.since, 30.0 * number + 1.0))
        if one.answer is None:
            assert (life.decided.state, life.decided.response) == ("failed", None)
            assert close(life.decided.delay, one.lasts + CONFIG.adjacency_pair_limit)
        else:
            assert (life.decided.state, life.decided.response) == ("succeeded", one.answer.action)
            assert close(life.decided.delay, one.answer.at - one.lasts)
            assert life.completed is not None


@settings(max_examples=share_of(150), deadline=None)
@given(rounds, st.lists(st.tuples(st.booleans(), st.integers(5, 150), st.integers(2, 15)), max_size=4))
def test_the_first_answer_after_the_limit_is_late_unless_the_robot_has_spoken_since(one, after):
    """after: further words of robot or person, each some tenths of a second after the last, and how long."""
    limit = 1.0 + one.lasts + CONFIG.adjacency_pair_limit
    stream, at, words = one.stream("turn", 1.0), limit + 12.0, []
    for number, (by_robot, pause, lasts) in enumerate(after):
        at += 0.1 * pause + 0.0113
        actor = ROBOT if by_robot else "ann"
        words.append((at, actor))
        for kind, when in ((ActionBegan, at), (ActionEnded, at + 0.1 * lasts)):
            stream.append((when, kind(actor=actor, action="speak", at=stamp(when), behavior=f"after-{number}")))
        at += 0.1 * lasts
    assume(max([seen[0] for seen in one.stream("turn", 1.0)]) < limit + 12.0)
    stream.sort(key=lambda observed: observed[0])
    session = Session(ROBOT, CONFIG)
    session.feed(world("ann"), 0.0)
    told = [effect for at, seen in stream for effect in session.feed(seen, at)] + session.advance(1e4)
    pairs = [effect for effect in told if isinstance(effect, ConnectionEvent) and effect.kind == "adjacency_pair"]
    late = [effect for effect in pairs if effect.retold]

    if not one.by_robot or one.answer is not None:
        assert late == []
        return
    # Of the round itself: what begins after the limit while the robot is silent, and has been since.
    spoken = [(1.0 + one.lasts + word.at, word.lasts) for word in one.further]
    done = [(1.0 + act.at, "ann", act.action) for act in one.acts] + [(at, ROBOT, "speak") for at, _ in spoken]
    done += [(at, actor, "speak") for at, actor in words]
    since = [(at, actor, action) for at, actor, action in sorted(done) if at > limit]
    is_muddled = any(at + lasts > limit for at, lasts in spoken)
    if is_muddled:  # the robot talks over the limit: what is short then is a backchannel
        return
    first = since[0] if since else None
    assert [(each.response, round(each.delay or 0.0, 6)) for each in late] == (
        [(first[2], round(first[0] - 1.0 - one.lasts, 6))] if first and first[1] != ROBOT else []
    )
