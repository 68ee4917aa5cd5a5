"""One gesture for several things: where it goes, what it may mean, how they are called, and what people are shown."""

import pytest

from engage_hri import embedded
from engage_hri.schemas.behaviors import SpeechOption
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.world import Entity, World
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.fragment_check import bearable
from engage_hri.services.generation.references.pairs import POINT, considered, shown
from tests.generation.tables import body, flat_world, scene
from tests.generation.test_phrases import SQUARES, options, refer

CONFIG = GenerationConfig()
THIS = SpeechOption(text="this", cost=1.0, deictic=True)


def test_several_are_one_object_at_their_middle_as_wide_as_they_lie_apart() -> None:
    world = World(
        entities=(
            Entity(id="a", kind="object", position=(0.5, 0.1, 0.7), radius=0.02),
            Entity(id="b", kind="object", position=(0.5, -0.3, 0.7), footprint=((0.03, 0.04), (-0.03, -0.04))),
        )
    )
    both = world.entity("a + b")

    assert both is not None
    assert both.position == pytest.approx((0.5, -0.1, 0.7))
    assert both.extent == pytest.approx(0.2 + 0.05)
    assert world.entity("a + c") is None


def test_a_point_at_several_may_mean_what_lies_among_them_and_none_of_themselves() -> None:
    world = flat_world({"a": (0.0, 0.0), "b": (0.6, 0.0), "among": (0.3, 0.2), "beyond": (0.3, 0.5)})
    motions, here = body(world, ["a", "a + b"]), scene(world)
    seems = shown(["a", "a + b"], here, motions)

    def left(target: str, gesture: str) -> frozenset[str]:
        pairs = considered(refer("r", target, THIS), seems[target], here, motions, CONFIG)
        return next(pair.distractors for pair in pairs if pair.gesture == gesture)

    assert left("a", POINT) == set()
    assert left("a + b", POINT) == {"among"}
    assert left("a + b", "none") == {"among", "beyond"}


def test_several_are_these_or_each_by_what_tells_it_best() -> None:
    these, each = options(SQUARES, "b + d")

    assert (these.text, these.deictic) == ("these", True)
    assert (each.text, each.distractors, each.cost) == ("the small square and the disc", (), 6.0)


def test_one_of_several_that_the_world_lacks_leaves_words_and_is_named() -> None:
    fragment = TurnFragment(id="f", behaviors=(refer("r", "a + cup"),), turn_status="middle")
    made, warnings = bearable(fragment, SQUARES, "robot")

    assert [getattr(each, "text", "") for each in made.behaviors] == ["cup"]
    assert [each for each in warnings if "'cup'" in each and "a + cup" not in each]


async def test_a_turn_points_once_at_two_things_and_a_look_at_either_is_the_look_there() -> None:
    async with embedded() as robot:
        with robot.actions() as actions:
            async with robot.turn() as turn:
                await turn.say("Take")
                seen = await turn.refer("blue-square", "pink-square", certainty="high")
                await turn.say("please.")
            told = []
            while (each := await actions.next(0.0)) is not None:
                told.append(each)
    [event] = [each for each in turn.events if each.kind == "directed_gaze"]
    shown_to = {
        (each.action, each.targets)
        for each in told
        if isinstance(each, ActionBegan) and each.actor == "robot" and "blue-square" in each.targets
    }

    assert event.objects == ("blue-square", "pink-square")
    assert shown_to == {("look", event.objects), ("point", event.objects)}
    assert seen is True
