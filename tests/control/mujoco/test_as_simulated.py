"""The healthy torso with physics passes the points that the simulated one does, whatever is asked of it."""

import asyncio
from random import Random

import pytest

pytest.importorskip("mujoco", reason="needs the extra `mujoco`")

from engage_hri.schemas.behaviors import BlockBehavior, FaceLexeme, Gaze, Gesture, Hand, Head, Pointing, PostureShift
from engage_hri.services.control.contract.body import BehaviorRefused, Body
from engage_hri.services.control.mujoco.body import MujocoBody
from engage_hri.services.control.testing import WORLD, Stage
from engage_hri.services.control.torso.body import SimulatedBody

HANDS: tuple[Hand, ...] = ("LEFT_HAND", "RIGHT_HAND", "BOTH_HANDS")
APART = 2.0
"""Seconds between two behaviors that take the same part: the physics may be late by less."""


def plan(seed: int) -> list[tuple[float, BlockBehavior]]:
    """Behaviors with the times at which they begin; none takes a part from another."""
    chance, at, begun = Random(f"as simulated {seed}"), 0.0, []
    for number in range(12):
        at += chance.choice((0.0, chance.uniform(0.1, 0.6), APART))
        id = str(number)
        begun.append(
            (
                at,
                chance.choice(
                    (
                        Gaze(id=id, target=chance.choice(("human", "near-right"))),
                        Gesture(id=id, lexeme="BEAT", mode=chance.choice(HANDS)),
                        Gesture(id=id, lexeme="BEAT", mode=chance.choice(HANDS)),
                        Pointing(id=id, target="far-left", mode="LEFT_HAND"),
                        Head(id=id, lexeme="NOD"),
                        FaceLexeme(id=id, lexeme="SMILE"),
                        PostureShift(id=id, lexeme=chance.choice(("LEAN_FORWARD", "LEAN_FORWARD", "UPRIGHT"))),
                    )
                ),
            )
        )
    free: dict[str, float] = {}
    kept: list[tuple[float, BlockBehavior]] = []
    for at, behavior in begun:
        hand = getattr(behavior, "mode", None)
        parts = ["left", "right"] if hand == "BOTH_HANDS" else [hand[:4].lower().rstrip("_")] if hand else []
        parts = parts or [type(behavior).__name__]
        if all(free.get(part, -1.0) <= at for part in parts):
            kept.append((at, behavior))
            free |= dict.fromkeys(parts, at + 2 * APART)
    return kept


async def passed(body: Body, begins: list[tuple[float, BlockBehavior]]) -> dict[str, list[str]]:
    """The points that each behavior has passed. Raises BodyFailed."""
    body.see(WORLD)
    loop, stages = asyncio.get_running_loop(), []
    since = loop.time()
    for at, behavior in begins:
        await asyncio.sleep(since + at - loop.time())
        stages.append((behavior.id, Stage(body, behavior, "end")))
    told = {}
    for id, stage in stages:
        try:
            await stage.over()
        except BehaviorRefused as refused:
            told[id] = [str(refused)]
        else:
            told[id] = stage.passed
    await body.home()
    return told


@pytest.mark.parametrize("seed", range(8))
async def test_points_are_those_of_the_simulated_torso(seed: int) -> None:
    begins = plan(seed)
    simulated = await passed(SimulatedBody(), begins)
    assert await passed(MujocoBody(), begins) == simulated
    assert all(told[-1] == "end" for told in simulated.values())
    assert len(simulated) > 4
