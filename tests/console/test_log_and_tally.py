from io import StringIO

import msgspec
import pytest
from msgspec.structs import replace
from rich.console import Console

from engage_hri.schemas.blocks import BodyHeld, Held, Hold, WarningFeedback
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import FragmentOutcome
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.recognition import Floor, FloorSpeech, Interjection, Statistics, WindowStatistics
from engage_hri.schemas.units import Seconds
from engage_hri.services.console import view
from engage_hri.services.console.terminal import log, tally
from engage_hri.services.console.terminal.log import Telling
from tests.console.scenes import SCENE, at, event, fed


def lines(messages: tuple[tuple[Message, Seconds], ...], telling: Telling) -> list[str]:
    told = []
    scene = view.empty("robot", 10.0)
    for message, time in messages:
        before, scene = scene, view.feed(scene, message, time)
        if (line := log.line(message, before, scene, time, telling)) is not None:
            told.append(line.strip())
    return told


def test_the_log_tells_the_scene_in_order() -> None:
    assert lines(SCENE, Telling()) == [
        "0:00.0  human looks at the robot",
        "0:00.1  head: fragment: rectangle",
        "0:00.3  robot looks at rectangle",
        "0:00.6  b:s:start at 0.60 s (planned 0.50 s)",
        "0:01.0  * directed gaze, robot → human about rectangle (reference): waiting",
        "0:01.9  * directed gaze, robot → human about rectangle (reference): succeeded 0.90 s",
        '0:02.0  robot: "a rectangle" (from 0:00.6)',
    ]


def test_what_cannot_be_told_apart_is_told_as_one_or_the_other() -> None:
    look = ActionBegan(actor="ann", action="look", targets=("a", "b", "c"), one_of=True, at=at(0.0))
    directed = event("e", "started", 10.5, objects=("a", "b"), one_of=True)

    assert lines(((look, 10.0), directed), Telling()) == [
        "0:00.0  ann looks at a, b or c",
        "0:00.5  * directed gaze, robot → human about a or b (reference): waiting",
    ]


def test_the_log_can_be_narrowed() -> None:
    told = lines(SCENE, Telling(actions=False, points=False, head=False))

    assert all(line.partition("  ")[2].startswith("*") for line in told)
    assert len(told) == 2


def test_what_is_said_into_a_turn_is_told_at_once_and_decided() -> None:
    opened = Interjection(actor="ann", since=at(0.5), at=at(0.6), reading="open")
    decided = replace(opened, reading="interruption", words="no, wait")

    assert lines(((opened, 10.6), (decided, 10.9)), Telling()) == [
        "0:00.6  ann, into the turn: (not decided yet)",
        '0:00.9  ann, into the turn: "no, wait" (takes the floor)',
    ]


def test_the_floor_is_told_when_two_speak_at_once() -> None:
    ann = FloorSpeech(actor="ann", since=at(0.0), to=("robot",))
    ben = FloorSpeech(actor="ben", since=at(0.4))
    alone, both = Floor(at=at(0.0), speeches=(ann,)), Floor(at=at(0.4), speeches=(ann, ben))

    assert lines(((alone, 10.0), (both, 10.4)), Telling()) == ["0:00.4  at once: ann (to the robot), ben"]


def test_a_warning_is_told_with_its_place() -> None:
    warning = WarningFeedback(block="b", behavior="p", kind="NO_SUCH_TARGET", message="no 'cup'")

    assert lines(((warning, 10.0),), Telling()) == ["0:00.0  ! NO_SUCH_TARGET b:p: no 'cup'"]


def test_a_warning_about_no_block_has_no_place() -> None:
    warning = WarningFeedback(block=None, kind="INTERRUPTED", message="the robot was held")

    assert lines(((warning, 10.0),), Telling()) == ["0:00.0  ! INTERRUPTED: the robot was held"]


def test_it_is_told_what_is_held_and_when_it_is_held_no_longer() -> None:
    everything = Hold(since=at(3.0), until=at(63.0))
    wave = Hold(block="b", behavior="wave", since=at(14.0), until=at(74.0))
    block = Hold(block="c", since=at(15.5), until=at(75.5))
    early = log.line(
        Held(at=at(4.0), holds=(everything,)),
        view.empty("robot", 10.0),
        view.feed(view.empty("robot", 10.0), Held(at=at(4.0), holds=(everything,)), 4.0),
        4.0,
        Telling(),
    )
    assert early == "  0:00.0  held: everything, for 7.00 s already and for at most 53.00 s"
    told = ((everything,), (everything, wave), (everything, wave), (wave, block), ())
    messages = tuple(
        (Held(at=at(when), holds=holds), when)
        for when, holds in zip((13.0, 14.0, 15.0, 15.5, 20.0), told, strict=True)
    )

    assert lines(messages, Telling()) == [
        "0:03.0  held: everything, for 10.00 s already and for at most 50.00 s",
        "0:04.0  held: b: wave, for at most 60.00 s",
        "0:05.5  held: block c, for at most 60.00 s; no longer held: everything, after 12.50 s",
        "0:10.0  no longer held: b: wave, after 6.00 s; no longer held: block c, after 4.50 s",
    ]


def test_what_is_let_go_and_held_still_as_a_part_of_more_is_not_said_to_be_free() -> None:
    wave = Hold(block="b", behavior="wave", since=at(11.0), until=at(71.0))
    block = Hold(block="b", since=at(12.0), until=at(72.0))
    everything = Hold(since=at(13.0), until=at(73.0))
    told = ((wave, block, everything), (block, everything), (everything,), ())
    messages = tuple((Held(at=at(when), holds=holds), when) for when, holds in enumerate(told, 14))

    assert lines(messages, Telling())[1:] == [
        "0:05.0  still held: b: wave, because block b and everything are",
        "0:06.0  still held: block b, because everything is",
        "0:07.0  no longer held: everything, after 4.00 s",
    ]


def test_it_is_told_what_waits_since_nobody_renews_it() -> None:
    waiting = BodyHeld(at=at(13.0), holds=(Hold(block="b", behavior="wave", since=at(13.0), until=at(17.0)),))

    assert lines(((waiting, 13.0), (BodyHeld(at=at(14.0)), 14.0)), Telling()) == [
        "0:03.0  ! the body holds b: wave: nobody renews it"
    ]
    late = Fault(reason="realizer has not renewed it for 0.5 s", cause="unrenewed", whose="realizer")
    told = replace(waiting, holds=tuple(replace(each, why=late) for each in waiting.holds))
    assert lines(((told, 13.0),), Telling()) == [
        "0:03.0  ! the body holds b: wave: realizer has not renewed it for 0.5 s"
    ]


def test_the_tally_counts_each_event_once_by_its_decision() -> None:
    total = fed(
        tally.feed,
        tally.empty(10.0),
        [
            *SCENE,
            event("e1", "completed", 13.0, started=at(11.0)),
            event("e2", "failed", 14.0, delay=2.5),
            event("e3", "failed", 15.0, optional=True),
            event("e4", "preempted", 15.0),
            event("e5", "started", 16.0),
            event("e6", "succeeded", 17.0, initiator="human", responder="robot", delay=0.2),
        ],
    )

    mine = tally.count(total, "directed_gaze", "robot", "robot")
    theirs = tally.count(total, "directed_gaze", None, "robot")
    assert (mine.count, mine.succeeded, mine.failed, mine.failed_optional, mine.other, mine.open) == (
        5,
        1,
        1,
        1,
        1,
        1,
    )
    assert mine.delays == (0.9,)
    assert (theirs.count, theirs.succeeded, theirs.delays) == (1, 1, (0.2,))
    assert total.duration == pytest.approx(7.0)


def test_the_summary_names_kinds_outcomes_delays_and_pace() -> None:
    total = fed(tally.feed, tally.empty(10.0))
    total = tally.feed(total, FragmentOutcome(id="r", fragment="f", status="failed"), 12.5)
    console = Console(width=160, record=True, file=StringIO())
    console.print(tally.render(total, "robot"))
    text = console.export_text()

    for expected in (
        "directed gaze",
        "0.90 0.90 0.90",
        "(MTBCE) 4.20 s",
        "duration 0:02.5; 1 fragments, 1 not finished",
    ):
        assert expected in text


def test_an_event_is_lost_with_its_recognition_but_not_what_was_decided() -> None:
    life = (event("dg-1", "started", 11.0), event("dg-1", "lost", 12.0))
    decided = (
        event("dg-2", "started", 11.0),
        event("dg-2", "succeeded", 11.5, delay=0.5),
        event("dg-2", "lost", 12.0),
    )

    assert lines(life, Telling())[-1] == "0:02.0  * directed gaze, robot → human about rectangle (reference): lost"
    counted = tally.empty(10.0)
    for message, time in (*life, *decided):
        counted = tally.feed(counted, message, time)
    row = tally.count(counted, "directed_gaze", "robot", "robot")
    assert (row.count, row.succeeded, row.other, row.open, row.delays) == (2, 1, 1, 0, (0.5,))


def test_statistics_are_told_if_asked_for_with_reasons_for_what_is_not_well() -> None:
    well = Statistics(
        actor="ann", at=at(12.0), session=WindowStatistics(events=12, mtbce=5.314), recent=WindowStatistics(),
        engagement=0.92, level="engaged", reasons=("pace 0.92",),
    )  # fmt: skip
    ill = msgspec.structs.replace(well, actor="", engagement=0.1, level="disengaged")

    assert lines(((well, 12.0), (ill, 12.0)), Telling(statistics=True)) == [
        "0:02.0  ann: engaged 0.92; 12 events, MTBCE 5.31 s",
        "0:02.0  all: disengaged 0.10 (pace 0.92); 12 events, MTBCE 5.31 s",
    ]
    assert lines(((well, 12.0),), Telling()) == []
