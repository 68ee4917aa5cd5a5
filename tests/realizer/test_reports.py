"""Reports of a body that come late, twice, in the wrong order, or about nothing: no end, and no false point."""

import asyncio
import random
from itertools import pairwise
from math import inf, isfinite, nan

from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gaze, Wait
from engage_hri.schemas.blocks import BlockOutcome, BlockProgress, SyncPointProgress, WarningFeedback
from engage_hri.schemas.body import SyncPointArrived, SyncPointReached
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.decide.decisions import Decisions
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.points import ORIGIN, Point
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.random_cases import share_of
from tests.realizer.fake_body import Act, FakeBody
from tests.realizer.oracle import estimate, possible_blocks
from tests.realizer.stage import after, block, stage
from tests.realizer.test_properties import blocks, planned

NOWHERE = (Point("g", "m-9"), Point("nobody", "start"), Point("b2:s", "end"), ORIGIN, Point("", ""))
WRONG_TIMES = (nan, inf, -inf, 1e300, -1e300, -1.0, 1e9)


@settings(max_examples=share_of(150), deadline=None)
@given(blocks() | possible_blocks(8), st.data())
def test_no_sequence_of_reports_ends_the_authority_or_makes_it_tell_a_point_twice(block, data) -> None:  # type: ignore[no-untyped-def]
    plan = planned(block)
    if plan is None:
        return
    authority, now, told = Decisions(plan, 0.0, RealizerConfig()), 0.0, []
    points = [*(point for chain in plan.chains.values() for point in chain.points), *NOWHERE]
    for _ in range(data.draw(st.integers(1, 40))):
        point = data.draw(st.sampled_from(points))
        at = data.draw(st.sampled_from((now, now, now - 0.3, now + 0.3, *WRONG_TIMES)))
        match data.draw(st.sampled_from(("advance", "advance", "arrive", "reach", "reach", "believe", "drop"))):
            case "advance":
                now = max(now + data.draw(st.sampled_from((0.0, 0.25, 1.0))), min(authority.deadline or 0.0, 1e6))
                authority.advance(now)
            case "arrive":
                authority.arrive(point, at)
            case "reach":
                told += authority.reach(point, at)
            case "believe":
                told += authority.reach(point, authority.facts.plausible(point, at, now))
            case "drop" if len(authority.plan.chains) > 1:
                left_out = (*authority.plan.dropped, data.draw(st.sampled_from(sorted(authority.plan.chains))))
                authority.replan(plan_block(block, plan.estimates.values(), dropped=left_out))
        authority.foresight.expected(now)
        assert all(each.seconds > 0.0 for point in points for each in authority.broken(point))

    assert len(told) == len(set(told))
    for chain in plan.chains.values():
        mine = tuple(point for point in told if point.behavior == chain.behavior.id)
        assert mine == chain.points[: len(mine)]


def test_what_has_not_begun_can_be_nowhere() -> None:
    made = block((Gaze(id="g", target="a"), Wait(id="w", duration=3.0)), after("w:end", "g:start"))
    authority = Decisions(plan_block(made, [estimate(made.behaviors[0])]), 0.0, RealizerConfig())
    authority.advance(0.0)

    assert authority.reach(Point("g", "stroke"), 0.5) == ()
    authority.arrive(Point("g", "stroke"), 0.5)
    assert authority.facts.arrived == {}


def test_an_arrival_where_the_behavior_has_passed_is_not_counted_again() -> None:
    made = block((Gaze(id="g", target="a"), Gaze(id="h", target="b"), Wait(id="w", duration=3.0)))
    authority = Decisions(plan_block(made, [estimate(each) for each in made.behaviors[:2]]), 0.0, RealizerConfig())
    authority.advance(0.0)
    authority.reach(Point("g", "stroke"), 0.5)
    authority.arrive(Point("g", "stroke"), 0.6)

    assert authority.facts.arrived == {}


async def test_a_body_that_arrives_after_its_end_is_not_heard() -> None:
    async with stage() as seen:
        pending = seen.ask(block((Gaze(id="g", target="a"), Wait(id="w", duration=3.0))))
        await asyncio.sleep(0.2)
        bus = seen.body.bus
        now = bus.stamp()
        end = SyncPointReached(id="r-b/g", block="b", behavior="g", sync="end", at=now, arrived=now)
        bus.publish(keys.SYNC_POINT, end)
        for sync in ("stroke", "relax", "end", "no such point"):
            bus.publish(keys.SYNC_POINT, SyncPointArrived(id="r-b/g", block="b", behavior="g", sync=sync, at=now))
            bus.publish(
                keys.SYNC_POINT, SyncPointReached(id="r-b/g", block="b", behavior="g", sync=sync, at=now, arrived=now)
            )
        outcome = await pending.outcome

    assert isinstance(outcome, BlockOutcome)
    assert outcome.status == "done"
    assert [each.sync for each in seen.progress() if each.behavior == "g"].count("end") == 1


class Liar(FakeBody):
    """Tells its reports at wrong times, some twice, and others that nobody has asked for beside them."""

    def __init__(self, seed: int) -> None:
        super().__init__()
        self.chance = random.Random(seed)

    def _reached(self, act: Act, sync: str, arrived: float) -> None:
        for _ in range(self.chance.choice((0, 1, 1, 1, 2))):
            self._lie(act, sync)
        super()._reached(act, sync, arrived)
        if self.chance.random() < 0.3:
            self._lie(act, self.chance.choice(("start", "stroke", "relax", "end", "m", "m-1", "nowhere")))

    def _lie(self, act: Act, sync: str) -> None:
        perform, kind = act.perform, self.chance.choice((SyncPointArrived, SyncPointReached))
        finite = (at for at in WRONG_TIMES if isfinite(at))  # a stamp takes no others
        wrong = (self.bus.now() + self.chance.uniform(-3.0, 3.0), *finite)
        at = self.bus.stamp(self.chance.choice(wrong))
        rest = {"arrived": self.bus.stamp(self.chance.choice(wrong))} if kind is SyncPointReached else {}
        lie = kind(id=perform.id, block=perform.block, behavior=perform.behavior.id, sync=sync, at=at, **rest)
        self.bus.publish(keys.SYNC_POINT, lie)


@settings(max_examples=share_of(80), deadline=None)
@given(blocks(), st.integers(0, 1000))
def test_the_feedback_of_a_block_never_goes_back_in_time_whatever_the_body_says(block, seed) -> None:  # type: ignore[no-untyped-def]
    async def main() -> list[object]:
        async with stage(Liar(seed)) as seen:
            await asyncio.gather(asyncio.wait_for(seen.ask(block).outcome, 300.0), return_exceptions=True)
            await asyncio.sleep(0)
            return seen.feedback

    feedback = run_virtual(main())

    said = [each for each in feedback if isinstance(each, (BlockProgress, SyncPointProgress, WarningFeedback))]
    instants = [each.at.seconds for each in said if each.at is not None]
    assert all(one <= other for one, other in pairwise(instants))
    progress = [each for each in said if isinstance(each, SyncPointProgress)]
    assert all(each.arrived is None or each.arrived <= each.time for each in progress)
    points = [(each.behavior, each.sync) for each in progress]
    assert len(points) == len(set(points))
    assert len([each for each in said if isinstance(each, BlockProgress) and each.progress == "end"]) <= 1
