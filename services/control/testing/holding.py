"""Laws of waiting: at hold points until more is permitted, and wherever a behavior that is held can wait next."""

import asyncio
from itertools import pairwise
from random import Random

from msgspec.structs import replace

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Gesture, Mark, Pointing, Speech, Wait
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import Arrived, Body, Reached, Spoke
from engage_hri.services.control.testing.asked import HOLDS
from engage_hri.services.control.testing.laws import broken, degrees, listed, ms
from engage_hri.services.control.testing.motions import Recording, recorded
from engage_hri.services.control.testing.stage import Stage, default, done, standing, times
from engage_hri.services.control.testing.suite import STILL, Suite, trials

SETTLING: Seconds = 0.5
"""Time for the last tenths of a degree, once the joints are near enough to say that they have arrived."""
NOTHING = "nothing that can wait on its way"


def is_movement(behavior: BlockBehavior) -> bool:
    """True for what can wait on its way and is no voice and no clock."""
    return type_name(behavior) in HOLDS and not isinstance(behavior, Wait | Speech)


class HoldingLaws(Suite):
    """Part of `BodyContract`."""

    topic = "waiting"

    def moving(self, body: Body) -> list[BlockBehavior]:
        """List behaviors that can wait on their way."""
        return [each for each in self.able(body) if is_movement(each)]

    async def test_waits_at_each_hold_point_until_it_may_pass(self, body: Body) -> None:
        """With authority for its start alone a behavior comes to its first hold point, says `Arrived`, and waits.

        Usually it does not ask `authority.covers` before that point, or it asks for one that comes earlier. When it
        leaves, `arrived` of the point is when it came, and `at` is when it left.
        """
        for case in self.cases(body, lambda each: bool(self.holds(body, each)), NOTHING):
            async with case as behavior:
                stage, points = Stage(body, behavior), sync_points(behavior)
                for number, hold in enumerate(self.holds(body, behavior), 1):
                    await stage.holding(number)
                    self._check_waits(stage, hold)
                    await asyncio.sleep(self.dwell)
                    self._check_waits(stage, hold)
                    stage.authority.extend(hold)
                progress = await stage.over()
                if default(stage.passed) != points:
                    broken(behavior, expected=f"{listed(points)}, once it may", measured=listed(stage.passed))
                for hold in self.holds(body, behavior):
                    left = next(each for each in progress if isinstance(each, Reached) and each.sync == hold)
                    came = next(each for each in progress if isinstance(each, Arrived) and each.sync == hold)
                    if not left.arrived == came.at < left.at:
                        broken(
                            behavior,
                            hold,
                            expected="`arrived` when it came there, and `at` when it left",
                            measured=f"`arrived` {ms(left.arrived - came.at)} and `at` {ms(left.at - came.at)} "
                            "after it said `Arrived`",
                        )

    def _check_waits(self, stage: Stage, hold: str) -> None:
        points = stage.authority.points
        if stage.waits_at[-1:] != [hold] or set(stage.passed) & set(points[points.index(hold) :]):
            broken(
                stage.behavior,
                hold,
                expected="that it waits there for authority",
                measured=f"it has waited at {listed(stage.waits_at)} and passed {listed(stage.passed)}",
            )

    async def test_stands_still_while_it_waits(self, body: Body) -> None:
        """Joints stand still where it waits, within the noise of their encoders, and `moving` is false.

        Usually `Arrived` is told when the command is over, and the joints come later; or a loop goes on to command
        small motions (breath, tracking noise) where the behavior holds.
        """
        for case in self.cases(body, is_movement, NOTHING):
            async with case as behavior:
                stage = Stage(body, behavior)
                await stage.holding()
                if body.state().moving and not await standing(body, self.tolerance + 0.5):
                    broken(
                        behavior,
                        listed(stage.waits_at),
                        expected="`moving` false where it waits",
                        measured="`moving` true",
                    )
                await asyncio.sleep(SETTLING)
                async with recorded(body, self.joints(body, behavior)) as recording:
                    await asyncio.sleep(1.0)
                self._check_still(recording, behavior, listed(stage.waits_at))
                stage.authority.extend("end")
                await stage.over()

    def _check_still(self, recording: Recording, behavior: BlockBehavior, sync: str) -> None:
        if not recording.joints:
            return
        moved = recording.angles.max(axis=0) - recording.angles.min(axis=0)
        worst = int(moved.argmax())
        if moved[worst] > STILL + 2.0 * self.slack:
            broken(
                behavior,
                sync,
                expected=f"joints that stand still, within {degrees(STILL + 2.0 * self.slack)}",
                measured=f"{recording.joints[worst]} moves by {degrees(float(moved[worst]))} within 1 s",
            )

    async def test_a_held_behavior_waits_at_the_next_hold_point_though_it_might_pass(self, body: Body) -> None:
        """`authority.held` makes it wait at the next hold point that it can brake for, and `go_on` ends that.

        Usually it looks at `through` alone. `authority.covers` is false while it is held: ask it again at each hold
        point.
        """
        for case in self.cases(body, is_movement, NOTHING):
            async with case as behavior:
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
                    if stage.waits_at != [hold] or not await standing(body, self.tolerance + 0.5):
                        broken(
                            behavior,
                            hold,
                            expected="that it stands there while it is held",
                            measured=f"it waited at {listed(stage.waits_at)}; `moving` is {body.state().moving}",
                        )
                    stage.authority.go_on()
                    await stage.over()
                    if default(stage.passed) != sync_points(behavior):
                        broken(behavior, expected="all of its points, once it goes on", measured=listed(stage.passed))

    async def test_an_authority_that_comes_while_it_is_held_counts_once_it_goes_on(self, body: Body) -> None:
        """Extended while it is held, a behavior stays where it waits; once it goes on it uses what it has got.

        Usually `extend` wakes it and it does not look whether it is still held.
        """
        for case in self.cases(body, is_movement, NOTHING):
            async with case as behavior:
                stage, first = Stage(body, behavior), HOLDS[type_name(behavior)][0]
                stage.authority.hold()
                await stage.holding()
                stage.authority.extend("end")
                await asyncio.sleep(self.dwell)
                self._check_waits(stage, first)
                stage.authority.go_on()
                await stage.over()
                if default(stage.passed) != sync_points(behavior) or stage.waits_at != [first]:
                    broken(
                        behavior,
                        expected=f"one wait, at {first}, and then all points",
                        measured=f"waits at {listed(stage.waits_at)}; {listed(stage.passed)}",
                    )

    async def test_going_on_does_not_give_authority(self, body: Body) -> None:
        """A behavior that is no longer held still waits for the authority that it lacks.

        Usually `go_on` is taken for a permission.
        """
        for case in self.cases(body, is_movement, NOTHING):
            async with case as behavior:
                stage = Stage(body, behavior)
                stage.authority.hold()
                await stage.holding()
                stage.authority.go_on()
                await asyncio.sleep(self.dwell)
                self._check_waits(stage, HOLDS[type_name(behavior)][0])
                stage.authority.extend("end")
                await stage.over()

    async def test_a_pace_takes_nothing_from_a_hold(self, body: Body) -> None:
        """A behavior that is asked for other times and is held comes to its hold point, and waits there.

        Usually it waits for the time that it was asked for before it moves, or reads the pace as a permission.
        """
        for case in self.cases(body, is_movement, NOTHING):
            async with case as behavior:
                stage, first = Stage(body, behavior, "end"), HOLDS[type_name(behavior)][0]
                stage.authority.set_pace({"end": asyncio.get_running_loop().time() + 60.0})
                stage.authority.hold()
                await stage.holding()
                self._check_waits(stage, first)
                stage.authority.set_pace({})
                stage.authority.go_on()
                await stage.over()

    @trials(4)
    async def test_whenever_it_is_held_it_waits_or_ends_by_itself(self, body: Body, seed: int) -> None:
        """Held at any instant, a behavior waits at one hold point, or is on its way home and ends.

        Usually it has been asked on the way to a hold point that it can no longer brake for, passes that one, and
        forgets about the next.
        """
        chance = Random(seed)
        for case in self.cases(body, is_movement, NOTHING):
            async with case as behavior:
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
                            behavior,
                            expected="one place where it waits, and no point behind it",
                            measured=f"waits at {listed(stage.waits_at)}; passed {listed(stage.passed)}",
                        )
                    if not await standing(body, self.tolerance + 0.5):
                        broken(behavior, hold, expected="`moving` false where it waits", measured="`moving` true")
                else:
                    # It went home by itself: it had left its last hold point, or could not stop there any more.
                    last = HOLDS[type_name(behavior)][-1]
                    late = times(stage.progress)[last] - held_at
                    if stage.waits_at or late > 0.5 + self.tolerance:
                        broken(
                            behavior,
                            last,
                            expected="that it waits there, held in time",
                            measured=f"it passes {ms(late)} after it was held",
                        )
                stage.authority.go_on()
                await stage.over()
                if default(stage.passed) != points:
                    broken(behavior, expected=listed(points), measured=listed(stage.passed))

    async def test_a_held_behavior_can_be_aborted_and_taken_over(self, body: Body) -> None:
        """A behavior that waits ends at once when it is aborted, or when a later one takes its part.

        Usually the wait for authority does not look at `authority.revoked`: `await authority.granted(...)` raises
        `Revoked`.
        """
        for case in self.cases(body, is_movement, NOTHING):
            async with case as behavior:
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
                            behavior,
                            expected=f"that it ends as {how}, without `end`",
                            measured=f"revoked: {stage.authority.revoked}; passed {listed(stage.passed)}",
                        )
                    if not await standing(body):
                        broken(behavior, expected="a body that comes to stand", measured="`moving` stays true")

    def with_one_hand(self, body: Body, behavior: Pointing | Gesture) -> Pointing | Gesture:
        """Choose a hand for a behavior, so that a second one like it takes over the same arm."""
        for mode in ("RIGHT_HAND", "LEFT_HAND"):
            chosen = replace(behavior, mode=mode)
            if body.estimate(chosen, None, self.world).feasible:
                return chosen
        return behavior

    @trials(6)
    async def test_a_held_voice_is_silent_from_the_next_gap_on(self, body: Body, seed: int) -> None:
        """A voice that is held says its word to the end, is silent, and then says the rest: no word twice, none lost.

        Usually the synthesiser is asked for the whole text and can only be cut. Play word by word, or pause the sound
        at the next word time.
        """
        if "speech" not in self.types(body):
            self.lacks(body, "it has no voice", "speech")
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
                    speech,
                    expected=f"silence from {ms(longest)} after it was held",
                    measured=f"{stage.progress[told]} comes later",
                )
            stage.authority.go_on()
        await stage.over()

        words, due = ([each.word for each in one.progress if isinstance(each, Spoke)] for one in (stage, alone))
        if words != due or stage.passed != alone.passed:
            broken(
                speech,
                expected=f"the words {' '.join(due)!r}, and {listed(alone.passed)}",
                measured=f"{' '.join(words)!r}, and {listed(stage.passed)}",
            )
        # Silence adds up; what it says after it was told to hold is no more than the word it is in.
        lasted = times(stage.progress)["end"] - times(stage.progress)["start"]
        if not took + held - 3 * longest <= lasted <= took + held + 3 * self.tolerance:
            broken(
                speech,
                "end",
                expected=f"{ms(took)} of words and {ms(held)} of silence, less the words that were under way",
                measured=ms(lasted),
            )
