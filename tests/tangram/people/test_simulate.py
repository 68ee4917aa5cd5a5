"""The simulation on the bus: the world, the person's coming, and what moves."""

import math
from collections import Counter
from functools import partial
from typing import Any

import msgspec
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import BlockProgress
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.perception import ActionBegan, ActionEnded, OngoingActions
from engage_hri.schemas.world import World
from engage_hri.services.bus.interface import Bus, Keep
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.runtime.service import running
from engage_hri.services.tangram.people.appendix_b import MOVE
from engage_hri.services.tangram.people.config import PerceptionFaults, SimulationConfig
from engage_hri.services.tangram.people.service import simulate
from tests.ongoing import going_on, is_seen

QUICK = SimulationConfig(entrance=1.0, jitter=0.0)


async def perceived(bus: Bus, until: float) -> list[tuple[float, str, str]]:
    """Time, kind and target of everything perceived until then."""
    seen = []
    with bus.subscribe(keys.PERCEIVED_ACTION) as inbox:
        while (received := await inbox.next(until)) is not None:
            message = received.message
            target = message.targets[0] if isinstance(message, ActionBegan | ActionEnded) and message.targets else ""
            seen.append((round(received.at, 3), type(message).__name__, target))
    return seen


async def test_step_1_is_seen_from_when_the_person_sits_down(hub: MemoryHub) -> None:
    async with running(hub, {"simulation": partial(simulate, config=QUICK, awaited=())}):
        seen = await perceived(hub.join("test"), until=10.0)

    assert seen == [
        (1.8, "ActorFound", ""),
        (1.8, "ActionBegan", "table"),
        (2.6, "ActionEnded", "table"),
        (2.6, "ActionBegan", "robot"),
        (4.2, "ActionEnded", "robot"),
        (4.2, "ActionBegan", "table"),
        (5.4, "ActionEnded", "table"),
        (5.4, "ActionBegan", "robot"),
    ]


async def test_the_person_waits_for_the_robot_to_be_there(hub: MemoryHub) -> None:
    bus = hub.join("test")
    async with running(hub, {"simulation": partial(simulate, config=QUICK, awaited=("control",))}):
        assert await perceived(bus, until=60.0) == []

        hub.join("control").declare_alive()
        seen = await perceived(bus, until=62.0)

    assert seen[0] == (61.8, "ActorFound", "")


async def test_a_late_subscriber_gets_the_whole_world_at_once(hub: MemoryHub) -> None:
    async with running(hub, {"simulation": partial(simulate, config=QUICK, awaited=())}):
        with hub.join("test").subscribe(keys.WORLD, keep=Keep.LATEST) as inbox:
            received = await inbox.next(0.0)

    assert received is not None
    assert isinstance(received.message, World)
    assert len(received.message.objects) == 10
    assert received.message.people == ()


async def test_the_person_moves_the_blue_square_to_the_top_of_the_rectangle(hub: MemoryHub) -> None:
    bus = hub.join("test")
    async with running(hub, {"simulation": partial(simulate, config=QUICK, awaited=())}):
        await perceived(bus, until=6.0)
        bus.publish(keys.FEEDBACK, BlockProgress(block="step-5", progress="start", at=bus.stamp()))
        word = WordSpoken(block="step-5", behavior="speech-2", word="so", position=2, at=bus.stamp())
        bus.publish(keys.SYNC_POINT, word)
        await perceived(bus, until=8.0)
        bus.publish(keys.FEEDBACK, BlockProgress(block="step-5", progress="end", status="done", at=bus.stamp()))
        seen = await perceived(bus, until=14.0)
        with bus.subscribe(keys.WORLD, keep=Keep.LATEST) as inbox:
            received = await inbox.next(14.0)

    assert [(kind, target) for _, kind, target in seen] == [
        ("ActionBegan", "blue-square"),
        ("ActionEnded", "blue-square"),
    ]
    assert seen[0][0] == pytest.approx(8.0 + MOVE)
    assert received is not None
    assert isinstance(received.message, World)
    blue = received.message.entity("blue-square")
    assert blue is not None
    assert blue.position == pytest.approx((0.48, 0.0, 0.72), abs=1e-6)


async def test_the_world_is_reported_often_while_something_moves_and_not_at_all_otherwise(hub: MemoryHub) -> None:
    bus = hub.join("test")
    with bus.subscribe(keys.WORLD) as inbox:
        async with running(hub, {"simulation": partial(simulate, config=QUICK, awaited=())}):
            await perceived(bus, until=20.0)
            at_rest = len(inbox)
            bus.publish(keys.FEEDBACK, BlockProgress(block="step-5", progress="end", status="done", at=bus.stamp()))
            await perceived(bus, until=20.0 + MOVE + 1.0)
            while_moving = len(inbox) - at_rest

    assert at_rest == 2
    assert 8 <= while_moving <= 20


async def test_who_does_not_come_is_never_found(hub: MemoryHub) -> None:
    config = SimulationConfig(human="none")
    async with running(hub, {"simulation": partial(simulate, config=config, awaited=())}):
        assert await perceived(hub.join("test"), until=60.0) == []


@pytest.mark.parametrize("wrong", [{"frame": 0.0}, {"jitter": math.inf}, {"entrance": -0.1}, {"reciprocity": 1.1}])
def test_a_wrong_number_in_the_configuration_is_refused_by_name(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        SimulationConfig(**wrong)  # type: ignore[arg-type]


async def test_raw_perception_comes_on_its_own_keys_in_place_of_actions(hub: MemoryHub) -> None:
    config = SimulationConfig(entrance=1.0, jitter=0.0, perception="raw")
    bus = hub.join("test")
    seen = Counter[str]()
    with bus.subscribe(keys.ANY_HEAD_POSE, keys.ANY_VOICE_ACTIVITY, keys.PERCEIVED_ACTION) as inbox:
        async with running(hub, {"simulation": partial(simulate, config=config, awaited=())}):
            while (received := await inbox.next(10.0)) is not None:
                seen[received.key] += 1

    assert seen.keys() == {keys.head_pose("human"), keys.voice_activity("human")}
    assert seen[keys.head_pose("human")] == pytest.approx((10.0 - 1.8) * 15, abs=2)


@pytest.mark.parametrize("faults", [{}, {"lost_faces": 30.0, "lost_for": (0.3, 3.0), "missed_look": 0.2}])
async def test_what_the_person_does_is_told_as_a_state_after_each_event(
    hub: MemoryHub, faults: dict[str, Any]
) -> None:
    config = msgspec.structs.replace(QUICK, human="stochastic", faults=PerceptionFaults(**faults))
    state_key = keys.perceived_ongoing("simulation", "human")
    bus, told = hub.join("test"), []
    async with running(hub, {"simulation": partial(simulate, config=config, awaited=())}):
        with bus.subscribe(keys.PERCEIVED_ACTION, state_key) as inbox:
            while (received := await inbox.next(120.0)) is not None:
                told.append(received.message)
        with hub.join("late").subscribe(state_key) as inbox:
            last = await inbox.next()

    states = [at for at, message in enumerate(told) if isinstance(message, OngoingActions)]
    assert states
    for at in states:
        assert told[at].actions == going_on(told[:at], "human")  # type: ignore[union-attr]
        assert told[at].seen == is_seen(told[:at], "human")  # type: ignore[union-attr]
    assert isinstance(told[-1], OngoingActions), "each event is followed by a state"
    assert last is not None
    assert last.message == told[-1]
