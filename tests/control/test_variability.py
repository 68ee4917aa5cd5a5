"""What goes wrong on purpose: seeded, the same each time, and never the end of the world."""

import asyncio

import pytest

from engage_hri.schemas.behaviors import Gaze, Pointing, Posture, Speech
from engage_hri.services.control.config import ControlConfig, Displaced, Slow, Stall, Variability
from engage_hri.services.control.contract.body import BehaviorRefused, BodyFailed, Reached, Spoke
from engage_hri.services.control.contract.variability import Deviations, configured, is_lost, normal
from engage_hri.services.control.testing import WORLD, Stage, performed, times
from engage_hri.services.control.torso.body import SimulatedBody
from tests.control.watching import poses_agree

POINT = Pointing(id="p", target="near-right")


def body_with(**deviations: object) -> SimulatedBody:
    body = SimulatedBody(deviations=Variability(**deviations))  # type: ignore[arg-type]
    body.see(WORLD)
    return body


async def test_a_slow_arm_takes_its_factor_longer_than_it_said():
    body = body_with(slow=(Slow(part="right_arm", factor=3.0),))
    natural = {phase.to: phase.natural for phase in body.estimate(POINT, None, WORLD).phases}
    begin = asyncio.get_running_loop().time()
    at = times(await performed(body, POINT))

    assert at["ready"] - begin == pytest.approx(3 * natural["ready"])
    assert at["end"] - at["relax"] == pytest.approx(3 * natural["end"])


async def test_the_other_parts_of_a_slow_arm_keep_their_time():
    body = body_with(slow=(Slow(part="right_arm", factor=3.0),))
    estimate = body.estimate(Gaze(id="g", target="human"), None, WORLD)
    at = times(await performed(body, Gaze(id="g", target="human")))

    assert at["end"] - at["start"] == pytest.approx(sum(phase.natural for phase in estimate.phases))


async def test_a_stalled_arm_comes_late_by_its_stall():
    perfect = times(await performed(body_with(), POINT))
    before = asyncio.get_running_loop().time()
    stalled = body_with(stall=(Stall(part="right_arm", before="ready", seconds=2.0),))
    at = times(await performed(stalled, POINT))

    late = (at["ready"] - before) - perfect["ready"]
    assert 2.0 < late < 2.6


async def test_an_arm_that_stalls_for_ever_can_still_be_aborted():
    body = body_with(stall=(Stall(part="right_arm", before="stroke"),))
    home = body.state().pose
    stage = Stage(body, POINT, "end")
    await asyncio.sleep(60.0)

    assert stage.passed == ["start", "ready", "stroke_start"]
    stage.authority.revoke()
    await stage.over()
    await asyncio.sleep(2.0)
    assert poses_agree(body.state().pose, home)


async def test_an_arm_that_is_near_already_comes_early_once():
    near = (
        Displaced(joint="right_shoulder_pitch", angle=25.0),
        Displaced(joint="right_elbow", angle=80.0),
    )
    body = body_with(displaced=near)
    said = body.estimate(POINT, None, WORLD)
    at = times(await performed(body, POINT))
    again = body.estimate(POINT, None, WORLD)
    later = times(await performed(body, POINT))

    natural = sum(phase.natural for phase in said.phases[:3])
    assert at["stroke"] - at["start"] < natural - 0.05
    assert later["stroke"] - later["start"] == pytest.approx(sum(phase.natural for phase in again.phases[:3]))


async def test_an_overheated_motor_fails_its_behavior_and_the_arm_goes_home():
    body = body_with(overheated=("right_arm",))
    home = body.state().pose
    stage = Stage(body, POINT, "end")
    with pytest.raises(BodyFailed, match="overheated"):
        await stage.over()
    await asyncio.sleep(3.0)

    assert stage.passed == ["start", "ready", "stroke_start"]
    assert poses_agree(body.state().pose, home)


TURN = Posture(id="turn", lexeme="TURN_LEFT", part="WHOLEBODY")
"""Its ready and its stroke are one place of its way: a fault before the stroke comes before both."""


async def test_an_overheated_trunk_fails_its_posture_half_way():
    body = body_with(overheated=("torso",))
    natural = {phase.to: phase.natural for phase in body.estimate(TURN, None, WORLD).phases}
    begin = asyncio.get_running_loop().time()
    with pytest.raises(BodyFailed, match="overheated"):
        async with asyncio.timeout(60.0):
            await performed(body, TURN)

    assert natural["stroke"] == 0.0
    assert asyncio.get_running_loop().time() - begin < natural["ready"]


async def test_a_posture_that_stalls_before_its_stroke_goes_on_after_the_stall():
    perfect = times(await performed(body_with(), TURN))
    before = asyncio.get_running_loop().time()
    async with asyncio.timeout(60.0):
        at = times(await performed(body_with(stall=(Stall(part="torso", before="stroke", seconds=2.0),)), TURN))

    assert 2.0 < at["stroke"] - before - perfect["stroke"] < 2.6


async def test_a_silent_voice_reports_what_nobody_hears():
    body = body_with(mute="silent")
    stage = Stage(body, Speech(id="s", text="can you hear me"), "end")
    await asyncio.sleep(0.5)

    assert body.state().speaking == ""
    assert [item.word for item in await stage.over() if isinstance(item, Spoke)] == ["can", "you", "hear", "me"]


async def test_a_voice_that_knows_it_is_mute_refuses():
    body = body_with(mute="refuse")

    assert not body.estimate(Speech(id="s", text="hello"), None, WORLD).feasible
    with pytest.raises(BehaviorRefused, match="the voice cannot speak"):
        await performed(body, Speech(id="s", text="hello"))


async def durations(seed: int, order: list[str]) -> dict[str, float]:
    body = body_with(seed=seed, noise=0.2)
    took = {}
    for id in order:
        reached = [item for item in await performed(body, Gaze(id=id, target="human")) if isinstance(item, Reached)]
        took[id] = reached[-1].at - reached[0].at
        await asyncio.sleep(1.0)
    return took


async def test_noise_comes_from_the_seed():
    order = ["a", "b", "c", "d"]
    one, same, other = await durations(1, order), await durations(1, order), await durations(2, order)

    assert one == pytest.approx(same)
    assert one != pytest.approx(other)
    assert len({round(seconds, 6) for seconds in one.values()}) == len(order)


def test_noise_is_normal():
    draws = [normal(7, str(index)) for index in range(4000)]
    mean = sum(draws) / len(draws)

    assert mean == pytest.approx(0.0, abs=0.06)
    assert sum((draw - mean) ** 2 for draw in draws) / len(draws) == pytest.approx(1.0, abs=0.08)


def test_lost_messages_are_lost_at_their_rate():
    deviations = configured(Variability(seed=3, lost=0.25))

    assert sum(is_lost(deviations, number, 0.0) for number in range(2000)) == pytest.approx(500, abs=60)
    assert not any(is_lost(Deviations(), number, 0.0) for number in range(100))


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"state_rate": 0.0}, "state_rate"),
    ],
)
def test_a_bad_configuration_says_what_is_wrong(settings: dict[str, float], reason: str):
    with pytest.raises(ValueError, match=reason):
        ControlConfig(**settings)  # type: ignore[arg-type]


def test_a_bad_deviation_says_what_is_wrong():
    with pytest.raises(ValueError, match=r"slow\.factor of 'head' is 0"):
        Variability(slow=(Slow(part="head", factor=0.0),))
    with pytest.raises(ValueError, match="noise is -1"):
        Variability(noise=-1.0)
