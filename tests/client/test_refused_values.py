"""Values that are no names, times or words: the client says so, with the place, and takes none of them."""

import math
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

import pytest

from engage_hri import perceive
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.summary import summary
from engage_hri.schemas.world import Entity
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import stream
from engage_hri.services.client.robot import connect
from tests.cancelling import whole_robot

PLACE = (0.5, 0.0, 0.8)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda ann: ann.tell(None),
        lambda ann: ann.tell("hello"),
        lambda ann: ann.stamp("x"),
        lambda ann: ann.stamp(math.nan),
        lambda ann: ann.stamp(math.inf),
        lambda ann: ann.bring(Entity(id="ann", kind="object", position=PLACE)),
        lambda ann: ann.bring(Entity(id="robot", kind="object", position=PLACE)),
    ],
)
async def test_a_person_refuses_it(hub: MemoryHub, wrong: Callable[[Any], object]) -> None:
    async with whole_robot(hub), perceive("ann", hub=hub) as ann:
        before = ann.world
        with pytest.raises(InputRefused, match="ann"):
            wrong(ann)

        assert ann.world == before


@pytest.mark.parametrize("name", ["connection_events", "statistics_updates"])
async def test_a_robot_refuses_it(hub: MemoryHub, name: str) -> None:
    async with connect(hub=hub) as robot:
        with pytest.raises(InputRefused, match="actor"):
            getattr(robot, name)(5)


@pytest.mark.parametrize(
    "ask",
    [
        lambda robot: robot.person("bob"),
        lambda robot: robot.world("bob"),
        lambda robot: robot.statistics("all", "soon"),
        lambda robot: robot.perform({"turn_status": "full", "parts": [{"say": "Hello"}]}, timeout="soon"),
    ],
)
async def test_a_time_that_is_no_number_is_refused(hub: MemoryHub, ask: Callable[[Any], Awaitable[object]]) -> None:
    async with connect(hub=hub) as robot:
        with pytest.raises(InputRefused, match="timeout"):
            await ask(robot)


async def test_a_turn_that_is_no_tool_input_is_refused(hub: MemoryHub) -> None:
    async def pieces() -> AsyncIterator[str]:
        yield "Hello."

    async with connect(hub=hub) as robot:
        with pytest.raises(InputRefused, match=r"t: turn.*no ToolInput"):
            await stream(robot, pieces(), id="t", turn={"turn_index": 2})  # type: ignore[arg-type]


def test_what_is_no_outcome_is_not_summed_up() -> None:
    with pytest.raises(InputRefused, match=r"summary.*None is no outcome"):
        summary(None)  # type: ignore[arg-type]
