"""Holds of one performance: what of it is held, and which points of other blocks are stuck.

A point is stuck if it does not come before what is held goes on.
"""

from collections.abc import Callable, Collection, Set
from contextlib import AbstractContextManager
from typing import Protocol

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.decide.decisions import Decisions
from engage_hri.services.realizer.decide.effects import Effect
from engage_hri.services.realizer.points import Point, frozen
from engage_hri.services.realizer.report.feedback import Reporter
from engage_hri.services.realizer.together.live_blocks import LiveBlocks
from engage_hri.services.realizer.together.ties import Ties


class Holdable(Protocol):
    """A performance, as far as it can be held."""

    report: Reporter
    decisions: Decisions
    ties: Ties

    @property
    def is_ending(self) -> bool:
        """True if its behaviors are being ended, whatever was planned."""

    @property
    def has_begun(self) -> bool:
        """True if its behaviors may begin."""

    def take_in(self, news: Callable[[], object]) -> None:
        """Take in news and do what follows from it, unless the block is ending."""

    def containing(self) -> AbstractContextManager[object]:
        """Contain exceptions in the body of `with`: they end this block, and no other."""

    def apply(self, effect: Effect) -> bool:
        """Carry out one decision; True if there is more to be decided then."""


class HeldBlock:
    """Holds of one performance. is_holding: whether something is held, perhaps of another block."""

    def __init__(
        self, owner: Holdable, live_blocks: LiveBlocks, behaviors: Collection[str] | None, *, is_holding: bool
    ) -> None:
        """behaviors: those that are held as it begins; None: all."""
        self._owner = owner
        self._live_blocks = live_blocks
        self._behaviors = behaviors
        self._stuck: Set[Point] = frozen()
        """Points of other blocks that do not come before what is held goes on."""
        self._standing: Set[Point] = frozen()
        """Those of them that come no nearer either."""
        self.is_holding = is_holding

    @property
    def _now(self) -> Seconds:
        return self._owner.report.now()

    def can_wait(self, behavior: str) -> bool:
        """True if the behavior, which is going on, can still be made to wait somewhere."""
        return not self._owner.has_begun or self._owner.decisions.can_wait(behavior)

    def begin(self) -> None:
        """Hold what is held as the block begins."""
        if self.is_holding:
            self._owner.decisions.hold_up(True, self._now)
            self._carry_out()

    def names(self, behavior: str) -> bool:
        """True if this behavior is held, not just the whole block."""
        return self._behaviors is not None and behavior in self._behaviors

    def hold_up(self, is_holding: bool) -> None:
        """Note that something is held from now on, perhaps of another block, or nothing any more."""
        if is_holding != self.is_holding:
            self.is_holding = is_holding
            if self._owner.has_begun:  # Otherwise it is noted as it begins.
                self._owner.decisions.hold_up(is_holding, self._now)

    def hold(self, behaviors: Collection[str] | None) -> None:
        """Hold these behaviors, and no others, from now on. None: all of them."""
        if behaviors != self._behaviors:
            self._behaviors = behaviors
            self._renew()

    def stick(self, elsewhere: Set[Point], standing: Set[Point]) -> None:
        """Take the news which points of other blocks are stuck; those that it is tied to count."""
        named = self._owner.ties.foreign
        if (elsewhere & named, standing & named) != (self._stuck, self._standing):
            self._stuck, self._standing = elsewhere & named, standing & named
            self._renew()

    def stuck(self, elsewhere: Set[Point], standing: Set[Point]) -> Set[Point]:
        """Points that others are tied to and that are stuck. elsewhere: points of other blocks that are."""
        return self._found(lambda: self._owner.decisions.stuck(elsewhere, standing))

    def running(self, elsewhere: Set[Point], running: Set[Point]) -> Set[Point]:
        """Points that others are tied to and that come nearer. running: those of others that do."""
        return self._found(lambda: self._owner.decisions.running(elsewhere, running))

    def _found(self, points: Callable[[], Set[Point]]) -> Set[Point]:
        found = set[Point]()
        if not self._owner.is_ending:
            with self._owner.containing():
                found.update(points())
        return found

    def tell(self) -> None:
        """Tell other blocks what is stuck, if anything is held."""
        if self.is_holding:
            self._live_blocks.tell_stuck()

    def _renew(self) -> None:
        if self._owner.has_begun:  # Otherwise it is held as it begins.
            self._owner.take_in(self._carry_out)

    def _carry_out(self) -> None:
        for effect in self._owner.decisions.hold(self._behaviors, self._now, self._stuck, self._standing):
            self._owner.apply(effect)
