"""The realizer and the simulated body together, whatever goes wrong: a block ends once, the body ends safe.

And no stop that nobody asked for: joint speed under 1 % of its peak between start and end, outside a hold.
"""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from itertools import groupby
from operator import itemgetter

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import Struct, field

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gaze, Gesture, Mark, Pointing, Speech
from engage_hri.schemas.blocks import (
    Block,
    BlockOutcome,
    BlockProgress,
    PerformBlock,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.config import ControlConfig, Displaced, Slow, Stall, Variability
from engage_hri.services.control.service import embody
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.requests.ends import Pending, Requester, RequestRefused
from engage_hri.services.runtime.service import running
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.random_cases import share_of
from tests.realizer.stage import block, together
from tests.realizer.test_properties import blocks

WORLD = World(
    entities=(
        Entity(id="human", kind="person", position=(1.3, 0.0, 1.2)),
        Entity(id="a", kind="object", position=(0.55, 0.15, 0.73), radius=0.03),
        Entity(id="b", kind="object", position=(0.50, -0.20, 0.73), radius=0.03),
    )
)
STEP = 0.01


class Robot(Struct):
    """Everything seen of it. speeds: of what each behavior moves, over time."""

    body: SimulatedBody
    bus: Bus
    requests: Requester
    first: dict[str, float]
    feedback: list[object] = field(default_factory=list)
    speeds: dict[str, list[tuple[float, float]]] = field(default_factory=dict)

    def ask(self, block: Block) -> Pending:
        return self.requests.send(keys.BLOCK, PerformBlock(id=f"r-{block.id}", requester="test", block=block))

    async def perform(self, block: Block) -> BlockOutcome | None:
        try:
            outcome = await asyncio.wait_for(self.ask(block).outcome, 300.0)
        except RequestRefused:
            return None
        assert isinstance(outcome, BlockOutcome)
        return outcome

    def times(self) -> dict[str, SyncPointProgress]:
        return {f"{e.behavior}:{e.sync}": e for e in self.feedback if isinstance(e, SyncPointProgress)}

    def ends(self) -> list[BlockProgress]:
        return [each for each in self.feedback if isinstance(each, BlockProgress) and each.progress == "end"]

    def kinds(self) -> list[str]:
        return [each.kind for each in self.feedback if isinstance(each, WarningFeedback)]

    def away_from_home(self) -> dict[str, float]:
        """Joints of the arms that are not where they belong, nor where they were in the beginning."""
        home, here = angles(SimulatedBody()), angles(self.body)
        return {
            joint: angle
            for joint, angle in here.items()
            if joint.startswith(("left", "right"))
            and min(abs(angle - home[joint]), abs(angle - self.first[joint])) > 0.01
        }

    def sample(self) -> None:
        now = asyncio.get_running_loop().time()
        for run in set(self.body.moves.runs.values()):
            joints = np.concatenate([self.body.moves.tracks[part].at(now).v for part in run.course.parts])
            self.speeds.setdefault(run.behavior.id, []).append((now, float(np.linalg.norm(joints))))

    def unnecessary_stops(self) -> list[str]:
        """Instants at which a behavior stood still that need not have."""
        found, times = [], self.times()
        for behavior, samples in self.speeds.items():
            progress = [each for each in times.values() if each.behavior == behavior]
            began = {each.sync: each.at.seconds for each in progress}
            if "end" not in began:
                continue
            holds = [
                (each.at.seconds - each.time + each.arrived, each.at.seconds) for each in progress if each.arrived
            ]
            peak = max(speed for _, speed in samples)
            if peak < 1e-3:
                continue
            inside = [each for each in samples if began["start"] <= each[0] <= began["end"]]
            marked = [(at, speed < 0.01 * peak) for at, speed in inside]
            moving = [number for number, (_, is_slow) in enumerate(marked) if not is_slow]
            # It sets off from rest and comes to rest in the end: what counts is in between.
            for is_slow, group in groupby(marked[moving[0] : moving[-1]], itemgetter(1)):
                times_slow = [at for at, _ in group]
                first, last = times_slow[0] - STEP, times_slow[-1] + STEP
                if is_slow and not any(since <= last and first <= until for since, until in holds):
                    found.append(f"{behavior} at {times_slow[0]:.2f}")
        return found


def angles(body: SimulatedBody) -> dict[str, float]:
    return {angle.joint: angle.angle for angle in body.state().pose.joints}


@asynccontextmanager
async def robot(variability: Variability, *, watched: bool = False) -> AsyncIterator[Robot]:
    async with MemoryHub() as hub:
        eyes, bus = hub.join("simulation"), hub.join("test")
        eyes.publish(keys.WORLD, WORLD)
        body = SimulatedBody(deviations=variability)
        services = {
            "control": partial(embody, config=ControlConfig(variability=variability), body=body),
            "realizer": partial(realize, config=RealizerConfig()),
        }
        async with running(hub, services), Requester(bus) as requests:
            seen = Robot(body, bus, requests, angles(body))
            tasks = [asyncio.create_task(_listen(seen), name="feedback")]
            if watched:
                tasks.append(asyncio.create_task(_watch(seen), name="joints"))
            try:
                yield seen
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
        await bus.leave()
        await eyes.leave()


async def _listen(seen: Robot) -> None:
    with seen.bus.subscribe(keys.FEEDBACK) as inbox:
        async for received in inbox:
            seen.feedback.append(received.message)


async def _watch(seen: Robot) -> None:
    while True:
        seen.sample()
        await asyncio.sleep(STEP)


PARTS = ("head", "left_arm", "right_arm")
FAULTS = st.builds(
    Variability,
    seed=st.integers(0, 1000),
    noise=st.sampled_from((0.0, 0.1, 0.3)),
    slow=st.lists(
        st.builds(Slow, part=st.sampled_from((*PARTS, "voice")), factor=st.sampled_from((0.7, 1.5, 4.0))), max_size=2
    ).map(tuple),
    stall=st.lists(
        st.builds(
            Stall,
            part=st.sampled_from(PARTS),
            before=st.sampled_from(("ready", "stroke", "stroke_end", "relax", "end")),
            seconds=st.sampled_from((0.5, 3.0, None)),
        ),
        max_size=2,
    ).map(tuple),
    displaced=st.sampled_from(((), (Displaced(joint="right_shoulder_pitch", angle=20.0),))),
    overheated=st.sampled_from(((), (), ("left_arm",), ("head",))),
    mute=st.sampled_from(("", "", "silent", "refuse")),
    lost=st.sampled_from((0.0, 0.0, 0.2)),
)


@settings(max_examples=share_of(40), deadline=None)
@given(blocks(), FAULTS, st.sampled_from((None, None, 0.4, 1.3)))
def test_whatever_fails_the_block_ends_once_and_the_arms_are_home(
    example: Block, faults: Variability, cancelled: float | None
) -> None:
    async def main() -> None:
        async with robot(faults) as seen:
            asked = seen.ask(example)
            if cancelled is not None:
                await asyncio.sleep(cancelled)
                seen.requests.cancel(f"r-{example.id}")
            try:
                outcome = await asyncio.wait_for(asked.outcome, 300.0)
            except RequestRefused:
                outcome = None
            await asyncio.sleep(10.0)

            assert len(seen.ends()) == (outcome is not None)
            assert seen.away_from_home() == {}
            assert not seen.body.state().moving
            assert seen.body.moves.runs == {}
        assert asyncio.all_tasks() == {asyncio.current_task()}

    run_virtual(main())


@settings(max_examples=share_of(20), deadline=None)
@given(
    blocks(),
    st.sampled_from(
        (Variability(), Variability(noise=0.2, seed=3), Variability(slow=(Slow(part="right_arm", factor=2.0),)))
    ),
)
def test_nothing_stops_that_was_not_asked_to(example: Block, variability: Variability) -> None:
    async def main() -> None:
        async with robot(variability, watched=True) as seen:
            await seen.perform(example)

            assert seen.unnecessary_stops() == []

    run_virtual(main())


async def test_the_counter_sees_a_stop() -> None:
    stalled = Variability(stall=(Stall(part="right_arm", before="stroke", seconds=1.0),))
    async with robot(stalled, watched=True) as seen:
        await seen.perform(block((Gesture(id="g", lexeme="BEAT", mode="RIGHT_HAND"),)))

        assert seen.unnecessary_stops()


async def test_an_exact_body_meets_a_word_with_its_stroke() -> None:
    story = Speech(id="s", text="Well, take this piece", marks=(Mark("m", 11),))
    async with robot(Variability()) as seen:
        await seen.perform(block((Pointing(id="p", target="b"), story), together("p:stroke", "s:m")))

    times = seen.times()
    assert abs(times["p:stroke"].time - times["s:m"].time) < 1e-6
    assert seen.kinds() == []


async def test_a_gesture_with_a_fixed_duration_is_faster_or_slower() -> None:
    for end in (1.6, 2.2, 6.0):
        async with robot(Variability(), watched=True) as seen:
            beat = Gesture(id="g", lexeme="BEAT", mode="RIGHT_HAND")
            await seen.perform(block((beat,), together("g:start", "0"), together("g:end", str(end))))

            assert abs(seen.times()["g:end"].time - end) < 0.03, end
            assert seen.kinds() == []
            assert seen.unnecessary_stops() == []


async def test_a_gaze_is_on_target_when_it_is_due() -> None:
    async with robot(Variability()) as seen:
        await seen.perform(block((Gaze(id="g", target="a"),), together("g:start", "0"), together("g:stroke", "1")))

    assert abs(seen.times()["g:stroke"].time - 1.0) < 0.03
    assert seen.kinds() == []
