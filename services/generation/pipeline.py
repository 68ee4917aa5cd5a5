"""Plan of a fragment, made in one pure step: phrases are proposed, references are chosen, the block is emitted."""

from collections.abc import Sequence

from msgspec.structs import replace

from engage_hri.schemas.behaviors import Reference
from engage_hri.schemas.body import Capabilities
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.world import World
from engage_hri.services.generation.block.emission import Emission, FragmentPlan
from engage_hri.services.generation.block.ordering import ordered
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.permits import Permits
from engage_hri.services.generation.references.discourse import NO_DISCOURSE, Discourse
from engage_hri.services.generation.references.motions import Motions
from engage_hri.services.generation.references.phrases import proposed
from engage_hri.services.generation.references.policy import Choices, ReferenceScene, choose
from engage_hri.services.generation.references.posture import references_apart
from engage_hri.services.generation.turns.continuation import NO_CONTINUATION, Continuation
from engage_hri.services.generation.turns.policy import TurnPlan, vain_delay


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


def plan(
    fragment: TurnFragment,
    turn: TurnPlan,
    world: World,
    body: Capabilities | None,
    motions: Motions,
    permits: Permits,
    config: GenerationConfig,
    before: Continuation = NO_CONTINUATION,
    discourse: Discourse = NO_DISCOURSE,
) -> FragmentPlan:
    """Plan the block of a checked fragment. Raises RunFailed where a reference cannot be made at all.

    body, motions: needed for references only. before: continuation of the turn's blocks under way. discourse: what
    was referred to before this fragment.
    """
    chosen = Choices()
    order = ordered(fragment.behaviors, fragment.constraints, fragment.id)
    apart = references_apart(order, fragment.constraints, config.words_between)
    made = proposed(references(fragment), world, config, discourse)
    if made.references:
        motions = replace(motions, looks_last=config.profile == "figure-3.3")
        chosen = choose(made.references, _scene(world, body, permits, config), motions, config, apart)
    emitted = Emission(fragment, turn, chosen.choices, config, permits, chosen.hands, before, apart).plan()
    return replace(emitted, warnings=(*vain_delay(fragment), *made.warnings, *chosen.warnings, *emitted.warnings))


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
