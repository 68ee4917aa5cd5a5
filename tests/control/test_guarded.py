"""A driver that breaks in any call: what comes of it, and that each fault names the driver and the place."""

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Gaze
from engage_hri.schemas.body import BodyPose, Estimate, EstimateItem, JointAngle
from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.world import World
from engage_hri.services.control.bases.composed import Member, composed
from engage_hri.services.control.bases.driver_guard import GuardedBody
from engage_hri.services.control.contract.body import (
    BehaviorRefused,
    BodyFailed,
    BodyState,
    DriverBroken,
    Idle,
    MovementAuthority,
    Progress,
    Reached,
)
from engage_hri.services.runtime.steps import finished
from tests.control.test_drivers import Bare

WORLD = World(entities=())
LOOK = Gaze(id="look", target="cup")
THERE = BodyState(pose=BodyPose(joints=(JointAngle("neck", 0.5),)), moving=True, looking_at="cup", speaking="word")
QUIET = ("see", "move_lips", "idle", "seen", "ray_at", "state", "faults")
"""Calls that go on with less where they break, and tell it."""


class Slow(Bare):
    """A driver in whose calls the loop stands still. A clock of virtual time does not, so it is moved by hand."""

    def __init__(self, loop: asyncio.AbstractEventLoop, seconds: float) -> None:
        super().__init__()
        self.loop, self.seconds, self.late = loop, seconds, 0.0
        self.time, loop.time = loop.time, lambda: self.time() + self.late  # type: ignore[method-assign]

    def block(self) -> None:
        self.late += self.seconds

    def state(self) -> BodyState:
        self.block()
        return THERE

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        await asyncio.sleep(5.0)
        yield Reached("start", 0.0, 0.0)
        await asyncio.sleep(5.0)
        self.block()
        yield Reached("end", 0.0, 0.0)


class Breaking(Bare):
    """A driver that raises in the calls that are named in `at`."""

    def __init__(self, *at: str, error: type[Exception] = OSError) -> None:
        super().__init__()
        self.at, self.error, self.went = set(at), error, list[str]()

    def _call(self, name: str) -> None:
        self.went.append(name)
        if name in self.at:
            raise self.error("the port vanished")

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        self._call("open")
        async with asyncio.TaskGroup() as tasks:
            if "task" in self.at:
                tasks.create_task(self._task())
            yield
        self._call("close")

    async def _task(self) -> None:
        await asyncio.sleep(1.0)
        self._call("task")

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        self._call(behavior.id)
        return Estimate(behavior=behavior.id, feasible=True)

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        yield Reached("start", 0.0, 0.0)
        self._call("perform")

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        self._call("home")

    def state(self) -> BodyState:
        self._call("state")
        return THERE

    def see(self, world: World) -> None:
        self._call("see")

    def move_lips(self, shapes: Any) -> None:
        self._call("move_lips")

    def idle(self) -> Idle:
        self._call("idle")
        return Idle(added={"neck": 0.1})

    def seen(self) -> None:
        self._call("seen")

    def ray_at(self, part: str, pose: BodyPose) -> None:
        self._call("ray_at")

    @property
    def faults(self) -> tuple[()]:
        self._call("faults")
        return ()

    def switch_faults(self, faults: Any) -> None:
        self._call("switch_faults")

    def calibrate(self, offsets: Any) -> None:
        self._call("calibrate")


def guarded(*at: str, error: type[Exception] = OSError) -> tuple[GuardedBody, Breaking, list[Fault]]:
    driver, told = Breaking(*at, error=error), list[Fault]()
    body = GuardedBody("mine.py:Mine", driver)
    body.on_fault = told.append
    return body, driver, told


def is_named(fault: Fault, when: str) -> bool:
    return (
        fault.reason == f"its driver breaks {when}: OSError: the port vanished"
        and fault.where == "body mine.py:Mine"
        and fault.advice.startswith(f"see {__file__}, line ")
    )


def call(body: GuardedBody, name: str) -> object:
    arguments = {"see": (WORLD,), "move_lips": ((),), "ray_at": ("head", BodyPose())}.get(name, ())
    found = getattr(body, name)
    return found if name == "faults" else found(*arguments)


@pytest.mark.parametrize("name", QUIET)
async def test_a_call_that_breaks_is_told_once_until_it_works_again(name: str):
    body, driver, told = guarded(name)
    for _ in range(3):
        call(body, name)
    driver.at.clear()
    call(body, name)
    driver.at.add(name)
    call(body, name)

    assert [is_named(each, f"in `{name}`") for each in told] == [True, True]


async def test_a_body_that_cannot_be_measured_is_where_it_was_and_looks_at_nothing():
    body, driver, _ = guarded()
    assert body.state() == THERE
    driver.at.add("state")

    assert body.state() == BodyState(pose=THERE.pose, moving=False)
    assert body.idle().added == {"neck": 0.1}


async def test_an_estimate_that_breaks_says_so_and_the_others_are_told():
    body, _, told = guarded("bad")
    items = [EstimateItem(behavior=Gaze(id=id, target="cup")) for id in ("good", "bad", "fine")]
    each = finished(body.rehearse_in_steps(items, WORLD))

    assert [it.feasible for it in each] == [True, False, True]
    assert each[1].fault is not None
    assert (each[1].fault.where, each[1].warning) == ("bad", "CANNOT_CREATE_BEHAVIOR")
    assert each[1].fault.reason == "its driver breaks in an estimate: OSError: the port vanished"
    assert each == [body.estimate(item.behavior, None, WORLD) for item in items]
    assert told == []


async def test_a_behavior_that_breaks_has_failed_after_what_it_told():
    body, _, _ = guarded("perform", "home")
    progress: list[Progress] = []

    async def perform() -> None:
        async for each in body.perform(LOOK, MovementAuthority(LOOK, "end")):
            progress.append(each)

    with pytest.raises(DriverBroken) as failed:
        await perform()
    with pytest.raises(BodyFailed) as stuck:
        await body.home()

    assert progress == [Reached("start", 0.0, 0.0)]
    assert is_named(failed.value.fault, "as it moves")
    assert is_named(stuck.value.fault, "on the way home")


@pytest.mark.parametrize("error", [SystemExit, GeneratorExit, asyncio.TimeoutError])
async def test_it_breaks_by_whatever_it_raises(error: type[Exception]):
    body, _, _ = guarded("perform", error=error)
    with pytest.raises(DriverBroken, match=f"its driver breaks as it moves: {error.__name__}: the port vanished"):
        async for _ in body.perform(LOOK, MovementAuthority(LOOK, "end")):
            pass


@pytest.mark.parametrize("made", [None, 3])
async def test_what_is_no_stream_no_state_and_no_estimate_breaks_as_well(made: Any):
    body, driver, told = guarded()
    driver.perform = lambda behavior, authority: made  # type: ignore[method-assign]
    driver.state = driver.estimate = lambda *_: made  # type: ignore[assignment, method-assign]
    with pytest.raises(DriverBroken, match="its driver breaks as it moves: TypeError"):
        async for _ in body.perform(LOOK, MovementAuthority(LOOK, "end")):
            pass

    assert body.state() == BodyState(pose=BodyPose(), moving=False)
    assert [each.reason for each in told] == [
        f"its driver breaks in `state`: TypeError: it returns a {type(made).__name__}, and no BodyState"
    ]
    assert not body.estimate(LOOK, None, WORLD).feasible


@pytest.mark.parametrize("error", [BehaviorRefused, BodyFailed])
async def test_what_a_driver_says_on_purpose_stays_as_it_is(error: type[Exception]):
    body, _, _ = guarded("perform", error=error)
    with pytest.raises(error, match=r"^the port vanished$"):
        async for _ in body.perform(LOOK, MovementAuthority(LOOK, "end")):
            pass


@pytest.mark.parametrize("name", ["switch_faults", "calibrate"])
async def test_a_setting_that_breaks_is_refused(name: str):
    body, _, _ = guarded(name)
    with pytest.raises(InputRefused) as refused:
        getattr(body, name)(())

    assert is_named(refused.value.fault, f"in `{name}`")


@pytest.mark.parametrize(
    ("at", "when"), [("open", "as it connects"), ("task", "while it is connected"), ("close", "as it leaves")]
)
async def test_a_connection_that_breaks_ends_the_run_and_one_that_is_left_does_not(at: str, when: str):
    body, _, told = guarded(at)

    async def stay() -> None:
        async with body.connected():
            await asyncio.sleep(2.0)

    if at == "close":
        await stay()
    else:
        with pytest.raises(RunFailed) as failed:
            await stay()
        told.append(failed.value.fault)

    assert [is_named(each, when) for each in told] == [True]


async def test_a_driver_that_says_it_cannot_be_had_is_named():
    body, _, _ = guarded("open", error=RunFailed)
    with pytest.raises(RunFailed, match=r"^body mine\.py:Mine: the port vanished$"):
        async with body.connected():
            pass


async def test_a_driver_that_breaks_keeps_no_other_from_going_home():
    broken, driver, _ = guarded("home")
    other = Breaking()
    other.capabilities = replace(other.capabilities, parts=("left_arm",))
    body = composed([Member("mine", broken, ("head",)), Member("other", other, ("left_arm",))])
    with pytest.raises(BodyFailed):
        await body.home()

    assert (driver.went, other.went) == (["home"], ["home"])


@pytest.mark.parametrize(("seconds", "told"), [(0.4, []), (0.6, ["as it moves", "in `state`"])])
async def test_a_call_in_which_everything_stands_still_is_told_once_and_awaiting_is_none(
    seconds: float, told: list[str]
):
    loop = asyncio.get_running_loop()
    slow = Slow(loop, seconds)
    guarded, faults = GuardedBody("slow", slow), list[Fault]()
    guarded.on_fault = faults.append
    for _ in range(2):
        passed = [each async for each in guarded.perform(LOOK, MovementAuthority(LOOK, "end"))]
        assert guarded.state() is THERE
    del loop.time

    assert len(passed) == 2
    said = "everything has stood still for 0.6 s (no method may wait but by await: see docs/control.md)"
    assert [str(fault) for fault in faults] == [f"body slow: its driver blocks {when}: {said}" for when in told]
