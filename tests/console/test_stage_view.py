"""View model of the stage: what of the picture visitors see, and what their pages may ask for."""

import json
from typing import Any

from engage_hri.schemas.participants import PeerAlive, PeerGone, ServiceSettings
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.recognition import Statistics, WindowStatistics
from engage_hri.services.console.web import orders, sections
from engage_hri.services.console.web.frames import Viewer
from engage_hri.services.console.web.stage import BUBBLES, Bond, Bubble, LevelShown, StageFace, VoiceNow, talk
from tests.console.scenes import at, event
from tests.console.test_picture import RUN, picture

SERVICES = ("generation", "realizer", "recognition", "control")


def told(**more: Any) -> Any:
    """A talk in which nothing goes on, but for what is given."""
    health = [sections.Health(name, True, True, True, (), ()) for name in SERVICES]
    nothing: dict[str, Any] = {
        "words": (), "floor": (), "events": (), "measures": (), "health": health, "held": False, "reporters": {},
        "understands": False,
    }  # fmt: skip
    return talk(**nothing | more)


def test_only_words_that_were_said_stand_in_a_bubble_and_only_the_newest_turns() -> None:
    long = [
        sections.UtteranceShown("ann", float(number), f"turn {number}", False, 6) for number in range(BUBBLES + 2)
    ]
    cut = sections.UtteranceShown("robot", 9.0, "Look at", True, 0, (sections.Left(7, "the square"),), "held")

    shown = told(words=[sections.UtteranceShown("ann", 0.0, "", True, 0), *long, cut]).bubbles

    assert shown[-1] == Bubble("robot", 9.0, "Look at", True)
    assert [each.words for each in shown[:-1]] == [f"turn {number}" for number in range(3, BUBBLES + 2)]


def test_who_speaks_now_is_a_voice_with_those_it_is_for() -> None:
    over = sections.SpeechShown("ann", ("robot",), 1.0, 2.0)
    now = sections.SpeechShown("robot", ("ann",), 2.0, None)

    assert told(floor=[over, now]).voices == (VoiceNow("robot", ("ann",)),)


def test_a_bond_is_there_while_its_event_goes_on_and_is_met_once_it_succeeded() -> None:
    values: dict[str, Any] = {
        "kind": "directed_gaze", "by": "robot", "to": "ann", "about": ("cup",), "cause": "reference",
        "optional": False, "delay": None, "limit": None, "since": 1.0, "decided": None, "one_of": False,
    }  # fmt: skip
    waits = sections.EventShown(id="a", state="started", until=None, **values)
    met = sections.EventShown(id="b", state="succeeded", until=None, **values)
    over = sections.EventShown(id="c", state="succeeded", until=3.0, **values)
    failed = sections.EventShown(id="d", state="failed", until=None, **values)

    bonds = told(events=[waits, met, over, failed]).bonds

    assert bonds == (
        Bond("directed_gaze", "robot", "ann", ("cup",), False),
        Bond("directed_gaze", "robot", "ann", ("cup",), True),
    )


def test_each_person_has_a_level_and_all_together_have_none() -> None:
    ann = sections.PersonMeasures("ann", "engaged", (), ((1.0, 0.2), (2.0, 0.876)), ())
    ben = sections.PersonMeasures("ben", "unknown", (), (), ())
    everybody = sections.PersonMeasures("", "engaged", (), ((1.0, 0.5),), ())

    levels = told(measures=[everybody, ann, ben]).levels

    assert levels == (LevelShown("ann", "engaged", 0.88), LevelShown("ben", "unknown", None))


def test_the_robot_is_away_while_a_service_is_and_held_while_somebody_holds_it() -> None:
    lame = [sections.Health(name, True, name != "control", True, (), ()) for name in SERVICES]

    assert [told(health=lame, held=True).state, told(held=True).state, told().state] == ["away", "held", "ready"]


def test_people_that_a_program_plays_are_told_and_so_is_the_task() -> None:
    task = [sections.Health("collaboration", False, True, True, (), ())]

    shown = told(health=task, reporters={"ann": "simulation", "eva": "console-1"})

    assert (shown.played, shown.task, told().task) == (("ann",), True, False)


def test_the_stage_is_sent_what_it_shows_and_again_only_what_has_changed() -> None:
    made = picture()
    face, viewer = StageFace(made), Viewer()

    def sent(now: float) -> Any:
        frame = viewer.frame(face, now)
        return {} if frame is None else json.loads(frame)["sections"]

    for name in SERVICES:
        made.feed(PeerAlive(participant=name, run=RUN), 10.0, 10.0)
    assert set(sent(10.0)) == {"scene", "talk"}
    made.feed(PeerAlive(participant="somebody", run=RUN), 10.1, 10.1)
    assert sent(10.1) == {}  # a participant of whom the stage does not tell

    made.feed(Utterance(actor="ann", id="u", text="Hello", began=at(10.2), at=at(10.6)), 10.6, 10.6)
    assert sent(10.6)["talk"]["bubbles"] == [{"actor": "ann", "since": 0.2, "words": "Hello", "open": False}]
    made.feed(*event("e1", "started", 10.7), 10.7)
    assert sent(10.7)["talk"]["bonds"][0]["about"] == ["rectangle"]
    level = Statistics(
        actor="ann",
        at=at(10.8),
        session=WindowStatistics(),
        recent=WindowStatistics(),
        engagement=0.5,
        level="engaged",
    )
    made.feed(level, 10.8, 10.8)
    made.advance(12.0)
    assert sent(12.0)["talk"]["levels"] == [{"actor": "ann", "level": "engaged", "value": 0.5}]
    made.feed(PeerGone(participant="control"), 12.1, 12.1)
    assert sent(12.1)["talk"]["state"] == "away"


def test_a_visitor_of_the_stage_sits_down_and_does_no_more_whatever_the_role_of_the_window() -> None:
    denied = orders.denied("wizard", True, stage=True)

    assert set(denied) == set(orders.ALL_RIGHTS) - {"seat"}
    assert "seat" in orders.denied("operator", True, stage=True)
    assert set(orders.denied("wizard", False, stage=True)) == set(orders.ALL_RIGHTS)


def test_it_hears_while_hearing_is_on_the_bus_and_words_if_somebody_understands_them() -> None:
    made = picture()
    face = StageFace(made)

    def hears() -> str:
        return str(json.loads(face.section("talk"))["hears"]) if face.versions["talk"] else ""

    def settings(text: str, participant: str = "hearing") -> None:
        told = ServiceSettings(participant=participant, run=RUN, version="1", at=at(10.0), settings=text)
        made.feed(told, 10.0, 10.0)

    assert hears() == ""
    made.feed(PeerAlive(participant="hearing", run=RUN), 10.0, 10.0)
    assert hears() == "voices"
    settings('{"hearing": {"recognizer": "sphinx"}}')
    assert hears() == "words"
    for text in ('{"hearing": {"recognizer": ""}}', '{"hearing": 3}', "no JSON"):
        settings(text)
        assert hears() == "voices"
    settings('{"hearing": {"recognizer": "sphinx"}}')
    made.feed(PeerGone(participant="hearing"), 10.0, 10.0)
    assert hears() == ""
