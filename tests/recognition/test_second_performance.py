"""The same fragment performed again under its id: what is remembered of the first performance does not count."""

import asyncio

import pytest

from engage_hri.schemas.documents.json_codec import read
from engage_hri.schemas.fragments import FragmentOutcome, TurnFragment
from engage_hri.services.bus.memory import MemoryHub
from tests.cancelling import whole_robot
from tests.cli.command import FRAGMENT

ATTENTIVE = "simulation.human=attentive"


@pytest.fixture
def ask() -> TurnFragment:
    (fragment,) = read(FRAGMENT.encode())
    assert isinstance(fragment, TurnFragment)
    return fragment


def events(outcome: FragmentOutcome) -> set[tuple[str, str, bool]]:
    return {(event.kind, event.state, (event.delay or 0.0) < 2.5) for event in outcome.events}


async def test_its_events_are_decided_as_the_first_time(hub: MemoryHub, ask: TurnFragment) -> None:
    async with whole_robot(hub, ATTENTIVE) as robot:
        first, second = [await robot.perform(ask, await_answer=True) for _ in range(2)]

    assert ("adjacency_pair", "succeeded", True) in events(first)
    assert events(second) == events(first)


async def test_its_events_are_decided_after_it_was_cut_off(hub: MemoryHub, ask: TurnFragment) -> None:
    async with whole_robot(hub, ATTENTIVE) as robot:
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(robot.perform(ask), 1.0)
        await asyncio.sleep(5.0)
        second = await robot.perform(ask, await_answer=True)

    assert second.warnings == ()
    assert {kind for kind, *_ in events(second)} == {"directed_gaze", "mutual_facial_gaze", "adjacency_pair"}
    assert ("adjacency_pair", "succeeded", True) in events(second)
