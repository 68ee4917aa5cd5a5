"""Laws of truth: no sync point that the joints do not bear out, alone, in a crowd, and with a fault."""

import asyncio
from collections.abc import Iterator, Sequence
from random import Random

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.testing.laws import Finding, LawBroken, angles, broken, degrees, turned
from engage_hri.services.control.testing.motions import Recording, recorded
from engage_hri.services.control.testing.playing import Played
from engage_hri.services.control.testing.predictions import has_joints
from engage_hri.services.control.testing.stage import (
    LOOK_EVERY,
    Stage,
    done,
    standing,
    target_point,
    times,
    until_target,
)
from engage_hri.services.control.testing.suite import STILL, Suite, by_each, does_not_apply, trials
from engage_hri.services.control.testing.witness import CROWDS, Witness, crowded

TRIMMED = 6
"""Samples at both ends of a stand that are not judged: a measurement of motion comes late."""
SETTLED: Seconds = 1.0
"""Time within which a body that is at home stands."""
PATIENCE_WITH_FAULTS: Seconds = 15.0
"""Time after which a behavior that a fault keeps from its next point is aborted. Those who tell points by the clock
have told them by then."""
CROWDS_WITH_FAULTS = ("all but nods", "nods")
"""They have all behaviors of the others, too."""
ACTS_WITH_FAULTS = 8


class TruthLaws(Suite):
    """Part of `BodyContract`."""

    topic = "truth"

    async def test_measures_all_its_joints_within_their_noise(self, body: Body) -> None:
        """`state()` has each joint of the capabilities, and at rest it scatters no more than the stated `noise`.

        Usually the encoders are noisier than it was said: state what is measured here, or filter them. All other laws
        allow for the noise that is stated.
        """
        named_joints = {limit.joint for limit in body.capabilities.joints}
        if not named_joints:
            does_not_apply("its capabilities name no joints")
        if missing := sorted(named_joints - set(angles(body.state().pose))):
            broken(expected="an angle of each joint in `state().pose`", measured=f"none of {', '.join(missing)}")
        async with recorded(body, self.joints(body)) as recording:
            await asyncio.sleep(1.0)
        if not recording.joints:
            does_not_apply("its behaviors move no joints")
        scatter = recording.scatter
        worst, most = int(scatter.argmax()), 1.5 * self.noise + STILL / 5
        if scatter[worst] > most:
            broken(
                expected=f"readings at rest that scatter by {degrees(most)} at most (standard deviation)",
                measured=f"{recording.joints[worst]} scatters by {degrees(float(scatter[worst]))}",
                advice=f"state it: `noise = math.radians({float(scatter[worst]) * 57.2958:.2f})`, or --noise",
            )

    @by_each(has_joints, "no joints")
    async def test_says_that_it_moves_as_long_as_it_moves(self, body: Body, behavior: BlockBehavior) -> None:
        """While `moving` is false the joints stand still, within the noise of their encoders.

        Usually `moving` is false once the planned time is over: it is for the measured joints to say.
        """
        recording, stands = Recording(self.joints(body, behavior)), []
        stage = Stage(body, behavior, "end")
        while not stage.task.done() or body.state().moving:
            stands.append(not body.state().moving)
            recording.take(body)
            await asyncio.sleep(LOOK_EVERY)
        await stage.over()
        for first, last in _runs(stands):
            self.check_still(recording.angles[first + TRIMMED : max(first, last - TRIMMED)], recording.joints)

    @by_each()
    async def test_each_point_is_where_the_joints_are(self, body: Body, behavior: BlockBehavior) -> None:
        """Alone, and waiting at each hold point: as each point is told, eyes, forearms and joints are where it says.

        Usually a point is told when the planned time is over, or when the vendor's "finished" comes: tell it when the
        measured angles are there. A movement that takes time has moved a joint by its stroke.
        """
        takes = until_target(body.estimate(behavior, None, self.world), behavior)
        joints, sync = self.joints(body, behavior), target_point(behavior)
        before = angles(self.observed(body).pose)
        witness = Witness(self, body)
        stage = witness.begin(behavior, "start")
        for number, hold in enumerate(self.holds(body, behavior), 1):
            await stage.holding(number)
            stage.authority.extend(hold)
        if lies := await witness.close():
            raise LawBroken(lies)
        if not joints or not has_joints(behavior) or takes < 0.05:
            return
        await body.home()
        async with recorded(body, joints) as recording:
            at = times(await done(body, behavior))[sync]
        if (moved := turned(recording.at(at), before)) < 5 * STILL:
            broken(sync, expected=f"a joint that has moved by {degrees(5 * STILL)} at least", measured=degrees(moved))

    @trials(6)
    @pytest.mark.parametrize("crowd", CROWDS)
    async def test_no_sync_point_that_the_joints_do_not_bear_out(self, body: Body, crowd: str, seed: int) -> None:
        """Begun, extended, held, released and aborted at random, no behavior tells a point that is not so.

        Usually what was taken over or cut goes on to tell its points. As each is told, the eyes are on the target,
        the forearm points at it, the head has nodded; in the end all is back where it belongs.
        """
        witness = await crowded(self, body, CROWDS[crowd], Random(f"{crowd} {seed}"))
        if witness is None:
            kinds = (type_name(make("any", Random(0), ["any"])) for make in CROWDS[crowd])
            self.lacks(body, f"it has nothing for the crowd of {crowd}", *kinds)
        if lies := await witness.close():
            raise LawBroken(lies)

    async def test_with_a_fault_it_passes_or_names_the_fault(self, fault: str | None) -> None:
        """With a fault a behavior is done, fails with a reason, or stays short of a point: it tells nothing untrue.

        Usually points are told by the clock, so that nothing notices a stall; or the error of the SDK comes out:
        catch it, and raise BodyFailed with a reason and an advice.
        """
        if fault is None:
            does_not_apply("no faults are named (`faults` of the suite)")
        make, lies = self.faults()[fault], list[Finding]()
        async with self.connected(make) as body:
            able = [each for each in self.behaviors if type_name(each) in self.types(body)]
        asked = list({_kind(each): each for each in able}.values())
        while asked:
            async with self.connected(make) as body:
                lies += await self._with_fault(body, asked.pop(0))
                while asked and isinstance(make, Played) and await self._is_as_before(body):
                    lies += await self._with_fault(body, asked.pop(0))
        for name in CROWDS_WITH_FAULTS:
            async with self.connected(make) as body:
                witness = await crowded(self, body, CROWDS[name], Random(f"{fault} {name}"), ACTS_WITH_FAULTS)
                if witness is not None:
                    lies += await witness.close(may_fail=True, patience=PATIENCE_WITH_FAULTS)
        if lies:
            raise LawBroken([replace(each, behavior=f"{each.behavior or 'the body'} with {fault}") for each in lies])

    async def _is_as_before(self, body: Body) -> bool:
        """Take a body home; false if it does not get there, so that another one is needed."""
        await Stage.end_all()
        try:
            async with asyncio.timeout(PATIENCE_WITH_FAULTS):
                await body.home()
        except Exception:
            return False
        return await standing(body, SETTLED)

    async def _with_fault(self, body: Body, behavior: BlockBehavior) -> Sequence[Finding]:
        witness = Witness(self, body)
        witness.begin(behavior, "end")
        return await witness.close(may_fail=True, patience=PATIENCE_WITH_FAULTS)


def _kind(behavior: BlockBehavior) -> tuple[str, tuple[str, ...]]:
    """Family and points of a behavior: those that share both use the same parts in the same way."""
    row = TYPES[type_name(behavior)]
    return row.family or row.name, row.points


def _runs(flags: Sequence[bool]) -> Iterator[tuple[int, int]]:
    """First and last index of each run of true ones."""
    first = None
    for index, flag in enumerate((*flags, False)):
        if flag and first is None:
            first = index
        elif not flag and first is not None:
            yield first, index
            first = None
