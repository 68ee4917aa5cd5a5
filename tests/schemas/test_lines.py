"""The public JSON lines, to the letter: others parse them."""

import json

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import (
    BlockProgress,
    PlannedPoint,
    PredictionFeedback,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.export import bundle
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import Claim, HeadOwner
from engage_hri.schemas.messages import Message, line, published
from engage_hri.schemas.participants import PeerGone
from engage_hri.schemas.recognition import ConnectionEvent, KindStatistics, OpenEvents, Statistics, WindowStatistics
from engage_hri.schemas.units import Stamp


@pytest.mark.parametrize(
    ("where", "names", "told"),
    [
        ("b: g", ("b", "g"), "line 2: bad (mend it)"),
        ("g", ("b", "g"), "line 2: bad (mend it)"),
        ("b: constraint 1", ("b",), "constraint 1, line 2: bad (mend it)"),
        ("beat", ("b", "g"), "beat, line 2: bad (mend it)"),
        ("b: b", ("b", "b"), "line 2: bad (mend it)"),
        ("", ("",), "line 2: bad (mend it)"),
    ],
)
def test_a_fault_does_not_say_again_what_is_told_with_it(where: str, names: tuple[str, ...], told: str) -> None:
    assert Fault(reason="bad", where=where, line=2, advice="mend it").within(*names) == told


def at(seconds: float) -> Stamp:
    return Stamp("loop", seconds)


def test_the_start_of_a_block() -> None:
    assert line(BlockProgress(block="b", progress="start", at=at(1.23456789))) == (
        '{"type":"block_progress","block":"b","progress":"start","at":1.234568,"time":0.0,"status":"",'
        '"character_id":""}'
    )


def test_the_end_of_a_block_that_had_no_id() -> None:
    message = BlockProgress(block=None, progress="end", status="failed", time=0.1 + 0.2, at=at(2))

    assert line(message) == (
        '{"type":"block_progress","block":null,"progress":"end","at":2.0,"time":0.3,"status":"failed",'
        '"character_id":""}'
    )


def test_a_sync_point() -> None:
    message = SyncPointProgress(block="b", behavior="g", sync="stroke", at=at(5.5), time=0.5, predicted=0.4)

    assert line(message) == (
        '{"type":"sync_point_progress","block":"b","behavior":"g","sync":"stroke","at":5.5,"time":0.5,'
        '"predicted":0.4,"arrived":null,"skew":0.0,"source":"body","character_id":""}'
    )


def test_a_warning_about_a_behavior_and_about_the_whole_block() -> None:
    message = WarningFeedback(block="b", behavior="g", kind="NO_SUCH_TARGET", message="no 'cup'", at=at(1))

    assert line(message) == (
        '{"type":"warning","block":"b","kind":"NO_SUCH_TARGET","message":"no \'cup\'","behavior":"g","at":1.0,'
        '"character_id":""}'
    )
    assert json.loads(line(WarningFeedback(block=None, kind="PARSING_FAILURE", message="")) or "") == {
        "type": "warning",
        "block": None,
        "kind": "PARSING_FAILURE",
        "message": "",
        "behavior": "",
        "at": None,
        "character_id": "",
    }


def test_a_prediction() -> None:
    message = PredictionFeedback(block="b", points=(PlannedPoint(behavior="g", sync="end", time=-0.0),))

    assert line(message) == (
        '{"type":"prediction","block":"b","points":[{"behavior":"g","sync":"end","time":0.0,"type":""}],"at":null,'
        '"character_id":""}'
    )


def test_a_connection_event_that_has_only_begun() -> None:
    message = ConnectionEvent(
        id="e-1", kind="directed_gaze", initiator="robot", responder="human", state="started", objects=("cup",),
        at=at(3), started=at(3), cause="reference",
    )  # fmt: skip

    assert line(message) == (
        '{"type":"connection_event","id":"e-1","kind":"directed_gaze","initiator":"robot","responder":"human",'
        '"state":"started","at":3.0,"started":3.0,"objects":["cup"],"one_of":false,"cause":"reference","optional":false,'
        '"delay":null,"delay_error":0.0,"duration":null,"limit":null,"response":null,"answered_by":"","confidence":1.0,"block":"","behavior":"","turn":"",'
        '"words":"","retold":false}'
    )


def test_other_messages_have_no_line() -> None:
    assert line(PeerGone(participant="control")) is None


def test_statistics_of_all() -> None:
    kind = KindStatistics(kind="directed_gaze", count=2, succeeded=2, delay_mean=0.1 + 0.2, failure_rate=0.0)
    window = WindowStatistics(kinds=(kind,), events=2, mtbce=5.7, last_start=at(2.5))
    message = Statistics(
        actor="", at=at(3), session=window, recent=WindowStatistics(), engagement=0.5, level="engaged"
    )

    assert json.loads(line(message) or "") == {
        "type": "statistics", "actor": "", "at": 3.0, "engagement": 0.5, "level": "engaged", "reasons": [],
        "busy": False, "busy_until": None, "level_since": None,
        "contact": {"now": None, "share": 0.0, "ended": None},
        "head": None,
        "session": {
            "events": 2, "mtbce": 5.7, "mtbce_without_maintenance": None, "max_gap": None, "last_start": 2.5,
            "last_start_without_maintenance": None,
            "kinds": [
                {
                    "kind": "directed_gaze", "count": 2, "succeeded": 2, "failed": 0, "failure_rate": 0.0,
                    "delay_min": None, "delay_mean": 0.3, "delay_max": None,
                    "failed_delay_min": None, "failed_delay_mean": None, "failed_delay_max": None,
                        "delay_error": 0.0,
                }
            ],
        },
        "recent": {
            "events": 0, "mtbce": None, "mtbce_without_maintenance": None, "max_gap": None, "kinds": [],
            "last_start": None, "last_start_without_maintenance": None,
        },
    }  # fmt: skip


def test_a_fault() -> None:
    assert line(Fault(reason="bad", where="here")) == (
        '{"type":"fault","reason":"bad","where":"here","line":0,"advice":"","service":"","cause":"","whose":""}'
    )


@pytest.mark.parametrize(
    "message",
    [
        HeadOwner(owner=Claim(kind="none", priority=0), since=at(1), waiting=(Claim(kind="glance", priority=3),)),
        Statistics(actor="", at=at(3), session=WindowStatistics(), recent=WindowStatistics()),
        WarningFeedback(block=None, kind="LATE", message="late"),
    ],
    ids=lambda message: type(message).__name__,
)
def test_the_exported_schema_has_the_keys_of_a_line(message: Message) -> None:
    definitions = bundle()["$defs"]

    schema = definitions[f"{type(message).__name__}Line"]

    assert list(json.loads(line(message) or "")) == list(schema["properties"]) == schema["required"]
    assert definitions["StampLine"]["type"] == "number"


def test_what_is_for_programs_of_others_travels_as_json() -> None:
    state = OpenEvents(actor="ann", session="7a4d6501", at=at(1))

    payload, encoding = published(keys.open_events("ann"), state)

    assert encoding == "application/json;engage.OpenEvents/1"
    assert json.loads(payload) == {"type": "open_events", "actor": "ann", "session": "7a4d6501", "at": ["loop", 1.0]}
    assert published(keys.fault("a"), Fault(reason="bad"))[1] == "application/msgpack;engage.Fault/1"
