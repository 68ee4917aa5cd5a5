"""Makes a BML block of a fragment: replaces references, adds the turn's events and gaze. Two profiles of timing.

Events are behaviors of the block, so they begin exactly when the speech or gaze they belong to does. They carry
their timing inline: the constraints that remain, but for the hold of a point until its event has ended, are
plain BML.

Words are given as a voice needs them. A voice can't say a comma alone: in "[the red cup], please" the phrase becomes
"the red cup,", and "please" is left of the speech. The last words of a turn are lower, a signal that it is over
(thesis 3.3.1).
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import count, cycle, islice

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behavior_types import SERIES, TYPES
from engage_hri.schemas.behaviors import (
    After,
    BlockBehavior,
    Constraint,
    Event,
    EventKind,
    FragmentBehavior,
    Gaze,
    Hand,
    Head,
    Locomotion,
    Looks,
    Mark,
    Pointing,
    Reference,
    Speech,
    Synchronize,
    Timing,
    TurnSignal,
)
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.prosody import marked_up
from engage_hri.schemas.fragments import ReferenceChoice, TurnFragment
from engage_hri.schemas.references import BLOCK_ITSELF, SyncRef, type_name
from engage_hri.schemas.text import tokens, word_count
from engage_hri.schemas.units import Seconds
from engage_hri.services.generation.block.ordering import ordered
from engage_hri.services.generation.block.parts import (
    FreshIds,
    Made,
    Parts,
    after,
    as_in_the_figure,
    checking_back,
    from_there,
    same,
)
from engage_hri.services.generation.block.rewriting import Operator, Rewriting, points_named, tie_needs, tied
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.inhibitions import Permits
from engage_hri.services.generation.turns.continuation import NO_CONTINUATION, Continuation, Stroke, first_met, stroke
from engage_hri.services.generation.turns.plan import TurnPlan

_ALPHABETIC = r"""(?:['’](?:s|d|m|ll|re|ve)\b)?[.,;:!?…)\]"'”’»]*(?=\s|$)"""
_IDEOGRAPHIC = "[、。，．；：！？…）］」』】》〉]+"
"""Punctuation that needs no space behind it."""
_CLOSING = re.compile(rf"\s*({_ALPHABETIC}|{_IDEOGRAPHIC})\s*")


class MovedPunctuation(Struct, frozen=True):
    """Punctuation that was moved to phrases.

    closings: what a reference's phrase ends with, by reference. rest: what is left of a speech, by speech; None:
    nothing. follows: by speech of which nothing is left, the reference with the phrase that has its punctuation.
    """

    closings: dict[str, str]
    rest: dict[str, Speech | None]
    follows: dict[str, str]


def moved_punctuation(order: Sequence[FragmentBehavior], phrased: Collection[str]) -> MovedPunctuation:
    """Find the punctuation to move. order: that of the voice. phrased: references that are made with a phrase.

    Speech with prosodic markup is left as it is: its words stand in the text and in the markup.
    """
    result = MovedPunctuation({}, {}, {})
    before = ""
    for behavior in order:
        if isinstance(behavior, Reference):
            before = behavior.id if behavior.id in phrased else ""
        elif isinstance(behavior, Speech) and behavior.text.strip():
            match = _CLOSING.match(behavior.text)
            if before and match and match[1] and not behavior.markup:
                result.closings[before] = result.closings.get(before, "") + match[1]
                result.rest[behavior.id] = _without_start(behavior, match.end())
                if match.end() == len(behavior.text):
                    result.follows[behavior.id] = before
                    continue
            before = ""
    return result


def _without_start(speech: Speech, length: int) -> Speech | None:
    """The speech without its first `length` characters; None if nothing is left."""
    if length == len(speech.text):
        return None
    marks = tuple(Mark(mark.id, max(0, mark.position - length)) for mark in speech.marks)
    return replace(speech, text=speech.text[length:], marks=marks)


WORDS = 2
"""Last words of the turn that are lowered."""
PER_WORD = 2
"""Characters of a script without spaces that count as one word."""


def lowered(behaviors: Sequence[BlockBehavior], last: str) -> tuple[BlockBehavior, ...]:
    """Lower the end of the speech `last`. A speech with prosodic markup stays as its author wrote it."""
    return tuple(
        _lowered(each) if isinstance(each, Speech) and each.id == last and not each.markup else each
        for each in behaviors
    )


def _lowered(speech: Speech) -> Speech:
    left, start = float(WORDS), len(speech.text)
    for token in reversed(list(tokens(speech.text))):
        if not token.letters:
            continue
        start = token.end - len(token.text)
        left -= 1.0 if token.script == "spaced" else 1.0 / PER_WORD
        if left <= 0.0:
            break
    if start == len(speech.text):
        return speech
    markup = marked_up(speech.text, speech.marks, start, len(speech.text), pitch="low")
    return replace(speech, markup=markup)


_PHRASE_END = re.compile(r"[.,;:!?…]+(?=\s+\w)|[。、！？，；：]+(?=\w)")
PHRASE = 2.0
"""Least number of words between two looks at addressees: a look takes about half a second. Ours."""
LOOK_AND_BACK = 4.0
"""Least number of words from the last such look to the end of the turn, when the eyes are back: about 1.2 s. Ours."""
FIGURE_LEAD: Seconds = 2.0
"""Time from gaze on target to the stroke of the point in profile figure-3.3: the figure's own."""


class FragmentPlan(Struct, frozen=True, kw_only=True):
    """The block of a fragment and what is known of it before it is sent.

    continuation: for the turn's next fragment. made: the behaviors of each reference, in order. opening: ids of what
    opens the turn.
    """

    block: Block
    continuation: Continuation = NO_CONTINUATION
    made: tuple[Made, ...] = ()
    opening: tuple[str, ...] = ()
    choices: tuple[ReferenceChoice, ...] = ()
    warnings: tuple[str, ...] = ()


class Emission:
    """The making of the block that performs a fragment: its behaviors and constraints so far.

    choices: one for each reference. hands: the one to point with, by reference; where none is given, two points count
    as made with the same arm. before: what the turn's earlier fragments still have to do. apart: the references
    before which head and arms go home.
    """

    def __init__(
        self,
        fragment: TurnFragment,
        turn: TurnPlan,
        choices: Sequence[ReferenceChoice],
        config: GenerationConfig,
        permits: Permits,
        hands: Mapping[str, Hand],
        before: Continuation = NO_CONTINUATION,
        apart: Collection[str] = (),
    ) -> None:
        self.fragment, self.turn, self.config, self.permits, self.hands = fragment, turn, config, permits, hands
        self.choices, self.before, self.apart = choices, before, apart
        self.names = FreshIds(fragment)
        self.figure = config.profile == "figure-3.3"
        self.dropped = [behavior for behavior in fragment.behaviors if not permits.allows(behavior)]
        kept = [behavior for behavior in fragment.behaviors if permits.allows(behavior)]
        order = ordered(kept, fragment.constraints, fragment.id)
        chosen = {choice.reference: choice for choice in choices}
        punctuation = moved_punctuation(order, [id for id, choice in chosen.items() if choice.phrase])
        self.kept = [each for old in kept if (each := punctuation.rest.get(old.id, old)) is not None]
        self.order = [each for old in order if (each := punctuation.rest.get(old.id, old)) is not None]
        self.parts: dict[str, Parts] = {}
        self.hinge: tuple[str, ...] = ()  # the phrase that what comes now needs (see `Parts`)
        self.needs: dict[str, tuple[str, ...]] = {}  # of the author's behaviors
        for behavior in self.order:
            if isinstance(behavior, Reference):
                hand, closing = hands.get(behavior.id, permits.only_hand), punctuation.closings.get(behavior.id, "")
                parts = Parts(behavior, chosen[behavior.id], closing, self.names, turn, hand, self.hinge)
                self.parts[behavior.id] = parts
                self.hinge = parts.hinge or self.hinge
            self.needs[behavior.id] = self.hinge
        tie_needs(self.needs, self.kept, fragment)
        self.named = points_named(fragment.id, fragment.behaviors, fragment.constraints)
        self.named_behaviors = {behavior for behavior, _ in self.named}
        self.speeches = self._speeches()
        self.rewriting = Rewriting(
            fragment=fragment.id,
            replacements={id: parts.replacement(gaze_leads=self.figure) for id, parts in self.parts.items()}
            | {id: self.parts[said_by].closing for id, said_by in punctuation.follows.items()},
            words=frozenset(self.speeches),
            instants=tied(fragment.behaviors, fragment.constraints, at_one_instant=True),
            dropped=frozenset(behavior.id for behavior in self.dropped),
            begins=before.start,
        )
        self.constraints: list[Constraint] = []
        self.last_gaze = self.last_glance = ""
        """Ids of the gaze before the end-of-turn gaze, if its timing leaves `relax` free, and of the last glance."""
        self.strokes: list[Stroke] = []
        self.round = cycle((*turn.others, turn.addressee))
        """Those at whom the robot looks next: it has looked at the one named first."""

    def plan(self) -> FragmentPlan:
        """Make the block; called once."""
        for constraint in self.fragment.constraints:
            if (rewritten := self.rewriting.constraint(constraint)) is not None:
                self.constraints.append(rewritten)
        self._follow_the_turn()
        self._time_speeches_and_references()
        opening, around = self._opening(), self._looks_around()
        behaviors = (*opening, *self._in_document_order(), *around, *self._closing())
        self._let_the_eyes_rest(behaviors)
        if self.turn.closes and self.speeches:
            behaviors = lowered(behaviors, self.speeches[-1])
        return FragmentPlan(
            block=Block(
                id=self.fragment.id,
                behaviors=behaviors,
                constraints=tuple(self.constraints),
                unread=self.fragment.unread,
            ),
            continuation=Continuation(
                self.speeches[-1] if self.speeches else "", self.last_glance, tuple(self.strokes)
            ),
            made=tuple(parts.made for parts in self.parts.values()),
            choices=tuple(self.choices),
            opening=tuple(each.id for each in opening),
            warnings=tuple(f"{behavior.id} is left out: inhibited" for behavior in self.dropped),
        )

    def _let_the_eyes_rest(self, behaviors: Sequence[BlockBehavior]) -> None:
        """Let the first look wait until what the eyes have just come to has been seen, unless its author times it."""
        first = next((each for each in behaviors if isinstance(each, Gaze)), None)
        if not self.before.seen_after or first is None or first.target == self.before.eyes_on:
            return
        source = next((id for id, parts in self.parts.items() if parts.gaze == first.id), first.id)
        if not self.rewriting.is_timed(source, self.named):
            rested = after(str(SyncRef("", BLOCK_ITSELF, "start", 0, self.before.seen_after)), f"{first.id}:start")
            self.constraints.append(Constraint(id=self.names.fresh("eyes-rest"), operators=(rested,)))

    def _speeches(self) -> list[str]:
        """Ids of plain speeches and phrases, in order."""
        speeches = []
        for behavior in self.order:
            if isinstance(behavior, Speech):
                speeches.append(behavior.id)
            elif isinstance(behavior, Reference) and self.parts[behavior.id].phrase:
                speeches.append(self.parts[behavior.id].phrase)
        return speeches

    def _in_document_order(self) -> list[BlockBehavior]:
        behaviors: list[BlockBehavior] = []
        for behavior in self.kept:
            if isinstance(behavior, Reference):
                behaviors += self.parts[behavior.id].behaviors
            else:
                behaviors.append(self._passed_through(behavior))
        return behaviors

    def _passed_through(self, behavior: BlockBehavior) -> BlockBehavior:
        if isinstance(behavior, Pointing) and behavior.mode is None and self.permits.only_hand:
            behavior = replace(behavior, mode=self.permits.only_hand)
        new = replace(behavior, timing=self.rewriting.timing(behavior), needs=self._needs(behavior))
        return behavior if new == behavior else new

    def _needs(self, behavior: BlockBehavior) -> tuple[str, ...]:
        """Ids that a behavior of the author needs: those that it names, and the phrase that it stands behind."""
        said: list[str] = []
        for needed in behavior.needs:
            parts = self.parts.get(needed)
            said += [needed] if parts is None else parts.made.gestures or filter(None, [parts.phrase])
        behind = () if behavior.required else self.needs.get(behavior.id, ())
        return tuple(dict.fromkeys((*said, *behind)))

    # -- after the turn's earlier fragments -----------------------------------------------------------------------

    def _follow_the_turn(self) -> None:
        """Let everything begin after the turn's words so far, and each stroke only when its limb is free.

        A behavior that the input does not name is left out, unless it is the first of its series: the realizer has it
        follow the one before it of its series, but only as long as nothing names it.
        """
        operators: list[Operator] = []
        free: list[str] = []
        begun: set[str] = set()
        for behavior in self.kept:
            if isinstance(behavior, Reference):
                continue
            is_first = (series := SERIES[type_name(behavior)]) not in begun
            begun.add(series)
            if (made := stroke(behavior, self.permits.only_hand)) is not None:
                self.strokes.append(made)
            if is_first or behavior.id in self.named_behaviors:
                free.append(f"{behavior.id}:{first_met(behavior, self.named)}")
                if made is not None:
                    operators += [after(sync, f"{behavior.id}:start") for sync in self.before.frees(made.limb)]
        if self.before.start and free:
            operators.insert(0, After(ref=self.before.start, syncs=tuple(free)))
        if operators:
            self.constraints.append(Constraint(id=self.names.fresh("turn-goes-on"), operators=tuple(operators)))

    # -- references and phrases -----------------------------------------------------------------------------------

    def _time_speeches_and_references(self) -> None:
        preceding = self.before.speech  # the speech or phrase before; "": the block start stands for it
        glance = self.before.glance
        points: dict[Hand | None, str] = {}  # hand -> its last point
        previous: Parts | None = None  # of the reference before this one
        look = ""  # the last look of a reference, unless a glance or another look has followed it
        gazes = 0
        last = self._last_reference()
        for behavior in self.order:
            if isinstance(behavior, Reference):
                parts = self.parts[behavior.id]
                operators: list[Operator] = list(self.rewriting.inherited(behavior))
                hand = self.hands.get(behavior.id, self.permits.only_hand)
                if parts.point:
                    operators += [after(sync, f"{parts.point}:start") for sync in self.before.frees(hand)]
                    self.strokes.append(Stroke(parts.point, hand))
                is_timed = self.rewriting.is_timed(behavior.id, self.named)
                if self.figure:
                    lines = as_in_the_figure(parts, preceding, self.before.speech, is_timed, FIGURE_LEAD)
                    operators += [each for each in lines if not self._is_said(each, operators)]
                else:
                    gives_way = behavior.id == last and self._gaze_follows(behavior)
                    operators += checking_back(parts, preceding, self.before.speech, is_timed, glance, gives_way)
                    held = previous if previous is not None and behavior.id not in self.apart else None
                    if parts.gaze and look:
                        operators.append(
                            from_there(look, "relax", parts.gaze, held is not None and held.gaze == look)
                        )
                    if parts.point and (point := points.get(hand)):
                        stays = held is not None and held.point == point
                        operators.append(from_there(point, "stroke_end", parts.point, stays))
                    look = parts.gaze or look
                    if parts.point:
                        points[hand] = parts.point
                        if behavior.id != last:
                            operators.append(self._glance(parts))
                            glance, look = parts.glance, ""
                            self.last_glance = glance
                previous = parts
                if operators:
                    id = self.names.fresh(f"{behavior.id}-timing")
                    self.constraints.append(Constraint(id=id, operators=tuple(operators), line=behavior.line))
                if parts.gaze:
                    gazes += 1
                    self.last_gaze = parts.glance or parts.gaze
                preceding = parts.phrase or preceding
            elif isinstance(behavior, Speech):
                self._keep_in_line(behavior, preceding)
                preceding = behavior.id
            elif isinstance(behavior, Gaze):
                gazes, look = gazes + 1, ""
                free = not {(behavior.id, "relax"), (behavior.id, "end")} & self.named.keys()
                # An unnamed gaze follows the one before it; naming it would make it start with the block.
                unnamed_follower = gazes > 1 and behavior.id not in self.named_behaviors
                self.last_gaze = behavior.id if free and not unnamed_follower else ""

    def _glance(self, parts: Parts) -> Operator:
        parts.glance = self.names.fresh(f"{parts.reference.id}-glance")
        needs = self.needs[parts.reference.id]
        parts.behaviors.append(Gaze(id=parts.glance, target=next(self.round), needs=needs))
        return same(f"{parts.gaze}:relax", f"{parts.glance}:start")

    def _is_said(self, operator: Operator, inherited: Sequence[Operator]) -> bool:
        """True if the input, or the reference's own timing, asks for this order already."""
        said = [*inherited, *(each for constraint in self.constraints for each in constraint.operators)]
        return isinstance(operator, After) and any(
            {operator.ref, *operator.syncs} <= {each.ref, *each.syncs}
            for each in said
            if isinstance(each, Synchronize) or each.ref == operator.ref
        )

    def _keep_in_line(self, speech: Speech, preceding: str) -> None:
        """Let a speech without a timed start begin after the words before it in the document.

        The realizer does so only for speeches that nothing names. This block names them, and so does an author who
        ties something to a word.
        """
        if preceding and preceding != self.before.speech and (speech.id, "start") not in self.named:
            start = f"{speech.id}:start"
            is_free = speech.id not in self.named_behaviors
            relate = same if self.figure and is_free else after
            operator: Operator = relate(f"{preceding}:end", start)
            id = self.names.fresh(f"{speech.id}-timing")
            self.constraints.append(Constraint(id=id, operators=(operator,), line=speech.line))

    def _gaze_follows(self, reference: Reference) -> bool:
        """True if the end-of-turn gaze comes right after the look of this reference."""
        behind = self.order[self.order.index(reference) :]
        return not any(isinstance(each, Gaze) for each in behind) and not self._wordless_at_the_end()

    def _last_reference(self) -> str:
        """Id of the reference with the gaze that lasts until the end-of-turn gaze; "": there is none."""
        if not self._ends_with_gaze or not self.parts:
            return ""
        return next(behavior.id for behavior in reversed(self.order) if isinstance(behavior, Reference))

    # -- the turn -------------------------------------------------------------------------------------------------

    @property
    def _ends_with_gaze(self) -> bool:
        return self.turn.closes and self.permits.looks

    def _looks_around(self) -> list[Gaze]:
        """Looks at several addressees in turn, from one phrase to the next, if the fragment has no looks itself."""
        has_looks = any(isinstance(each, Looks | Locomotion) for each in self.kept) or any(
            each.gaze for each in self.parts.values()
        )
        if not self.turn.others or has_looks or not self.permits.looks:
            return []
        looks: list[Gaze] = []
        for at in islice(self._gaps(), len(self.turn.addressees)):
            look = Gaze(id=self.names.fresh("turn-look"), target=next(self.round), timing=(Timing("start", at),))
            if looks:
                self._tie(same(f"{looks[-1].id}:relax", f"{look.id}:start"))
            looks.append(look)
        if looks and self._ends_with_gaze:
            self.last_gaze = looks[-1].id
        elif looks:
            self._tie(after(f"{self.speeches[-1]}:end", f"{looks[-1].id}:relax"))
        return looks

    def _gaps(self) -> Iterator[str]:
        """Sync points between two phrases, each some words after the one before; marks are set if there are none."""
        words = 0.0
        for number, behavior in enumerate(self.kept):
            if isinstance(behavior, Reference):
                words += word_count(self.parts[behavior.id].made.words)
            if not isinstance(behavior, Speech):
                continue
            least = LOOK_AND_BACK if behavior.id == self.speeches[-1] and self._ends_with_gaze else 0.0
            if words >= PHRASE and behavior.id != self.speeches[0] and word_count(behavior.text) >= least:
                yield f"{behavior.id}:start"
                words = 0.0
            begins = 0
            for end in [] if behavior.markup else [found.end() for found in _PHRASE_END.finditer(behavior.text)]:
                words += word_count(behavior.text[begins:end])
                begins = end
                if words >= PHRASE and word_count(behavior.text[end:]) >= least:
                    taken = {each.id for each in behavior.marks}
                    mark = next(id for n in count(1) if (id := f"look-{n}") not in taken)
                    marks = sorted((*behavior.marks, Mark(mark, end)), key=lambda each: each.position)
                    self.kept[number] = behavior = replace(behavior, marks=tuple(marks))
                    yield f"{behavior.id}:{mark}"
                    words = 0.0
            words += word_count(behavior.text[begins:])

    def _tie(self, operator: Operator) -> None:
        self.constraints.append(Constraint(id=self.names.fresh("turn-looks"), operators=(operator,)))

    def _event(self, id: str, kind: EventKind, start: str, needs: tuple[str, ...], responder: str = "") -> Event:
        """An event of the turn. start: the sync point with which it begins; "": it begins with the block.

        responder: "": the one named first.
        """
        return Event(
            id=self.names.fresh(id), kind=kind, responder=responder or self.turn.addressee, cause="turn",
            turn=self.turn.turn,
            timing=(Timing("start", start),) if start else (), needs=needs,
        )  # fmt: skip

    def _opening(self) -> list[BlockBehavior]:
        """The turn's event or signal that begins with the first speech, or with the block if there is none."""
        turn = self.turn
        start = f"{self.speeches[0]}:start" if self.speeches else ""
        needs = next((each.hinge for each in self.parts.values() if [*each.hinge] == self.speeches[:1]), ())
        if turn.announces_pair:
            pairs = [self._event("turn-pair", "adjacency_pair", start, needs, each) for each in turn.addressees]
            return [replace(each, accept=turn.accept, limit=turn.within) for each in pairs]
        if turn.reply:
            timing = (Timing("start", start),) if start else ()
            signal = TurnSignal(id="", turn=turn.turn, signal=turn.reply, timing=timing, needs=needs)
            name = f"turn-{turn.reply}"
            return [replace(signal, id=self.names.fresh(name), actor=each) for each in turn.addressees]
        if turn.backchannel:
            nod = next((behavior.id for behavior in self.order if isinstance(behavior, Head)), "")
            if not start and nod and not self.permits.speech_only:
                start = f"{nod}:start"
            about = (start.rpartition(":")[0],) if start else ()
            event = self._event("backchannel", "backchannel", "", about)
            if start:
                # Recognition has to know of it before it hears the robot: else the sign would answer the person.
                id = self.names.fresh("backchannel-first")
                self.constraints.append(Constraint(id=id, operators=(after(f"{event.id}:start", start),)))
            return [event]
        return []

    def _closing(self) -> list[BlockBehavior]:
        """Behaviors that end the turn: facial gaze, an optional mutual facial gaze, and the signal to recognition."""
        turn = self.turn
        if not turn.closes:
            return []
        ended = self.names.fresh("turn-ended")
        actor = "" if turn.others else turn.addressee
        signal = TurnSignal(id=ended, turn=turn.turn, signal="ended", actor=actor, needs=self.hinge)
        operators: list[Operator] = []
        closing: list[BlockBehavior] = []
        looks = self._looks_late
        ends = [f"{self.speeches[-1]}:end", *self._wordless_at_the_end()] if self.speeches else []
        if self._ends_with_gaze:
            gaze = self.names.fresh("turn-gaze")
            closing.append(Gaze(id=gaze, target=turn.addressee, needs=self.hinge))
            start = f"{gaze}:start"
            event = self._event("turn-gaze-event", "mutual_facial_gaze", start, (gaze,))
            closing.append(replace(event, optional=True, anchors=(f"{gaze}:stroke",)))
            if len(ends) > 1 or (ends and looks):
                operators += [after(end, f"{gaze}:start") for end in ends]
            elif ends:
                operators.append(same(ends[0], f"{gaze}:{self._met_by_the_end}"))
            else:
                operators += self._once_all_is_done(f"{gaze}:start")
            if self.last_gaze:
                operators.append(same(f"{self.last_gaze}:relax", f"{gaze}:start"))
            signal = replace(signal, timing=(Timing("start", f"{gaze}:start"),))
        if len(ends) == 1 and not (looks and self._ends_with_gaze):
            signal = replace(signal, timing=(Timing("start", f"{self.speeches[-1]}:end"),))
        elif not self._ends_with_gaze:
            operators += self._once_all_is_done(f"{ended}:start")
        closing.append(signal)
        if operators:
            self.constraints.append(Constraint(id=self.names.fresh("turn-timing"), operators=tuple(operators)))
        return closing

    @property
    def _met_by_the_end(self) -> str:
        """The sync point of the end-of-turn gaze that comes with the end of the last word.

        Who ends a turn has looked up by then: the eyes are on the hearer's when the last word ends, and do not only
        set out. The figure has its own times.
        """
        return "start" if self.figure else "stroke"

    @property
    def _looks_late(self) -> bool:
        """True if the last gaze is one of the author that may go on, or only begin, when the words are over.

        The turn ends after it. One that begins with the fragment, or by words that others follow, is over then: these
        can wait until it is made.
        """
        look = next((each for each in self.order if isinstance(each, Gaze) and each.id == self.last_gaze), None)
        if look is None:
            return False
        names = sum(times for (id, _), times in self.named.items() if id == look.id)
        operators = [operator for constraint in self.fragment.constraints for operator in constraint.operators]
        awaited = sum(isinstance(each, After) and SyncRef.parse(each.ref).behavior == look.id for each in operators)
        spoken = [each.id for each in self.order if each.id in self._worded]
        by_words = all(
            timing.sync == "start" and SyncRef.parse(timing.ref).behavior in spoken[:-1] for timing in look.timing
        )
        behind = self.order[self.order.index(look) :]
        is_early = any(each.id in spoken for each in behind) and by_words and names == len(look.timing) + awaited
        return self.figure or not is_early

    @property
    def _worded(self) -> set[str]:
        """Ids of the fragment's speeches and of its references with words."""
        phrased = {id for id, parts in self.parts.items() if parts.phrase}
        return {each.id for each in self.order if isinstance(each, Speech)} | phrased

    def _wordless_at_the_end(self) -> Sequence[str]:
        """Last sync points of the references that follow all words, by a gesture alone: the turn ends after them."""
        ends: list[str] = []
        for behavior in reversed(self.order):
            if isinstance(behavior, Speech):
                break
            if isinstance(behavior, Reference):
                parts = self.parts[behavior.id]
                if parts.phrase:
                    break
                ends.append(":".join(parts.made.by))
        return ends

    def _once_all_is_done(self, sync: str) -> list[Operator]:
        """Operators that put `sync` after the turn's last words and after all behaviors that end by themselves."""
        ends = [self.before.start] if self.before.start else []
        ends += [f"{each.id}:end" for each in self._in_document_order() if not TYPES[type_name(each)].lasts]
        return [after(end, sync) for end in ends]
