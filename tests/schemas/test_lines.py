"""The public JSON lines, to the letter: others parse them."""

import json

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.feedback import (
    BlockProgress,
    PlannedPoint,
    PredictionFeedback,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.lines import line
from engage_hri.schemas.messages import published
from engage_hri.schemas.presence import PeerGone
from engage_hri.schemas.recognition import ConnectionEvent, KindStatistics, OpenEvents, Statistics, WindowStatistics
from engage_hri.schemas.units import Stamp


def at(seconds: float) -> Stamp:
    return Stamp("loop", seconds)


def test_the_start_of_a_block() -> None:
    assert line(BlockProgress(block="b", progress="start", at=at(1.23456789))) == (
        '{"type":"block_progress","block":"b","progress":"start","status":null,"time":0.0,"global_time":1.234568}'
    )


def test_the_end_of_a_block_that_had_no_id() -> None:
    message = BlockProgress(block=None, progress="end", status="failed", time=0.1 + 0.2, at=at(2))

    assert line(message) == (
        '{"type":"block_progress","block":null,"progress":"end","status":"failed","time":0.3,"global_time":2.0}'
    )


def test_a_sync_point() -> None:
    message = SyncPointProgress(block="b", behavior="g", sync="stroke", at=at(5.5), time=0.5, predicted=0.4)

    assert line(message) == (
        '{"type":"sync_point_progress","block":"b","behavior":"g","sync":"stroke","time":0.5,"global_time":5.5,'
        '"predicted":0.4,"source":"body","arrived":null,"skew":0.0}'
    )


def test_a_warning_about_a_behavior_and_about_the_whole_block() -> None:
    message = WarningFeedback(block="b", behavior="g", kind="NO_SUCH_TARGET", message="no 'cup'")

    assert line(message) == (
        '{"type":"warning","block":"b","behavior":"g","kind":"NO_SUCH_TARGET","message":"no \'cup\'"}'
    )
    assert json.loads(line(WarningFeedback(block=None, kind="PARSING_FAILURE", message="")) or "") == {
        "type": "warning",
        "block": None,
        "behavior": None,
        "kind": "PARSING_FAILURE",
        "message": "",
    }


def test_a_prediction() -> None:
    message = PredictionFeedback(block="b", points=(PlannedPoint(behavior="g", sync="end", time=-0.0),))

    assert line(message) == (
        '{"type":"prediction","block":"b","points":[{"behavior":"g","sync":"end","time":0.0}]}'
    )  # fmt: skip


def test_a_connection_event_that_has_only_begun() -> None:
    message = ConnectionEvent(
        id="e-1", kind="directed_gaze", initiator="robot", responder="human", state="started", objects=("cup",),
        at=at(3), started=at(3), cause="reference",
    )  # fmt: skip

    assert line(message) == (
        '{"type":"connection_event","id":"e-1","kind":"directed_gaze","initiator":"robot","responder":"human",'
        '"objects":["cup"],"cause":"reference","state":"started","optional":false,"delay":null,"time":3.0,'
        '"started":3.0,"duration":null,"response":null,"block":null,"behavior":null,"turn":null}'
    )


def test_other_messages_have_no_line() -> None:
    assert line(PeerGone(participant="control")) is None


def test_statistics_of_all() -> None:
    kind = KindStatistics(kind="directed_gaze", count=2, succeeded=2, delay_mean=0.1 + 0.2, failure_rate=0.0)
    window = WindowStatistics(kinds=(kind,), events=2, mtbce=5.7)
    message = Statistics(
        actor="", at=at(3), session=window, recent=WindowStatistics(), engagement=0.5, level="engaged"
    )

    assert json.loads(line(message) or "") == {
        "type": "statistics", "actor": None, "time": 3.0, "engagement": 0.5, "level": "engaged", "reasons": [],
        "busy": False,
        "session": {
            "events": 2, "mtbce": 5.7, "mtbce_without_maintenance": None, "max_gap": None,
            "kinds": [
                {
                    "kind": "directed_gaze", "count": 2, "succeeded": 2, "failed": 0, "failure_rate": 0.0,
                    "delay_min": None, "delay_mean": 0.3, "delay_max": None,
                    "failed_delay_min": None, "failed_delay_mean": None, "failed_delay_max": None,
                }
            ],
        },
        "recent": {
            "events": 0, "mtbce": None, "mtbce_without_maintenance": None, "max_gap": None, "kinds": [],
        },
    }  # fmt: skip


def test_faults_and_head_owners_are_lines_as_they_travel() -> None:
    assert line(Fault(reason="bad", where="here")) == '{"type":"fault","reason":"bad","where":"here"}'


def test_what_is_for_programs_of_others_travels_as_json() -> None:
    state = OpenEvents(actor="ann", session="7a4d6501", at=at(1))

    payload, encoding = published(state)

    assert encoding == "application/json;engage.OpenEvents/1"
    assert json.loads(payload) == {"type": "open_events", "actor": "ann", "session": "7a4d6501", "at": ["loop", 1.0]}
    assert published(Fault(reason="bad"))[1] == "application/msgpack;engage.Fault/1"
