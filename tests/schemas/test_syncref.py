"""References to sync points: every form of realizer.md, every bad one, and the round trip."""

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.behavior_types import canonical_sync, dialect_sync
from engage_hri.schemas.references import SyncRef
from tests.random_cases import share_of

names = st.from_regex(r"[A-Za-z_][A-Za-z0-9_.-]{0,8}", fullmatch=True)
ids = names.filter(lambda name: name != "bml")
offsets = st.floats(-1e6, 1e6, allow_nan=False).map(lambda number: number + 0.0)


@st.composite
def references(draw: st.DrawFn) -> SyncRef:
    block = draw(st.just("") | ids)
    match draw(st.sampled_from(["time", "point", "stroke", "block"])):
        case "time":
            return SyncRef(block=block, offset=draw(offsets))
        case "stroke":
            return SyncRef(block, draw(ids), "stroke", draw(st.integers(0, 9)), draw(offsets))
        case "block":
            return SyncRef(block, "bml", draw(st.sampled_from(["start", "end"])), 0, draw(offsets))
    return SyncRef(block, draw(ids), draw(names), 0, draw(offsets))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("speech-1:end", SyncRef(behavior="speech-1", sync="end")),
        ("speech-1:end+0.5", SyncRef(behavior="speech-1", sync="end", offset=0.5)),
        ("gaze-1:stroke + 2", SyncRef(behavior="gaze-1", sync="stroke", offset=2)),
        ("gaze-1:stroke-2", SyncRef(behavior="gaze-1", sync="stroke", offset=-2)),
        (" gaze-1 : stroke  -  2. ", SyncRef(behavior="gaze-1", sync="stroke", offset=-2)),
        ("n1:stroke:2", SyncRef(behavior="n1", sync="stroke", repetition=2)),
        ("n1:stroke:2-1.5", SyncRef(behavior="n1", sync="stroke", repetition=2, offset=-1.5)),
        ("b-1:n1:stroke:2", SyncRef(block="b-1", behavior="n1", sync="stroke", repetition=2)),
        ("b-1:n1:stroke : 2 + .5", SyncRef(block="b-1", behavior="n1", sync="stroke", repetition=2, offset=0.5)),
        ("b-1:n1:end-1", SyncRef(block="b-1", behavior="n1", sync="end", offset=-1)),
        ("2", SyncRef(offset=2)),
        ("-0.5", SyncRef(offset=-0.5)),
        ("b1:2.5", SyncRef(block="b1", offset=2.5)),
        ("bml:start", SyncRef(behavior="bml", sync="start")),
        ("bml:end+1", SyncRef(behavior="bml", sync="end", offset=1)),
        ("s:word-a", SyncRef(behavior="s", sync="word-a")),
        ("s:word-2", SyncRef(behavior="s", sync="word", offset=-2)),
        ("s:word-2+0", SyncRef(behavior="s", sync="word-2")),
        ("s:word-2-1", SyncRef(behavior="s", sync="word-2", offset=-1)),
        ("g:strokeStart", SyncRef(behavior="g", sync="strokeStart")),
    ],
)
def test_a_reference_is_read(text: str, expected: SyncRef) -> None:
    assert SyncRef.parse(text) == expected


@pytest.mark.parametrize(
    "text",
    [
        "", " ", "a", ":a:b", "a::b", "a:", "a:b:", "a:relax:2", "a:stroke:0", "a:stroke:-1", "a:stroke:2:3", "+x",
        "-x", "a:+x", "a:-x", "a:b+", "a:b+c", "a:b+1+2", "b:a:stroke:2:3", "a:b:c:d", "a b:c", "a:b c",
        "a:stroke:1.5", "bml:stroke", "1e3", "nan", "inf", "a:b - c", "a:b+1" + "0" * 400, "٣",
    ],
)  # fmt: skip
def test_a_bad_reference_is_refused_by_name(text: str) -> None:
    with pytest.raises(ValueError, match="sync reference") as refusal:
        SyncRef.parse(text)

    assert repr(text[:70])[1:-1] in str(refusal.value)


def test_a_known_mark_is_not_taken_for_an_offset() -> None:
    assert SyncRef.parse("s:word-2", names={"word-2"}) == SyncRef(behavior="s", sync="word-2")
    assert SyncRef.parse("s:word-2-1", names={"word-2"}) == SyncRef(behavior="s", sync="word-2", offset=-1)


@settings(max_examples=share_of(200, 20))
@given(references())
def test_the_canonical_text_of_a_reference_reads_back_equal(reference: SyncRef) -> None:
    assert SyncRef.parse(str(reference)) == reference


@given(references(), st.sampled_from([":", " :", ": ", " : "]))
def test_spaces_around_the_colon_mean_nothing(reference: SyncRef, colon: str) -> None:
    assert SyncRef.parse(str(reference).replace(":", colon)) == reference


def test_canonical_text_is_the_shortest() -> None:
    assert str(SyncRef.parse(" a : stroke : 2 + 1.50 ")) == "a:stroke:2+1.5"
    assert str(SyncRef.parse("a:end + 0")) == "a:end"
    assert str(SyncRef.parse("2.0")) == "2"


@pytest.mark.parametrize(
    ("name", "type", "canonical"),
    [
        ("strokeStart", "gesture", "stroke_start"),
        ("strokeEnd", "head", "stroke_end"),
        ("attackPeak", "face", "ready"),
        ("ready", "gesture", "ready"),
        ("ready", "gaze", "stroke"),
        ("relax", "gaze", "relax"),
        ("strokeStart", "speech", "strokeStart"),
    ],
)
def test_the_spelling_of_bml_1_0_has_one_meaning_and_its_way_back(name: str, type: str, canonical: str) -> None:
    assert canonical_sync(name, type, "bml-1.0") == canonical
    assert dialect_sync(canonical, type, "bml-1.0") == name


def test_the_draft_spelling_is_the_systems_own() -> None:
    assert canonical_sync("ready", "gaze", "draft") == "ready"
    assert canonical_sync("attackPeak", "face", "draft") == "ready"
    assert canonical_sync("attackPeak", "gesture", "draft") == "attackPeak"  # a gesture has none
    assert dialect_sync("stroke_start", "gaze", "draft") == "stroke_start"


def test_feedback_in_bml_1_0_leaves_out_points_that_it_does_not_know() -> None:
    assert dialect_sync("stroke_start", "gaze", "bml-1.0") is None
    assert dialect_sync("ready", "gazeShift", "bml-1.0") is None


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("g:m 1", "'m 1' is not a sync point: it holds a space"), ("g 1:end", "'g 1' is not an id: it holds a space"),
        ("-g:end", "'-g' is not an id: it begins with '-'"),
    ],
)  # fmt: skip
def test_a_refusal_says_what_keeps_a_name_from_being_one(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=f"{re.escape(why)}$"):
        SyncRef.parse(text)


def test_a_mark_that_is_a_number_is_known_by_its_speech_or_its_offset() -> None:
    assert SyncRef.parse("s:1") == SyncRef(block="s", offset=1.0)
    assert SyncRef.parse("s:1", ["1"]) == SyncRef.parse("s:1+0") == SyncRef(behavior="s", sync="1")
    assert SyncRef.parse("s:1-0.5") == SyncRef(behavior="s", sync="1", offset=-0.5)
    assert SyncRef.parse("b:s:1") == SyncRef(block="b", behavior="s", sync="1")
    assert [str(SyncRef.parse(each)) for each in ("s:1+0", "b:s:1", "s:1+2")] == ["s:1+0", "b:s:1", "s:1+2"]
