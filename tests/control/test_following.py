"""Looks and pointing arms follow what they are on, and say that they are on it where it is, not where it was.

The witness takes where the eyes and the forearm point from the body, and where the target is from the world it gave.
"""

import asyncio
from collections.abc import Callable
from random import Random

import pytest

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Pointing
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.bases.drivers import made
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import Body, BodyFailed, Progress
from engage_hri.services.control.testing import Stage
from engage_hri.services.control.testing.findings import aside, beside
from tests.random_cases import share_of

POINTED, LOOKED = 0.05, 0.05
"""Metres by which a forearm may pass its target, as capabilities say, and radians by which eyes may look beside."""
PLACE = {"human": (1.3, 0.0, 1.2), "cup": (0.5, 0.2, 0.73)}
LOOK, POINT = Gaze(id="look", target="human"), Pointing(id="point", target="cup", mode="LEFT_HAND")


def world(**moved: tuple[float, float, float] | None) -> World:
    """Where things are; None: nowhere."""
    places = {**PLACE, **moved}
    kinds = {"human": "person", "cup": "object"}
    return World(
        entities=tuple(
            Entity(id=name, kind=kinds[name], position=place, radius=0.03)  # type: ignore[arg-type]
            for name, place in places.items()
            if place is not None
        )
    )


def by(name: str, way: float) -> dict[str, tuple[float, float, float]]:
    x, y, z = PLACE[name]
    return {name: (x, y + way, z)}


class Seeing(Stage):
    """A stage that notes how far beside its target the body is as it says that it is on it."""

    def __init__(self, body: Body, behavior: Gaze | Pointing, through: str) -> None:
        self.off: dict[str, float] = {}
        self._target = behavior.target
        self.seen = world()
        self._seer: Callable[[World], None] = body.see
        super().__init__(body, behavior, through)

    def see(self, seen: World) -> None:
        self.seen = seen
        self._seer(seen)

    def hear(self, progress: Progress) -> None:
        entity, state = self.seen.entity(self._target), self._body.state()
        sync = getattr(progress, "sync", "")
        if entity is None or sync not in ("stroke", "stroke_end"):
            return
        if self._target == "cup":
            assert state.left_arm is not None
            self.off[f"{type(progress).__name__} {sync}"] = beside(state.left_arm, entity.position)
        elif sync == "stroke":
            assert state.gaze is not None
            self.off[f"{type(progress).__name__} {sync}"] = aside(state.gaze, entity.position)

    @property
    def untrue(self) -> dict[str, float]:
        allowed = POINTED if self._target == "cup" else LOOKED
        return {told: off for told, off in self.off.items() if off > allowed}


def new(name: str) -> Body:
    if name == "mujoco":
        pytest.importorskip("mujoco")
    body = made(ControlConfig(body=name))
    body.see(world())
    return body


@pytest.mark.parametrize("name", ["simulated", "mujoco"])
@pytest.mark.parametrize("way", [0.02, 0.05, 0.3])
@pytest.mark.parametrize("behavior", [LOOK, POINT], ids=["look", "point"])
@pytest.mark.parametrize("later", [0.05, 0.3, 0.7, 1.5])
async def test_what_moves_is_followed_and_told_where_it_is(
    name: str, way: float, behavior: Gaze | Pointing, later: float
) -> None:
    body = new(name)
    stage = Seeing(body, behavior, "stroke")
    await asyncio.sleep(later)
    stage.see(world(**by(behavior.target, way)))
    await asyncio.sleep(1.5)
    stage.authority.extend("end")
    await stage.over()

    assert stage.passed[-1] == "end"
    assert stage.untrue == {}


@pytest.mark.parametrize("name", ["simulated", "mujoco"])
@pytest.mark.parametrize("behavior", [LOOK, POINT], ids=["look", "point"])
async def test_authority_that_comes_with_the_move_waits_until_it_is_followed(
    name: str, behavior: Gaze | Pointing
) -> None:
    body = new(name)
    stage = Seeing(body, behavior, "stroke" if behavior is POINT else "stroke_start")
    await asyncio.sleep(2.0)
    stage.off.clear()
    stage.see(world(**by(behavior.target, 0.3)))
    stage.authority.extend("end")
    await stage.over()

    assert stage.passed[-1] == "end"
    assert stage.off != {}
    assert stage.untrue == {}


@pytest.mark.parametrize("name", ["simulated", "mujoco"])
async def test_a_look_that_waits_on_someone_who_walks_can_leave(name: str) -> None:
    """0.5 m/s, seen 20 times a second."""
    body = new(name)
    stage = Seeing(body, LOOK, "stroke_start")
    for step in range(60):
        await asyncio.sleep(0.05)
        stage.see(world(**by("human", 0.025 * step)))
        if step == 40:
            stage.authority.extend("end")
    await stage.over()

    assert stage.passed[-1] == "end"
    assert stage.untrue == {}


@pytest.mark.parametrize("later", [0.1, 2.0])
async def test_a_pointing_whose_target_has_gone_out_of_reach_fails_and_says_nothing_untrue(later: float) -> None:
    stage = Seeing(new("simulated"), POINT, "stroke")
    await asyncio.sleep(later)
    stage.see(world(cup=(2.6, 0.2, 0.73)))
    await asyncio.sleep(1.0)
    stage.authority.extend("end")
    with pytest.raises(BodyFailed, match="out of reach"):
        await stage.over()
    assert stage.passed[-1] == ("stroke_start" if later < 1.0 else "stroke")


async def test_what_is_seen_no_more_was_last_seen_there() -> None:
    stage = Seeing(new("simulated"), POINT, "stroke")
    await asyncio.sleep(0.1)
    stage.see(world(cup=None))
    stage.authority.extend("end")
    await stage.over()
    assert stage.passed[-1] == "end"


@pytest.mark.parametrize("seed", range(share_of(12)))
async def test_nothing_untrue_is_told_whatever_moves_when(seed: int) -> None:
    chance, body = Random(f"follow {seed}"), new("simulated")
    at = dict.fromkeys(PLACE, 0.0)
    stages: list[Seeing] = []
    for number in range(30):
        await asyncio.sleep(chance.choice((0.0, chance.uniform(0.0, 0.3), chance.uniform(0.0, 1.2))))
        live = [each for each in stages if not each.task.done()]
        act = chance.choice(("begin", "move", "move", "extend")) if live else "begin"
        if act == "begin":
            kind: type[BlockBehavior] = chance.choice((Gaze, Pointing))
            behavior = Gaze(id=f"{number}", target="human")
            pointing = Pointing(id=f"{number}", target="cup", mode="LEFT_HAND")
            stage = Seeing(body, behavior if kind is Gaze else pointing, chance.choice(("start", "stroke", "end")))
            stage.seen = world(**by("human", at["human"]), **by("cup", at["cup"]))
            stages.append(stage)
        elif act == "move":
            at[chance.choice(tuple(at))] = chance.uniform(-0.2, 0.2)
            seen = world(**by("human", at["human"]), **by("cup", at["cup"]))
            body.see(seen)
            for stage in stages:
                stage.seen = seen
        else:
            chance.choice(live).authority.extend("end")
    for stage in stages:
        stage.authority.extend("end")
        await stage.over()
    assert [stage.untrue for stage in stages if stage.untrue] == []
    assert sum(len(stage.off) for stage in stages) > 3
