"""Laws of ends: aborted, dropped, or called home, a body brakes within its limits and comes to its safe pose."""

import asyncio
import math
from collections.abc import Mapping
from random import Random

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Speech, Wait
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.services.control.contract.body import AbortMode, Body, Spoke
from engage_hri.services.control.testing.findings import OLD_READINGS, broken, degrees, listed, ms
from engage_hri.services.control.testing.holding import NOTHING, is_movement
from engage_hri.services.control.testing.motions import Recording, Violation, recorded, violations
from engage_hri.services.control.testing.stage import PATIENCE, Connection, Stage, standing, still_running
from engage_hri.services.control.testing.suite import Suite, by_each, does_not_apply, trials

AT_ONCE: Seconds = 3.0
"""Time within which a behavior ends that is aborted: it may brake, and freeze for a moment."""
SHORTEST: Seconds = 0.005
"""Half of the time of a behavior that is over before anybody can abort it: the points of a face of lamps are one
instant."""
WORD: Seconds = 1.0
"""Time that a voice has for saying its word to the end."""
HOWS: tuple[AbortMode, ...] = ("relax", "freeze")


OVERLAY = "nothing that takes time and goes back to rest by itself"
OLD: Seconds = 0.04
"""Time for which readings come again in motion, from which on they are no measurement of it."""
Angles = Mapping[str, Radians]


def is_overlay(behavior: BlockBehavior) -> bool:
    """True for what goes back to rest by itself; a shift stays, wherever it was cut."""
    return not type_name(behavior).endswith("Shift") and type_name(behavior) != "pose"


class EndingLaws(Suite):
    """Part of `BodyContract`."""

    topic = "ends"

    @by_each(is_overlay, OVERLAY)
    async def test_an_aborted_behavior_ends_at_once_and_safe(
        self, body: Body, behavior: BlockBehavior, home: Angles
    ) -> None:
        """Revoked on its way, a behavior ends within 3 s without `end`, and its parts go on to the safe pose.

        Usually `perform` waits for a motion to be over before it looks at the authority, or nobody commands the way
        home once the behavior has ended: do it in a `finally`.
        """
        if self.half(body, behavior) <= SHORTEST:
            does_not_apply(f"it has {OVERLAY}")
        for how in HOWS:
            after = min(0.35, self.half(body, behavior))
            stage = Stage(body, behavior, "end")
            await asyncio.sleep(after)
            stage.authority.revoke(how)
            await stage.over(AT_ONCE)
            if "end" in stage.passed:
                broken("end", expected=f"no `end` of what was aborted after {ms(after)}", measured=stage.told)
            await self.check_rest(body, home, behavior, f"after an abort ({how})")

    @by_each(is_movement, NOTHING)
    async def test_an_aborted_hold_ends_at_once_and_safe(
        self, body: Body, behavior: BlockBehavior, home: Angles
    ) -> None:
        """Revoked where it waits, a behavior ends within 3 s, and its parts go on to the safe pose.

        Usually it waits for a point that never comes: `await authority.granted(...)` raises `Revoked`.
        """
        stage = Stage(body, behavior)
        await stage.holding()
        stage.authority.revoke()
        await stage.over(AT_ONCE)
        await self.check_rest(body, home, behavior, "after an aborted wait")

    @by_each()
    async def test_a_dropped_stream_ends_safe(self, body: Body, behavior: BlockBehavior, home: Angles) -> None:
        """`home` brings parts to the safe pose also from a behavior whose task was cancelled.

        Usually the part still belongs to the behavior that is gone: give it back in a `finally`.
        """
        stage = Stage(body, behavior, "end")
        await asyncio.sleep(0.35)
        stage.task.cancel()
        await asyncio.gather(stage.task, return_exceptions=True)
        await self.go_home(body)
        await self.check_rest(body, home, behavior, "after its task was cancelled")

    async def test_home_is_reached_from_anything(self, body: Body) -> None:
        """`home` returns when the body is at its safe pose, whatever it was doing; those behaviors end as aborted.

        Usually `home` returns as the command is sent, or a behavior that was under way commands its next goal after
        it.
        """
        home = await self.pose(body)
        stages = [Stage(body, each, "end") for each in self.able(body) if not isinstance(each, Wait)]
        if not stages:
            does_not_apply("it only waits")
        await asyncio.sleep(0.45)
        under_way = [stage for stage in stages if not stage.task.done()]
        await self.go_home(body)
        joints = self.joints(body)
        self.check_pose(await self.pose(body), home, joints, what="the safe pose as `home` returns")
        if not await standing(body, WORD) or body.state().speaking:
            broken(
                expected=f"`moving` false and silence {ms(WORD)} after `home` has returned",
                measured=f"moving {body.state().moving}, speaking {body.state().speaking!r}",
            )
        await asyncio.wait([stage.task for stage in stages], timeout=AT_ONCE)
        for stage in under_way:
            if not stage.task.done() or "end" in stage.passed:
                what = f"that it ends within {ms(AT_ONCE)} as `home` takes its parts, without `end`"
                broken(behavior=stage.behavior, expected=what, measured=stage.told)
            if stage.authority.revoked is None:
                what = "that `home` revokes its authority"
                broken(behavior=stage.behavior, expected=what, measured="it is not revoked")
        await asyncio.sleep(self.dwell)
        self.check_pose(await self.pose(body), home, joints, what="the safe pose some time later")

    async def go_home(self, body: Body, parts: tuple[str, ...] = ()) -> None:
        """Call parts of the body home; empty: all. Raises LawBroken if they do not get there."""
        try:
            async with asyncio.timeout(PATIENCE):
                await body.home(parts)
        except TimeoutError:
            what = f"that `home` returns within {ms(PATIENCE)}"
            broken(expected=what, measured="it does not", cause="`home` never returns")

    @trials(2)
    @by_each(is_movement, NOTHING)
    async def test_brakes_within_the_limits_of_its_joints(
        self, body: Body, behavior: BlockBehavior, seed: int
    ) -> None:
        """Held and aborted at any instant on its way, no joint exceeds its speed or acceleration.

        Usually a stop is a command to be where the joint is now. Brake with the acceleration that `capabilities`
        names, or name the one that the motors have.
        """
        self._needs_limits(body)
        chance = Random(f"{seed} {behavior.id}")
        async with recorded(body) as recording:
            stage = Stage(body, behavior, "end")
            for _ in range(4):
                await asyncio.sleep(chance.uniform(0.0, 0.4))
                stage.authority.hold()
                await asyncio.sleep(chance.choice((0.02, 0.1, 0.5)))
                stage.authority.go_on()
            await stage.over()
            stage = Stage(body, behavior, "end")
            await asyncio.sleep(chance.uniform(0.1, 0.5))
            stage.authority.revoke(chance.choice(HOWS))
            await stage.over()
            await self.go_home(body)
        self.check_limits(body, recording)

    @by_each()
    async def test_keeps_its_limits_whatever_comes(self, body: Body, behavior: BlockBehavior) -> None:
        """No joint leaves its range, its speed or its acceleration, whatever is begun, taken over and aborted.

        Usually a new command starts as if the joints stood still, and the motors are asked to jump; or the limits in
        `capabilities` are those of the data sheet, and the motors are set to others.
        """
        self._needs_limits(body)
        async with recorded(body) as recording:
            stage = Stage(body, behavior)
            await asyncio.sleep(0.3)
            stage.authority.extend("end")
            other = Stage(body, replace(behavior, id="other"), "end")
            await asyncio.sleep(0.25)
            other.authority.revoke()
            await asyncio.gather(stage.task, other.task, return_exceptions=True)
            await self.go_home(body)
        self.check_limits(body, recording)

    async def test_home_takes_the_parts_that_it_is_asked_for_and_no_others(self, body: Body) -> None:
        """`home(parts)` brings these to the safe pose and ends what they do; behaviors of other parts go on.

        Usually `parts` is not looked at, so that all goes home, or nothing.
        """
        home, together = await self.pose(body), self._together(body)
        joints = {behavior.id: self.joints(body, behavior) for behavior, _ in together}
        for number, (first, parts) in enumerate(together):
            stages = [Stage(body, replace(each, id=f"{each.id} {number}")) for each, _ in together]
            for stage in stages:
                await stage.holding()
            await standing(body)
            before = await self.pose(body)
            await self.go_home(body, parts)
            after, mine = await self.pose(body), stages[number]
            safe = f"the safe pose of {listed(parts)}"
            self.check_pose(after, home, joints[first.id], what=safe, behavior=first)
            await asyncio.wait([mine.task], timeout=AT_ONCE)
            if not mine.task.done() or "end" in mine.passed:
                broken(behavior=first, expected="that it ends as its parts go home", measured=mine.told)
            for stage, (other, _) in zip(stages, together, strict=True):
                if stage is mine:
                    continue
                if stage.task.done() or stage.authority.revoked is not None:
                    expected = f"that it goes on while {listed(parts)} goes home"
                    broken(behavior=stage.behavior, expected=expected, measured=stage.told)
                if "torso" not in parts:  # that takes all others with it
                    what = f"where it was before {listed(parts)} went home"
                    self.check_pose(after, before, joints[other.id], what=what, behavior=other)
                stage.authority.extend("end")
            for stage in stages:
                await stage.over()
            await self.go_home(body)

    def _together(self, body: Body) -> list[tuple[BlockBehavior, tuple[str, ...]]]:
        """Behaviors that can wait and share no parts, with their parts."""
        found: list[tuple[BlockBehavior, tuple[str, ...]]] = []
        taken: set[str] = set()
        for behavior in self.able(body):
            parts = body.estimate(behavior, None, self.world).parts
            if is_movement(behavior) and self.joints(body, behavior) and taken.isdisjoint(parts):
                found.append((behavior, parts))
                taken |= set(parts)
        if not found:
            self.lacks(body, f"it has {NOTHING}", *self.unable)
        return found

    def _needs_limits(self, body: Body) -> None:
        if not body.capabilities.joints:
            does_not_apply("its capabilities name no joints")

    def check_limits(self, body: Body, recording: Recording) -> None:
        """Judge what was recorded. Raises LawBroken with the first limit that was left."""
        if self.fastest is not None:
            for joint, speed in recording.fastest(self.noise).items():
                self.fastest[joint] = max(speed, self.fastest.get(joint, 0.0))
        for each in violations(recording, body.capabilities.joints, self.noise, self.age):
            if (repeats := recording.repeats) > OLD:
                broken(
                    expected=f"new readings while {each.joint} moves, to judge its {each.what} by",
                    measured=f"each comes again for {ms(repeats)}",
                    advice="are the motors asked often enough, and is it the newest reading that `angles` tells?",
                    cause=OLD_READINGS,
                )
            when = each.at - recording.times[0]
            broken(
                expected=f"{each.what} of {each.joint} up to {degrees(each.limit)}{each.unit}",
                measured=f"{degrees(each.measured)}{each.unit}, {ms(when)} after it was asked for",
                advice=_encoders(each) if each.what != "range" else "",
            )

    async def test_leaves_no_task_once_it_is_disconnected(self) -> None:
        """No task or timer of the driver goes on once `connected()` is left, at rest or in motion.

        Usually a task is created in `__init__` or `home`, and nobody ends it: tasks belong into `connected()`, and a
        timer that sets itself again is cancelled there.
        """
        await self._check_leaving(is_home=True)
        await self._check_leaving(is_home=False)

    async def _check_leaving(self, *, is_home: bool) -> None:
        before = asyncio.all_tasks()
        body = self.make()
        connection = Connection(body)
        await connection.enter()
        body.see(self.world)
        for behavior in self.able(body):
            Stage(body, behavior, "end")
        await asyncio.sleep(0.3)
        await Stage.end_all()
        if is_home:
            await self.go_home(body)
        await connection.leave()
        left = await still_running(before)
        for task in left:
            task.cancel()
        if left:
            names = ", ".join(task.get_name() for task in left)
            broken(expected="no task of the driver once it is disconnected", measured=f"these go on: {names}")
        timers = _timers()
        await asyncio.sleep(0.1)
        if later := _timers() - timers:
            names = ", ".join(
                sorted(str(getattr(getattr(each, "_callback", None), "__qualname__", "a timer")) for each in later)
            )
            broken(expected="no timer of the driver once it is disconnected", measured=f"this is set anew: {names}")

    async def test_an_aborted_speech_stops_at_a_word(self, body: Body) -> None:
        """Aborted, a voice says its word to the end, tells it, and is silent; it tells no word that it has not said.

        Usually all words are told as the synthesiser returns, before the sound is played.
        """
        self.needs(body, "voice", "speech")
        words = ["one", "two", "three", "four", "five", "six", "seven"]
        speech = Speech(id="long", text=" ".join(words))
        stage = Stage(body, speech, "end")
        await asyncio.sleep(0.8)
        if not body.state().speaking:
            what = "its text in `speaking` while it speaks"
            broken(behavior=speech, expected=what, measured="an empty `speaking`")
        stage.authority.revoke()
        progress = await stage.over(AT_ONCE)
        said = [each.word for each in progress if isinstance(each, Spoke)]
        if not 0 < len(said) < len(words) or said != words[: len(said)] or "end" in stage.passed:
            broken(
                behavior=speech,
                expected="some of its words in order, and no `end`, 800 ms after it began",
                measured=f"{' '.join(said)!r}; {stage.told}",
            )
        if saying := body.state().speaking:
            broken(behavior=speech, expected="silence once it has ended", measured=f"`speaking` is {saying!r}")


def _encoders(violation: Violation) -> str:
    """Advice for encoders that count in steps: they look like motion that comes in jerks."""
    noise = math.ceil(math.degrees(violation.explained) * 100.0) / 100.0
    return f"if its encoders count in steps or are noisy, `--noise {noise:g}` explains this" if noise < 1.0 else ""


def _timers() -> set[asyncio.TimerHandle]:
    """Timers of this loop that are to come; none where a loop does not tell."""
    scheduled: list[asyncio.TimerHandle] = getattr(asyncio.get_running_loop(), "_scheduled", [])
    return {timer for timer in scheduled if not timer.cancelled()}
