"""A manager performs while holders of keys send too much: no fragment is lost, and the router names who it was.

A small share of `python -m tests.rigs.attacker`, which measures as well.
"""

import time
from pathlib import Path

import pytest

from tests.rigs.attacker.trial import NOBODY, Siege, attacked

pytestmark = pytest.mark.real_time


async def test_no_fragment_is_lost_to_messages_that_are_too_large_and_their_sender_is_named(tmp_path: Path) -> None:
    with Siege(tmp_path) as siege:
        async with siege.manager() as robot:
            calm = await siege.perform(robot, time.monotonic() + 60, fragments=1)
            attacks = [
                await attacked(siege, robot, role, attack, 3.0)
                for role, attack in (
                    ("observer", "one-byte-more"), ("manager", "huge"), (NOBODY, "huge"),
                )
            ]  # fmt: skip
            # Who has stolen a service's key can fill the router (decision 0166): it is told, and it passes.
            await attacked(siege, robot, "generation", "ghosts", 3.0)
            siege.router.expect("robot/generation/generation has more than", "a service of the robot keeps its links")
            after = await siege.perform(robot, time.monotonic() + 60, fragments=3)
            environment = siege.environment
    assert not calm.lost
    for one in attacks:
        assert (one.role, one.performed.lost) == (one.role, [])
        assert one.performed.seconds
    assert b"MALLOC_ARENA_MAX=2" in environment, "floods of questions leave holes in every heap"
    assert after.seconds, after.lost
    _, huge, stranger = attacks
    assert any(line.startswith("loud: robot/manager/mallory sends") for line in huge.told), huge.told
    assert stranger.times == 0
    assert any("refused a link" in line for line in stranger.told), stranger.told


async def test_no_fragment_is_lost_to_a_stranger_on_a_robot_that_is_open_to_all(tmp_path: Path) -> None:
    with Siege(tmp_path, has_keys=False) as siege:
        async with siege.manager() as robot:
            attacks = [await attacked(siege, robot, NOBODY, each, 3.0) for each in ("one-byte-more", "huge")]
    for one in attacks:
        assert one.times > 0
        assert (one.attack, one.performed.lost) == (one.attack, [])
        assert one.performed.seconds
