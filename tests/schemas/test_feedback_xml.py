"""Feedback as XML: the forms of BML 1.0 to the letter, and back again equal."""

from typing import Any, get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.documents.xml_feedback import HEAD, TAIL, encode_feedback
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.feedback import (
    BlockProgress,
    Feedback,
    PlannedPoint,
    PredictionFeedback,
    SyncPointProgress,
    WarningFeedback,
    WarningKind,
)
from engage_hri.schemas.units import Stamp
from tests.random_cases import share_of
from tests.schemas.feedback_reader import decode_feedback
from tests.schemas.strategies import ids

BML = 'xmlns="http://www.bml-initiative.org/bml/bml-1.0"'
OURS = f'{BML} xmlns:ebml="edu.wpi.ebml"'
FORMS = [
    (
        BlockProgress(block="b-1", progress="start", at=Stamp("", 1.5), character_id="Melvin"),
        f'<blockProgress {OURS} id="b-1:start" globalTime="1.5" ebml:time="0.0" characterId="Melvin"/>',
    ),
    (
        SyncPointProgress(block="b-1", behavior="g", sync="ready", at=Stamp("c", 2.0), time=0.5, predicted=0.4),
        f'<syncPointProgress {OURS} id="b-1:g:ready" time="0.5" globalTime="2.0" ebml:clock="c"'
        ' ebml:predicted="0.4" ebml:skew="0.0" ebml:source="body"/>',
    ),
    (
        PredictionFeedback(
            block="b-1",
            at=Stamp("", 1.5),
            points=(
                PlannedPoint(behavior="g", sync="start", time=0.0, type="gaze"),
                PlannedPoint(behavior="g", sync="ready", time=0.5, type="gaze"),
                PlannedPoint(behavior="s", sync="end", time=2.0, type="speech"),
            ),
        ),
        f'<predictionFeedback {BML}><bml id="b-1" globalStart="1.5" globalEnd="3.5"/>'
        '<gaze id="b-1:g" start="0.0" ready="0.5"/><speech id="b-1:s" end="2.0"/></predictionFeedback>',
    ),
    (
        WarningFeedback(block="b-1", behavior="g", kind="NO_SUCH_TARGET", message="no <cup> & saucer"),
        f'<warningFeedback {BML} id="b-1:g" type="NO_SUCH_TARGET">no &lt;cup&gt; &amp; saucer</warningFeedback>',
    ),
    (
        WarningFeedback(block=None, kind="PARSING_FAILURE", message="no id"),
        f'<warningFeedback {BML} type="PARSING_FAILURE">no id</warningFeedback>',
    ),
]


@pytest.mark.parametrize(("message", "xml"), FORMS)
def test_feedback_has_the_forms_of_bml_1_0(message: Feedback, xml: str) -> None:
    assert encode_feedback(message) == xml
    assert decode_feedback(xml) == (message,)


def test_a_stream_is_one_document() -> None:
    document = HEAD + "".join(f"{encode_feedback(message, in_stream=True)}\n" for message, _ in FORMS) + TAIL

    assert decode_feedback(document.encode()) == tuple(message for message, _ in FORMS)


times = st.floats(-1e6, 1e6).map(lambda time: time + 0.0)
stamps = st.builds(Stamp, clock=st.sampled_from(["", "c 1"]), seconds=times)
texts = st.text("ab <>&\"'é😀\n", max_size=8)
rest: dict[str, Any] = {"character_id": texts}
messages = st.one_of(
    st.builds(
        BlockProgress, block=ids, progress=st.sampled_from(["start", "end"]), at=stamps, time=times,
        status=st.sampled_from(["", "done", "failed"]), **rest,
    ),
    st.builds(
        SyncPointProgress, block=ids, behavior=ids, sync=ids, at=stamps, time=times, predicted=st.none() | times,
        arrived=st.none() | times, skew=times, source=st.sampled_from(["body", "clock"]), **rest,
    ),
    st.builds(
        PredictionFeedback, block=ids, at=st.none() | stamps, **rest,
        points=st.lists(
            st.builds(
                PlannedPoint, behavior=ids, time=times, type=st.sampled_from(["", "gaze", "speech"]),
                sync=st.sampled_from(["end", "start", "2nd", "id", "xmlns", "ö", "stroke_start"]),
            ),
            max_size=4, unique_by=lambda point: point.behavior,
        ).map(tuple),
    ),
    st.builds(
        WarningFeedback, block=ids, behavior=st.just("") | ids, kind=st.sampled_from(get_args(WarningKind)),
        message=texts, at=st.none() | stamps, **rest,
    ),
)  # fmt: skip


@settings(max_examples=share_of(200), deadline=None)
@given(messages)
def test_feedback_survives_xml(message: Feedback) -> None:
    assert decode_feedback(encode_feedback(message)) == (message,)


@pytest.mark.parametrize(
    "xml",
    [
        "<feedback/>", "<blockProgress/>", '<blockProgress id="b:middle" globalTime="1"/>', "<predictionFeedback/>",
        '<blockProgress id="b:start" globalTime="soon"/>', '<syncPointProgress id="b:g" time="1" globalTime="1"/>',
        '<warningFeedback type="BORING"/>', "<warningFeedback>", "",
    ],
)  # fmt: skip
def test_bad_feedback_is_refused(xml: str) -> None:
    with pytest.raises(InputRefused):
        decode_feedback(xml)


def test_what_xml_cannot_hold_is_replaced() -> None:
    assert "a\ufffdb" in encode_feedback(WarningFeedback(block="b", kind="LATE", message="a\0b"))


def test_there_is_no_negative_zero_in_xml() -> None:
    points = (PlannedPoint(behavior="g", sync="start", time=-0.0, type="gaze"),)
    text = encode_feedback(PredictionFeedback(block="b", at=Stamp("", -0.0), points=points))

    assert '"0.0"' in str(text)
    assert "-0.0" not in str(text)
