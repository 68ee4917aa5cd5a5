"""Holding, continuing and stopping what is performed, on request: the robot, a block, or a behavior.

What is held is kept by its name, for blocks that come later are held as well (`Holds`).
"""

import asyncio
from collections.abc import Iterable, Mapping

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Held, Hold, PerformanceSteered, SteerPerformance, SteerRobot, WarningFeedback
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.perform.performance import BlockPerformance
from engage_hri.services.realizer.points import EPSILON, frozen
from engage_hri.services.realizer.report import ON_REQUEST
from engage_hri.services.realizer.together.live import Ending, Live, absence
from engage_hri.services.realizer.together.live_blocks import LiveBlocks
from engage_hri.services.requests.ends import RequestDesk
from engage_hri.services.runtime.loop import Timer

Named = tuple[str, str]
"""A block and a behavior of it. An empty behavior: the whole block; an empty block: the robot."""


class Holds:
    """Holds by what they hold, each with the time since when."""

    def __init__(self) -> None:
        self._since: dict[Named, Seconds] = {}
        self._holders: dict[Named, set[str]] = {}
        """Those who have asked for each hold."""

    def hold(self, block: str, behavior: str, now: Seconds, by: str = "") -> None:
        """Hold it from now on, if it is not held already. by: who asks for it."""
        self._since.setdefault((block, behavior), now)
        self._holders.setdefault((block, behavior), set()).add(by)

    def let_go(self, block: str, behavior: str, by: str | None = None) -> None:
        """Let go what this names, and all that is part of it. by: only what nobody else has asked for; None: all."""
        for held in [each for each in self._since if _is_part(each, (block, behavior))]:
            if by is None or not self._holders[held] - {by}:
                del self._since[held], self._holders[held]
            else:
                self._holders[held].discard(by)

    def holds(self, block: str, behavior: str) -> bool:
        """True if this itself is held, and not only something around it."""
        return (block, behavior) in self._since

    def of_block(self, block: str) -> frozenset[str] | None:
        """Behaviors of the block that are held; None: all."""
        if ("", "") in self._since or (block, "") in self._since:
            return None
        return frozen(behavior for name, behavior in self._since if name == block)

    @property
    def in_force(self) -> list[tuple[Named, Seconds]]:
        """All holds, each with the time since when, the oldest first."""
        return sorted(self._since.items(), key=lambda each: each[1])

    def around(self, block: str, behavior: str) -> Named | None:
        """The smallest of what is held of which this is a part: it goes on only when that does. None: nothing."""
        named = (block, behavior)
        wholes = [held for held in self._since if held != named and _is_part(named, held)]
        return max(wholes, default=None)

    def earliest(self) -> Seconds | None:
        """Time since when something is held, the longest; None: nothing is."""
        return min(self._since.values(), default=None)

    def expired(self, now: Seconds, longest: Seconds) -> list[Named]:
        """Holds that have been in force for so long: those whose time, begun plus longest, has come."""
        return [held for held, since in self._since.items() if since + longest <= now + EPSILON]


def _is_part(one: Named, whole: Named) -> bool:
    block, behavior = whole
    return not block or (one[0] == block and (not behavior or one[1] == behavior))


class Steering:
    """Takes requests to hold, continue and stop.

    live, performances: live blocks, and those that are being performed, by the id of their request.
    """

    def __init__(
        self,
        bus: Bus,
        desk: RequestDesk,
        config: RealizerConfig,
        live: Mapping[str, Live],
        performances: Mapping[str, BlockPerformance],
        live_blocks: LiveBlocks,
    ) -> None:
        self._bus = bus
        self._desk = desk
        self._longest = config.longest_hold
        self._live = live
        self._performances = performances
        self._live_blocks = live_blocks
        self._holds = Holds()
        self._told: list[tuple[Named, Seconds]] = []
        """What was told last to be held."""
        self._timer = Timer(self._expire)
        self._stopping: set[asyncio.Task[None]] = set()

    async def steer(self, request: SteerPerformance | SteerRobot) -> None:
        """Carry out a request, and answer it."""
        block, behavior = ("", "") if isinstance(request, SteerRobot) else (request.block, request.behavior)
        with self._desk.serving(request):
            concerned = self._concerned(block)
            going_on = any(self.is_going_on(live, behavior) for live in concerned) if behavior else concerned
            if isinstance(request, SteerPerformance) and not (block and going_on):
                nameless = Fault(reason="names no block", advice=f"the whole robot: `steer_robot`, on {keys.ROBOT}")
                self._desk.refuse(request.id, absence(block, behavior, self._live.values()) if block else nameless)
                return
            if request.to == "hold" and behavior and not any(self._can_wait(live, behavior) for live in concerned):
                reason = "nothing of it can wait any more: it has passed its last hold point, and goes on to its end"
                fault = Fault(reason=reason, where=f"{block}: {behavior}", advice="`stop` ends it now")
                self._desk.refuse(request.id, fault)
                return
            self._desk.accept(request.id)
            match request.to:
                case "hold":
                    self._holds.hold(block, behavior, self._bus.now(), request.requester)
                case "continue":
                    is_own = isinstance(request, SteerPerformance) and request.own
                    self._holds.let_go(block, behavior, request.requester if is_own else None)
                case "stop":
                    self._holds.let_go(block, behavior)
                    await self._stop(concerned, behavior, "" if behavior else ON_REQUEST, request.requester)
            self._apply()
            around = self._holds.around(block, behavior) if request.to == "continue" else None
            if around is None and request.to == "continue" and self._holds.holds(block, behavior):
                around = block, behavior
            if around is None:
                self._desk.end(PerformanceSteered(id=request.id, blocks=tuple(live.id for live in concerned)))
            else:
                self._desk.end(PerformanceSteered(id=request.id, held_with="block" if around[0] else "robot"))

    def is_going_on(self, live: Live, behavior: str) -> bool:
        """True if the behavior is performed, or is to be when its block begins."""
        performance = self._performances.get(live.request.id)
        return live.has_yet(behavior) if performance is None else performance.is_going_on(behavior)

    def _can_wait(self, live: Live, behavior: str) -> bool:
        """True if the behavior can still be made to wait."""
        performance = self._performances.get(live.request.id)
        return self.is_going_on(live, behavior) and (performance is None or performance.decisions.can_wait(behavior))

    async def interrupt(self, live: Live, behavior: str, reason: str = "") -> bool:
        """End a behavior that is going on, or take it out if its block has yet to begin.

        Returns once it has ended: True if it came to its end.
        """
        if (performance := self._performances.get(live.request.id)) is not None:
            return await performance.interrupt(behavior, reason)
        live.taken_out[behavior] = reason
        return False

    def tell(self) -> None:
        """Publish what is held now."""
        self._told = self._holds.in_force
        holds = tuple(
            Hold(
                block=block,
                behavior=behavior,
                since=self._bus.stamp(since),
                until=self._bus.stamp(since + self._longest),
            )
            for (block, behavior), since in self._told
        )
        self._bus.publish(keys.HELD, Held(at=self._bus.stamp(), holds=holds))

    def held(self, live: Live) -> frozenset[str] | None:
        """Behaviors of the block that are held now; None: all."""
        return self._holds.of_block(live.id)

    @property
    def is_holding(self) -> bool:
        """True if anything is held."""
        return self._holds.earliest() is not None

    def forget(self, block: str, behavior: str = "") -> None:
        """Let go what was held of a block that has ended, or of a behavior of it. Another block may have its id."""
        if behavior or not self._concerned(block):
            self._holds.let_go(block, behavior)
            self._apply()

    def close(self) -> None:
        """Ring no more."""
        self._timer.set(None)
        for task in self._stopping:
            task.cancel()

    def _concerned(self, block: str) -> list[Live]:
        """Live blocks that this names; empty: all."""
        return [live for live in self._live.values() if block in ("", live.id)]

    def _apply(self) -> None:
        # In the order in which they came: who is tied to another knows when that goes on before it decides itself.
        performed = [(live, self._performances.get(id)) for id, live in self._live.items()]
        for _, performance in performed:
            if performance is not None:
                performance.hold_up(self.is_holding)
        for live, performance in performed:
            if performance is not None:
                performance.hold(self.held(live))
        self._live_blocks.tell_stuck()  # Those that wait for their turn may be held, too.
        since = self._holds.earliest()
        self._timer.set(None if since is None else since + self._longest)
        if self._holds.in_force != self._told:
            self.tell()

    async def _stop(self, concerned: list[Live], behavior: str, reason: str, by: str) -> None:
        if behavior:
            going_on = [live for live in concerned if self.is_going_on(live, behavior)]
            await asyncio.gather(*[self.interrupt(live, behavior, reason) for live in going_on])
            return
        _interrupt(concerned, reason, by)
        if concerned:
            await asyncio.wait([live.ended for live in concerned])

    def _expire(self) -> None:
        """Stop what has been held for too long."""
        reason = f"held for {self._longest:g} s, the longest time (`realizer.longest_hold`)"
        for block, behavior in self._holds.expired(self._bus.now(), self._longest):
            self._holds.let_go(block, behavior)
            if behavior:
                task = asyncio.create_task(
                    self._stop(self._concerned(block), behavior, reason, "realizer"), name=f"stop {behavior}"
                )
                self._stopping.add(task)
                task.add_done_callback(self._stopping.discard)
            else:
                self._warn(block, reason)
                _interrupt(self._concerned(block), reason, "realizer")
        self._apply()

    def _warn(self, block: str, reason: str) -> None:
        """Warn that a block, or all, was held for too long; in order with the other feedback of the block."""
        performed = [each for each in self._performances.values() if block and each.id == block]
        for each in performed:
            each.report.warn("INTERRUPTED", reason)
        if not performed:
            message = reason if block else f"the robot was {reason}: what comes is performed again"
            warning = WarningFeedback(block=block or None, kind="INTERRUPTED", message=message, at=self._bus.stamp())
            self._bus.publish(keys.FEEDBACK, warning)


def _interrupt(concerned: Iterable[Live], reason: str, by: str) -> None:
    for live in concerned:
        live.stop(Ending("interrupted", Fault(reason=reason, where=live.id, cause="cancelled", whose=by)))
