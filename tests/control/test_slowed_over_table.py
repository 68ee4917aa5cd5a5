"""Gestures that are slowed to be on time, and a trunk that leans meanwhile: no arm comes into the table.

The witness works out elbows and hands from the joint angles by matrices of its own, every 5 ms.
"""

import asyncio
import math
from collections.abc import Iterator
from contextlib import suppress
from random import Random

import numpy as np
import pytest
from numpy.typing import NDArray

from engage_hri.schemas.behaviors import BlockBehavior, Gesture, Hand, Pointing, Posture, PostureShift
from engage_hri.schemas.units import Meters
from engage_hri.services.control.contract.body import BehaviorRefused, Body, Reached
from engage_hri.services.control.figure.kinematics import TABLE_EDGE, TABLE_TOP
from engage_hri.services.control.figure.repertoire import BUILT_IN, extended
from engage_hri.services.control.testing import WORLD, Stage
from engage_hri.services.control.torso.body import SimulatedBody
from tests.random_cases import share_of

Array = NDArray[np.float64]
HANDS: tuple[Hand, ...] = ("LEFT_HAND", "RIGHT_HAND", "BOTH_HANDS")
HIP = np.array((0.0, 0.0, 0.6))
LOW = (
    """
[pose]
LEAN = { torso = { lean = 14.7, turn = 3.85 } }
[gesture.LOW]
ready = { inward = 2.66, forward = 5.31, elbow = 89.79 }
stroke = { inward = 4.33, forward = 2.04, elbow = 90.95 }
stroke_end = { inward = 10.66, forward = 5.31, elbow = 87.15 }
""",
    """
[pose]
LEAN = { torso = { lean = 12.37, turn = 8.03 } }
[gesture.LOW]
ready = { inward = 11.51, forward = 16.95, elbow = 77.94 }
stroke = { inward = 15.22, forward = 16.02, elbow = 71.6 }
stroke_end = { inward = 19.51, forward = 16.95, elbow = 76.61 }
""",
)
"""Gestures 2 to 6 cm above the table of an upright trunk, as a search among 500 of them has found them."""
DEEP_OPEN = """
[pose]
DEEP_OPEN = { torso = { lean = 25 }, arms = { inward = -40, forward = -32, elbow = 95 } }
"""
OPENED = [
    (Gesture(id="past", lexeme="PAST", mode="LEFT_HAND"), ("stroke_start", 4.840256511804471), Posture, 0.5446733),
    (Gesture(id="beat", lexeme="BEAT", mode="RIGHT_HAND"), ("stroke_end", 5.084611030870445), Posture, 0.3122555),
]


def about(axis: str, angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    rows = ((c, 0, s), (0, 1, 0), (-s, 0, c)) if axis == "y" else ((c, -s, 0), (s, c, 0), (0, 0, 1))
    return np.array(rows, dtype=np.float64)


def forearms(pose: dict[str, float]) -> Iterator[tuple[Array, Array]]:
    """Elbow and hand of each arm."""
    trunk = about("z", pose["torso_turn"]) @ about("y", pose["torso_lean"])
    for side, y in (("left", 0.2), ("right", -0.2)):
        yaw, pitch = about("z", pose[f"{side}_shoulder_yaw"]), pose[f"{side}_shoulder_pitch"]
        elbow = np.array((0.0, y, 0.95)) - HIP + yaw @ about("y", -pitch) @ (0.0, 0.0, -0.2)
        hand = elbow + yaw @ about("y", -pitch - pose[f"{side}_elbow"]) @ (0.0, 0.0, -0.25)
        yield HIP + trunk @ elbow, HIP + trunk @ hand


def lowest(pose: dict[str, float]) -> Meters:
    """Metres by which forearms are above the table top where they are over the table; infinite: nowhere."""
    points = [elbow + t * (hand - elbow) for elbow, hand in forearms(pose) for t in np.linspace(0.0, 1.0, 26)]
    return min((float(z) - TABLE_TOP for x, _, z in points if x > TABLE_EDGE), default=math.inf)


class Witness:
    """The lowest place of the forearms of a body while it is watched."""

    def __init__(self, body: Body) -> None:
        self.lowest = math.inf
        self._body = body
        self._task = asyncio.create_task(self._watch())

    async def _watch(self) -> None:
        while True:
            pose = {each.joint: each.angle for each in self._body.state().pose.joints}
            self.lowest = min(self.lowest, lowest(pose))
            await asyncio.sleep(0.005)

    def end(self) -> None:
        self._task.cancel()


async def scene(text: str, gesture: Gesture, pace: tuple[str, float], lean: BlockBehavior, at: float) -> Meters:
    """Begin a lean then, and return the lowest place of the forearms.

    pace: a sync point of the gesture, and the instant for which it is asked; negative: so long after the lean began.
    """
    body = SimulatedBody(repertoire=extended(BUILT_IN, [("low.toml", text)]))
    body.see(WORLD)
    witness, loop, (sync, due) = Witness(body), asyncio.get_running_loop(), pace
    stage = Stage(body, gesture, "end")
    if due > 0.0:
        stage.authority.set_pace({sync: due})
    await asyncio.sleep(at)
    leaning = Stage(body, lean, "end")
    if due < 0.0:
        await asyncio.sleep(0.0)
        stage.authority.set_pace({sync: loop.time() - due})
    for each in (stage, leaning):
        with suppress(BehaviorRefused):
            await each.over()
    await asyncio.sleep(0.5)
    witness.end()
    return witness.lowest


@pytest.mark.parametrize("sync", ["ready", "stroke", "stroke_end"])
@pytest.mark.parametrize("at", [0.7248213, 0.6, 0.9][: share_of(3, 3)])
@pytest.mark.parametrize("text", LOW, ids=["near", "far"])
async def test_an_arm_is_not_slowed_into_the_table_while_the_trunk_leans(text: str, at: float, sync: str) -> None:
    gesture = Gesture(id="low", lexeme="LOW", mode="BOTH_HANDS")

    assert await scene(text, gesture, (sync, -5.7), PostureShift(id="lean", lexeme="LEAN"), at) > 0.0


@pytest.mark.parametrize("seed", range(share_of(10)))
async def test_a_gesture_that_is_slow_already_stays_out_of_the_table_as_the_trunk_leans(seed: int) -> None:
    chance = Random(f"slow already {seed}")
    gesture = Gesture(id="low", lexeme="LOW", mode=chance.choice(HANDS))
    pace = (chance.choice(("ready", "stroke_start", "stroke", "stroke_end", "relax")), chance.uniform(3.0, 9.0))
    at = chance.uniform(0.2, 0.97) * pace[1]

    assert await scene(LOW[seed % 2], gesture, pace, PostureShift(id="lean", lexeme="LEAN"), at) > 0.0


@pytest.mark.parametrize("at", [0.1, 0.0, 0.3][: share_of(3, 3)])
async def test_an_arm_on_its_way_home_from_a_target_takes_a_pace_while_the_trunk_leans(at: float) -> None:
    body = SimulatedBody()
    body.see(WORLD)
    witness, stage = Witness(body), Stage(body, Pointing(id="point", target="far-left"), "stroke")
    await stage.holding(2)
    leaning = Stage(body, Posture(id="lean", lexeme="LEAN_FORWARD"), "end")
    await asyncio.sleep(at)
    stage.authority.extend("end")
    await stage.until(lambda: "stroke_end" in stage.passed)
    due = asyncio.get_running_loop().time() + 3.0
    stage.authority.set_pace({"end": due})
    told = await stage.over()
    await leaning.over()
    witness.end()

    assert isinstance(told[-1], Reached)
    assert told[-1].at == pytest.approx(due)
    assert witness.lowest > 0.0


@pytest.mark.parametrize(("gesture", "pace", "kind", "at"), OPENED)
async def test_a_posture_that_takes_a_slow_gesture_over_stays_out_of_the_table(
    gesture: Gesture, pace: tuple[str, float], kind: type[Posture | PostureShift], at: float
) -> None:
    assert await scene(DEEP_OPEN, gesture, pace, kind(id="open", lexeme="DEEP_OPEN"), at) > 0.0
