"""A recording as a script: who said what to whom, looked at whom, and what was answered."""

from typing import Any

from engage_hri.schemas import keys
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, Utterance
from engage_hri.schemas.recognition import ConnectionEvent, EventState, Floor, FloorSpeech
from engage_hri.schemas.units import Stamp
from engage_hri.services.recording.play_script import script
from tests.recording.files import recording, sample


def stamp(at: float) -> Stamp:
    return Stamp("loop", at)


def did(actor: str, action: Any, begin: float, end: float, *targets: str, behavior: str = "") -> list[Message]:
    what: dict[str, Any] = {"actor": actor, "action": action, "targets": targets, "behavior": behavior}
    return [ActionBegan(at=stamp(begin), **what), ActionEnded(at=stamp(end), **what)]


def said(actor: str, text: str, begin: float, end: float, to: str) -> list[Message]:
    words = Utterance(
        actor=actor, id=f"{begin}", text=text, began=stamp(begin), ended=stamp(end), at=stamp(end + 0.1)
    )
    over = FloorSpeech(actor=actor, since=stamp(begin), to=(to,), until=stamp(end))
    return [*did(actor, "speak", begin, end), words, Floor(at=stamp(end + 0.2), ended=(over,))]


def robot_says(block: str, begin: float, *words: str) -> list[Message]:
    ended = [begin + 0.5 * (number + 1) for number in range(len(words))]
    told: list[Message] = [
        WordSpoken(block=block, behavior="s", word=word, position=1, at=stamp(at))
        for word, at in zip(words, ended, strict=True)
    ]
    began, over = did("robot", "speak", begin, ended[-1], behavior=f"{block}:s")
    floor = Floor(at=stamp(begin), speeches=(FloorSpeech(actor="robot", since=stamp(begin), to=("ann",)),))
    return [began, floor, *told, over]


def pair(state: EventState, at: float, **fields: Any) -> ConnectionEvent:
    return ConnectionEvent(
        id="ap-1", kind="adjacency_pair", initiator="robot", responder="ann", state=state, at=stamp(at),
        started=stamp(5.0), **fields,
    )  # fmt: skip


def played(*messages: Message) -> str:
    def at(message: Message) -> float:
        return message.at.seconds  # type: ignore[union-attr]

    key = {
        ConnectionEvent: keys.connection_event("ann", "adjacency_pair"), Floor: keys.FLOOR, Utterance: keys.UTTERANCE,
        WordSpoken: keys.SYNC_POINT,
    }  # fmt: skip
    begin = sample(keys.fault("there"), Fault(reason="begin"), 0.0)
    told = [sample(key.get(type(each), keys.RECOGNIZED_ACTION), each, at(each)) for each in sorted(messages, key=at)]
    return script(recording([begin, *told]))


LOOKS = [
    *did("ann", "look", 0.0, 5.5, "bob"), *did("ann", "look", 5.5, 9.0, "robot"),
    *did("bob", "look", 0.0, 4.0, "ann"), *did("bob", "look", 4.0, 9.0, "robot"),
    *did("robot", "look", 4.0, 9.0, "ann"),
]  # fmt: skip


def test_it_tells_who_said_what_to_whom_who_was_looked_at_and_what_was_answered() -> None:
    question = [*robot_says("q", 5.0, "Do", "you"), *robot_says("r", 6.2, "see", "it?")]
    answer = pair("succeeded", 8.0, response="speak", delay=0.8, answered_by="ann", words="Not really.")
    told = played(
        *LOOKS, *said("ann", "they were expensive", 1.0, 3.0, "bob"), *question,
        *said("ann", "Not really.", 8.0, 8.6, "robot"),
        pair("started", 5.0), answer, *did("bob", "speak", 9.5, 9.8),
    )  # fmt: skip

    assert told.splitlines() == [
        '  0:01.0  ann to bob, looking at bob, watched by bob: "they were expensive"',
        '  0:05.0  robot to ann, looking at ann, watched by ann and bob: "Do you see it?"',
        '          ann answered after 0.8 s: "Not really."',
        '  0:08.0  ann to robot, looking at robot, watched by robot: "Not really."',
        "  0:09.5  bob: (without words)",
    ]


def test_a_question_that_nobody_answers_says_so() -> None:
    told = played(*robot_says("q", 5.0, "Well?"), pair("started", 5.0), pair("failed", 7.5))

    assert told.splitlines() == ['  0:05.0  robot to ann: "Well?"', "          ann did not answer"]
