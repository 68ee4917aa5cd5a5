"""What the service says of an object when nobody tells it how to call it."""

from itertools import combinations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Reference, SpeechOption
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.world import Entity, World
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.inhibitions import Permits
from engage_hri.services.generation.references import phrases
from engage_hri.services.generation.references.phrases import Proposals, proposed
from engage_hri.services.generation.turns.plan import plan_turn
from engage_hri.services.tangram.table import tangram_table
from tests.generation.tables import HEIGHT, body, plan

SMALL, BIG = 0.02, 0.04
CONFIG = GenerationConfig()


def thing(id: str, **known: object) -> Entity:
    return Entity(id=id, kind="object", **{"position": (0.5, 0.0, 0.7), **known})  # type: ignore[arg-type]


def world(*things: Entity) -> World:
    return World(entities=(*things, Entity(id="human", kind="person", position=(1.3, 0.0, 1.2))))


TANGRAM = world(*(tangram_table().lying(piece, piece.start) for piece in tangram_table().pieces))
SQUARES = world(
    thing("a", shape="square", color="red", radius=BIG),
    thing("b", shape="square", color="red", radius=SMALL),
    thing("c", shape="square", color="blue", radius=BIG),
    thing("d", shape="disc", color="red", radius=BIG),
)


def refer(id: str, target: str, *options: SpeechOption) -> Reference:
    return Reference(id=id, target=target, minimum_reliability=0.85, options=options or None)


def offered(around: World, *targets: str) -> Proposals:
    return proposed([refer(f"ref-{index}", target) for index, target in enumerate(targets, 1)], around)


def options(around: World, *targets: str) -> tuple[SpeechOption, ...]:
    """Of the last of these references."""
    return offered(around, *targets).references[-1].options or ()


def table(around: World, *targets: str) -> dict[str, set[str]]:
    return {option.text: set(option.distractors) for option in options(around, *targets)}


def test_phrases_go_from_short_to_long_each_with_its_words_and_what_else_they_may_mean() -> None:
    descriptions = [option for option in options(SQUARES, "a") if not option.deictic]

    assert [(option.text, option.cost, option.distractors) for option in descriptions] == [
        ("the square", 2.0, ("b", "c")),
        ("the red square", 3.0, ("b",)),
        ("the big square", 3.0, ("c",)),
        ("the big red square", 4.0, ()),
    ]


def test_each_piece_of_the_tangram_is_named_without_doubt() -> None:
    for piece in TANGRAM.objects:
        alone = [
            option.text for option in options(TANGRAM, piece.id) if not option.deictic and not option.distractors
        ]
        unique = sum(other.shape == piece.shape for other in TANGRAM.objects) == 1

        assert alone == [f"the {piece.shape}" if unique else f"the {piece.color} {piece.shape}"]


def test_words_that_rule_nothing_out_are_not_said() -> None:
    assert table(SQUARES, "d") == {"this": set(), "the disc": set()}


def test_the_preferred_attribute_wins_among_equals(monkeypatch: pytest.MonkeyPatch) -> None:
    pair = world(
        thing("a", shape="square", color="red", size="big"), thing("b", shape="square", color="blue", size="small")
    )

    assert list(table(pair, "a")) == ["this", "the square", "the red square"]
    monkeypatch.setattr(phrases, "PHRASE_ATTRIBUTES", ("size", "color"))
    assert list(table(pair, "a")) == ["this", "the square", "the big square"]
    monkeypatch.setattr(phrases, "PHRASE_ATTRIBUTES", ())
    assert list(table(pair, "a")) == ["this", "the square"]


def test_what_is_not_known_of_an_object_does_not_rule_it_out() -> None:
    dim = world(
        thing("a", shape="square", color="red"), thing("b", shape="square"), thing("c"), thing("d", shape="disc")
    )

    assert table(dim, "a") == {"this": set(), "the square": {"b", "c"}}


def test_features_that_are_not_listed_do_not_hold() -> None:
    cups = world(
        thing("a", category="cup", shape="round", features=("wooden", "striped")),
        thing("b", category="cup", features=("wooden",)),
        thing("c", category="cup"),
    )

    assert table(cups, "a") == {"this": set(), "the cup": {"b", "c"}, "the striped cup": set()}
    assert table(cups, "b") == {"this": set(), "the cup": {"a", "c"}, "the wooden cup": {"a"}}


def test_modifiers_are_said_in_the_order_of_english() -> None:
    cup = {"category": "cup", "size": "big", "shape": "round", "color": "red", "features": ("wooden",)}
    others = [
        {**cup, "size": "small"}, {**cup, "shape": "square"}, {**cup, "color": "blue"}, {**cup, "features": ()},
    ]  # fmt: skip
    around = world(thing("a", **cup), *(thing(f"o{index}", **other) for index, other in enumerate(others)))

    longest = [text for text in table(around, "a") if len(text.split()) == 5]

    assert set(longest) == {
        "the round red wooden cup", "the big red wooden cup", "the big round wooden cup", "the big round red cup",
    }  # fmt: skip


def test_a_shape_may_be_the_noun_of_one_and_an_attribute_of_another() -> None:
    cups = [thing("b", category="cup", shape="square"), thing("c", category="cup", shape="round")]
    around = world(thing("a", shape="square"), *cups)

    assert table(around, "a")["the square"] == {"b"}
    assert table(around, "b") == {"this": set(), "the cup": {"c"}, "the square cup": set()}


@pytest.mark.parametrize(
    ("radii", "big"),
    [((1.0, 1.24), set()), ((1.0, 1.26), {"o1"}), ((1.0, 1.2, 1.8, 2.0), {"o2", "o3"}), ((0.0, 0.0), set())],
)
def test_big_and_small_are_told_apart_at_the_greatest_step(radii: tuple[float, ...], big: set[str]) -> None:
    around = world(*(thing(f"o{index}", shape="disc", radius=radius) for index, radius in enumerate(radii)))

    assert {each.id for each in around.objects if "the big disc" in table(around, each.id)} == big


def test_it_is_offered_only_where_nothing_else_was_mentioned() -> None:
    assert "it" not in table(SQUARES, "a")
    assert table(SQUARES, "a", "a")["it"] == set()
    assert "it" in table(SQUARES, "a", "a", "a")
    assert "it" not in table(SQUARES, "a", "b")
    assert "it" not in table(SQUARES, "a", "b", "b")


def test_phrases_of_the_authors_own_count_as_mentioned_and_stay_as_they_are() -> None:
    own = refer("ref-1", "a", SpeechOption(text="the left one", cost=3))

    made = proposed([own, refer("ref-2", "a")], SQUARES).references

    assert made[0] is own
    assert made[1].options is not None
    assert made[1].options[0].text == "it"


def test_near_things_are_this_and_far_ones_that_as_in_appendix_b() -> None:
    assert "this" in table(TANGRAM, "green-square")
    assert "that" in table(TANGRAM, "purple-triangle")
    assert [option.deictic for option in options(TANGRAM, "green-square")] == [True, False, False]


def test_what_the_world_does_not_describe_is_this_one_with_a_warning() -> None:
    made = offered(world(thing("obj-17"), thing("b", color="red")), "obj-17")

    assert made.warnings == (
        "ref-1: the world does not say what obj-17 is, so it is 'the object': give the entity a category or a name",
    )
    assert [(o.text, o.cost, o.deictic, o.distractors) for o in made.references[0].options or ()] == [
        ("this one", 2.0, True, ()), ("the object", 2.0, False, ("b",)),
    ]  # fmt: skip


def test_without_a_noun_it_is_the_red_one() -> None:
    assert table(world(thing("a", color="red"), thing("b", color="blue")), "a")["the red one"] == set()


def test_a_name_is_the_last_resort_for_a_noun() -> None:
    assert table(world(thing("a", name="teapot"), thing("b", name="jug")), "a") == {
        "this": set(),
        "the teapot": set(),
    }


@pytest.mark.parametrize(
    ("id", "noun"),
    [
        ("cup", "cup"), ("cup-2", "cup"), ("cup2", "cup"), ("red_cup", "red cup"), ("coffeeCup", "coffee cup"),
        ("block-a", "block"), ("杯子", "杯子"), ("obj-17", "object"), ("tracked.object.cup", "object"),
        ("3f2a-9c", "object"), ("x", "object"),
    ],
)  # fmt: skip
def test_what_the_world_does_not_describe_is_called_by_what_its_id_says(id: str, noun: str) -> None:
    assert f"the {noun}" in table(world(thing(id)), id)


def test_a_noun_found_in_an_id_tells_things_apart_and_the_warning_names_the_remedy() -> None:
    around = world(thing("cup"), thing("plate"), thing("cup-2"), thing("obj-1"), thing("c", category="cup"))

    assert table(around, "cup") == {"this": set(), "the cup": {"cup-2", "obj-1", "c"}}
    (warning,) = offered(around, "cup").warnings
    assert "so it is 'the cup': give the entity a category or a name" in warning


def test_a_category_counts_more_than_an_id_and_needs_no_warning() -> None:
    around = world(thing("cup", category="mug"), thing("bowl", name="cup"), thing("red-cup", color="red"))

    assert offered(around, "cup").warnings == offered(around, "bowl").warnings == ()
    assert set(table(around, "cup")) == {"this", "the mug"}
    assert table(around, "bowl") == {"this": set(), "the cup": set()}
    assert "the red cup" in table(around, "red-cup")


words = st.sampled_from(["", "x", "y", "z"])
things = st.builds(
    thing, id=st.just(""), category=words, color=words, shape=words, size=words,
    features=st.lists(st.sampled_from(["p", "q"]), unique=True).map(tuple), radius=st.sampled_from([0.0, SMALL, BIG]),
)  # fmt: skip


@settings(max_examples=100)
@given(st.lists(things, min_size=1, max_size=7))
def test_no_phrase_is_beaten_and_a_distinguishing_one_is_offered_if_there_is_one(some: list[Entity]) -> None:
    around = world(*(replace(each, id=f"o{index}") for index, each in enumerate(some)))
    descriptions = [option for option in options(around, "o0") if not option.deictic]

    assert descriptions[0].cost == 2.0
    assert [option.cost for option in descriptions] == sorted(option.cost for option in descriptions)
    for one, other in combinations(descriptions, 2):
        assert not set(one.distractors) <= set(other.distractors)
    others = {entity.id for entity in around.objects} - {"o0"}
    assert all(set(option.distractors) <= others for option in descriptions)
    assert all(option.cost == len(option.text.split()) for option in descriptions)


def test_the_outcome_of_a_plan_explains_the_proposed_phrases() -> None:
    fragment = TurnFragment(id="f", behaviors=(refer("ref", "a"),))
    made = plan(fragment, plan_turn(fragment, "f", "human"), SQUARES, None, body(SQUARES, ["a"]), Permits(), CONFIG)

    (choice,) = made.choices
    assert {pair.phrase for pair in choice.pairs} == set(table(SQUARES, "a"))
    assert choice.phrase in table(SQUARES, "a")
    assert len(choice.pairs) == 4 * len(table(SQUARES, "a"))


def in_a_row(*squares: dict[str, str]) -> World:
    """Squares of which a look means one."""
    places = [(0.5, 0.3 * index, 0.7) for index in range(len(squares))]
    return world(*(thing(f"s{i}", shape="square", position=places[i], **it) for i, it in enumerate(squares)))


def chosen(around: World, minimum: float = 0.85) -> tuple[str, str, tuple[str, ...]]:
    """Gesture, phrase and warnings of a reference to the first of them. A point costs much."""
    fragment = TurnFragment(id="f", behaviors=(replace(refer("ref", "s0"), minimum_reliability=minimum),))
    motions = body(around, ["s0"], arm=lambda since, target: 300.0)
    config = GenerationConfig(gaze_half_angle=0.2 / HEIGHT, pointing_radius=0.1)
    made = plan(fragment, plan_turn(fragment, "f", "human"), around, None, motions, Permits(), config)
    (choice,) = made.choices
    return choice.gesture, choice.phrase, made.warnings


RED, BLUE, GREEN = {"color": "red"}, {"color": "blue"}, {"color": "green"}


def test_one_of_four_squares_is_called_by_what_tells_it_apart_although_a_look_would_do() -> None:
    assert chosen(in_a_row(RED, BLUE, GREEN, BLUE)) == ("directed_gaze", "the red square", ())


def test_where_no_words_tell_it_apart_a_warning_says_that_the_look_does_the_rest() -> None:
    gesture, phrase, (warning,) = chosen(in_a_row(RED, RED, BLUE, BLUE))

    assert (gesture, phrase) == ("directed_gaze", "the red square")
    assert warning.startswith("ref: 'the red square' may mean 2 objects, and the look alone tells which")


def test_with_a_point_one_word_is_enough() -> None:
    assert chosen(in_a_row(RED, RED, BLUE), 0.95) == ("directed_gaze_with_pointing", "this", ())
