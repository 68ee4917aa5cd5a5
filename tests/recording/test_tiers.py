"""Tiers of a recorded task, and their files as other libraries read them."""

import csv
import io
from itertools import accumulate, pairwise
from pathlib import Path

import pympi
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.perception import ActionBegan, ActionEnded, Utterance
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.interface import Sample
from engage_hri.services.recording.reading import Recording
from engage_hri.services.recording.tiers import Annotation, Media, Tier, apart, eaf, table, tiers
from tests.recording.files import recording, sample

DATE = "2026-11-24T17:00:00+00:00"


def events(task: Recording) -> dict[str, list[ConnectionEvent]]:
    found: dict[str, list[ConnectionEvent]] = {}
    for number in range(len(task)):
        one = task.received(number)
        if one is not None and isinstance(one.message, ConnectionEvent):
            found.setdefault(one.message.id, []).append(one.message)
    return found


def test_every_connection_event_is_an_annotation_with_its_times(task: Recording) -> None:
    found = [one for tier in tiers(task) if tier.actor == "connection events" for one in tier.annotations]

    lives = list(events(task).values())
    assert len(found) == len(lives) > 80
    assert sorted((round(one.begin, 6), round(one.end, 6)) for one in found) == sorted(
        (round(life[0].started.seconds, 6), round(max(life[-1].at.seconds, life[0].started.seconds + 1e-3), 6))
        for life in lives
        if life[-1].state != "started"
    )
    succeeded = [one for one in found if one.value.startswith("succeeded")]
    assert len(succeeded) == len([life for life in lives if any(event.state == "succeeded" for event in life)])


def test_looks_of_both_sides_are_those_that_were_told(task: Recording) -> None:
    by_name = {tier.name: tier for tier in tiers(task)}
    looks = by_name["human gaze"].annotations

    told = [task.received(number) for number in range(len(task)) if task.key(number) == keys.PERCEIVED_ACTION]
    begins = [one.message for one in told if one is not None and isinstance(one.message, ActionBegan)]
    assert [one.begin for one in looks] == pytest.approx([b.at.seconds for b in begins if b.action == "look"])
    assert by_name["robot words"].annotations[0].value
    speech = " ".join(one.value for one in by_name["robot speech"].annotations)
    assert " ".join(one.value for one in by_name["robot words"].annotations) == speech


def test_words_of_people_are_where_they_were_said_as_they_were_understood_last() -> None:
    def says(id: str, text: str, began: float, ended: float | None, at: float, clock: str = "loop") -> Sample:
        last = None if ended is None else Stamp(clock, ended)
        words = Utterance(actor="ann", id=id, text=text, began=Stamp(clock, began), ended=last, at=Stamp("loop", at))
        return sample(keys.UTTERANCE, words, at)

    told = [
        sample(keys.fault("there"), Fault(reason="begin"), 0.0),
        says("1", "put it their", 1.0, 2.0, 2.25),
        says("1", "put it there", 1.0, 2.0, 2.5),
        says("2", "yes", 3.0, None, 3.5),
        says("3", "so", 71.0, 72.0, 5.0, clock="of nobody"),
    ]

    (words,) = [tier for tier in tiers(recording(told)) if tier.name == "ann words"]
    found = [(one.begin, one.value) for one in words.annotations]
    assert found == [(1.0, "put it there"), (3.0, "yes"), (5.0, "so")]
    assert [one.end for one in words.annotations[:2]] == [2.0, 3.5]


def test_an_eaf_is_read_by_another_library_as_it_was_meant(task: Recording, tmp_path: Path) -> None:
    made = tiers(task)
    (tmp_path / "a.eaf").write_bytes(eaf(made, date=DATE, media=Media("file:///films/a.mp4", "./a.mp4")))

    document = pympi.Elan.Eaf(str(tmp_path / "a.eaf"))

    assert list(document.get_tier_names()) == [tier.name for tier in made]
    for tier in made:
        found = sorted(document.get_annotation_data_for_tier(tier.name))
        assert [(begin, end, value) for begin, end, value, *_ in found] == [
            (*one.milliseconds, one.value) for one in tier.annotations
        ]
    assert document.get_linked_files()[0]["MEDIA_URL"] == "file:///films/a.mp4"


def test_a_table_has_a_row_for_each_annotation(task: Recording) -> None:
    made = tiers(task)

    header, *found = csv.reader(io.StringIO(table(made)))

    assert header == ["tier", "actor", "begin", "end", "value"]
    assert len(found) == sum(len(tier.annotations) for tier in made)
    assert {row[0] for row in found} == {tier.name for tier in made}


annotations = st.builds(
    lambda begin, length: Annotation(begin / 1000, (begin + length) / 1000, "x"),
    st.integers(0, 99),
    st.integers(1, 9),
)


@given(st.lists(annotations, max_size=30))
def test_nothing_overlaps_within_a_tier_and_nothing_is_lost(given: list[Annotation]) -> None:
    lanes = list(apart("a", "b", given))

    for tier in lanes:
        ends = [one.end for one in tier.annotations]
        assert all(one.begin >= end - 1e-9 for one, end in zip(tier.annotations[1:], ends, strict=False))
    kept = sorted((one.begin, one.end) for tier in lanes for one in tier.annotations)
    assert kept == sorted((one.begin, one.end) for one in given)


WORDS = st.lists(st.sampled_from((0.0, 0.0, 0.0004, 0.001, 0.0015, 0.2)), max_size=30)


@given(st.floats(0, 9), WORDS)
@example(0.0015, [0.001, 0.001, 0.001])
def test_words_one_after_the_other_are_one_tier_though_some_take_no_time(begin: float, lengths: list[float]) -> None:
    ends = [*accumulate(lengths, initial=begin)]
    words = [Annotation(*times, str(number)) for number, times in enumerate(pairwise(ends))]

    made = [*apart("a", "words", words)]

    assert len(made) == bool(words)
    assert [one.value for tier in made for one in tier.annotations] == [word.value for word in words]
    for tier in made:
        for before, after in pairwise(tier.annotations):
            assert before.end <= after.begin + 1e-9
            assert before.milliseconds[1] <= after.milliseconds[0]
        for one, word in zip(tier.annotations, words, strict=True):
            assert -1e-9 <= one.begin - word.begin <= 0.001 * (len(words) + 1)


@given(st.lists(annotations, max_size=10), st.text(max_size=20))
def test_any_text_and_any_times_are_valid_files(given: list[Annotation], text: str) -> None:
    made = [Tier(tier.name, "a", tuple(Annotation(one.begin, one.end, text) for one in tier.annotations))
            for tier in apart("a", "b", given)]  # fmt: skip

    from lxml import etree

    root = etree.fromstring(eaf(made, date=DATE))
    assert len(root.findall(".//ANNOTATION")) == len(given)


def test_what_began_before_and_what_never_ended_are_cut_to_the_recording() -> None:
    def look(at: float, target: str) -> ActionBegan:
        return ActionBegan(actor="ann", action="look", at=Stamp("loop", at), targets=(target,))

    told = [
        sample(keys.PERCEIVED_ACTION, look(-2.0, "cup"), 0.5),
        sample(keys.PERCEIVED_ACTION, look(1.0, "robot"), 1.5),
        sample(keys.PERCEIVED_ACTION, look(1.0, "robot"), 1.6),  # twice, as after a cut
        sample(keys.PERCEIVED_ACTION, ActionEnded(actor="bob", action="nod", at=Stamp("loop", 2.0)), 2.0),
        sample(keys.fault("there"), Fault(reason="over"), 4.0),
    ]

    [gaze] = [tier for tier in tiers(recording(told)) if tier.name == "ann gaze"]

    assert gaze.annotations == (Annotation(0.0, 1.0, "cup"), Annotation(1.0, 4.0, "robot"))
