"""A plan of a block: what its planning comes to (see planner.py)."""

from collections.abc import Iterable, Mapping
from functools import cached_property

from msgspec import Struct

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import PetriNet
from engage_hri.services.realizer.plan.handover import Turn
from engage_hri.services.realizer.plan.known import BLOCK_END, is_foreign
from engage_hri.services.realizer.plan.manner import AT_EASE, Late, Manner
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.promises import Broken
from engage_hri.services.realizer.plan.relations import Problem, Relations
from engage_hri.services.realizer.points import Member, Point


class Plan(Struct, frozen=True, kw_only=True, dict=True):
    """A planned block.

    schedule: of each transition of the net, seconds from the block's start, if all goes as estimated.
    block: with a hand for each gesture that must use a certain one. critical: the transitions that make the block as
    long as it is, from first to last.
    kept: for each behavior, the last point that it must pass itself. Who takes its part, in whatever block, may save
    it the rest.
    entering: behaviors in the order in which they take their parts: of two that begin at one instant, too.
    rounds: for each behavior, how many events of the instant in which it begins are measured before it, in a row.
    turns: behaviors that wait for a point of another before they take its part. holders: behaviors of other blocks
    that are waited for in this way, with their parts.
    behaviors: those that will be performed, in document order. dropped: those that will not, with `problems`.
    natural: behaviors that end when something takes their place, or with the block.
    waited_for: behaviors that the end of the block waits for. given_up: for each speech that lacks a time it should
    have, what the block said, with the warning.
    untied: points of other blocks that are not waited for, though the block names them: there is no time for it.
    relations: what the block says of these behaviors. broken: what of that the plan cannot keep, since times are
    fixed, another block has passed a point already, or the body cannot hurry so.
    manner: see there. late: bounds that the plan misses, though all that can hurry for them does.
    constrained: points that something waits for, or that are timed.
    successors: behaviors that hand their parts over, each with the one that takes them (`block:behavior` of another
    block), and the first of its points that comes by that. takes: behaviors of other blocks whose parts are taken.
    """

    block: Block
    behaviors: tuple[BlockBehavior, ...]
    net: PetriNet
    at: Mapping[Point, int]
    members: tuple[tuple[Member, ...], ...]
    schedule: tuple[Seconds, ...]
    chains: Mapping[str, Chain]
    estimates: Mapping[str, Estimate]
    natural: frozenset[str]
    required: frozenset[str]
    waited_for: frozenset[str]
    kept: Mapping[str, Point]
    entering: tuple[str, ...]
    relations: Relations
    rounds: Mapping[str, int] = {}
    turns: frozenset[Turn] = frozenset()
    manner: Manner = AT_EASE
    late: Late = {}
    holders: Mapping[str, tuple[str, ...]] = {}
    untied: frozenset[Point] = frozenset()
    broken: tuple[Broken, ...] = ()
    constrained: frozenset[Point] = frozenset()
    successors: Mapping[str, tuple[str, Point]] = {}
    takes: Mapping[str, str] = {}
    critical: tuple[int, ...] = ()
    dropped: tuple[str, ...] = ()
    given_up: Mapping[str, Mapping[str, Problem]] = {}
    problems: tuple[Problem, ...] = ()

    def predicted(self, point: Point) -> Seconds:
        """Seconds from the block's start to the point, if all goes as estimated."""
        return self.schedule[self.at[point]]

    @property
    def lateness(self) -> Seconds:
        """Most seconds by which the plan misses what the block says, as the body cannot hurry so."""
        return max(self.late.values(), default=0.0)

    @property
    def times(self) -> dict[Point, Seconds]:
        """Seconds from the block's start to each point, if all goes as estimated."""
        return {point: self.schedule[at] for point, at in self.at.items()}

    def begun_in_order(self, behaviors: Iterable[str]) -> list[str]:
        """Behaviors that begin at one instant in the order in which they are told: who waits for no measured event of
        that instant first, then as they take parts, and a torso first, since head and arms aim for where that is
        going to be."""
        rank = {
            id: (self.rounds.get(id, 0), "torso" not in self.chains[id].parts, number)
            for number, id in enumerate(self.entering)
        }
        return sorted(behaviors, key=rank.__getitem__)

    def transition(self, point: Point) -> int | None:
        """The transition of a point as other blocks may name it: the end of the block has one, too."""
        return len(self.net.transitions) - 1 if point == BLOCK_END else self.at.get(point)

    @cached_property
    def foreign(self) -> tuple[Point, ...]:
        """Points of other blocks that this one is tied to, or waits for."""
        return tuple([point for point in self.at if is_foreign(point.behavior)])

    def parts(self, behavior: str) -> set[str]:
        """Parts of the body that a behavior uses, by its estimate."""
        estimate = self.estimates.get(behavior)
        return set(estimate.parts) if estimate is not None else set()
