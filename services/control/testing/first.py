"""The first look at a body: what it is, and whether it can be judged at all. Each type of behavior is tried once.

What breaks here would break each law that needs it, with minutes of waiting and words of other things. So it is told
once, and the laws are judged without it.
"""

import asyncio
import math
import time
from collections.abc import Callable, Mapping, Sequence
from statistics import median

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Speech, Wait
from engage_hri.schemas.body import Capabilities, Estimate
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.testing.findings import cause_of
from engage_hri.services.control.testing.laws import (
    NEVER_ENDS,
    NOTHING_MOVES,
    WRONG_UNIT,
    angles,
    degrees,
    listed,
    named,
    turned,
)
from engage_hri.services.control.testing.report import Cause, by_words
from engage_hri.services.control.testing.stage import LOOK_EVERY, PATIENCE, Connection, Stage
from engage_hri.services.control.testing.suite import STILL

LOOKS = 20
"""Estimates whose time is taken."""
BEYOND = 3.0
"""Readings that are so many times beyond the range of a joint have the wrong unit: degrees are 57 times radians."""
SLACK: Seconds = 5.0
"""Seconds that a behavior may take here in addition to three times what it said."""


class FirstLook(Struct, frozen=True, kw_only=True):
    """Abilities of a body, and what it cannot be judged by.

    asked: behaviors that it is asked for. not_asked: those that it cannot do, in words, with the reason. estimate:
    median time that one estimate took. causes: what breaks already here. unable: for types of behaviors that laws
    are not to ask for, the words of that. is_there: false if it cannot be connected, so that no law can be judged.
    """

    capabilities: Capabilities
    asked: tuple[BlockBehavior, ...] = ()
    not_asked: tuple[str, ...] = ()
    estimate: Seconds = 0.0
    causes: tuple[Cause, ...] = ()
    unable: Mapping[str, str] = {}
    is_there: bool = True


async def look(
    make: Callable[[], Body], world: World, behaviors: Sequence[BlockBehavior], noise: Radians
) -> FirstLook:
    """Connect a body, ask it about the behaviors, and let it perform one of each type.

    Raises EngageError if it cannot be had.
    """
    body = make()
    connection = Connection(body)
    try:
        await connection.enter()
    except EngageError:
        raise
    except Exception as error:
        able = getattr(body, "capabilities", Capabilities(body="", types=(), parts=()))
        return FirstLook(capabilities=able, causes=(Cause(what=cause_of(error)),), is_there=False)
    try:
        return await _Looking(body, world, noise).look(behaviors)
    finally:
        await Stage.end_all()
        await connection.leave()


class _Looking:
    def __init__(self, body: Body, world: World, noise: Radians) -> None:
        self._body, self._world, self._noise = body, world, noise
        self._wrong: dict[str, str] = {}
        """What is wrong with behaviors, both in words."""
        self._unable: dict[str, str] = {}
        self._estimates: dict[str, Estimate] = {}
        """By the ids of the behaviors."""
        self._moved: dict[str, bool] = {}
        """Whether a joint has moved in behaviors that have joints; in words."""
        self._farthest: dict[str, Radians] = {}
        """The farthest from zero that each joint was read."""

    async def look(self, behaviors: Sequence[BlockBehavior]) -> FirstLook:
        self._note("", lambda: self._body.see(self._world))
        not_asked = []
        for behavior in behaviors:
            if type_name(behavior) not in self._body.capabilities.types:
                continue
            estimate = self._estimated(behavior)
            if estimate is not None and not estimate.feasible:
                not_asked.append(f"{named(behavior)}: {estimate.fault.reason if estimate.fault else 'not feasible'}")
        asked = [each for each in behaviors if (told := self._estimates.get(each.id)) and told.feasible]
        took = self._timed(asked)
        if asked:
            await self._go_home()
        for behavior in {type_name(each): each for each in reversed(asked)}.values():
            if type_name(behavior) not in self._unable:
                await self._try(behavior)
        return FirstLook(
            capabilities=self._body.capabilities, asked=tuple(asked), not_asked=tuple(not_asked), estimate=took,
            causes=self._causes(asked), unable=self._unable,
        )  # fmt: skip

    def _note(self, behavior: BlockBehavior | str, call: Callable[[], object]) -> None:
        """Make a call of the driver; what it raises is noted."""
        try:
            call()
        except Exception as error:
            self._is_wrong(behavior, cause_of(error))

    def _is_wrong(self, behavior: BlockBehavior | str, what: str) -> None:
        if isinstance(behavior, str):
            self._wrong[behavior] = what
        else:
            self._wrong[named(behavior)] = self._unable[type_name(behavior)] = what

    def _estimated(self, behavior: BlockBehavior) -> Estimate | None:
        try:
            estimate = self._estimates[behavior.id] = self._body.estimate(behavior, None, self._world)
        except Exception as error:
            self._is_wrong(behavior, cause_of(error))
            return None
        return estimate

    def _timed(self, asked: Sequence[BlockBehavior]) -> Seconds:
        times = []
        for number in range(LOOKS if asked else 0):
            since = time.perf_counter()
            self._estimated(asked[number % len(asked)])
            times.append(time.perf_counter() - since)
        return median(times) if times else 0.0

    async def _go_home(self) -> None:
        try:
            async with asyncio.timeout(PATIENCE):
                await self._body.home()
        except TimeoutError:
            pass  # that is for the laws of `home` to say, and takes nothing from the others
        except Exception as error:
            self._is_wrong("home", cause_of(error))

    async def _try(self, behavior: BlockBehavior) -> None:
        """Perform a behavior, and note whether it ends, and whether something moves."""
        takes = sum(phase.natural for phase in self._estimates[behavior.id].phases)
        until = asyncio.get_running_loop().time() + 3.0 * takes + SLACK
        stage = Stage(self._body, behavior, "end")
        is_moved = False
        try:
            before = angles(self._body.state().pose)
            while not stage.task.done() and asyncio.get_running_loop().time() < until:
                await asyncio.sleep(LOOK_EVERY)
                now = angles(self._body.state().pose)
                self._farthest = {each: max(abs(now[each]), self._farthest.get(each, 0.0)) for each in now}
                away = turned(now, before)
                is_moved = is_moved or away > 5 * STILL + 12.0 * self._noise
            if stage.task.done():
                stage.task.result()
            else:
                self._is_wrong(behavior, f"{NEVER_ENDS}, having passed {listed(stage.passed)}")
        except Exception as error:
            self._is_wrong(behavior, cause_of(error))
        if takes > LOOK_EVERY and not isinstance(behavior, Speech | Wait):
            self._moved[named(behavior)] = is_moved
        await Stage.end_all()

    def _causes(self, asked: Sequence[BlockBehavior]) -> tuple[Cause, ...]:
        """Put together what is wrong. That nothing moves is the cause of all else that is wrong with joints."""
        is_still = bool(self._body.capabilities.joints) and not any(self._moved.values())
        if is_still and (unmoved := {each for each in self._moved if self._has_ended(each)}):
            what = f"{NOTHING_MOVES}: none of its joints has turned in {listed(self._moved)}"
            kinds = {type_name(behavior) for behavior in asked if named(behavior) in unmoved}
            self._unable |= dict.fromkeys(kinds, what)
            self._wrong |= dict.fromkeys(unmoved, what)
        if unit := self._wrong_unit():
            self._unable = dict.fromkeys(map(type_name, asked), unit)
            self._wrong = dict.fromkeys(map(named, asked), unit)
        causes = by_words(self._wrong)
        return tuple(replace(cause, behaviors=tuple(filter(None, cause.behaviors))) for cause in causes)

    def _wrong_unit(self) -> str:
        """Say of readings far beyond the range of their joint that they may be degrees; empty: there are none."""
        for limit in self._body.capabilities.joints:
            read = self._farthest.get(limit.joint, 0.0)
            if read > max(math.pi, BEYOND * max(abs(limit.low), abs(limit.high))):
                goes = f"it goes from {degrees(limit.low)} to {degrees(limit.high)}"
                return f"{WRONG_UNIT} {limit.joint} was read at {degrees(read)}, and {goes}"
        return ""

    def _has_ended(self, behavior: str) -> bool:
        """True if a behavior has ended or failed by itself, so that its joints are to blame."""
        return behavior not in self._wrong or self._wrong[behavior].startswith("it failed")
