"""Faster, then smaller: gestures and nods that are given less time than their full size takes."""

import asyncio

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Gesture, Head, Pointing
from engage_hri.schemas.body import Estimate
from engage_hri.services.control.config import Slow, Variability
from engage_hri.services.control.contract.body import Body, MovementAuthority
from engage_hri.services.control.figure.estimates import SIZES
from engage_hri.services.control.testing import WORLD, times
from engage_hri.services.control.testing.motions import Recording, recorded, violations
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.random_cases import share_of

BEAT = Gesture(id="beat", lexeme="BEAT")
NOD = Head(id="nod", lexeme="NOD")
MOVING = [
    BEAT, Gesture(id="wave", lexeme="WAVE", mode="BOTH_HANDS"), NOD,
    Head(id="shake", lexeme="SHAKE", amount=1.0, repetition=2),
]  # fmt: skip
HASTE = [0.0, 0.3, 0.6, 1.0]
"""0: natural; 1: as short as the body says it can be."""


def body_in(variability: Variability | None = None) -> Body:
    body = SimulatedBody((), variability)
    body.see(WORLD)
    return body


def paced(estimate: Estimate, haste: float) -> dict[str, float]:
    """Instants from now on for each point, each phase as hasty."""
    at, pace = asyncio.get_running_loop().time(), {}
    for phase in estimate.phases:
        at += phase.natural - haste * (phase.natural - phase.shortest)
        pace[phase.to] = at
    return pace


async def hurried(body: Body, behavior: BlockBehavior, haste: float) -> tuple[float, Recording]:
    """How late the worst of its points is, and what it looked like."""
    pace = paced(body.estimate(behavior, None, WORLD), haste)
    authority = MovementAuthority(behavior, "end", pace)
    async with recorded(body) as recording:
        at = times([progress async for progress in body.perform(behavior, authority)])
    return max(at[sync] - pace[sync] for sync in pace), recording


def amplitude(recording: Recording) -> float:
    return float(np.abs(recording.angles - recording.angles[0]).max())


@pytest.mark.parametrize("behavior", MOVING, ids=lambda behavior: behavior.id)
@pytest.mark.parametrize("haste", HASTE)
async def test_every_point_is_on_time_within_the_limits_of_the_joints(behavior: BlockBehavior, haste: float):
    body = body_in()

    late, recording = await hurried(body, behavior, haste)

    assert late <= 0.001
    assert violations(recording, body.capabilities.joints) == []


@pytest.mark.parametrize("behavior", MOVING, ids=lambda behavior: behavior.id)
async def test_the_less_time_the_smaller_and_never_smaller_than_people_recognize(behavior: BlockBehavior):
    full, *smaller = [amplitude((await hurried(body_in(), behavior, haste))[1]) for haste in HASTE]

    assert sorted(smaller, reverse=True) == smaller
    assert smaller[-1] == pytest.approx(SIZES[-1] * full, rel=0.02)


async def test_it_is_of_full_size_as_long_as_being_faster_does():
    estimate = body_in().estimate(NOD, None, WORLD)
    natural = sum(phase.natural for phase in estimate.phases)
    shortest = sum(phase.shortest for phase in estimate.phases)
    faster = (natural - natural / 1.3) / (natural - shortest)
    _, full = await hurried(body_in(), NOD, 0.0)

    late, fast = await hurried(body_in(), NOD, faster)

    assert late <= 0.001
    assert amplitude(fast) == pytest.approx(amplitude(full), rel=0.001)


@pytest.mark.parametrize("behavior", [Pointing(id="p", target="far-left"), Gaze(id="g", target="far-left")])
async def test_what_has_a_target_is_never_smaller(behavior: BlockBehavior):
    _, full = await hurried(body_in(), behavior, 0.0)
    body = body_in()
    authority = MovementAuthority(behavior, "end", {"stroke": asyncio.get_running_loop().time() + 0.05})

    async with recorded(body) as recording:
        async for _ in body.perform(behavior, authority):
            pass

    assert amplitude(recording) == pytest.approx(amplitude(full), rel=0.01)
    assert violations(recording, body.capabilities.joints) == []


async def test_told_to_hurry_on_its_way_it_goes_on_smaller_from_where_it_is():
    body = body_in()
    now = asyncio.get_running_loop().time()
    natural = {phase.to: phase.natural for phase in body.estimate(BEAT, None, WORLD).phases}
    due = now + sum(natural.values()) - 0.25
    authority = MovementAuthority(BEAT, "end")
    asyncio.get_running_loop().call_at(now + natural["ready"], authority.set_pace, {"end": due})

    async with recorded(body) as recording:
        at = times([progress async for progress in body.perform(BEAT, authority)])

    assert at["end"] <= due + 0.001
    assert list(at) == list(dict.fromkeys(["start", *natural]))
    assert violations(recording, body.capabilities.joints) == []


async def test_a_slow_motor_makes_it_smaller_for_the_same_time():
    _, healthy = await hurried(body_in(), BEAT, 0.3)

    late, slow = await hurried(body_in(Variability(slow=(Slow(part="right_arm", factor=1.2),))), BEAT, 0.3)

    assert late <= 0.001
    assert amplitude(slow) < 0.9 * amplitude(healthy)


PACES = st.lists(
    st.tuples(st.floats(0.0, 1.5), st.sampled_from(["ready", "stroke", "stroke_end", "end"]), st.floats(-0.2, 1.0)),
    min_size=1, max_size=4,
)  # fmt: skip


@settings(max_examples=share_of(60), deadline=None)
@given(behavior=st.sampled_from(MOVING), paces=PACES, held=st.booleans())
def test_no_pace_breaks_limits_or_loses_a_point(
    behavior: BlockBehavior, paces: list[tuple[float, str, float]], held: bool
):
    async def play() -> tuple[list[str], list[str]]:
        body, loop = body_in(), asyncio.get_running_loop()
        authority = MovementAuthority(behavior, "start" if held else "end")
        for wait, sync, ahead in paces:
            loop.call_later(wait, lambda sync=sync, ahead=ahead: authority.set_pace({sync: loop.time() + ahead}))
        loop.call_later(1.0, authority.extend, "end")
        async with recorded(body) as recording:
            at = times([progress async for progress in body.perform(behavior, authority)])
            await body.home()
        return list(at), violations(recording, body.capabilities.joints)

    points, broken = run_virtual(play())

    assert [sync for sync in points if not sync.startswith("stroke:")] == list(sync_points(behavior))
    assert broken == []
