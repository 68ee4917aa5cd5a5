"""Rewrites a fragment's constraints for its block, in which behaviors have replaced references.

A constraint that names a reference names its replacement then; one that names a dropped behavior vanishes.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import (
    After,
    Before,
    Behavior,
    Constraint,
    Reference,
    Speech,
    Synchronize,
    Timing,
)
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.references import BLOCK_ITSELF, SyncRef

Operator = Synchronize | Before | After
Point = tuple[str, str]
"""Behavior and sync point."""


class Replacement(Struct, frozen=True):
    """The points that stand for start and end of a removed reference or speech.

    start_of_words: where the gaze leads (Fig. 3.3), the start of the phrase. Words and clock times are tied to it and
    not to the gaze: the phrase comes no earlier than they do.
    """

    start: Point
    end: Point
    start_of_words: Point | None = None


class Rewriting(Struct, frozen=True, kw_only=True, dict=True):
    """The rules by which the constraints of one fragment are rewritten.

    words: ids of speeches and phrases. instants: groups of the input's sync points that are one instant, or a fixed
    time apart. begins: the sync point of another block that stands for the start of this one; "": there is none.
    """

    fragment: str
    replacements: Mapping[str, Replacement]
    words: frozenset[str] = frozenset()
    instants: Sequence[Sequence[str]] = ()
    dropped: frozenset[str] = frozenset()
    begins: str = ""

    def text(self, text: str, *, among_words: bool = False) -> str | None:
        """A sync reference as the block must have it; None if the behavior that it names was dropped.

        among_words: the constraint relates it to words or the clock.
        """
        ref = self._parse(text)
        if ref is None:
            return text
        if ref.behavior in ("", BLOCK_ITSELF):
            begins = SyncRef.parse(self.begins) if self.begins and ref.sync != "end" else ref
            return text if begins is ref else str(replace(begins, offset=ref.offset))
        if ref.behavior in self.dropped:
            return None
        replacement = self.replacements.get(ref.behavior)
        if replacement is None:
            return text
        start = (among_words and replacement.start_of_words) or replacement.start
        behavior, sync = start if ref.sync == "start" else replacement.end
        return str(SyncRef(behavior=behavior, sync=sync, offset=ref.offset))

    def constraint(self, constraint: Constraint) -> Constraint | None:
        """A constraint as the block must have it; None if nothing is left of it."""
        operators = tuple(new for old in constraint.operators for new in self._operators(old))
        return replace(constraint, operators=operators) if operators else None

    def timing(self, behavior: Behavior) -> tuple[Timing, ...]:
        """The inline timing of a behavior that stays."""
        speaks = behavior.id in self.words
        texts = ((timing.sync, self.text(timing.ref, among_words=speaks)) for timing in behavior.timing)
        return tuple(Timing(sync, text) for sync, text in texts if text is not None)

    def inherited(self, reference: Behavior) -> tuple[Operator, ...]:
        """The inline timing of a removed reference, as operators on what replaces it."""
        return tuple(
            operator
            for timing in reference.timing
            for operator in self._operators(
                Synchronize(ref=timing.ref, syncs=(f"{reference.id}:{timing.sync}",), line=reference.line)
            )
        )

    def is_timed(self, reference: str, named: Counter[Point]) -> bool:
        """True if the input says when `reference` starts. named: see `points_named`.

        Another behavior that starts with it, and is named nowhere else, does not say when.
        """
        start, ties = (reference, "start"), 0
        uses: Counter[str] = Counter()
        for (behavior, _), times in named.items():
            uses[behavior] += times
        for group in self.instants:
            refs = {text: self._parse(text) for text in group if text}
            if start not in ((ref.behavior, ref.sync) for ref in refs.values() if ref):
                continue
            ties += 1
            for text, ref in refs.items():
                is_free = ref is not None and (ref.behavior == reference or uses[ref.behavior] == 1)
                if not is_free or (ref and ref.behavior != reference and self._is_of_words(text)):
                    return True
        return named[start] > ties

    def _operators(self, operator: Operator) -> Iterator[Operator]:
        if isinstance(operator, Synchronize):
            yield from self._synchronize(operator)
            return
        pairs: dict[str, list[str]] = {}
        ref_is_later = isinstance(operator, Before)
        for sync in operator.syncs:
            ref = self.text(operator.ref, among_words=self._leads(sync, not ref_is_later))
            text = self.text(sync, among_words=self._leads(operator.ref, ref_is_later))
            if ref is not None and text is not None and not self._have_become_one(operator.ref, sync):
                pairs.setdefault(ref, []).append(text)
        for ref, syncs in pairs.items():
            yield replace(operator, ref=ref, syncs=tuple(syncs))

    def _leads(self, other: str, is_later: bool) -> bool:
        """True if the phrase, and not the gaze that leads it, has to come before or after `other`."""
        return self._is_of_words(other) if is_later else self._is_timed(other)

    def _synchronize(self, operator: Synchronize) -> Iterator[Operator]:
        members = [member for member in (operator.ref, *operator.syncs) if member]
        loose = [member for member in members if self._is_loose(member)]
        fast = [member for member in members if member not in loose]
        if not any(map(self._is_timed, fast)):
            fast, loose = members, []
        fast = [member for member in fast if not self._have_become_one(fast[0], member)]
        texts = [text for member in fast if (text := self.text(member)) is not None]
        if len(texts) > 1:
            yield Synchronize(ref=texts[0], syncs=tuple(texts[1:]), line=operator.line)
        if texts and loose:
            syncs = tuple(text for member in loose if (text := self.text(member, among_words=True)) is not None)
            yield After(ref=texts[0], syncs=syncs, line=operator.line)

    def _have_become_one(self, one: str, other: str) -> bool:
        """True if two different points of the input are one in the block, whatever their offsets."""
        parsed, made = (self._parse(one), self._parse(other)), (self.text(one), self.text(other))
        if None in parsed or None in made or _is_same(one, other):
            return False
        return _is_same(str(made[0]), str(made[1]))

    def _is_loose(self, text: str) -> bool:
        """True for the start of a reference with a gaze that leads its phrase: words are not tied to that gaze."""
        ref = self._parse(text)
        if ref is None or ref.sync != "start":
            return False
        replacement = self.replacements.get(ref.behavior)
        return replacement is not None and replacement.start_of_words is not None

    def _is_timed(self, text: str) -> bool:
        """True for a point of words or of the clock, and for one at the same instant as such a point."""
        ref = self._parse(text)
        return ref is None or (ref.behavior, ref.sync) in self._timed or self._is_of_words(text)

    def _is_of_words(self, text: str) -> bool:
        """True for a point of words, of the clock, or of another block: nothing in this block can move the latter."""
        ref = self._parse(text)
        if ref is None or ref.behavior in ("", BLOCK_ITSELF):
            return True
        if replacement := self.replacements.get(ref.behavior):
            return (replacement.start if ref.sync == "start" else replacement.end)[0] in self.words
        return ref.behavior in self.words

    @cached_property
    def _timed(self) -> frozenset[Point]:
        """Points at the same instant as words or the clock, found without those that are loose (`_is_loose`)."""
        timed: set[Point] = set()
        groups = [[text for text in group if text and not self._is_loose(text)] for group in self.instants]
        points = [{(ref.behavior, ref.sync) for text in group if (ref := self._parse(text))} for group in groups]
        while grown := [
            named
            for group, named in zip(groups, points, strict=True)
            if not named <= timed and (named & timed or any(map(self._is_of_words, group)))
        ]:
            timed.update(*grown)
        return frozenset(timed)

    def _parse(self, text: str) -> SyncRef | None:
        """The reference; None for a clock time (empty) or a point of another block."""
        if not text:
            return None
        ref = SyncRef.parse(text)
        return ref if ref.block in ("", self.fragment) else None


def _is_same(one: str, other: str) -> bool:
    """True if both name one sync point, whatever their offsets."""
    return replace(SyncRef.parse(one), offset=0.0) == replace(SyncRef.parse(other), offset=0.0)


def tied(
    behaviors: Sequence[Behavior], constraints: Sequence[Constraint], *, at_one_instant: bool = False
) -> list[tuple[str, ...]]:
    """Groups of sync points that a timing or an operator relates; "": the clock.

    at_one_instant: only those that the input puts at one instant, or a fixed time apart.
    """
    inline = [(f"{each.id}:{timing.sync}", timing.ref) for each in behaviors for timing in each.timing]
    operators = [operator for constraint in constraints for operator in constraint.operators]
    kept = [each for each in operators if isinstance(each, Synchronize) or not at_one_instant]
    return [*inline, *((each.ref, *each.syncs) for each in kept)]


def points_named(
    fragment: str, behaviors: tuple[Behavior, ...], constraints: tuple[Constraint, ...]
) -> Counter[Point]:
    """Number of times that the input names each (behavior, sync), on either side of a constraint or inline."""
    refs = [SyncRef.parse(text) for group in tied(behaviors, constraints) for text in group if text]
    return Counter((ref.behavior, ref.sync) for ref in refs if ref.block in ("", fragment))


def tie_needs(needs: dict[str, tuple[str, ...]], behaviors: Sequence[Behavior], fragment: TurnFragment) -> None:
    """Let what is tied to words or references need what these need; what is tied to neither needs nothing.

    needs: of each behavior, changed in place; of words and references by their order.
    """
    words = {each.id for each in behaviors if isinstance(each, Speech | Reference)}
    for id in needs.keys() - words:
        needs[id] = ()
    groups = [
        {ref.behavior for text in group if text and (ref := SyncRef.parse(text)).block in ("", fragment.id)}
        for group in tied(behaviors, fragment.constraints)
    ]
    order = list(dict.fromkeys(needed for needed in needs.values() if needed))
    changed = True
    while changed:
        changed = False
        for group in groups:
            latest = max((needs.get(id, ()) for id in group), key=lambda each: order.index(each) if each else -1)
            for id in group & needs.keys() - words:
                if latest and needs[id] != latest and (not needs[id] or order.index(needs[id]) < order.index(latest)):
                    needs[id], changed = latest, True
