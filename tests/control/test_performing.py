"""What a body tells of a behavior is checked as it is told, and what it does not end is broken off."""

import asyncio
from collections.abc import AsyncGenerator, Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas import keys
from engage_hri.schemas.behavior_types import TYPES, sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Speech
from engage_hri.schemas.body import AbortBehavior, BehaviorAborted, BehaviorOutcome, Capabilities, SyncPointReached
from engage_hri.schemas.references import type_name
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.contract.body import Arrived, MovementAuthority, Progress, Reached, Spoke
from engage_hri.services.control.serving.live_behavior import SKEW, Told, sound
from engage_hri.services.control.serving.steps import Nonsense
from engage_hri.services.control.testing import BEHAVIORS
from tests.control.directing import robot
from tests.control.test_drivers import Bare

LOOK = Gaze(id="look", target="cup")
POINTS = sync_points(LOOK)


def reached(sync: Any, late: float = 0.0, arrived: float = 0.0) -> Callable[[float], Progress]:
    return lambda now: Reached(sync, now + late, now + arrived)


class Scripted(Bare):
    """A driver that does what a list says. Whatever it does, `home` works."""

    def __init__(self, *script: Any) -> None:
        super().__init__()
        self.capabilities = Capabilities(body="mine", types=("gaze",), parts=("head",))
        self.script: Sequence[Any] = script
        self.homes = 0

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        for step in self.script:
            if asyncio.iscoroutinefunction(step):
                await step()
            else:
                yield step(asyncio.get_running_loop().time()) if callable(step) else step

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        self.homes += 1


async def told_by(
    body: Scripted, *, abort: bool = False, through: str = "end"
) -> tuple[BehaviorOutcome, list[str], float]:
    """The outcome, the points that went out, and how long it took."""
    async with robot(MemoryHub(), body=body) as client:
        since = client.bus.now()
        pending = client.perform(LOOK, through, "b")
        if abort:
            await asyncio.sleep(1.0)
            stop = AbortBehavior(id="stop", requester=client.bus.name, block="b", behavior=LOOK.id)
            assert isinstance(await client.requests.send(keys.BEHAVIOR, stop).outcome, BehaviorAborted)
        outcome = await client.outcome(pending)
        took = client.bus.now() - since
        await asyncio.sleep(0.1)
        return outcome, [each.sync for each in client.of(SyncPointReached)], took  # type: ignore[attr-defined]


GOOD = tuple(map(reached, POINTS))
LIES: dict[str, tuple[tuple[Any, ...], str, int]] = {
    "twice": ((*GOOD[:2], GOOD[1]), "tells 'ready' after 'ready'", 2),
    "backwards": ((*GOOD[:3], GOOD[1]), "tells 'ready' after 'stroke_start'", 3),
    "left out": ((GOOD[0], GOOD[2]), "tells 'stroke_start' without 'ready' before it", 1),
    "unknown": ((GOOD[0], reached("lunch")), "tells 'lunch', and a gaze has the points start", 1),
    "nothing": ((GOOD[0], reached(None)), "tells None, which is no name of a sync point", 1),
    "no progress": ((GOOD[0], None), "tells a NoneType, which is no progress", 1),
    "never": ((reached("start", float("nan")),), "tells 'start' at nan, which is no time of the loop", 0),
    "words": ((lambda now: Reached("start", "now", now),), "tells 'start' at 'now', which is no time", 0),
    "ahead": ((reached("start", 7.0),), "tells 'start' 7.000 s before it is", 0),
    "long ago": ((reached("start", -7.0),), "tells 'start' 7.000 s before the behavior began", 0),
    "before it came": ((reached("start", 0.0, 7.0),), "tells 'start' 7.000 s before it is", 0),
    "after the end": ((*GOOD, lambda now: Arrived("stroke", now)), "tells 'stroke' after 'end'", len(POINTS)),
    "an early end": (GOOD[:2], "tells an end of this gaze after 'ready', and nobody has told it to end it there", 2),
    "no point at all": ((), "tells an end of this gaze before its start", 0),
}


@pytest.mark.parametrize("lie", LIES)
async def test_what_cannot_be_is_not_passed_on_and_fails_the_behavior(lie: str):
    script, reason, count = LIES[lie]
    body = Scripted(*script)
    outcome, points, _ = await told_by(body)

    assert (outcome.status, points) == ("failed", list(POINTS[:count]))
    assert outcome.fault is not None
    assert outcome.fault.reason.startswith(f"the body mine {reason}")
    assert outcome.fault.where == "b:look"
    assert body.homes == 1


async def test_beyond_its_authority_it_goes_to_the_next_hold_and_no_further():
    holds = TYPES["gaze"].holds
    outcome, points, _ = await told_by(Scripted(*GOOD), through="start")

    assert points == list(POINTS[: POINTS.index(holds[0])])
    assert outcome.fault is not None
    assert outcome.fault.reason == f"the body mine tells {holds[0]!r}, and it may go no further than 'start'"


async def _for_ever() -> None:
    await asyncio.Event().wait()


async def _whatever_comes() -> None:
    for _ in range(3):
        with suppress(asyncio.CancelledError):
            await asyncio.sleep(100.0)


@pytest.mark.parametrize(("step", "took"), [(_for_ever, 5.0), (_whatever_comes, 5.5)])
async def test_what_goes_on_after_an_abort_is_broken_off_and_then_given_up(step: Any, took: float):
    """1 s until the abort, 4 s until it is broken off; 0.5 s later it is over without its driver."""
    body = Scripted(GOOD[0], step, *GOOD[1:])
    outcome, points, time = await told_by(body, abort=True)

    assert (outcome.status, points) == ("failed", ["start"])
    assert outcome.fault is not None
    assert outcome.fault.reason == "the body mine goes on 4 s after it was told to end it"
    assert time == pytest.approx(took, abs=0.01)
    assert body.homes == 1


async def test_an_end_after_an_abort_is_an_abort():
    outcome, points, _ = await told_by(Scripted(GOOD[0], partial(asyncio.sleep, 2.0)), abort=True)

    assert (outcome.status, points) == ("aborted", ["start"])
    assert outcome.fault is not None
    assert (outcome.fault.cause, outcome.fault.whose) == ("cancelled", "realizer")


SPEECH = Speech(id="look", text="one two")


@pytest.mark.parametrize(
    ("positions", "reason"),
    [
        ((3, 7), ""),
        ((3.0, "7"), ""),
        ((3, 2), "a word that ends at 2 of 7 characters after one that ended at 3"),
        ((8,), "a word that ends at 8 of 7 characters after one that ended at 0"),
        ((-1,), "a word that ends at -1 of 7 characters after one that ended at 0"),
        ((None,), "a word that ends at None, which is no number of characters"),
    ],
)
def test_words_go_on_in_their_text(positions: tuple[Any, ...], reason: str):
    told = Told(SPEECH, MovementAuthority(SPEECH, "end"), 0.0)
    spoken = [sound(Spoke("word", position, 0.0)) for position in positions]
    flaws = [each.what if isinstance(each, Nonsense) else told.flaw(each, 0.0) for each in spoken]

    assert flaws == [""] * (len(positions) - 1) + [reason]


@given(st.sampled_from([each for each in BEHAVIORS if not isinstance(each, Speech)]), st.data())
def test_a_body_that_tells_the_truth_is_never_at_fault(behavior: BlockBehavior, data: st.DataObject):
    """Whatever it waits for: points in order, each once, at their time, no further than the hold it may pass."""
    holds = TYPES[type_name(behavior)].holds
    authority = MovementAuthority(behavior, "start")
    told, now = Told(behavior, authority, 0.0), 0.0
    for sync in authority.points:
        now += data.draw(st.floats(0.0, 10.0))
        arrived = now
        if sync in holds and not authority.covers(sync):
            assert not told.flaw(Arrived(sync, now), now)
            now += data.draw(st.floats(0.0, 10.0))
            authority.extend(data.draw(st.sampled_from(authority.points[authority.points.index(sync) :])))
        assert not told.flaw(Reached(sync, now - data.draw(st.floats(0.0, min(now, SKEW))), min(arrived, now)), now)
    assert not told.missing()
