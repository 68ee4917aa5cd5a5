"""Laws of waiting: at hold points until more is permitted, and wherever a behavior that is held can wait next."""

import asyncio
from itertools import pairwise
from random import Random

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Gesture, Mark, Pointing, Speech, Wait
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import Arrived, Body, Reached, Spoke
from engage_hri.services.control.testing.findings import broken, listed, ms
from engage_hri.services.control.testing.motions import recorded
from engage_hri.services.control.testing.stage import Stage, done, times
from engage_hri.services.control.testing.suite import HOLDS, Suite, by_each, does_not_apply, trials

SETTLING: Seconds = 0.5
"""Time for the last tenths of a degree, once the joints are near enough to say that they have arrived."""
NOTHING = "nothing that can wait on its way"


def is_movement(behavior: BlockBehavior) -> bool:
    """True for what can wait on its way and is no voice and no clock."""
    return type_name(behavior) in HOLDS and not isinstance(behavior, Wait | Speech)


class HoldingLaws(Suite):
    """Part of `BodyContract`."""

    topic = "waiting"

    @by_each(lambda each: type_name(each) in HOLDS, NOTHING)
    async def test_waits_at_each_hold_point_until_it_may_pass(self, body: Body, behavior: BlockBehavior) -> None:
        """With authority for its start alone a behavior comes to its first hold point, says `Arrived`, and waits.

        Usually it does not ask `authority.covers` before that point, or it asks for one that comes earlier. When it
        leaves, `arrived` of the point is when it came, and `at` is when it left.
        """
        if not (holds := self.holds(body, behavior)):
            does_not_apply(f"it has {NOTHING}")
        stage = Stage(body, behavior)
        for number, hold in enumerate(holds, 1):
            await stage.holding(number)
            self._check_waits(stage, hold)
            await asyncio.sleep(self.dwell)
            self._check_waits(stage, hold)
            stage.authority.extend(hold)
        progress = await stage.over()
        self.check_passed(stage)
        for hold in holds:
            left = next(each for each in progress if isinstance(each, Reached) and each.sync == hold)
            came = next(each for each in progress if isinstance(each, Arrived) and each.sync == hold)
            if not left.arrived == came.at < left.at:
                broken(
                    hold,
                    expected="`arrived` when it came there, and `at` when it left",
                    measured=f"`arrived` {ms(left.arrived - came.at)} and `at` {ms(left.at - came.at)} "
                    "after it said `Arrived`",
                )

    def _check_waits(self, stage: Stage, hold: str) -> None:
        points = stage.authority.points
        if stage.waits_at[-1:] != [hold] or set(stage.passed) & set(points[points.index(hold) :]):
            broken(
                hold,
                behavior=stage.behavior,
                expected="that it waits there for authority",
                measured=stage.told,
            )

    def _check_waited_once(self, stage: Stage, hold: str) -> None:
        if stage.waits_at != [hold]:
            broken(hold, expected="one wait, there", measured=stage.told)

    @by_each(is_movement, NOTHING)
    async def test_stands_still_while_it_waits(self, body: Body, behavior: BlockBehavior) -> None:
        """Joints stand still where it waits, within the noise of their encoders, and `moving` is false.

        Usually `Arrived` is told when the command is over, and the joints come later; or a loop goes on to command
        small motions (breath, tracking noise) where the behavior holds.
        """
        stage = Stage(body, behavior)
        await stage.holding()
        await self.check_stands(body, listed(stage.waits_at), self.tolerance + 0.5)
        await asyncio.sleep(SETTLING)
        async with recorded(body, self.joints(body, behavior)) as recording:
            await asyncio.sleep(1.0)
        self.check_still(recording.angles, recording.joints, listed(stage.waits_at))
        stage.authority.extend("end")
        await stage.over()

    @by_each(is_movement, NOTHING)
    async def test_a_held_behavior_waits_at_the_next_hold_point_though_it_might_pass(
        self, body: Body, behavior: BlockBehavior
    ) -> None:
        """`authority.held` makes it wait at the next hold point that it can brake for, and `go_on` ends that.

        Usually it looks at `through` alone. `authority.covers` is false while it is held: ask it again at each hold
        point.
        """
        alone = times(await done(body, behavior))
        for since, hold in pairwise(("start", *HOLDS[type_name(behavior)])):
            if alone[hold] - alone[since] < 0.05:
                continue  # it stands there for both
            stage = Stage(body, behavior, "end")
            await stage.until(lambda stage=stage, since=since: since in stage.passed)  # type: ignore[misc]
            if since != "start":
                await asyncio.sleep((alone[hold] - alone[since]) / 2)
            stage.authority.hold()
            await stage.holding()
            await asyncio.sleep(self.dwell)
            self._check_waits(stage, hold)
            self._check_waited_once(stage, hold)
            await self.check_stands(body, hold, self.tolerance + 0.5)
            stage.authority.go_on()
            await stage.over()
            self.check_passed(stage)

    @by_each(is_movement, NOTHING)
    async def test_an_authority_that_comes_while_it_is_held_counts_once_it_goes_on(
        self, body: Body, behavior: BlockBehavior
    ) -> None:
        """Extended while it is held, a behavior stays where it waits; once it goes on it uses what it has got.

        Usually `extend` wakes it and it does not look whether it is still held.
        """
        stage, first = Stage(body, behavior), HOLDS[type_name(behavior)][0]
        stage.authority.hold()
        await stage.holding()
        stage.authority.extend("end")
        await asyncio.sleep(self.dwell)
        self._check_waits(stage, first)
        stage.authority.go_on()
        await stage.over()
        self._check_waited_once(stage, first)
        self.check_passed(stage)

    @by_each(is_movement, NOTHING)
    async def test_going_on_does_not_give_authority(self, body: Body, behavior: BlockBehavior) -> None:
        """A behavior that is no longer held still waits for the authority that it lacks.

        Usually `go_on` is taken for a permission.
        """
        stage = Stage(body, behavior)
        stage.authority.hold()
        await stage.holding()
        stage.authority.go_on()
        await asyncio.sleep(self.dwell)
        self._check_waits(stage, HOLDS[type_name(behavior)][0])
        stage.authority.extend("end")
        await stage.over()

    @by_each(is_movement, NOTHING)
    async def test_a_pace_takes_nothing_from_a_hold(self, body: Body, behavior: BlockBehavior) -> None:
        """A behavior that is asked for other times and is held comes to its hold point, and waits there.

        Usually it waits for the time that it was asked for before it moves, or reads the pace as a permission.
        """
        stage, first = Stage(body, behavior, "end"), HOLDS[type_name(behavior)][0]
        stage.authority.set_pace({"end": asyncio.get_running_loop().time() + 60.0})
        stage.authority.hold()
        await stage.holding()
        self._check_waits(stage, first)
        stage.authority.set_pace({})
        stage.authority.go_on()
        await stage.over()

    @trials(4)
    @by_each(is_movement, NOTHING)
    async def test_whenever_it_is_held_it_waits_or_ends_by_itself(
        self, body: Body, behavior: BlockBehavior, seed: int
    ) -> None:
        """Held at any instant, a behavior waits at one hold point, or is on its way home and ends.

        Usually it has been asked on the way to a hold point that it can no longer brake for, passes that one, and
        forgets about the next.
        """
        chance = Random(f"{seed} {behavior.id}")
        stage, points = Stage(body, behavior, "end"), sync_points(behavior)
        await asyncio.sleep(chance.uniform(0.0, 2.0))
        stage.authority.hold()
        held_at = asyncio.get_running_loop().time()
        await stage.holding()
        if not stage.task.done():
            await asyncio.sleep(self.dwell)
            (hold, *more) = stage.waits_at or [""]
            if more or not hold or set(stage.passed) & set(points[points.index(hold) :]):
                broken(
                    expected="one place where it waits, and no point behind it",
                    measured=stage.told,
                )
            await self.check_stands(body, hold, self.tolerance + 0.5)
        else:
            # It went home by itself: it had left its last hold point, or could not stop there any more.
            last = HOLDS[type_name(behavior)][-1]
            late = times(stage.progress)[last] - held_at
            if stage.waits_at or late > 0.5 + self.tolerance:
                late_by = f"it passes {ms(late)} after it was held"
                broken(last, expected="that it waits there, held in time", measured=late_by)
        stage.authority.go_on()
        await stage.over()
        self.check_passed(stage)

    @by_each(is_movement, NOTHING)
    async def test_a_held_behavior_can_be_aborted_and_taken_over(self, body: Body, behavior: BlockBehavior) -> None:
        """A behavior that waits ends at once when it is aborted, or when a later one takes its part.

        Usually the wait for authority does not look at `authority.revoked`: `await authority.granted(...)` raises
        `Revoked`.
        """
        if isinstance(behavior, Pointing | Gesture):
            behavior = self.with_one_hand(body, behavior)
        for how in ("relax", "taken_over"):
            stage = Stage(body, behavior, "end")
            stage.authority.hold()
            await stage.holding()
            later = stage
            if how == "relax":
                stage.authority.revoke()
            else:
                later = Stage(body, behavior, "end")
            await stage.over()
            await later.over()
            if stage.authority.revoked != how or "end" in stage.passed:
                broken(
                    expected=f"that it ends as {how}, without `end`",
                    measured=stage.told,
                )
            await self.check_stands(body)

    @trials(6)
    async def test_a_held_voice_is_silent_from_the_next_gap_on(self, body: Body, seed: int) -> None:
        """A voice that is held says its word to the end, is silent, and then says the rest: no word twice, none lost.

        Usually the synthesiser is asked for the whole text and can only be cut. Play word by word, or pause the sound
        at the next word time.
        """
        self.needs(body, "voice", "speech")
        text = "this is one, and that: another piece. And 那边 也有 一个"
        chance = Random(seed)
        speech = Speech(id="s", text=text, marks=(Mark("m", text.index("that")), Mark("n", text.index("piece") + 2)))
        alone = Stage(body, speech, "end")
        await alone.over()
        took = times(alone.progress)["end"] - times(alone.progress)["start"]

        stage = Stage(body, speech, "end")
        longest = max(len(each.word) for each in alone.progress if isinstance(each, Spoke)) * 0.05 + 0.7
        held: Seconds = 0.0
        for _ in range(3):
            await asyncio.sleep(chance.uniform(0.0, took / 3))
            if stage.task.done():
                break
            stage.authority.hold()
            since = asyncio.get_running_loop().time()
            await asyncio.sleep(longest)
            told = len(stage.progress)
            await asyncio.sleep(self.dwell)
            held += asyncio.get_running_loop().time() - since
            if len(stage.progress) > told:
                broken(
                    behavior=speech,
                    expected=f"silence from {ms(longest)} after it was held",
                    measured=f"{stage.progress[told]} comes later",
                )
            stage.authority.go_on()
        await stage.over()

        words, due = ([each.word for each in one.progress if isinstance(each, Spoke)] for one in (stage, alone))
        if words != due or stage.passed != alone.passed:
            broken(
                behavior=speech,
                expected=f"the words {' '.join(due)!r}, and {listed(alone.passed)}",
                measured=f"{' '.join(words)!r}, and {listed(stage.passed)}",
            )
        # Silence adds up; what it says after it was told to hold is no more than the word it is in.
        lasted = times(stage.progress)["end"] - times(stage.progress)["start"]
        if not took + held - 3 * longest <= lasted <= took + held + 3 * self.tolerance:
            broken(
                "end",
                behavior=speech,
                expected=f"{ms(took)} of words and {ms(held)} of silence, less the words that were under way",
                measured=ms(lasted),
            )
