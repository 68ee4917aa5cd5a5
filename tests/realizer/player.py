"""Plays a plan without bus, loop or body: the decisions, and behaviors that take the time they are told to."""

import heapq
from collections.abc import Callable

from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.decide.decisions import Begin, Decisions, Extend
from engage_hri.services.realizer.plan.plan import Plan


class Player:
    """slow: how many times longer than estimated a behavior takes. after_each: called after each decision."""

    def __init__(
        self,
        plan: Plan,
        slow: Callable[[str], float] = lambda id: 1.0,
        after_each: Callable[[Decisions], None] = lambda authority: None,
    ) -> None:
        self.decisions = Decisions(plan, 0.0, RealizerConfig(stall=1e6))
        self.now = 0.0
        self.asked = 0
        self._plan = plan
        self._slow = slow
        self._after_each = after_each
        self._next: dict[str, int] = {}
        self._through: dict[str, int] = {}
        self._waiting: set[str] = set()
        self._coming: list[tuple[float, int, str]] = []
        self._count = 0

    def play(self) -> float:
        """To the end; returns how long it took."""
        while not self.decisions.net.is_over:
            while self._decide():
                pass
            if self.decisions.net.is_over:
                break
            deadline = self.decisions.deadline
            if self._coming and (deadline is None or self._coming[0][0] <= deadline):
                self.now, _, behavior = heapq.heappop(self._coming)
                self._come(behavior)
            else:
                assert deadline is not None, "everybody waits for everybody"
                self.now = max(self.now, deadline)
        return self.now

    def _decide(self) -> bool:
        """Whether that made new facts at once."""
        is_news = False
        self.asked += 1
        for effect in self.decisions.advance(self.now):
            if isinstance(effect, Begin | Extend):
                points = [point.sync for point in self._plan.chains[effect.behavior].points]
                self._through[effect.behavior] = points.index(effect.through)
                if isinstance(effect, Begin):
                    self._next[effect.behavior] = 0
                    self._come(effect.behavior)
                    is_news = True
                elif effect.behavior in self._waiting:
                    self._waiting.discard(effect.behavior)
                    self._come(effect.behavior)
                    is_news = True
        self._after_each(self.decisions)
        return is_news

    def _come(self, behavior: str) -> None:
        chain, number = self._plan.chains[behavior], self._next[behavior]
        point = chain.points[number]
        member = self.decisions.net.part_of[point]
        if member.kind == "hold" and self._through[behavior] < chain.points.index(member.point):
            self._waiting.add(behavior)
            self.decisions.arrive(member.point, self.now)
            return
        self.decisions.reach(point, self.now)
        self._next[behavior] = number + 1
        if number + 1 < len(chain.points):
            self._count += 1
            due = self.now + chain.segments[number].natural * self._slow(behavior)
            heapq.heappush(self._coming, (due, self._count, behavior))
