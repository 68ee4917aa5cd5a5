"""The files, letter by letter: others read them."""

import csv
import io

from engage_hri.services.study import summary
from engage_hri.services.study.records import EventRecord
from tests.study.sessions import kind, session


def test_events_have_exactly_these_columns():
    event = EventRecord(
        session=3, condition="operational", kind="directed_gaze", initiator="robot", cause="reference",
        outcome="succeeded", optional=False, start=12.3456789, delay=0.25,
    )  # fmt: skip
    backchannel = EventRecord(
        session=3, condition="operational", kind="backchannel", initiator="human", cause="human",
        outcome="succeeded", optional=True, start=-0.0, delay=None,
    )  # fmt: skip

    assert summary.events_csv([event, backchannel]) == (
        "session,condition,kind,initiator,cause,outcome,optional,start,delay\n"
        "3,operational,directed_gaze,robot,reference,succeeded,false,12.345679,0.25\n"
        "3,operational,backchannel,human,human,succeeded,true,0.0,\n"
    )


def test_no_session_is_a_header():
    assert summary.events_csv([]) == "session,condition,kind,initiator,cause,outcome,optional,start,delay\n"
    assert summary.sessions_csv([]).startswith(
        "session,condition,seed,finished,reason,duration,completion_time,events,mtbce,max_gap,adjacency_pairs_every,"
        "eye_contact_first,eye_contact_second,eye_contact_last,directed_gaze_count,"
    )
    assert summary.findings_csv([]).startswith("hypothesis,claim,measure,unit,condition,n,")


def test_a_session_is_one_row_whatever_its_reason():
    good = session("operational", 0, kind("adjacency_pair", 3, 1, delay=0.5), completion=150.0, face=(0.1, 0.2, 0.3))
    bad = session("operational", 1, reason='it said "no", and\nthen nothing')

    rows = list(csv.DictReader(io.StringIO(summary.sessions_csv([good, bad]))))

    assert [row["finished"] for row in rows] == ["true", "false"]
    assert (rows[0]["seed"], rows[0]["completion_time"], rows[0]["eye_contact_last"]) == ("100", "150.0", "0.3")
    assert (rows[0]["adjacency_pair_count"], rows[0]["adjacency_pair_delay_mean"]) == ("4", "0.5")
    assert (rows[0]["backchannel_count"], rows[0]["backchannel_delay_mean"]) == ("0", "")
    assert rows[1]["reason"] == bad.reason
    assert rows[1]["completion_time"] == ""
