"""Plan of a fragment, pure: phrases are proposed, the body is asked, references are chosen, the block is emitted.

The body is asked what it is able to, and what the motions that references need would cost. Whoever asks is a
generator, which yields the question and is sent the answer. All between two questions is done in one go: to choose
for ten references among a hundred objects takes 8 ms (decision 0262).
"""

from collections.abc import Callable, Generator, Sequence
from contextlib import suppress
from typing import Any, TypeVar

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import BlockBehavior, Hand, Reference
from engage_hri.schemas.body import Capabilities, DescribeBody, Estimate, EstimateBehaviors, EstimateItem, Estimates
from engage_hri.schemas.faults import EngageError, Fault, RunFailed
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.world import World
from engage_hri.services.generation.block.emission import Emission, FragmentPlan
from engage_hri.services.generation.block.ordering import ordered
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.exchange import Question
from engage_hri.services.generation.inhibitions import Permits
from engage_hri.services.generation.references.motions import (
    Motions,
    distinct,
    from_here,
    from_here_told,
    last_motions,
    onward,
    onward_told,
    pose_after,
)
from engage_hri.services.generation.references.pairs import ReferenceScene
from engage_hri.services.generation.references.phrases import NO_DISCOURSE, Discourse, proposed
from engage_hri.services.generation.references.policy import Choices, choice, references_apart, unasked, weigh
from engage_hri.services.generation.turns.continuation import NO_CONTINUATION, Continuation
from engage_hri.services.generation.turns.plan import TurnPlan, in_vain

WORDS_BETWEEN = 3.0
"""Words of plain speech between two references over which head and arm stay at the first one's target; after more
they have gone home. Decision 0024; the number is ours."""
T = TypeVar("T")
Asking = Generator[Question, Any, T]
"""Work that asks the body: it yields questions, and is sent the answers."""


def references(fragment: TurnFragment) -> tuple[Reference, ...]:
    """The fragment's references in the order in which they are made (decision B12)."""
    order = ordered(fragment.behaviors, fragment.constraints, fragment.id)
    return tuple(behavior for behavior in order if isinstance(behavior, Reference))


def targets(fragment: TurnFragment) -> Sequence[str]:
    """Targets of the fragment's references, in order: the body is asked for motions to them."""
    return [reference.target for reference in references(fragment)]


def glance(fragment: TurnFragment, turn: TurnPlan, config: GenerationConfig) -> str:
    """The person looked at after each of the fragment's points but the last; "": nobody."""
    return turn.addressee if config.profile == "check-back" and len(references(fragment)) > 1 else ""


def planning(
    fragment: TurnFragment,
    turn: TurnPlan,
    world: World,
    body: Capabilities | None,
    motions: Motions,
    permits: Permits,
    config: GenerationConfig,
    before: Continuation = NO_CONTINUATION,
    discourse: Discourse = NO_DISCOURSE,
) -> Asking[FragmentPlan]:
    """Plan the block of a checked fragment. Raises RunFailed where a reference cannot be made at all.

    body, motions: needed for references only; at least those motions that start where the body is. before:
    continuation of the turn's blocks under way. discourse: what was referred to before this fragment.
    """
    chosen = Choices()
    order = ordered(fragment.behaviors, fragment.constraints, fragment.id)
    apart = references_apart(order, fragment.constraints, WORDS_BETWEEN)
    made = proposed([each for each in order if isinstance(each, Reference)], world, discourse)
    if made.references:
        motions = replace(motions, looks_last=config.profile == "figure-3.3")
        scene = _scene(world, body, permits, config)
        tables = weigh(made.references, scene, motions, config)
        while ways := unasked(tables, motions, config, apart):
            answers = yield from _estimates(onward(ways, motions, permits.only_hand))
            motions = onward_told(ways, motions, answers)
        chosen = choice(tables, scene, motions, config, apart)
    emitted = Emission(fragment, turn, chosen.choices, config, permits, chosen.hands, before, apart).plan()
    return replace(emitted, warnings=(*in_vain(fragment, turn), *made.warnings, *chosen.warnings, *emitted.warnings))


def planned(
    planning: Asking[FragmentPlan], answers: Callable[[tuple[EstimateItem, ...]], Sequence[Estimate]]
) -> FragmentPlan:
    """The plan, where the body answers at once. answers: asks it."""
    told: Estimates | None = None
    while True:
        try:
            asked = planning.send(told)
        except StopIteration as end:
            plan: FragmentPlan = end.value
            return plan
        assert isinstance(asked, EstimateBehaviors)
        told = Estimates(items=tuple(answers(asked.items)))


def _scene(world: World, body: Capabilities | None, permits: Permits, config: GenerationConfig) -> ReferenceScene:
    said = body or Capabilities(body="unknown", types=(), parts=())
    return ReferenceScene(
        world=world,
        half_angle=config.gaze_half_angle or said.gaze_half_angle,
        pointing_radius=config.pointing_radius or said.pointing_radius,
        zones=said.no_point_zones,
        no_gaze=permits.no_gaze,
        no_point=permits.no_point,
    )


class BodyLink:
    """Generation's knowledge of the body. capabilities: what it last said of itself; None: that is not known yet."""

    def __init__(self) -> None:
        self.capabilities: Capabilities | None = None
        self._is_asked = False

    def forget(self) -> None:
        """Forget the body: another one may come."""
        self.capabilities, self._is_asked = None, False

    def described(self) -> Asking[Capabilities | None]:
        """Ask the body what it can, once; one that fails to say it is not asked again. None: that is not known."""
        if not self._is_asked and self.capabilities is None:
            self._is_asked = True
            with suppress(EngageError):
                yield from self._describe()
        return self.capabilities

    def _describe(self) -> Asking[None]:
        described = yield DescribeBody()
        if isinstance(described, Capabilities):
            self.capabilities = described

    def motions(
        self, sequence: Sequence[str], hand: Hand | None, moving: Sequence[BlockBehavior] = (), glance: str = ""
    ) -> Asking[Motions]:
        """Costs, rays and poses of a look and a point at each target of the `sequence`, from where the body is.

        hand: the only one allowed; None: either. moving: gazes and points under way, in order; they will be on target
        before the references begin. glance: see `Motions`.
        """
        if not sequence:
            return Motions({})
        if self.capabilities is None:
            yield from self._describe()
        last = last_motions(moving)
        pose = pose_after(last, (yield from _estimates(last)))
        each = distinct(sequence)
        return from_here_told(each, (yield from _estimates(from_here(each, hand, pose, glance))), glance)


def _estimates(items: tuple[EstimateItem, ...]) -> Asking[tuple[Estimate, ...]]:
    if not items:
        return ()
    answer = yield EstimateBehaviors(items=items)
    if not isinstance(answer, Estimates) or len(answer.items) != len(items):
        raise RunFailed(Fault(reason="the body's estimates do not fit the question", where=keys.ESTIMATE))
    return answer.items
