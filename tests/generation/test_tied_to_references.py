"""What is tied to a reference keeps its time: to the gaze's start, but words to the phrase's where the gaze leads."""

import pytest

from engage_hri.schemas.behaviors import (
    After,
    Before,
    Constraint,
    FaceLexeme,
    FragmentBehavior,
    Gesture,
    Head,
    Reference,
    Speech,
    SpeechOption,
    Synchronize,
    Timing,
)
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.commandline.talk.offline_plan import generated
from engage_hri.services.commandline.talk.plan import rehearsed
from engage_hri.services.generation.block.rewriting import Operator
from engage_hri.services.runtime.virtual_time import run_virtual
from engage_hri.services.simulation.still import table_world
from tests.generation.emitted import LOOK, POINT, Made, block, by_id, lines, reference, speech

PROFILES = ("check-back", "figure-3.3")
TIED: dict[str, FragmentBehavior] = {
    "nod": Head(id="x", lexeme="NOD"),
    "gesture": Gesture(id="x", lexeme="BEAT"),
    "face": FaceLexeme(id="x", lexeme="SMILE"),
}
WORLD = table_world()


def fragment(*operators: Operator, extra: FragmentBehavior = TIED["nod"], status: str = "middle") -> TurnFragment:
    """Words, a reference, words and what is tied to it."""
    return TurnFragment(
        id="f",
        turn_status=status,  # type: ignore[arg-type]
        behaviors=(speech("s1"), reference("r"), speech("s2"), extra),
        constraints=(Constraint(id="c", operators=operators),) if operators else (),
    )


def same(*syncs: str) -> Synchronize:
    return Synchronize(syncs=syncs)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("made", [(LOOK, "it"), (POINT, "it")])
@pytest.mark.parametrize("sync", ["start", "stroke", "end"])
def test_what_is_no_words_is_tied_to_the_gazes_start(profile: str, made: Made, sync: str) -> None:
    result = block(fragment(same("r:start+0.2", f"x:{sync}")), [made], profile)

    assert lines(result, "c") == [f"x:{sync} = r-gaze:start+0.2"]


@pytest.mark.parametrize("profile", PROFILES)
def test_inline_timing_is_tied_to_the_gazes_start(profile: str) -> None:
    tied = Head(id="x", lexeme="NOD", timing=(Timing("stroke", "r:start"),))

    result = block(fragment(extra=tied), [(LOOK, "it")], profile)

    assert by_id(result)["x"].timing == (Timing("stroke", "r-gaze:start"),)


@pytest.mark.parametrize("profile", PROFILES)
def test_the_end_of_a_reference_is_that_of_its_phrase_for_all(profile: str) -> None:
    result = block(fragment(same("r:end", "x:stroke"), same("s2:start", "r:end+0.3")), [(POINT, "it")], profile)

    assert lines(result, "c") == ["x:stroke = r-phrase:end", "r-phrase:end+0.3 = s2:start"]


def test_where_the_gaze_leads_words_and_clock_times_are_the_phrases() -> None:
    operators = (
        same("s1:end", "r:start"), same("r:start", "bml:start+3"), After(ref="s1:start", syncs=("r:start",)),
        After(ref="r:start", syncs=("s2:start", "x:start")), Before(ref="s2:end", syncs=("r:start",)),
        same("other:speech:end", "r:start"),
    )  # fmt: skip

    result = block(fragment(*operators), [(LOOK, "it")], "figure-3.3")

    assert lines(result, "c") == [
        "r-phrase:start after s1:end",
        "r-phrase:start after bml:start+3",
        "r-phrase:start after s1:start",
        "s2:start after r-phrase:start",
        "x:start after r-gaze:start",
        "r-phrase:start before s2:end",
        "r-phrase:start after other:speech:end",
    ]


def test_what_is_timed_by_words_stays_with_them_where_the_gaze_leads() -> None:
    """Else the gaze would have to start when the words end, and be on target when they begin."""
    one = block(fragment(same("s1:end", "x:start", "r:start")), [(LOOK, "it")], "figure-3.3")
    through = block(fragment(same("r:start", "x:start"), same("x:start", "s1:end")), [(LOOK, "it")], "figure-3.3")

    assert lines(one, "c") == ["x:start = s1:end", "r-phrase:start after s1:end"]
    assert lines(through, "c") == ["r-phrase:start after x:start", "s1:end = x:start"]


def test_what_is_tied_to_the_start_too_is_not_timed_by_the_words_it_is_tied_to() -> None:
    result = block(fragment(same("s1:end", "r:start"), same("r:start", "x:start")), [(LOOK, "it")], "figure-3.3")

    assert lines(result, "c") == ["r-phrase:start after s1:end", "x:start = r-gaze:start"]


@pytest.mark.parametrize(
    ("operator", "timed"),
    [
        (same("r:start", "x:start"), False), (same("r:start", "x:start+0.5"), False),
        (same("r:start", "s1:end"), True), (same("r:start", "x:start", "2"), True),
        (After(ref="x:end", syncs=("r:start",)), True),
    ],
)  # fmt: skip
def test_a_nod_that_starts_with_a_reference_does_not_say_when(operator: Operator, timed: bool) -> None:
    """So the words before the reference still do."""
    result = block(fragment(operator), [(LOOK, "it")])

    assert ("r-gaze:start after s1:end" not in lines(result)) == timed


def test_a_phrase_never_begins_in_the_words_before_it_whatever_hangs_on_it() -> None:
    result = block(fragment(same("r:start", "x:start")), [(POINT, "it")], "figure-3.3")

    assert "r-phrase:start after s1:end" in lines(result)


def test_a_look_without_words_starts_when_the_author_says_though_the_gaze_leads() -> None:
    result = block(fragment(same("s1:end", "r:start")), [(LOOK, "")], "figure-3.3")

    assert [line for line in lines(result) if "r-gaze" in line] == ["r-gaze:start = s1:end"]


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("minimum", [0.3, 0.9, 0.97])
@pytest.mark.parametrize("kind", TIED)
def test_whatever_is_tied_to_a_reference_can_be_performed(profile: str, minimum: float, kind: str) -> None:
    config = load(settings=[f"generation.profile={profile}"])
    options = (SpeechOption(text="the blue piece", cost=3), SpeechOption(text="this", cost=1, deictic=True))
    refers = Reference(id="r", target="blue-square", minimum_reliability=minimum, options=options)
    operators = (
        same("r:start", "x:start"), same("r:start", "x:stroke"), same("r:end", "x:start"), same("r:end", "x:end"),
        After(ref="r:start", syncs=("x:start",)), After(ref="x:end", syncs=("r:start",)),
        Before(ref="r:end", syncs=("x:stroke",)),
    )  # fmt: skip
    for count, operator in enumerate(operators):
        made = TurnFragment(
            id=f"f{count}",
            behaviors=(Speech(id="s1", text="Now move"), refers, Speech(id="s2", text="away"), TIED[kind]),
            constraints=(Constraint(operators=(operator,)),),
        )
        (plan,) = generated([made], WORLD, config, "")

        planned = run_virtual(rehearsed(plan.block, WORLD, config))

        assert not planned.dropped
