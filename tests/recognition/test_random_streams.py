"""Whatever comes in, in whatever order: no exception, every event ends exactly once, statistics add up."""

import random
from collections.abc import Callable, Sequence
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.behaviors import EVENT_KINDS, TurnSignal
from engage_hri.schemas.blocks import BlockProgress, SyncPointProgress
from engage_hri.schemas.fragments import Claim, HeadOwner
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.recognition import ENDINGS, ConnectionEvent, EventOutcome, SignalTurn, TurnOutcome
from engage_hri.schemas.requests import Accepted, Cancel, Refused
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.machine import DECISIONS
from engage_hri.services.recognition.events.session import Observation, Session
from engage_hri.services.reports.action_reports import FACE_GRACE
from engage_hri.services.reports.ongoing_actions import GoesOn
from tests.random_cases import share_of
from tests.recognition.observations import ROBOT, request_event, stamp, world

Stream = list[tuple[float, Observation]]
ACTORS = ("ann", "bob")
LATENESS = (0.0, 0.0, 0.0, 0.0, 0.3, 1.0)


class Chance:
    """Draws observations; shared by hypothesis (few, shrinking) and plain seeds (long, dense)."""

    def __init__(self, pick: Callable[[Sequence[Any]], Any]) -> None:
        self.pick = pick

    def id(self, prefix: str) -> str:
        return f"{prefix}-{self.pick(range(400))}"

    def observation(self, at: float) -> Observation:
        return self.pick((self.look, self.look, self.look, self.act, self.act, self.request, self.rare))(at)

    def look(self, at: float) -> Observation:
        actor = self.pick((ROBOT, "ann", "ann", "bob"))
        faces = ("ann", "ann", "bob") if actor == ROBOT else (ROBOT, ROBOT)
        place = self.pick((*faces, "blue-square", "blue-square", "rectangle", "table", "nowhere", ""))
        kind = self.pick((ActionBegan, ActionBegan, ActionEnded))
        return kind(actor=actor, action="look", at=stamp(at), targets=(place,) if place else ())

    def act(self, at: float) -> Observation:
        kind, actor = self.pick((ActionBegan, ActionEnded)), self.pick((ROBOT, "ann", "ann", "bob"))
        action = self.pick(("speak", "speak", "speak", "nod", "shake", "point", "act"))
        place = self.pick(("blue-square", "table", ""))
        return kind(actor=actor, action=action, at=stamp(at), targets=(place,) if place else ())

    def request(self, at: float) -> Observation:
        kind = self.pick(tuple(EVENT_KINDS))
        objects = self.pick(((), ("blue-square",), ("blue-square",), ("blue-square", "rectangle")))
        responder = self.pick(("ann", "ann", "ann", "bob", "stranger"))
        return request_event(
            kind, at, *objects, request=self.id("request"), responder=responder,
            optional=self.pick((False, True)), block=self.pick(("block-1", "block-2", "")),
            turn=self.pick(("", "turn-1", "turn-2")), accept=self.pick(((), ("act",), ("speak", "nod"))),
            anchors=self.pick(((), (), ("gaze-1:stroke",), ("gaze-1:stroke", "phrase-1:start+0.5", "?"))),
            cause=self.pick(("turn", "reference", "maintenance")),
        )  # fmt: skip

    def rare(self, at: float) -> Observation:
        block = self.pick(("block-1", "block-2"))
        match self.pick(("presence", "signal", "signal", "signal", "owner", "owner", "point", "end", "cancel")):
            case "presence":
                return self.pick((ActorFound, ActorFound, ActorLost))(actor=self.pick(ACTORS), at=stamp(at))
            case "signal":
                signal = TurnSignal(
                    id="t", turn=self.pick(("", "turn-1", "turn-2")), actor=self.pick((*ACTORS, "")),
                    signal=self.pick(("ended", "ended", "answered", "repaired", "aborted")),
                )  # fmt: skip
                return SignalTurn(
                    id=self.id("signal"), requester="realizer", signal=signal, at=stamp(at), block=block
                )
            case "owner":
                kind = self.pick(("fragment", "face", "face"))
                target = self.pick(("ann", "blue-square", ""))
                return HeadOwner(owner=Claim(kind=kind, priority=2, target=target), since=stamp(at))
            case "point":
                behavior, sync = self.pick((("gaze-1", "stroke"), ("phrase-1", "start")))
                return SyncPointProgress(block=block, behavior=behavior, sync=sync, at=stamp(at), time=at)
            case "cancel":
                return Cancel(id=self.id("request"), requester="realizer")
        status = self.pick(("done", "interrupted", "failed"))
        return BlockProgress(block=block, progress="end", at=stamp(at), status=status)

    def stream(self, length: int) -> Stream:
        """(time, observation) as they arrive, mostly in order: some come late, some twice."""
        arrivals: list[tuple[float, float, Observation]] = []
        at = 0.0
        for _ in range(length):
            at += self.pick((0.0, 0.1, 0.1, 0.2, 0.3, 0.4, 0.7, 2.0))
            observation, late = self.observation(at), self.pick(LATENESS)
            arrivals += [(at + late, at, observation)] * self.pick((1, 1, 1, 1, 2))
        return [(at, observation) for _, at, observation in sorted(arrivals, key=lambda arrival: arrival[0])]


@st.composite
def drawn_streams(draw):
    return Chance(lambda choices: draw(st.sampled_from(choices))).stream(draw(st.integers(1, 15)))


class Seeded(Stream):
    """Long and dense; told by its seed."""

    def __init__(self, seed: int) -> None:
        super().__init__(Chance(random.Random(seed).choice).stream(200))
        self._seed = seed

    def __repr__(self) -> str:
        return f"Seeded({self._seed})"


seeded_streams = st.integers(0, 10**6).map(Seeded)
streams = st.one_of(drawn_streams(), seeded_streams)


@st.composite
def corrected(draw):
    """Streams in which some beginnings have been missed: they show later, or much later, in a state."""
    chance = random.Random(draw(st.integers(0, 10**6)))
    stream = []
    for at, observation in draw(streams):
        if isinstance(observation, ActionBegan) and chance.random() < 0.4:
            observation = GoesOn(observation, at - chance.choice((0.0, 0.5, 2.5, 30.0)))
        stream.append((at, observation))
    return stream


any_streams = st.one_of(streams, corrected())


def run(stream, resolution="object"):
    """All effects, with everybody leaving at the end."""
    session = Session(ROBOT, RecognitionConfig(gaze_resolution=resolution))
    session.feed(world(*ACTORS), 0.0)
    effects, asked, signaled = [], [], []
    seen = set()
    for at, observation in stream:
        if hasattr(observation, "event"):
            if observation.id in seen:
                continue
            seen.add(observation.id)
            asked.append(observation.id)
        elif isinstance(observation, SignalTurn):
            if observation.id in seen:
                continue
            seen.add(observation.id)
            signaled.append(observation.id)
        effects += session.feed(observation, at)
    end = max(at for at, _ in stream) + 100.0
    for name in ACTORS:
        effects += session.feed(ActorLost(actor=name, at=stamp(end)), end)
    effects += session.advance(end + FACE_GRACE + 1.0)
    return session, effects, asked, signaled


@settings(max_examples=share_of(150), deadline=None)
@given(any_streams, st.sampled_from(("object", "table")))
def test_every_event_ends_exactly_once_and_every_request_is_answered(stream, resolution):
    session, effects, asked, signaled = run(stream, resolution)

    events = [effect for effect in effects if isinstance(effect, ConnectionEvent)]
    lives: dict[str, list[str]] = {}
    for event in events:
        states = lives.setdefault(event.id, [])
        if event.retold:
            is_late = states[-1] == event.state == "failed" and event.response
            is_adopted = states[-1] == event.state == "succeeded" and event.behavior
            assert is_late or is_adopted, "only a late answer and an adopted event are told again here"
        else:
            states.append(event.state)
    for id, states in lives.items():
        assert states[0] == "started", (id, states)
        assert sum(state in DECISIONS for state in states) == 1, (id, states)
        assert [state in ENDINGS for state in states] == [False] * (len(states) - 1) + [True], (id, states)
    accepted = [effect.id for effect in effects if isinstance(effect, Accepted)]
    refused = [effect.id for effect in effects if isinstance(effect, Refused)]
    outcomes = [effect.id for effect in effects if isinstance(effect, EventOutcome)]
    assert sorted(accepted + refused) == sorted(asked)
    assert sorted(outcomes) == sorted(accepted)
    assert [effect.id for effect in effects if isinstance(effect, TurnOutcome)] == signaled
    assert session.deadline is None


@settings(max_examples=share_of(100), deadline=None)
@given(any_streams)
def test_times_of_an_event_never_run_backwards(stream):
    _, effects, _, _ = run(stream)

    times: dict[str, float] = {}
    for event in effects:
        if isinstance(event, ConnectionEvent):
            assert event.at.seconds >= times.get(event.id, event.started.seconds)
            times[event.id] = event.at.seconds
            assert event.duration is None or event.duration >= 0
            assert event.delay is None or event.delay >= 0 or event.kind == "adjacency_pair"


def is_deed(observation: Observation) -> bool:
    """True for what the robot does, by its body or by its blocks; the actions of people are none."""
    told = observation.began if isinstance(observation, GoesOn) else observation
    return getattr(told, "actor", ROBOT) == ROBOT and not isinstance(told, Cancel | HeadOwner)


@settings(max_examples=share_of(150), deadline=None)
@given(any_streams, st.sampled_from(("object", "table")))
def test_every_accepted_event_is_decided_in_the_promised_time_after_the_last_deed_of_the_robot(stream, resolution):
    """Also if nobody tells the end of the turn, or the anchors, and if everybody stays."""
    session = Session(ROBOT, RecognitionConfig(gaze_resolution=resolution))
    session.feed(world(*ACTORS), 0.0)
    over = stream[-1][0] + 0.1
    silent = ActionEnded(actor=ROBOT, action="speak", at=stamp(over))
    deed, is_speaking = 0.0, False
    due: dict[str, float] = {}
    promised: dict[str, float] = {}
    for at, observation in [*stream, (over, silent), (over + 1000.0, None)]:
        effects = session.advance(at) if observation is None else session.feed(observation, at)
        for effect in effects:
            if isinstance(effect, Accepted):
                assert effect.within is not None
                promised[effect.id], due[effect.id] = effect.within, float("inf")
            elif isinstance(effect, EventOutcome):
                del promised[effect.id]
                assert effect.at.seconds <= due.pop(effect.id) + 1e-6, effect
        if observation is not None and is_deed(observation):
            deed = at
            told = observation.began if isinstance(observation, GoesOn) else observation
            if getattr(told, "action", "") == "speak":
                is_speaking = not isinstance(told, ActionEnded)
        due = {id: float("inf") if is_speaking else deed + within for id, within in promised.items()}
    assert promised == {}
