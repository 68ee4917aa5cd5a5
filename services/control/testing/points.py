"""Laws of sync points: each once, in order, as it is passed; and of what a body refuses."""

import asyncio
from collections.abc import Sequence
from itertools import pairwise
from typing import NoReturn

from msgspec.structs import replace

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Locomotion, Speech
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import Arrived, BehaviorRefused, Body, MouthShape, Reached, Spoke
from engage_hri.services.control.testing.findings import broken, listed, ms
from engage_hri.services.control.testing.stage import Stage, default, done, times
from engage_hri.services.control.testing.suite import ONE_INSTANT, Suite, by_each

PROMPT = 0.05
"""Seconds within which a body reports a point."""


class PointsLaws(Suite):
    """Part of `BodyContract`."""

    topic = "sync points"

    async def test_can_do_something_of_each_type_that_it_has(self, body: Body) -> None:
        """A body can do some behavior of each type in `capabilities.types` that the suite knows.

        Usually the targets of the suite's `world` are out of this robot's range, or its lexemes have other names:
        set `world` and `behaviors` to what it can do.
        """
        kinds = self.types(body) or self.lacks(body, "it has no types", *body.capabilities.types)
        known = [each for each in self.behaviors if type_name(each) in kinds]
        if not any(body.estimate(each, None, self.world).feasible for each in known):
            broken(
                expected="at least one behavior that the suite can ask for",
                measured=f"none; its types are {listed(kinds)}",
                advice="set `behaviors` and `world` of the suite to what this robot can do where it stands",
            )
        for kind in kinds:
            asked = [each for each in self.behaviors if type_name(each) == kind]
            estimates = [body.estimate(each, None, self.world) for each in asked]
            if estimates and not any(each.feasible for each in estimates):
                fault = estimates[0].fault
                broken(
                    behavior=asked[0],
                    expected="a feasible estimate, since its type is among the capabilities",
                    measured=f"not feasible: {fault or 'no fault is given'}",
                )

    @by_each()
    async def test_reports_every_sync_point_once_and_in_order(self, body: Body, behavior: BlockBehavior) -> None:
        """A behavior that is let through to its end reports each of its points once, in order, as its estimate says.

        Usually a point is yielded in two branches, or in none. Of a nod with repetitions, `stroke:2` and on are told
        if the estimate has phases to them, and only then.
        """
        estimate = body.estimate(behavior, None, self.world)
        reached = [each for each in await done(body, behavior) if isinstance(each, Reached)]
        told, due = tuple(each.sync for each in reached), sync_points(behavior)
        if default(told) != due:
            broken(expected=listed(due), measured=listed(told))
        if told != (foreseen := ("start", *(phase.to for phase in estimate.phases))):
            broken(expected=f"the points of its estimate, {listed(foreseen)}", measured=listed(told))
        for one, other in pairwise(reached):
            if other.at < one.at:
                early = f"{ms(one.at - other.at)} before it"
                broken(other.sync, expected=f"no earlier than {one.sync}", measured=early)

    @by_each()
    async def test_reports_a_point_as_it_is_passed(self, body: Body, behavior: BlockBehavior) -> None:
        """A report comes at most 50 ms after its `at`, and never before; nobody arrives after they left.

        Usually `at` is the planned time and not that of the measurement, or reports are yielded in a bunch. Times are
        those of `asyncio.get_running_loop().time()`.
        """
        stage = Stage(body, behavior, "end")
        await stage.over()
        for progress, heard in zip(stage.progress, stage.heard, strict=True):
            sync = progress.sync if isinstance(progress, Reached | Arrived) else "a word"
            if not -1e-6 <= heard - progress.at <= PROMPT + self.tolerance:
                late = f"it is told {ms(heard - progress.at)} after its `at`"
                broken(sync, expected=f"that it is told within {ms(PROMPT)}", measured=late)
            if isinstance(progress, Reached) and progress.arrived > progress.at:
                late = f"{ms(progress.arrived - progress.at)} later"
                broken(sync, expected="`arrived` no later than `at`", measured=late)

    @by_each()
    async def test_never_stops_where_it_may_pass(self, body: Body, behavior: BlockBehavior) -> None:
        """A behavior whose authority reaches to its end waits nowhere: no `Arrived`, and `arrived` is `at`.

        Usually it asks for the hold point behind the one that it is at, or it asks before it is there and waits for
        an answer that it has.
        """
        for each in await done(body, behavior):
            if isinstance(each, Arrived):
                broken(each.sync, expected="it passes without a stop", measured="it waits there")
            if isinstance(each, Reached) and each.at - each.arrived > 1e-9:
                early = f"`arrived` {ms(each.at - each.arrived)} earlier"
                broken(each.sync, expected="`arrived` equal to `at`, since it never waits", measured=early)

    @by_each(lambda each: type_name(each) in ONE_INSTANT, "nothing with points of one instant")
    async def test_points_that_are_one_instant_are_reported_as_one(self, body: Body, behavior: BlockBehavior) -> None:
        """`ready`, `stroke_start` and `start` of a gaze have one `at`, and so on: docs/control.md has the table.

        Usually each report takes the time anew: take it once for the points of one instant.
        """
        for through in ("end", "start"):
            stage = Stage(body, behavior, through)
            if through == "start":
                await stage.holding()
                await asyncio.sleep(self.dwell)
            stage.authority.extend("end")
            realized = times(await stage.over())
            for points in ONE_INSTANT[type_name(behavior)]:
                at = [realized[sync] for sync in points if sync in realized]
                if at and (apart := max(at) - min(at)) > 0.0:
                    what = f"one time of {listed(points)}"
                    broken(points[-1], expected=what, measured=f"they are {ms(apart)} apart")

    async def test_refuses_what_it_cannot_do_before_anything_moves(self, body: Body) -> None:
        """A target that the world has not is refused with BehaviorRefused and a reason, and so says the estimate.

        Usually the target is looked up after the first `yield`, or `world.entity` gives None and that is taken for a
        place. A type that the body has not is refused by `control` before the body is asked; a body that is asked
        all the same does nothing.
        """
        unable = [replace(each, target="nothing") for each in self.able(body) if hasattr(each, "target")] + [
            Locomotion(id="walk", target="human")
        ] * ("locomotion" not in body.capabilities.types)
        if not unable:
            self.lacks(body, "it has no behavior with a target", *self.unable)
        before = await self.pose(body)
        for behavior in unable:
            if body.estimate(behavior, None, self.world).feasible:
                broken(behavior=behavior, expected="an estimate that is not feasible", measured="`feasible` is true")
            try:
                progress = await done(body, behavior)
            except BehaviorRefused as refusal:
                if not refusal.fault.reason:
                    broken(behavior=behavior, expected="a reason in the fault", measured="an empty one")
            else:
                told = listed(each.sync for each in progress if isinstance(each, Reached | Arrived))
                broken(behavior=behavior, expected="BehaviorRefused", measured=f"it is performed: {told}")
        if body.state().moving:
            broken(expected="a body that stands after refusals", measured="`moving` is true")
        self.check_pose(await self.pose(body), before, before, what="where it was before the refusals")

    @by_each(Speech, "no voice")
    async def test_a_speech_tells_its_words_in_order(self, body: Body, behavior: BlockBehavior) -> None:
        """A voice tells each word as it has been said, in order, with the characters so far; then all is told.

        Usually the last word is left out, or `position` counts words. A mark is passed where its characters have been
        said.
        """
        assert isinstance(behavior, Speech)
        text, marks, said = behavior.text, {mark.id: mark.position for mark in behavior.marks}, 0
        for each in await done(body, behavior):
            if isinstance(each, Spoke):
                if each.position <= said or not text[: each.position].endswith(each.word):
                    counted = f"{each.position} characters, which end with {text[: each.position][-12:]!r}"
                    what = "the text up to its end in `position`"
                    broken(f"the word {each.word!r}", expected=what, measured=counted)
                said = each.position
            elif isinstance(each, Reached) and (mark := marks.get(each.sync)) is not None:
                is_gap = mark == len(text) or text[mark].isspace() or text[mark - 1].isspace()
                if is_gap and text[min(said, mark) : max(said, mark)].strip():
                    broken(each.sync, expected=f"{mark} characters said by then", measured=f"{said}")
        if any(letter.isalnum() for letter in text[said:]):
            broken("end", expected="all words told", measured=f"not told: {text[said:]!r}")
        if saying := body.state().speaking:
            broken("end", expected="silence after `end`", measured=f"`speaking` is {saying!r}")

    async def test_closes_its_mouth_with_the_voice(self, body: Body) -> None:
        """Shapes of the lips are in time order, open the mouth while it speaks, and close it as it ends or is cut.

        Usually the last shape is missing, or `on_lips` is not called with nothing when the voice falls silent early.
        """
        self.needs(body, "voice", "speech")
        moved, told = body.on_lips, list[Sequence[MouthShape]]()
        now = asyncio.get_running_loop().time

        def listen(shapes: Sequence[MouthShape]) -> None:
            told.append(tuple(shapes))
            moved(shapes)

        body.on_lips = listen
        for is_cut in (False, True):
            speech = Speech(id="lips", text="one two three four five six seven")
            stage = Stage(body, speech, "end")
            if is_cut:
                await asyncio.sleep(0.8)
                stage.authority.revoke()
            await stage.over()
            self._check_lips(speech, [each for each in told[-1:] if each] if is_cut else told, ended=now())
            told.clear()

    def _check_lips(self, speech: Speech, told: Sequence[Sequence[MouthShape]], ended: Seconds) -> None:
        def is_wrong(expected: str, measured: str) -> NoReturn:
            broken(behavior=speech, expected=expected, measured=measured)

        if told and not any(shape.opening > 0.0 for shapes in told for shape in shapes):
            is_wrong("a mouth that opens while it speaks", "shapes that are all closed")
        for shapes in filter(None, told):
            if any(later.at < earlier.at for earlier, later in pairwise(shapes)):
                is_wrong("shapes of the lips in time order", "one is earlier than one before")
            if shapes[-1].opening > 0.0:
                is_wrong("a last shape that closes the mouth", f"{shapes[-1].opening:.2f} open")
            if (late := shapes[-1].at - ended) > PROMPT + self.tolerance:
                is_wrong("a mouth that is closed by the end", f"{ms(late)} later")
