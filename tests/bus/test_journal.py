"""The lines of the log: what each says, what none says, and what it costs."""

import logging

import msgspec
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block, BlockProgress, BodyHeld, Held, Hold, PerformBlock, WarningFeedback
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import FragmentOutcome, TurnClosed
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.perception import ActorLost
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.requests import Refused
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus import journal
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub

AT = Stamp("loop", 1.0)
EVENT = "event e-1: directed_gaze from robot to ann about cup: "


def happened(state: str, delay: float | None = None) -> ConnectionEvent:
    return msgspec.convert(
        {
            "id": "e-1", "kind": "directed_gaze", "initiator": "robot", "responder": "ann", "objects": ["cup"],
            "state": state, "at": AT, "started": AT, "delay": delay,
        },
        ConnectionEvent,
    )  # fmt: skip


LATE = Fault(reason="realizer has not renewed it for 0.5 s", cause="unrenewed", whose="realizer")
LASTS = {"since": AT, "until": AT}


@pytest.mark.parametrize(
    ("message", "level", "text"),
    [
        (BlockProgress(block="b", progress="start", at=AT), "DEBUG", "block b: started"),
        (
            BlockProgress(block="b", progress="end", at=AT, time=3.2, status="done"),
            "INFO",
            "block b: done after 3.20 s",
        ),
        (
            WarningFeedback(block="b", behavior="g", kind="LATE", message="too late"),
            "WARNING",
            "block b:g: LATE: too late",
        ),
        (
            WarningFeedback(block=None, kind="INTERRUPTED", message="held"),
            "WARNING",
            "no block: INTERRUPTED: held",
        ),
        (Held(at=AT, holds=(Hold(**LASTS),)), "INFO", "held: everything"),
        (
            Held(at=AT, holds=(Hold(block="b", **LASTS), Hold(block="c", behavior="g", **LASTS))),
            "INFO",
            "held: b, c: g",
        ),
        (Held(at=AT), "DEBUG", "held: nothing"),
        (
            BodyHeld(at=AT, holds=(Hold(block="b", behavior="g", **LASTS),)),
            "WARNING",
            "held, since nobody renews it: b: g",
        ),
        (
            BodyHeld(at=AT, holds=tuple(Hold(block="b", behavior=id, why=LATE, **LASTS) for id in "gh")),
            "WARNING",
            "held, since nobody renews it: b: g, b: h; realizer has not renewed it for 0.5 s",
        ),
        (BodyHeld(at=AT), "DEBUG", "held, since nobody renews it: nothing"),
        (FragmentOutcome(id="f", requester="me", fragment="f", status="done"), "INFO", "fragment f of me: done"),
        (
            FragmentOutcome(id="f", requester="me", fragment="f", status="interrupted", replaced_by="g"),
            "INFO",
            "fragment f of me: interrupted, replaced by g",
        ),
        (
            FragmentOutcome(id="f", requester="me", fragment="f", status="failed", fault=Fault(reason="no voice")),
            "INFO",
            "fragment f of me: failed: no voice",
        ),
        (
            TurnClosed(turn="f", addressee="ann", status="aborted", reason="barge-in"),
            "INFO",
            "turn f to ann: aborted (barge-in)",
        ),
        (happened("started"), "DEBUG", EVENT + "started"),
        (happened("succeeded", 0.5), "INFO", EVENT + "succeeded after 0.50 s"),
        (happened("failed", 3.0), "INFO", EVENT + "failed after 3.00 s"),
        (happened("completed"), "DEBUG", EVENT + "completed"),
        (
            Refused(id="x", requester="me", kind="perform_block", fault=Fault(reason="bad")),
            "WARNING",
            "refused perform_block x of me: bad",
        ),
        (ActorLost(actor="ann", at=AT), "INFO", "person ann: gone"),
        (PerformBlock(id="b", block=Block(id="b")), "DEBUG", "perform_block b"),
    ],
)  # fmt: skip
def test_each_message_has_its_line(message: Message, level: str, text: str) -> None:
    assert journal.entry(message) == (getattr(logging, level), text)


def test_the_words_that_are_spoken_are_in_no_line() -> None:
    word = WordSpoken(block="b", behavior="s", word="secret", position=6, at=AT)

    assert "secret" not in journal.entry(word)[1]


def test_peers_come_and_go() -> None:
    assert journal.presence(PeerAlive(participant="control", run="abc"))[1] == "peer control: here, life abc"
    assert journal.presence(PeerGone(participant="control"))[1] == "peer control: gone"


async def joined(name: str, role: str) -> Bus:
    return MemoryHub("robot").join(name, role)


async def test_a_bus_logs_what_it_publishes_and_no_streams(caplog: pytest.LogCaptureFixture) -> None:
    bus = await joined("realizer", "realizer")
    with caplog.at_level(logging.DEBUG, "engage"):
        bus.publish(keys.FEEDBACK, BlockProgress(block="b", progress="start", at=AT))
        bus.publish(keys.ROBOT_MOTION, PerformBlock(id="b", block=Block(id="b")))
        bus.declare_alive()
        await bus.leave()

    assert [(record.name, record.getMessage()) for record in caplog.records] == [
        ("engage.realizer", "block b: started"),
        ("engage.peers", f"peer realizer: here, life {bus.run}"),
        ("engage.peers", "peer realizer: gone"),
    ]


async def test_what_no_log_wants_is_not_even_worded(monkeypatch: pytest.MonkeyPatch) -> None:
    worded: list[Message] = []

    def entry(message: Message) -> journal.Entry:
        worded.append(message)
        return journal.INFO, ""

    monkeypatch.setattr(journal, "entry", entry)
    bus = await joined("me", "manager")
    bus.publish(keys.BLOCK, PerformBlock(id="b", block=Block(id="b")))

    assert worded == []
