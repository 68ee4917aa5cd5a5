"""Acts of a fragment: its blocks, one after the other, and what really came of each of them.

A fragment has one block, unless a reference is chosen again: then the block ends where that reference would have
begun, and another one of the same name goes on from there. What is told of a fragment is computed here, from sync
points, words and decided events. Nothing of it is read from what was chosen.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import zip_longest
from typing import Literal

from msgspec import Struct, field
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Behavior, Event, FragmentBehavior, Reference, Speech, Timing
from engage_hri.schemas.blocks import BlockOutcome, SpokenText
from engage_hri.schemas.fragments import ReferenceChoice, ReferenceMade, TurnFragment
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.references import SyncRef
from engage_hri.schemas.text import has_words
from engage_hri.services.generation.block.emission import FragmentPlan
from engage_hri.services.generation.block.parts import Made
from engage_hri.services.generation.turns.policy import TurnPlan
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
    decided = [
        event
        for _, made in tries
        if (event := events.get(made.event)) is not None and event.state in DECIDED and by in ("pointing", "look")
    ]
    answered = next((event for event in decided if event.state != "failed"), None)
    _, last = tries[-1]
    return ReferenceMade(
        reference=last.reference,
        object=last.object,
        by=by,
        phrase=" ".join(
            said(text := made.words if each.complete else each.text, len(text)) for each, made in phrases
        ),
        looked=answered is not None if decided else None,
        delay=answered.delay if answered else None,
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
