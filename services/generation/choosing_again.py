"""Knowledge for choosing references again, besides the world as it is: what has left it, what has failed. Pure.

A reference is chosen again when what it was chosen for has changed before its words begin: the object has left or
moved, or the body does not make the gesture. What failed is not tried again.
"""

from collections.abc import Collection, Iterable, Mapping
from typing import TypeGuard

from msgspec.structs import replace

from engage_hri.schemas.behaviors import FragmentBehavior, Reference
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import ReferenceChoice, TurnFragment
from engage_hri.schemas.units import Meters
from engage_hri.schemas.world import Entity, World
from engage_hri.services.generation.acts import Act
from engage_hri.services.generation.names import names
from engage_hri.services.generation.references.motions import Motions

MOVED: Meters = 0.02
"""Distance from which on an object counts as moved: what was chosen for it is looked at again."""


def named_objects(fragment: TurnFragment, world: World) -> dict[str, Entity]:
    """Objects that the fragment refers to, or names as distractors, as they are now."""
    named = {each.id for each in names(fragment) if each.kind == "object"}
    return {each.id: each for each in world.objects if each.id in named}


def remembered(world: World, known: Mapping[str, Entity]) -> World:
    """The world with what it has lost meanwhile, where that was last: a person may well be told of it."""
    present = {each.id for each in world.entities}
    lost = tuple(each for id, each in known.items() if id not in present)
    return replace(world, entities=(*world.entities, *lost)) if lost else world


def barred(
    targets: Iterable[str], world: World, known: Mapping[str, Entity], failed: Mapping[str, Mapping[str, str]]
) -> dict[str, dict[str, str]]:
    """Gestures that are not to be made, with the reason, by target."""
    found = {target: dict(failed.get(target, {})) for target in targets}
    for target, reasons in found.items():
        if world.entity(target) is None and target in known:
            reasons |= dict.fromkeys(("gaze", "point"), f"{target} has left the world")
    return {target: reasons for target, reasons in found.items() if reasons}


def without(motions: Motions, bars: Mapping[str, Mapping[str, str]]) -> Motions:
    """The motions, of which those that are barred cannot be made."""
    gazes = {way: _refused(each, bars, way[1], "gaze") for way, each in motions.gazes.items()}
    points = {way: _refused(each, bars, way[1], "point") for way, each in motions.points.items()}
    return replace(motions, gazes=gazes, points=points)


def _refused(estimate: Estimate, bars: Mapping[str, Mapping[str, str]], target: str, gesture: str) -> Estimate:
    reason = bars.get(target, {}).get(gesture)
    return estimate if reason is None else replace(estimate, feasible=False, fault=Fault(reason=reason), ray=None)


def changed(act: Act, then: World, now: World) -> bool:
    """True if an object of a reference that may be chosen again has moved, left or come back since `then`."""
    for made in act.open_hinges:
        was, is_now = then.entity(made.object), now.entity(made.object)
        if was is None or is_now is None:
            if was is not is_now:
                return True
        elif sum((a - b) ** 2 for a, b in zip(was.position, is_now.position, strict=True)) > MOVED**2:
            return True
    return False


def open_references(fragment: TurnFragment, act: Act) -> TurnFragment:
    """The fragment with nothing but the references that may be chosen again."""
    left = {each.reference for each in act.open_hinges}
    behaviors = tuple(replace(each, timing=(), needs=()) for each in fragment.behaviors if each.id in left)
    return replace(fragment, behaviors=behaviors, constraints=(), unread=())


def first_that_differs(
    act: Act, choices: Collection[ReferenceChoice], bars: Mapping[str, Mapping[str, str]]
) -> tuple[str, ...]:
    """Ids of the gestures of the first reference that would be made otherwise now; none: all is as it was chosen."""
    chosen = {each.reference: each for each in act.plan.choices}
    fresh = {each.reference: each for each in choices}
    for made in act.open_hinges:
        old, new = chosen[made.reference], fresh.get(made.reference)
        if new is None or made.object in bars or (old.gesture, old.phrase) != (new.gesture, new.phrase):
            return made.gestures
    return ()


def with_other_words(fragment: TurnFragment, bars: Mapping[str, Mapping[str, str]]) -> TurnFragment | None:
    """The fragment with phrases of ours for objects with barred gestures; None: it has no others to offer."""

    def is_helpless(behavior: FragmentBehavior) -> TypeGuard[Reference]:
        return isinstance(behavior, Reference) and behavior.target in bars and behavior.options is not None

    if not any(map(is_helpless, fragment.behaviors)):
        return None
    behaviors = tuple(replace(each, options=None) if is_helpless(each) else each for each in fragment.behaviors)
    return replace(fragment, behaviors=behaviors)
