"""A body whose driver may break: what it raises becomes a fault that names it and the place, and nothing else ends.

A driver is somebody's program, and its robot may be unplugged in any call. Each call has its own honest answer then:
an estimate says that it cannot be done, a behavior fails, a measurement tells the last joint angles and no look.
"""

import asyncio
import traceback
from collections.abc import (
    AsyncGenerator,
    AsyncIterator,
    Awaitable,
    Callable,
    Generator,
    Iterator,
    Mapping,
    Sequence,
)
from contextlib import AsyncExitStack, aclosing, asynccontextmanager, contextmanager
from functools import partial
from pathlib import Path
from sysconfig import get_paths
from types import FrameType, coroutine
from typing import Any, TypeVar

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import BodyPose, Estimate, EstimateItem, Ray
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import EngageError, Fault, InputRefused, RunFailed
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import (
    Body,
    BodyFailed,
    BodyState,
    DriverBroken,
    Idle,
    MouthShape,
    MovementAuthority,
    Progress,
    Revoked,
    Seen,
)
from engage_hri.services.control.contract.refusals import infeasible
from engage_hri.services.runtime.steps import Steps

# -- errors and their places -----------------------------------------------------------------------------------------

_PACKAGE = str(Path(__file__).parents[3])
_LIBRARY = tuple(
    str(Path(get_paths()["stdlib"]) / name) for name in ("asyncio", "contextlib.py", "concurrent", "importlib")
)
"""Modules of Python through which errors of tasks and of imports come."""


class Place(Struct, frozen=True):
    """A line of a file."""

    file: str
    line: int


def words_of(error: BaseException) -> str:
    """Say what was raised, on one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())


def place_of(error: BaseException, frames: Sequence[traceback.FrameSummary] = ()) -> Place | None:
    """Find the line of the driver that raised an error; None: it is not known.

    That is the last one outside of this package, of what imports modules and of what runs tasks, if there is one.
    frames: the part of its traceback that counts; none: all of it.
    """
    if isinstance(error, SyntaxError) and error.filename and error.lineno:
        return Place(error.filename, error.lineno)
    every = frames or traceback.extract_tb(error.__traceback__)
    beyond = [each for each in every if not each.filename.startswith(_LIBRARY) and "importlib" not in each.filename]
    own = [each for each in beyond if not each.filename.startswith(_PACKAGE)]
    last = (own or beyond or list(every))[-1:]
    return Place(last[0].filename, last[0].lineno or 0) if last else None


def seen_at(error: BaseException) -> str:
    """Say where to look: `see drivers/pan_tilt.py, line 14`; empty: it is not known."""
    place = place_of(error)
    return f"see {place.file}, line {place.line}" if place else ""


T = TypeVar("T")
BREAKS = (Exception, SystemExit)
"""Errors of a driver. Some SDKs call `sys.exit`."""
STANDSTILL: Seconds = 0.5
"""Seconds for which a call may keep all else of the service from going on: longer ones are told, once a call."""


class GuardedBody(Body):
    """A body as its driver makes it, until that breaks."""

    def __init__(self, name: str, body: Body) -> None:
        """name: of the driver, as it was asked for. body: as the driver has made it."""
        self.name = name
        self.body = body
        self.capabilities = body.capabilities
        self.carries = body.carries  # type: ignore[misc]
        self._last = BodyState(pose=BodyPose(), moving=False)
        self._broken: set[str] = set()
        """Calls that broke when they were made last: each is told once until it works again."""
        self._slow: set[str] = set()
        """Calls that have held everything up."""
        body.on_fault = lambda fault: self.on_fault(fault)
        body.on_recovery = lambda text: self.on_recovery(text)
        body.on_lips = lambda shapes: self.on_lips(shapes)
        body.on_sound = lambda sound: self.on_sound(sound)
        body.wants_sound = lambda: self.wants_sound()
        body.others_say = lambda: self.others_say()

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        async with AsyncExitStack() as stack:
            try:
                await stack.enter_async_context(self.body.connected())
            except EngageError as error:
                raise self._placed(error) from error
            except BREAKS as error:
                raise RunFailed(self._fault(error, "as it connects")) from error
            is_left = False
            try:
                yield
                is_left = True
            finally:
                try:
                    await stack.aclose()
                except BREAKS as error:
                    fault = self._fault(error, "as it leaves" if is_left else "while it is connected")
                    if not is_left:  # a task of its own has ended us
                        raise RunFailed(fault) from error
                    self.on_fault(fault)

    # -- planning -----------------------------------------------------------------------------------------------

    def prepare(self, behaviors: Sequence[BlockBehavior]) -> Awaitable[None] | None:
        awaited = self._asked(lambda: self.body.prepare(behaviors), None, "in `prepare`")
        return None if awaited is None else self._awaited(awaited)

    async def _awaited(self, awaited: Awaitable[None]) -> None:
        try:
            await awaited
        except BREAKS as error:
            self._tell(error, "in `prepare`")

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        try:
            with self._timed("in an estimate"):
                return _of(Estimate, self.body.estimate(behavior, pose, world))
        except BREAKS as error:
            return self._refusal(behavior, error)

    def rehearse(
        self, items: Sequence[EstimateItem], world: World, others: Sequence[EstimateItem] = ()
    ) -> Sequence[Estimate]:
        try:
            return self.body.rehearse(items, world, others)
        except BREAKS as error:
            return [self._refusal(item.behavior, error) for item in items]

    def rehearse_in_steps(
        self, items: Sequence[EstimateItem], world: World, others: Sequence[EstimateItem] = ()
    ) -> Steps[Sequence[Estimate]]:
        try:
            return (yield from self.body.rehearse_in_steps(items, world, others))
        except BREAKS as error:
            if len(items) == 1:
                return [self._refusal(items[0].behavior, error)]
        return [self.estimate(item.behavior, item.pose, world) for item in items]  # not all need to break

    def _refusal(self, behavior: BlockBehavior, error: BaseException) -> Estimate:
        fault = self._fault(error, "in an estimate")
        return infeasible(behavior.id, "CANNOT_CREATE_BEHAVIOR", replace(fault, where=behavior.id))

    # -- motion -------------------------------------------------------------------------------------------------

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        try:
            stream = _of(AsyncGenerator, self.body.perform(behavior, authority))  # type: ignore[type-abstract]
        except BREAKS as error:
            raise DriverBroken(self._fault(error, "as it moves")) from error
        async with aclosing(stream):
            while True:
                try:
                    progress = await self._stepping(anext(stream), "as it moves")
                except StopAsyncIteration:
                    return
                except (EngageError, Revoked):
                    raise
                except (*BREAKS, GeneratorExit) as error:
                    raise DriverBroken(self._fault(error, "as it moves")) from error
                yield progress

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        try:
            await self._stepping(self.body.home(parts), "on the way home")
        except EngageError:
            raise
        except BREAKS as error:
            raise BodyFailed(self._fault(error, "on the way home")) from error

    def see(self, world: World) -> None:
        self._asked(lambda: self.body.see(world), None, "in `see`")

    def move_lips(self, shapes: Sequence[MouthShape]) -> None:
        self._asked(lambda: self.body.move_lips(shapes), None, "in `move_lips`")

    # -- measurements -------------------------------------------------------------------------------------------

    def state(self) -> BodyState:
        unknown = BodyState(pose=self._last.pose, moving=False)
        self._last = self._asked(lambda: _of(BodyState, self.body.state()), unknown, "in `state`")
        return self._last

    def idle(self) -> Idle:
        return self._asked(self.body.idle, Idle(), "in `idle`")

    def seen(self) -> Seen | None:
        return self._asked(self.body.seen, None, "in `seen`")

    def ray_at(self, part: str, pose: BodyPose) -> Ray | None:
        return self._asked(lambda: self.body.ray_at(part, pose), None, "in `ray_at`")

    @property
    def faults(self) -> tuple[BodyFault, ...]:
        return self._asked(lambda: self.body.faults, (), "in `faults`")

    def switch_faults(self, faults: Sequence[BodyFault]) -> None:
        self._refusing(lambda: self.body.switch_faults(faults), "in `switch_faults`")

    def calibrate(self, offsets: Mapping[str, Radians]) -> None:
        self._refusing(lambda: self.body.calibrate(offsets), "in `calibrate`")

    # -- faults -------------------------------------------------------------------------------------------------

    def _asked(self, call: Callable[[], T], otherwise: Any, when: str) -> T:
        try:
            with self._timed(when):
                told = call()
        except BREAKS as error:
            self._tell(error, when)
            return otherwise  # type: ignore[no-any-return]
        self._broken.discard(when)
        return told

    def _refusing(self, call: Callable[[], None], when: str) -> None:
        try:
            call()
        except EngageError:
            raise
        except BREAKS as error:
            raise InputRefused(self._fault(error, when)) from error

    @contextmanager
    def _timed(self, when: str) -> Iterator[None]:
        """Tell once if a call has held everything up, by the loop's clock: virtual time never stands still."""
        began = _now()
        try:
            yield
        finally:
            if (seconds := _now() - began) > STANDSTILL and when not in self._slow:
                self._slow.add(when)
                reason = f"its driver blocks {when}: everything has stood still for {seconds:.1f} s"
                advice = "no method may wait but by await: see docs/control.md"
                self.on_fault(Fault(reason=reason, where=f"body {self.name}", advice=advice, service="control"))

    @coroutine
    def _stepping(self, awaited: Awaitable[T], when: str) -> Generator[Any, Any, T]:
        """Await, and time each step in which others have to wait."""
        steps = awaited.__await__()
        resume: Callable[[], Any] = partial(next, steps)
        while True:
            try:
                with self._timed(when):
                    given = resume()
            except StopIteration as stop:
                return stop.value  # type: ignore[no-any-return]
            try:
                sent = yield given
            except BaseException as error:
                resume = partial(steps.throw, error)
            else:
                resume = partial(steps.send, sent)

    def _tell(self, error: BaseException, when: str) -> None:
        if when not in self._broken:
            self._broken.add(when)
            self.on_fault(self._fault(error, when))

    def _fault(self, error: BaseException, when: str) -> Fault:
        if isinstance(error, EngageError):
            return self._placed(error).fault
        while isinstance(error, BaseExceptionGroup):  # of a task group: all that have failed are there
            error = error.exceptions[0]
        return Fault(
            reason=f"its driver breaks {when}: {words_of(error)}", where=f"body {self.name}",
            advice=seen_at(error), service="control",
        )  # fmt: skip

    def _placed(self, error: EngageError) -> EngageError:
        """The same, saying whose it is where the driver has not said."""
        if not error.fault.where:
            error.fault = replace(error.fault, where=f"body {self.name}", service="control")
            error.args = (str(error.fault),)
        return error


def _of(kind: type[T], told: object) -> T:
    """Pass on what a driver tells, if it is what it is to be. Raises TypeError."""
    if not isinstance(told, kind):
        raise TypeError(f"it returns a {type(told).__name__}, and no {kind.__name__}")
    return told


def _now() -> Seconds:
    try:
        return asyncio.get_running_loop().time()
    except RuntimeError:  # nobody waits
        return 0.0


def held_up(frame: FrameType | None) -> str:
    """Say where the driver is in whose call a signal has come; empty: it came in none."""
    frames: list[FrameType] = []
    while frame is not None:
        frames.append(frame)
        frame = frame.f_back
    if not any(each.f_code.co_filename == __file__ for each in frames):
        return ""
    own = next((each for each in frames if not each.f_code.co_filename.startswith(_PACKAGE)), frames[0])
    return f"a driver's call had not come back: {own.f_code.co_name}, {own.f_code.co_filename}, line {own.f_lineno}"
