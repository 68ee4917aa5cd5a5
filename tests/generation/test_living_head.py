"""Policies of a head that lives: looks away from faces, eyes that have met, nods to who speaks for long."""

from collections.abc import Callable
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.behaviors import Event, Head
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.recognition import Floor, FloorSpeech
from engage_hri.schemas.world import Entity, World
from engage_hri.services.generation.head.aversion_policy import ATTENDED, LENGTHS, LONG_UTTERANCE, PAUSES, PLANNING
from engage_hri.services.generation.head.mutual_policy import MUTUAL
from engage_hri.services.generation.head.nod_policy import AGAIN, LISTENS, PAUSE, UNINVITED
from tests.generation.heads import AT, INHIBITED, Stage, event, world

TABLE = Entity(id="table", kind="surface", position=(0.7, 0.0, 0.7))
PEOPLE = tuple(Entity(id=id, kind="person", position=(1.2, y, 1.2)) for id, y in (("ann", 0.0), ("ben", 0.6)))
DWELL = 0.3


def before_a_table(*off: str) -> Stage:
    """A robot, a table, and ann and ben, of whom it looks at ann."""
    stage = Stage(policies_off=off)
    stage.feed(World(entities=(*PEOPLE, TABLE)))
    stage.do(lambda arbiter: arbiter.speak_to("ann"))
    return stage


def speak(stage: Stage, *actors: str, to: str = "robot") -> None:
    speeches = tuple(FloorSpeech(actor=each, since=AT, to=(to if each != "robot" else "ann",)) for each in actors)
    stage.feed(Floor(at=AT, speeches=speeches))


def aways(stage: Stage, seconds: float) -> list[tuple[float, float]]:
    """Beginning and length of each look away in the time from now."""
    begins = len(stage.owners)
    stage.until(stage.now + seconds)
    told = stage.owners[begins:]
    return [(at, round(back - at, 3)) for (at, kind, _), (back, *_) in pairwise(told) if kind == "aversion"]


# -- looks away ---------------------------------------------------------------------------------------------------


def test_in_a_minute_on_a_face_the_eyes_leave_it_as_often_and_as_briefly_as_peoples() -> None:
    found = aways(before_a_table(), 60.0)

    assert 4 <= len(found) <= 10
    lengths = [length for _, length in found[: len(LENGTHS)]]
    assert lengths == [round(each + DWELL, 3) for each in LENGTHS[: len(found)]]
    assert {target for _, kind, target in before_a_table_for(60.0) if kind == "aversion"} == {"table"}
    gaps = [later - began for (began, _), (later, _) in pairwise(found)]
    assert all(min(PAUSES) < gap < max(PAUSES) + max(LENGTHS) + DWELL + 0.1 for gap in gaps)


def before_a_table_for(seconds: float) -> list[tuple[float, str, str]]:
    stage = before_a_table()
    stage.until(seconds)
    return stage.owners


def test_where_there_is_nothing_but_people_it_looks_nowhere_else() -> None:
    stage = Stage()
    stage.feed(World(entities=PEOPLE))

    assert aways(stage, 60.0) == []


def test_who_begins_to_speak_to_it_has_its_eyes_though_a_look_away_was_due() -> None:
    stage = before_a_table()
    stage.until(PAUSES[0] - 0.1)
    speak(stage, "ann")
    assert aways(stage, 10.0)[0][0] == pytest.approx(PAUSES[0] - 0.1 + ATTENDED)

    waits = before_a_table()
    waits.feed(event("pair", "started", kind="adjacency_pair", initiator="robot", responder="ann", objects=()))
    waits.do(lambda arbiter: arbiter.wait_for_answers())
    assert aways(waits, 30.0) == [], "an answer is awaited"


@pytest.mark.parametrize(("words", "away"), [(LONG_UTTERANCE, True), (LONG_UTTERANCE - 1, False)])
def test_it_looks_away_where_a_long_utterance_begins(words: int, away: bool) -> None:
    stage = before_a_table()
    stage.until(3.0)
    stage.do(lambda arbiter: arbiter.says(words))
    speak(stage, "robot")
    stage.until(6.0)

    assert ((3.0, "aversion", "table") in stage.owners) == away
    assert ((3.0 + PLANNING + DWELL, "face", "ann") in stage.owners) == away


def test_what_somebody_shows_it_ends_a_look_away_and_a_fragment_goes_before() -> None:
    stage = before_a_table()
    stage.until(PAUSES[0] + LENGTHS[0] / 2 + 0.1)
    stage.feed(event("e", "started", initiator="ann", objects=("cup",)))
    stage.until(stage.now + DWELL)
    shown = PAUSES[0] + 0.7
    assert stage.owners[-2:] == [(PAUSES[0], "aversion", "table"), (pytest.approx(shown), "response", "cup")]

    stage.do(lambda arbiter: arbiter.fragment_gazes("ben"))
    assert stage.owner == "fragment"


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(
                [
                    lambda stage: speak(stage, "ann"),
                    lambda stage: speak(stage, "ben", "ann"),
                    lambda stage: speak(stage, "robot"),
                    lambda stage: speak(stage),
                    lambda stage: stage.feed(event("e", "started", initiator="ann", objects=("cup",))),
                    lambda stage: stage.feed(event("e", "failed", initiator="ann", objects=("cup",))),
                    lambda stage: stage.do(lambda arbiter: arbiter.says(20.0)),
                    lambda stage: stage.do(lambda arbiter: arbiter.wait_for_answers()),
                ]
            ),
            st.floats(0.0, 5.0),
        ),
        max_size=20,
    )
)
def test_whatever_happens_a_look_away_is_one_from_a_face_and_ends(
    story: list[tuple[Callable[[Stage], None], float]],
) -> None:
    stage = before_a_table()
    for happening, pause in story:
        happening(stage)
        stage.until(stage.now + pause)
    stage.until(stage.now + 3.0)

    for (_, _, before), (at, kind, _), (ended, *_) in zip(
        stage.owners, stage.owners[1:], [*stage.owners[2:], (stage.now, "", "")], strict=False
    ):
        if kind == "aversion":
            assert before in ("ann", "ben")
            assert ended - at <= max(*LENGTHS, PLANNING) + DWELL + 1e-6


# -- eyes that have met -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("off", "left"), [((), 5.2 + MUTUAL), (("mutual",), 5.4)])
def test_eyes_that_it_has_sought_and_met_are_not_left_for_a_hand(off: tuple[str, ...], left: float) -> None:
    stage = Stage(policies_off=("aversion", *off))
    stage.feed(world())
    stage.until(5.2)
    met = {"kind": "mutual_facial_gaze", "initiator": "robot", "responder": "human", "objects": ()}
    stage.feed(event("gaze", "started", **met), event("gaze", "succeeded", **met), world(speed=0.4))
    stage.until(8.0)

    on_hand = next(at for at, _, target in stage.shifts if target == "hand")
    assert on_hand == pytest.approx(left + (DWELL if not off else 0.0))


@pytest.mark.parametrize(("to", "left"), [("robot", 5.4), ("ann", 5.0 + MUTUAL)])
def test_eyes_that_it_has_met_are_left_for_who_may_speak_to_it(to: str, left: float) -> None:
    stage = before_a_table("aversion", "hands")
    stage.until(5.0)
    met = {"kind": "mutual_facial_gaze", "initiator": "robot", "responder": "ann", "objects": ()}
    stage.feed(event("gaze", "started", **met), event("gaze", "succeeded", **met))
    stage.until(5.2)
    speak(stage, "ben", to=to)
    stage.until(8.0)

    assert stage.owners[-1][2] == "ben"
    assert stage.owners[-1][0] == pytest.approx(left)


# -- nods ---------------------------------------------------------------------------------------------------------


def nods(stage: Stage) -> list[tuple[float, str]]:
    return [(at, person) for at, person, _ in signs(stage)]


def signs(stage: Stage) -> list[tuple[float, str, str]]:
    return [(round(at, 3), *ruling.sign.sign) for at, ruling in stage.timed if ruling.sign is not None]


def say(stage: Stage, at: float, words: str) -> None:
    stage.until(at)
    stage.feed(Utterance(actor="ann", id="u", text=words, began=AT, at=AT, final=False))


def test_who_speaks_to_it_for_long_is_nodded_to_and_again_after_a_while() -> None:
    stage = before_a_table("aversion")
    speak(stage, "ann")
    stage.until(LISTENS + AGAIN + 1.0)

    assert nods(stage) == [(LISTENS, "ann"), (LISTENS + AGAIN, "ann")]


def test_a_pause_between_words_invites_the_nod_and_without_one_it_comes_late() -> None:
    pauses, talks = before_a_table("aversion"), before_a_table("aversion")
    for stage in (pauses, talks):
        speak(stage, "ann")
        for number in range(1, 6):
            say(stage, 0.5 * number, "so " * number)
    pauses.until(5.0)
    for number in range(6, 12):
        say(talks, 0.5 * number, "so " * number)

    assert nods(pauses) == [(LISTENS + PAUSE, "ann")]
    assert nods(talks) == [(LISTENS + UNINVITED, "ann")]


def told_long(stage: Stage, *pauses: tuple[float, str]) -> list[tuple[float, str, str]]:
    """Signs to ann, who speaks from 0 on without a break but for pauses of 1 s after these times and words."""
    speak(stage, "ann")
    silent = {round(at, 1) for at, _ in pauses}
    ends = dict(pauses)
    at = 0.5
    while at < 40.0:
        say(stage, at, f"so on {at} {ends.get(at, 'blue')}")
        at += 1.5 if round(at, 1) in silent else 0.5
    return signs(stage)


def test_a_pause_after_words_that_may_be_all_invites_a_word_with_the_second_nod() -> None:
    found = told_long(before_a_table("aversion"), (3.0, "piece"), (9.5, "piece"), (16.0, "piece"), (22.5, "piece"))

    assert [(at, words) for at, _, words in found[:4]] == [(3.6, ""), (10.1, "mm-hmm"), (16.6, ""), (23.1, "uh-huh")]


@pytest.mark.parametrize("end", ["the", "and", "piece?", "piece,"])
def test_words_after_which_more_must_follow_or_an_answer_invite_a_nod_alone(end: str) -> None:
    found = told_long(before_a_table("aversion"), (3.0, "piece"), (9.5, end))

    assert [(at, words) for at, _, words in found[:2]] == [(3.6, ""), (10.1, "")]


def test_without_the_policy_and_without_a_pause_no_word_is_said() -> None:
    pauses = ((3.0, "piece"), (9.5, "piece"), (16.0, "piece"))

    assert {words for *_, words in told_long(before_a_table("aversion", "continuers"), *pauses)} == {""}
    assert {words for *_, words in told_long(before_a_table("aversion"))} == {""}


def test_in_a_turn_of_the_robot_there_is_no_sign_though_it_is_silent() -> None:
    stage = before_a_table("aversion")
    stage.do(lambda arbiter: arbiter.has_turn(True))

    assert told_long(stage, (3.0, "piece"), (9.5, "piece")) == []


def test_nobody_is_nodded_to_who_is_brief_or_speaks_to_others_or_while_the_robot_speaks_or_is_held() -> None:
    brief, aside, speaking, held = (before_a_table("aversion") for _ in range(4))
    speak(brief, "ann")
    brief.until(LISTENS - 0.1)
    speak(brief)
    speak(aside, "ann", to="ben")
    speak(speaking, "robot", "ann")
    held.do(lambda arbiter: arbiter.inhibit(INHIBITED))
    speak(held, "ann")
    for stage in (brief, aside, speaking, held):
        stage.until(LISTENS + 3.0)

    assert [nods(stage) for stage in (brief, aside, speaking, held)] == [[]] * 4


def test_a_nod_is_announced_as_a_backchannel_before_it_is_seen() -> None:
    stage = before_a_table("aversion")
    speak(stage, "ann")
    stage.until(LISTENS)
    ordered = stage.timed[-1][1].sign

    assert ordered is not None
    told, nod = ordered.block.behaviors
    assert isinstance(told, Event)
    assert isinstance(nod, Head)
    assert (told.kind, told.responder, told.cause, nod.lexeme) == ("backchannel", "ann", "maintenance", "NOD")
    (order,) = (operator for each in ordered.block.constraints for operator in each.operators)
    assert (order.ref, order.syncs) == ("backchannel:start", ("nod:start",))
