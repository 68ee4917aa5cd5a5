"""What the body shows: its state, as often as somebody wants it."""

import asyncio
from itertools import pairwise

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gaze, GazeShift, Pointing, Speech
from engage_hri.schemas.body import RobotState
from engage_hri.schemas.perception import OngoingActions
from engage_hri.services.bus.memory import MemoryHub
from tests.control.directing import robot
from tests.ongoing import going_on

POINT = Pointing(id="point-1", target="near-right")


async def test_states_come_at_a_steady_rate_while_it_moves_and_once_a_second_else(hub: MemoryHub):
    async with robot(hub, state_rate=20.0, alive=False) as client:
        await asyncio.sleep(3.5)
        resting = [item.at.seconds for item in client.of(RobotState)]
        client.heard.clear()
        await client.outcome(client.perform(POINT))
        moving = [item.at.seconds for item in client.of(RobotState)]
        await asyncio.sleep(1.5)
        last = client.of(RobotState)[-1]

    assert resting == pytest.approx([1.0, 2.0, 3.0])  # the first came before anybody listened
    gaps = [later - one for one, later in pairwise(moving)]
    assert gaps == pytest.approx([0.05] * len(gaps))
    assert len(moving) >= 25
    assert last.right_arm.tip == pytest.approx((0.194, -0.2, 0.8), abs=1e-3)  # type: ignore[attr-defined]


async def test_who_wants_less_hears_what_is_new_and_the_rest_four_times_a_second():
    """What the robot is seen to do does not depend on whether anybody wants more."""
    began, states, actions = [], [], []
    for key in (keys.ROBOT_STATE, keys.ROBOT_MOTION):
        async with MemoryHub() as hub, robot(hub, hears=(key,), state_rate=20.0) as client:
            began.append(client.bus.now())
            await client.outcome(client.perform(Gaze(id="g", target="near-right")))
        states.append([each for each in client.of(RobotState) if isinstance(each, RobotState)])
        actions.append([(*what, pytest.approx(at - began[-1])) for *what, at in client.actions()])

    assert len(states[0]) < len(states[1]) / 2
    assert max(later.at.seconds - one.at.seconds for one, later in pairwise(states[0])) <= 0.25 + 1e-9
    assert actions[0] == actions[1] != []
    seldom, often = (
        {each.looking_at: pytest.approx(each.at.seconds - start) for each in reversed(told) if each.looking_at}
        for start, told in zip(began, states, strict=True)
    )
    assert seldom == often


async def test_what_the_robot_does_is_there_for_whoever_comes_late(hub: MemoryHub):
    late = hub.join("late")
    async with robot(hub) as client:
        with late.subscribe(keys.ROBOT_ONGOING) as inbox:
            first = await inbox.next()
        client.perform(GazeShift(id="g", target="near-right"))
        speaking = client.perform(Speech(id="s", text="one two three four"))
        await asyncio.sleep(1.0)
        with late.subscribe(keys.ROBOT_ONGOING) as inbox:
            amid = await inbox.next()
        await client.outcome(speaking)
        with late.subscribe(keys.ROBOT_ONGOING) as inbox:
            last = await inbox.next()

    told = [each.message for each in (first, amid, last) if each and isinstance(each.message, OngoingActions)]
    assert [{(each.action, *each.targets) for each in state.actions} for state in told] == [
        set(),
        {("look", "near-right"), ("speak",)},
        {("look", "near-right")},
    ]
    assert all(state.actor == "robot" and state.seen is None for state in told)


async def test_each_state_is_what_the_events_before_it_say(hub: MemoryHub):
    async with robot(hub, hears=(keys.ROBOT_ONGOING,)) as client:
        for behavior in (Gaze(id="g", target="near-right"), POINT, Gaze(id="g2", target="far-left"), POINT):
            await client.outcome(client.perform(behavior))
        heard = list(client.heard)

    states = [at for at, message in enumerate(heard) if isinstance(message, OngoingActions)]
    assert len(states) > 5
    for at in states:
        assert heard[at].actions == going_on(heard[:at], "robot")  # type: ignore[attr-defined]
