"""What the turn policy adds to a block, and what inhibitions take away."""

import pytest

from engage_hri.schemas.behaviors import (
    After,
    Constraint,
    Event,
    Gaze,
    Gesture,
    Head,
    Pointing,
    Synchronize,
    Timing,
    TurnSignal,
)
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.services.generation.inhibitions import Permits
from tests.generation.emitted import LOOK, POINT, Made, block, by_id, emission, lines, reference, speech, start_of

# -- the turn ----------------------------------------------------------------------------------------------------


def test_a_full_turn_announces_the_pair_and_ends_with_a_look_at_the_face() -> None:
    made = block(TurnFragment(id="f", behaviors=(speech("s1"), speech("s2")), accept=("act", "speak")))

    behaviors = by_id(made)
    assert list(behaviors) == ["turn-pair", "s1", "s2", "turn-gaze", "turn-gaze-event", "turn-ended"]
    assert behaviors["turn-pair"] == Event(
        id="turn-pair",
        kind="adjacency_pair",
        responder="human",
        cause="turn",
        turn="turn",
        accept=("act", "speak"),
        timing=(Timing("start", "s1:start"),),
    )
    assert behaviors["turn-gaze"] == Gaze(id="turn-gaze", target="human")
    assert behaviors["turn-gaze-event"] == Event(
        id="turn-gaze-event",
        kind="mutual_facial_gaze",
        responder="human",
        cause="turn",
        optional=True,
        anchors=("turn-gaze:stroke",),
        turn="turn",
        timing=(Timing("start", "turn-gaze:start"),),
        needs=("turn-gaze",),
    )
    assert behaviors["turn-ended"] == TurnSignal(
        id="turn-ended", turn="turn", signal="ended", actor="human", timing=(Timing("start", "s2:end"),)
    )
    assert lines(made, "turn-timing") == ["turn-gaze:stroke = s2:end"]


@pytest.mark.parametrize(("index", "signal"), [(2, "answered"), (3, "repaired")])
def test_later_turns_tell_what_became_of_the_pair_instead_of_starting_one(index: int, signal: str) -> None:
    made = block(TurnFragment(id="f", turn_index=index, behaviors=(speech("s"),)))  # type: ignore[arg-type]

    (told,) = (each for each in made.behaviors if isinstance(each, TurnSignal) and each.signal != "ended")
    assert told.signal == signal
    assert start_of(told) == "s:start"
    assert not [each for each in made.behaviors if isinstance(each, Event) and each.kind == "adjacency_pair"]


@pytest.mark.parametrize(
    ("status", "added"),
    [
        ("beginning", ["turn-pair"]),
        ("middle", []),
        ("end", ["turn-gaze", "turn-gaze-event", "turn-ended"]),
        ("backchannel", ["backchannel"]),
    ],
)
def test_what_each_status_adds(status: str, added: list[str]) -> None:
    made = block(TurnFragment(id="f", turn_status=status, behaviors=(speech("s"),)))  # type: ignore[arg-type]

    assert [id for id in by_id(made) if id != "s"] == added


def test_a_backchannel_is_announced_before_its_nod_or_word() -> None:
    nod = Head(id="n", lexeme="NOD", timing=(Timing("start", "0.2"),))

    nodded = block(TurnFragment(id="f", turn_status="backchannel", behaviors=(nod,)))
    said = block(TurnFragment(id="f", turn_status="backchannel", behaviors=(nod, speech("s", "mhm"))))

    assert "n:start after backchannel:start" in lines(nodded)
    assert "s:start after backchannel:start" in lines(said)
    assert [by_id(made)["backchannel"].needs for made in (nodded, said)] == [("n",), ("s",)]


@pytest.mark.parametrize(("first", "needs"), [("r", ("r-phrase",)), ("s", ())])
def test_the_pair_of_a_turn_falls_with_its_first_words_alone(first: str, needs: tuple[str, ...]) -> None:
    parts = (reference("r"), speech("s"))
    made = block(TurnFragment(id="f", behaviors=parts if first == "r" else parts[::-1]), [(LOOK, "it")])

    assert by_id(made)["turn-pair"].needs == needs


def test_a_turn_without_speech_ends_when_everything_in_it_has() -> None:
    waves = (Gesture(id="wave", lexeme="wave"), Gaze(id="g", target="piece"))

    made = block(TurnFragment(id="f", behaviors=waves))

    assert start_of(by_id(made)["turn-pair"]) == ""
    assert "turn-gaze:start after wave:end" in lines(made)
    assert start_of(by_id(made)["turn-ended"]) == "turn-gaze:start"


@pytest.mark.parametrize(
    ("made", "last"), [((LOOK, "it"), "r-gaze"), ((POINT, "it"), "r-gaze"), (("none", "it"), "own")]
)
def test_the_last_gaze_gives_way_to_the_end_of_turn_gaze(made: Made, last: str) -> None:
    """So that the eyes are on the face when the last word ends."""
    fragment = TurnFragment(
        id="f", behaviors=(Gaze(id="own", target="human"), speech("s"), reference("r"), speech("t"))
    )

    assert lines(block(fragment, [made]), "turn-timing") == [
        "turn-gaze:stroke = t:end",
        f"turn-gaze:start = {last}:relax",
    ]


@pytest.mark.parametrize(
    ("timing", "is_late"),
    [
        ((), False), ((Timing("start", "s:start"),), False), ((Timing("start", "t:start"),), True),
        ((Timing("start", "t:end"),), True),
        ((Timing("start", "wave:end"),), True), ((Timing("stroke", "t:start"),), True),
    ],
)  # fmt: skip
def test_a_look_that_may_go_on_after_the_words_is_made_first(timing: tuple[Timing, ...], is_late: bool) -> None:
    own = Gaze(id="own", target="piece", timing=timing)
    made = block(TurnFragment(id="f", behaviors=(own, speech("s"), Gesture(id="wave", lexeme="wave"), speech("t"))))

    ends = "turn-gaze:start after t:end" if is_late else "turn-gaze:stroke = t:end"
    assert ends in lines(made, "turn-timing")
    assert start_of(by_id(made)["turn-ended"]) == ("turn-gaze:start" if is_late else "t:end")


def test_a_look_for_which_the_words_wait_is_over_at_the_last_of_them() -> None:
    waits = Constraint(id="c", operators=(After(ref="own:stroke", syncs=("s:start",)),))
    made = block(TurnFragment(id="f", behaviors=(Gaze(id="own", target="piece"), speech("s")), constraints=(waits,)))

    assert "turn-gaze:stroke = s:end" in lines(made, "turn-timing")


@pytest.mark.parametrize(("made", "seen"), [((LOOK, "it"), "gaze:stroke+0.3"), ((LOOK, ""), "")])
def test_the_look_at_the_last_reference_is_seen_before_it_gives_way(made: Made, seen: str) -> None:
    tied = lines(block(TurnFragment(id="f", behaviors=(speech("s"), reference("r"))), [made]))

    assert [line for line in tied if line.startswith("r-gaze:relax after")] == (
        [f"r-gaze:relax after r-{seen}"] if seen else []
    )


@pytest.mark.parametrize("words", [(), ("r",)])
def test_a_look_after_the_last_words_is_made_before_the_turn_ends(words: tuple[str, ...]) -> None:
    own = Gaze(id="own", target="piece", timing=(Timing("start", "r:end" if words else "s:end"),))
    made = block(
        TurnFragment(id="f", behaviors=(speech("s"), *map(reference, words), own)), [(LOOK, "it")] * len(words)
    )

    assert f"turn-gaze:start after {'r-phrase' if words else 's'}:end" in lines(made, "turn-timing")
    assert "turn-gaze:start = own:relax" in lines(made, "turn-timing")
    assert start_of(by_id(made)["turn-ended"]) == "turn-gaze:start"


def test_a_gaze_whose_end_the_author_has_timed_keeps_it() -> None:
    own = Gaze(id="own", target="human", timing=(Timing("end", "s:start"),))
    fragment = TurnFragment(id="f", behaviors=(own, speech("s")))

    assert lines(block(fragment), "turn-timing") == ["turn-gaze:stroke = s:end"]


def test_gazes_and_constraints_of_the_fragment_pass_through() -> None:
    own = Gaze(id="own", target="human")
    constraint = Constraint(id="c", operators=(After(ref="own:stroke", syncs=("s:start",)),))

    made = block(TurnFragment(id="f", behaviors=(own, speech("s")), constraints=(constraint,)))

    assert by_id(made)["own"] is own
    assert made.constraints[0] == constraint


# -- what is inhibited -------------------------------------------------------------------------------------------


def test_inhibited_gaze_takes_its_constraints_along() -> None:
    constraint = Constraint(
        id="c",
        operators=(
            After(ref="own:stroke", syncs=("s:start",)),
            Synchronize(ref="s:start", syncs=("own:end", "wave:start")),
        ),
    )
    wave = Gesture(id="wave", lexeme="wave", timing=(Timing("end", "own:relax"),))
    fragment = TurnFragment(
        id="f", behaviors=(Gaze(id="own", target="human"), speech("s"), wave), constraints=(constraint,)
    )

    result = emission(fragment, permits=Permits(gaze=False))

    assert list(by_id(result.block)) == ["turn-pair", "s", "wave", "turn-ended"]
    assert lines(result.block) == ["wave:start = s:start"]
    assert by_id(result.block)["wave"].timing == ()
    assert result.warnings == ("own is left out: inhibited",)


def test_with_one_hand_inhibited_the_other_points() -> None:
    points = (Pointing(id="any", target="piece"), Pointing(id="left", target="piece", mode="LEFT_HAND"))

    result = emission(TurnFragment(id="f", behaviors=points), permits=Permits(hands=("RIGHT_HAND",)))

    assert [each for each in result.block.behaviors if isinstance(each, Pointing)] == [
        Pointing(id="any", target="piece", mode="RIGHT_HAND")
    ]
    assert result.warnings == ("left is left out: inhibited",)


def test_speech_only_says_the_words_and_announces_the_pair() -> None:
    fragment = TurnFragment(
        id="f",
        behaviors=(Gaze(id="g", target="human"), speech("s"), reference("r"), Head(id="n", lexeme="NOD")),
    )

    made = block(fragment, [("none", "it")], permits=Permits(speech_only=True))

    assert list(by_id(made)) == ["turn-pair", "s", "r-phrase", "turn-ended"]


@pytest.mark.parametrize("profile", ["check-back", "figure-3.3"])
def test_a_reference_without_words_after_the_last_words_is_made_before_the_turn_ends(profile: str) -> None:
    fragment = TurnFragment(id="f", behaviors=(speech("s"), reference("r")))

    made = block(fragment, [(POINT, "")], profile)

    assert [line for line in lines(made, "turn-timing") if line.startswith("turn-gaze:start after")] == [
        "turn-gaze:start after s:end", "turn-gaze:start after r-point:stroke_end",
    ]  # fmt: skip
    assert start_of(by_id(made)["turn-ended"]) == "turn-gaze:start"
