"""The same scene told in symbols and filmed: the same connection events, in the same order, with the same times."""

from random import Random

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound
from engage_hri.schemas.recognition import ConnectionEvent, EventOutcome
from engage_hri.schemas.requests import Accepted
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.recognizer import Recognizer
from tests.random_cases import share_of
from tests.recognition.observations import HUMAN, ROBOT, request_event, stamp
from tests.recognition.raw import PLACES, TABLE, face, hand, piece, pose, table, voice

FRAME = 0.05
LAST = 30.0


class Scene:
    """What a person and the robot do, at random: looks with a frame, speech between two, the robot a little off."""

    def __init__(self, seed: int) -> None:
        random = Random(seed)
        self.looks: list[tuple[float, str]] = []
        self.speech: list[tuple[float, float]] = []
        self.robot: list[tuple[float, object]] = []
        at = 1.0
        while at < LAST - 5:
            self.looks.append((round(at, 6), random.choice((*PLACES, ROBOT, ROBOT, "table", ""))))
            at += FRAME * random.randint(4, 40)
        at = 1.5 + FRAME / 2
        while at < LAST - 5:
            end = at + FRAME * random.randint(3, 40)
            self.speech.append((round(at, 6), round(end, 6)))
            at = end + FRAME * random.randint(6, 60)
        self._robot_acts(random)

    def _robot_acts(self, random: Random) -> None:
        at, number = 1.013, 0
        while at < LAST - 5:
            number += 1
            target = random.choice((*PLACES, HUMAN, HUMAN))
            self.robot.append((at, ActionBegan(actor=ROBOT, action="look", at=stamp(at), targets=(target,))))
            if random.random() < 0.6:
                name, objects = ("mutual_facial_gaze", ()) if target == HUMAN else ("directed_gaze", (target,))
                self.robot.append((at + 0.003, request_event(name, at + 0.003, *objects, request=f"r-{number}")))  # type: ignore[arg-type]
            if random.random() < 0.5:
                words, end = f"b:{number}", at + 0.3 + random.random()
                kind = request_event("adjacency_pair", at + 0.004, request=f"a-{number}", block=f"block-{number}")
                self.robot += [
                    (at + 0.004, kind),
                    (at + 0.005, ActionBegan(actor=ROBOT, action="speak", at=stamp(at), behavior=words)),
                    (end, ActionEnded(actor=ROBOT, action="speak", at=stamp(end), behavior=words)),
                ]
            at += 0.5 + FRAME * random.randint(10, 60)
        self.robot.sort(key=lambda one: one[0])

    def told(self) -> list[tuple[float, object]]:
        """In symbols."""
        actions: list[tuple[float, object]] = [(1.0, ActorFound(actor=HUMAN, at=stamp(1.0)))]
        for at, target in self.looks:
            targets = (target,) if target else ()
            actions.append((at, ActionBegan(actor=HUMAN, action="look", at=stamp(at), targets=targets)))
        for start, end in self.speech:
            actions.append((start, ActionBegan(actor=HUMAN, action="speak", at=stamp(start))))
            actions.append((end, ActionEnded(actor=HUMAN, action="speak", at=stamp(end))))
        return actions

    def filmed(self) -> list[tuple[float, object]]:
        """Frame by frame, until the end: a face that vanishes would be one more event."""
        frames: list[tuple[float, object]] = []
        for index in range(round((LAST - 1.0) / FRAME)):
            at = round(1.0 + index * FRAME, 6)
            target = [target for since, target in self.looks if since <= at][-1]
            heard = round(at + FRAME / 2, 6)
            speaks = any(start <= heard < end for start, end in self.speech)
            frames += [(at, pose(target, at)), (heard, voice(speaks, heard))]
        return frames


def events(perceived: list[tuple[float, object]], robot: list[tuple[float, object]], resolution: str) -> list[object]:
    """What a recognizer makes of it that is woken whenever it wants to be."""
    recognizer = Recognizer(ROBOT, RecognitionConfig(gaze_resolution=resolution))  # type: ignore[arg-type]
    results = recognizer.feed(table(face()), 0.0, 0.0)
    for at, observation in sorted([*perceived, *robot], key=lambda one: one[0]):
        while recognizer.deadline is not None and recognizer.deadline < at:
            results += recognizer.advance(recognizer.deadline)
        results += recognizer.feed(observation, at, at)  # type: ignore[arg-type]
    results += recognizer.advance(LAST - 0.3)
    return [
        (one.kind, one.initiator, one.state, one.objects, when(one.started), when(one.at), one.response)
        if isinstance(one, ConnectionEvent)
        else (one.id, type(one).__name__)
        for one in results
        if isinstance(one, ConnectionEvent | EventOutcome | Accepted)
    ]


def when(moment: object) -> float:
    return round(moment.seconds, 3)  # type: ignore[attr-defined, no-any-return]


@settings(max_examples=share_of(10), deadline=None)
@given(st.integers(0, 10**6))
@example(0)
def test_a_filmed_scene_gives_the_same_events_as_a_told_one(seed):
    scene = Scene(seed)

    assert events(scene.filmed(), scene.robot, "object") == events(scene.told(), scene.robot, "object")


def test_such_scenes_have_events_of_every_kind_and_outcome():
    kinds, states = set(), set()
    for seed in range(20):
        scene = Scene(seed)
        for one in events(scene.told(), scene.robot, "object"):
            kinds.add(one[0])  # type: ignore[index]
            states.add(one[2] if len(one) > 2 else "")  # type: ignore[arg-type, index]

    assert kinds >= {"directed_gaze", "mutual_facial_gaze", "adjacency_pair", "backchannel"}
    assert states >= {"succeeded", "failed", "withdrawn", "superseded", "completed"}


@pytest.mark.parametrize("accepts", [True, False])
def test_nothing_waits_for_symbolic_perception(accepts):
    recognizer = Recognizer(ROBOT, RecognitionConfig())
    recognizer.feed(table(face()), 0.0, 0.0)
    recognizer.feed(ActorFound(actor=HUMAN, at=stamp(0.5)), 0.5, 0.5)
    request = request_event("mutual_facial_gaze", 1.0, responder=HUMAN if accepts else "nobody")
    answers = recognizer.feed(request, 1.0, 1.0)

    assert len(answers) == (2 if accepts else 1)


def test_a_request_waits_for_a_gaze_that_may_have_come_before_it_but_not_for_long():
    recognizer = Recognizer(ROBOT, RecognitionConfig())
    recognizer.feed(table(face()), 0.0, 0.0)
    for time in (0.5, 0.6, 0.7):
        recognizer.feed(pose("table", time), time, time)
    recognizer.feed(pose("blue", 0.9), 0.9, 0.9)
    waiting = recognizer.feed(request_event("directed_gaze", 0.95, "blue"), 0.95, 0.95)
    deadline = recognizer.deadline
    answers = recognizer.advance(1.25)

    assert waiting == []
    assert deadline == pytest.approx(0.9 + 0.35)
    assert [type(one) for one in answers] == [Accepted, ConnectionEvent]


def test_what_is_too_old_or_doubtful_is_ignored():
    recognizer = Recognizer(ROBOT, RecognitionConfig())
    recognizer.feed(table(face()), 0.0, 0.0)
    results = [
        *recognizer.feed(pose("blue", 1.0), 1.0, 1.51),
        *recognizer.feed(
            ActionBegan(actor=HUMAN, action="look", at=stamp(2.0), targets=(ROBOT,), confidence=0.39), 2.0, 2.0
        ),
    ]

    assert results == []
    assert recognizer.session.persons[HUMAN].gazes.gaze.targets == ()


def test_a_moved_piece_is_the_same_answer_told_and_filmed():
    """An act is known where it begins and ends to a frame or four: kinds and outcomes are the same."""
    robot = [(1.013, request_event("adjacency_pair", 1.013, accept=("act",)))]

    def film():
        for index in range(round((LAST - 1.0) / FRAME)):
            time = round(1.0 + index * FRAME, 6)
            blue = (0.6 - 0.3 * min(1.0, max(0.0, time - 3.0)), -0.2, 0.7)
            palm = (blue[0], blue[1] - max(0.0, 3.0 - time) * 0.3, 0.73)
            others = tuple(piece(id) for id in PLACES if id != "blue")
            world = type(table())(entities=(TABLE, piece("blue", blue), *others, face(), hand(palm)))
            yield from ((time, pose("table", time)), (time, world))

    began = ActionBegan(actor=HUMAN, action="act", at=stamp(3.0), targets=("blue",))
    ended = ActionEnded(actor=HUMAN, action="act", at=stamp(4.0), targets=("blue",))
    told = [(1.0, ActorFound(actor=HUMAN, at=stamp(1.0))), (3.0, began), (4.0, ended)]

    def kinds(perceived):
        return [one[:3] + one[6:] for one in events(list(perceived), robot, "object")]

    assert kinds(film()) == kinds(told)
    assert kinds(told)[-1] == ("adjacency_pair", ROBOT, "completed", "act")
