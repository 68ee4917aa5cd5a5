"""Acts of a fragment: its blocks, one after the other, what really came of each, and what is chosen again. Pure.

A fragment has one block, unless a reference is chosen again. That happens when what it was chosen for has changed
before its words begin: the object has left or moved, or the body does not make the gesture. Then the block ends where
the reference would have begun, and another one of the same name goes on from there; what failed is not tried again.
What is told of a fragment is computed from sync points, words and decided events. Nothing of it is read from what was
chosen.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import zip_longest
from typing import Literal, TypeGuard

from msgspec import Struct, field
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Behavior, Event, FragmentBehavior, Reference, Speech, Timing
from engage_hri.schemas.blocks import BlockOutcome, SpokenText
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import ReferenceChoice, ReferenceMade, TurnFragment
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.references import SyncRef
from engage_hri.schemas.text import has_words
from engage_hri.schemas.units import Meters
from engage_hri.schemas.world import Entity, World
from engage_hri.services.generation.block.emission import FragmentPlan
from engage_hri.services.generation.block.parts import Made
from engage_hri.services.generation.fragment_check import names
from engage_hri.services.generation.references.motions import Motions
from engage_hri.services.generation.turns.plan import TurnPlan
from engage_hri.services.text.ear import is_spoken, said

DECIDED = ("succeeded", "completed", "failed")
"""States of an event that a person has decided, for good or not."""


class Act(Struct):
    """One block of a fragment. reached: sync points that came. heard: characters that the voice has told of."""

    plan: FragmentPlan
    reached: set[tuple[str, str]] = field(default_factory=set)
    spoken: tuple[SpokenText, ...] = ()
    heard: dict[str, int] = field(default_factory=dict)

    def came(self, behavior: str, sync: str) -> bool:
        return (behavior, sync) in self.reached

    @property
    def said_so_far(self) -> tuple[SpokenText, ...]:
        """Words that came, as far as sync points and the voice tell: for want of the block's outcome."""
        speeches = [each for each in self.plan.block.behaviors if isinstance(each, Speech)]
        told = [
            (each, len(each.text) if self.came(each.id, "end") else self.heard.get(each.id, 0)) for each in speeches
        ]
        return tuple(
            SpokenText(behavior=each.id, text=each.text[:count], complete=count >= len(each.text))
            for each, count in told
            if count
        )

    @property
    def words(self) -> tuple[SpokenText, ...]:
        """Words that were spoken, without what is for the eye in a text."""
        texts = {each.id: each.text for each in self.plan.block.behaviors if isinstance(each, Speech)}
        return tuple(
            replace(each, text=said(text, len(each.text)))
            if (text := texts.get(each.behavior, "")).startswith(each.text)
            else each
            for each in self.spoken
        )

    @property
    def open_hinges(self) -> tuple[Made, ...]:
        """References that may still be chosen again: of their phrases nothing has been said."""
        return tuple(each for each in self.plan.made if each.falls and not self.came(each.phrase, "start"))


def reasons(outcome: BlockOutcome) -> Mapping[str, str]:
    """Dropped behaviors of a block, each with the reason."""
    given = zip_longest(outcome.dropped, outcome.reasons[: len(outcome.dropped)], fillvalue="")
    return {id: reason.removeprefix(f"{id}: ") for id, reason in given}


# -- what is left of a fragment ------------------------------------------------------------------------------------


class Rest(Struct, frozen=True):
    """Rest of a fragment, and of its turn, after a block that was cut.

    failed: gestures, `gaze` and `point`, that failed for each object that is chosen again, and why.
    """

    fragment: TurnFragment
    turn: TurnPlan
    failed: Mapping[str, Mapping[str, str]]


def rest_of(fragment: TurnFragment, turn: TurnPlan, act: Act, outcome: BlockOutcome) -> Rest | None:
    """The rest of a fragment whose block was cut; None: it was not.

    It was if a phrase fell with a gesture, and so all that stands behind it (see `Parts`).
    """
    why = reasons(outcome)
    lost = {*outcome.dropped, *outcome.interrupted}
    fallen = {each.phrase for each in act.plan.made if each.falls and each.phrase in lost}
    cut = {
        each.id
        for each in act.plan.block.behaviors
        if each.id in lost and {*each.needs} & (lost if each.id in fallen else fallen)
    }
    if not cut or outcome.status == "interrupted":
        return None
    made = {each.reference: each for each in act.plan.made}
    emitted = {each.id: each for each in act.plan.block.behaviors}
    left: list[FragmentBehavior] = []
    is_in_rest = False
    for behavior in fragment.behaviors:
        if isinstance(behavior, Reference):
            parts = made[behavior.id]
            is_in_rest = bool({parts.phrase, *parts.gestures} & cut)
            if is_in_rest:
                left.append(behavior)
        elif behavior.id in cut:
            said = emitted[behavior.id]
            is_shortened = isinstance(behavior, Speech) and isinstance(said, Speech) and not is_in_rest
            left.append(replace(behavior, text=said.text, marks=said.marks) if is_shortened else behavior)  # type: ignore[union-attr]
        elif behavior.id not in emitted and isinstance(behavior, Speech) and is_in_rest:
            left.append(behavior)  # punctuation that was to be said with the phrase
    ids = {behavior.id for behavior in left}
    failed = {
        each.object: {"point" if id == each.point else "gaze": why[id] for id in each.gestures if id in why}
        for each in act.plan.made
        if each.phrase in cut and lost & {*each.gestures}
    }
    behaviors = tuple(replace(each, timing=_among(each, ids), needs=tuple(ids & {*each.needs})) for each in left)
    constraints = tuple(
        replace(constraint, operators=kept)
        for constraint in fragment.constraints
        if (
            kept := tuple(
                each for each in constraint.operators if all(_is_among(text, ids) for text in (each.ref, *each.syncs))
            )
        )
    )
    opened = {each.id for each in act.plan.block.behaviors if each.id in act.plan.opening} - lost
    return Rest(
        replace(fragment, behaviors=behaviors, constraints=constraints, unread=()),
        replace(turn, announces_pair=False, reply="") if opened else turn,
        failed,
    )


def _among(behavior: Behavior, ids: Collection[str]) -> tuple[Timing, ...]:
    return tuple(each for each in behavior.timing if _is_among(each.ref, ids))


def _is_among(text: str, ids: Collection[str]) -> bool:
    """True if a reference names one of these behaviors. Times of the block that is over mean nothing in the next."""
    return bool(text) and SyncRef.parse(text).behavior in ids


# -- what was done -------------------------------------------------------------------------------------------------


def references_made(acts: Sequence[Act], events: Iterable[ConnectionEvent]) -> tuple[ReferenceMade, ...]:
    """Each reference of a fragment as it was made. events: of its blocks."""
    by_behavior = {event.behavior: event for event in sorted(events, key=lambda event: event.started.seconds)}
    tries: dict[str, list[tuple[Act, Made]]] = {}
    for act in acts:
        for made in act.plan.made:
            tries.setdefault(made.reference, []).append((act, made))
    return tuple(_made(all_tries, by_behavior) for all_tries in tries.values())


def _made(tries: Sequence[tuple[Act, Made]], events: Mapping[str, ConnectionEvent]) -> ReferenceMade:
    pointed = any(act.came(made.point, "stroke") for act, made in tries if made.point)
    looked = any(act.came(made.gaze, "stroke") for act, made in tries if made.gaze)
    phrases = [
        (each, made)
        for act, made in tries
        for each in act.spoken
        if each.behavior == made.phrase and has_words(each.text)
    ]
    by: Literal["pointing", "look", "words", "nothing"] = (
        "pointing" if pointed else "look" if looked else "words" if phrases else "nothing"
    )
    answers: dict[str, ConnectionEvent] = {}  # by person
    for id in [id for _, made in tries for id in made.events if by in ("pointing", "look")]:
        event = events.get(id)
        if event is not None and event.state in DECIDED:
            former = answers.get(event.responder)
            answers[event.responder] = event if former is None or former.state == "failed" else former
    all_looked = all(each.state != "failed" for each in answers.values())
    _, last = tries[-1]
    return ReferenceMade(
        reference=last.reference,
        object=last.object,
        by=by,
        phrase=" ".join(
            said(text := made.words if each.complete else each.text, len(text)) for each, made in phrases
        ),
        looked=all_looked if answers else None,
        delay=max((each.delay for each in answers.values() if each.delay is not None), default=None)
        if all_looked
        else None,
    )


def unsaid(acts: Iterable[Act]) -> tuple[str, ...]:
    """Ids of the speeches and references with words of which none was said; of several tries the last one counts."""
    owed: dict[str, bool] = {}
    for act in acts:
        told = {each.behavior for each in act.spoken if has_words(each.text)}
        phrases = {made.phrase: made.reference for made in act.plan.made}
        owed |= {made.reference: False for made in act.plan.made}
        owed |= {
            phrases.get(each.id, each.id): is_spoken(each.text) and each.id not in told
            for each in act.plan.block.behaviors
            if isinstance(each, Speech)
        }
    return tuple(id for id, is_owed in owed.items() if is_owed)


def eye_contact(acts: Sequence[Act], events: Iterable[ConnectionEvent]) -> bool | None:
    """True if a person returned a look of the robot that came to their face, False if not; None: not decided."""
    came = {
        each.id
        for act in acts
        for each in act.plan.block.behaviors
        if isinstance(each, Event) and all(act.came(id, "stroke") for id in each.needs)
    }
    decided = [
        event
        for event in events
        if event.kind == "mutual_facial_gaze" and event.behavior in came and event.state in DECIDED
    ]
    last = max(decided, key=lambda event: event.started.seconds, default=None)
    return None if last is None else last.state != "failed"


def unshown(acts: Sequence[Act], made: Iterable[ReferenceMade]) -> Iterator[str]:
    """Warnings of words that were said with a gesture that did not come: then it was too late to choose again."""
    planned = {parts.reference: (act, parts) for act in acts for parts in act.plan.made}
    for each in made:
        act, parts = planned[each.reference]
        gesture, name = (parts.point, "point") if parts.point else (parts.gaze, "look")
        if each.phrase and gesture and not act.came(gesture, "stroke"):
            yield f"{each.reference}: {each.phrase!r} was said, but the {name} at {each.object} did not come"


def last_choices(acts: Iterable[Act]) -> tuple[ReferenceChoice, ...]:
    """The newest choice of each reference, in the order of the references."""
    return tuple({choice.reference: choice for act in acts for choice in act.plan.choices}.values())


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
    known = dict(motions.known)
    for way, estimate in known.items():
        if reason := bars.get(way.target, {}).get("gaze" if way.part == "head" else "point"):
            known[way] = replace(estimate, feasible=False, fault=Fault(reason=reason), ray=None)
    return replace(motions, known=known)


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
