"""A fragment that the world does not bear out is refused whole, with its place."""

import pytest

from engage_hri.schemas.behaviors import (
    After,
    Constraint,
    Gaze,
    Pointing,
    Reference,
    Speech,
    SpeechOption,
    Synchronize,
    Timing,
)
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.tool import from_tool, in_call
from engage_hri.schemas.world import Entity, World
from engage_hri.services.generation.fragment_check import checked
from tests.generation.partners import TABLE


def reference(**fields: object) -> Reference:
    option = SpeechOption(text="it", cost=1, distractors=("left",), line=8)
    values = {"id": "ref", "target": "middle", "minimum_reliability": 0.8, "options": (option,), "line": 7, **fields}
    return Reference(**values)  # type: ignore[arg-type]


GOOD = TurnFragment(id="f", behaviors=(Speech(id="s", text="Take"), reference()))


def test_phrases_are_optional_but_the_object_is_not() -> None:
    alone = TurnFragment(id="f", behaviors=(reference(options=None),))

    assert checked(alone, TABLE, "robot").behaviors == alone.behaviors
    with pytest.raises(InputRefused, match="did you mean 'middle'"):
        checked(TurnFragment(id="f", behaviors=(reference(options=None, target="midle"),)), TABLE, "robot")


def test_a_sound_fragment_passes_and_knows_its_addressee() -> None:
    assert checked(GOOD, TABLE, "robot").addressee == "human"


@pytest.mark.parametrize(
    ("behavior", "place", "reason"),
    [
        (Gaze(id="g", target="nothing", line=3), "behaviors[0].target", "does not know 'nothing'"),
        (Pointing(id="p", target="midle"), "behaviors[0].target", "did you mean 'middle'"),
        (reference(target="table"), "behaviors[0].target", "'table' is a surface, and no object"),
        (reference(target="human"), "behaviors[0].target", "'human' is a person, and no object"),
        (
            reference(options=(SpeechOption(text="it", cost=1, distractors=("left", "ghost")),)),
            "options[0].distractors[1]",
            "ghost",
        ),
        (reference(minimum_reliability=1.0), "minimum_reliability", "outside"),
        (reference(options=()), "options", "no phrase"),
        (reference(options=(SpeechOption(text="it", cost=-1),)), "cost", "cost -1"),
        (reference(timing=(Timing("stroke", "1"),)), "timing[0].sync", "no sync point 'stroke'"),
        (reference(timing=(Timing("start", "ref:end"),)), "timing[0].ref", "itself"),
    ],
)
def test_what_is_wrong_with_a_behavior_is_named(behavior: object, place: str, reason: str) -> None:
    with pytest.raises(InputRefused) as refusal:
        checked(TurnFragment(id="f", behaviors=(behavior,)), TABLE, "robot")  # type: ignore[arg-type]

    assert reason in str(refusal.value)
    assert place in str(refusal.value) or refusal.value.fault.line


def test_a_refusal_names_the_line_of_the_xml() -> None:
    unknown = TurnFragment(id="f", behaviors=(reference(target="ghost"),))

    with pytest.raises(InputRefused) as refusal:
        checked(unknown, TABLE, "robot")

    assert refusal.value.fault.line == 7


@pytest.mark.parametrize("sync", ["ref:stroke", "ref:relax"])
def test_a_reference_has_only_a_start_and_an_end(sync: str) -> None:
    constraint = Constraint(operators=(Synchronize(ref="s:end", syncs=(sync,)),))

    with pytest.raises(InputRefused, match="no sync point"):
        checked(TurnFragment(id="f", behaviors=GOOD.behaviors, constraints=(constraint,)), TABLE, "robot")


def test_a_constraint_on_an_unknown_behavior_is_refused() -> None:
    constraint = Constraint(operators=(After(ref="s:end", syncs=("reff:start",)),))

    with pytest.raises(InputRefused, match="did you mean 'ref'"):
        checked(TurnFragment(id="f", behaviors=GOOD.behaviors, constraints=(constraint,)), TABLE, "robot")


@pytest.mark.parametrize(
    ("people", "addressee", "reason"),
    [((), "", "no people"), (("ann", "bob"), "", "name one of ann, bob"), (("ann",), "bob", "the person 'bob'")],
)
def test_somebody_must_be_spoken_to(people: tuple[str, ...], addressee: str, reason: str) -> None:
    world = World(entities=tuple(Entity(id=id, kind="person", position=(1.0, 0.0, 1.2)) for id in people))

    with pytest.raises(InputRefused, match=reason):
        checked(TurnFragment(id="f", addressee=addressee), world, "robot")


def test_the_delay_must_be_spent_looking_at_something_known() -> None:
    with pytest.raises(InputRefused, match="delay_target"):
        checked(TurnFragment(id="f", delay=True, delay_target="moon"), TABLE, "robot")


def test_the_robot_itself_and_surfaces_may_be_looked_at() -> None:
    gazes = (Gaze(id="a", target="table"), Gaze(id="b", target="robot"))

    assert checked(TurnFragment(id="f", behaviors=gazes), TABLE, "robot").behaviors == gazes


def test_the_rest_of_a_turn_need_not_say_again_whom_it_speaks_to() -> None:
    two = World(entities=(*TABLE.entities, Entity(id="ann", kind="person", position=(1.2, 0.5, 1.3))))

    with pytest.raises(InputRefused, match="knows 2 people"):
        checked(TurnFragment(id="f", turn_status="beginning"), two, "robot")

    assert checked(TurnFragment(id="f", turn_status="end"), two, "robot").addressee == ""


@pytest.mark.parametrize(
    ("part", "place"),
    [
        ({"refer": "cub"}, "$.parts[1].refer"),
        ({"look": "nowhere"}, "$.parts[1].look"),
        ({"refer": "table", "phrases": ["it"]}, "$.parts[1].refer"),
    ],
)
def test_of_a_tool_call_the_part_is_named_that_the_model_wrote(part: dict[str, object], place: str) -> None:
    call = from_tool({"turn_status": "full", "parts": [{"say": "Take"}, part]}, "f")

    with pytest.raises(InputRefused) as refusal:
        checked(call, TABLE, "robot")

    assert refusal.value.fault.where == f"f: {place}"


def test_of_a_tool_call_a_bad_phrase_is_named_by_its_number() -> None:
    call = from_tool({"turn_status": "full", "parts": [{"refer": "left"}]}, "f")

    assert in_call("f: $.behaviors[0].options[2].distractors[1]", call) == "f: $.parts[0].phrases[2]"
    assert in_call("f: $.turn_status", call) == "f: $.turn_status"
    assert in_call("f: $.behaviors[0].target", GOOD) == "f: $.behaviors[0].target"
