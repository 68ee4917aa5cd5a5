"""A fragment's constraints as its block needs them: ids of removed references stay usable, dropped ones vanish."""

from collections.abc import Iterator, Mapping

from msgspec import Struct
from msgspec.structs import replace

from schemas.behaviors import After, Before, Behavior, Constraint, Synchronize, Timing
from schemas.syncref import BLOCK_ITSELF, SyncRef

Operator = Synchronize | Before | After


class Replacement(Struct, frozen=True):
    """What stands for a removed reference. start, end: (behavior, sync).

    loose_start: nothing is synchronized with its start any more; what was, comes no later than `start` (Fig. 3.3:
    the gaze leads, so only the order of the phrases is kept).
    """

    start: tuple[str, str]
    end: tuple[str, str]
    loose_start: bool = False


class Rewriting(Struct, frozen=True, kw_only=True):
    """begins: the sync point of another block that stands for the start of this one; "": it begins by itself."""

    fragment: str
    replacements: Mapping[str, Replacement]
    dropped: frozenset[str] = frozenset()
    begins: str = ""

    def text(self, text: str) -> str | None:
        """A sync reference as the block must have it; None if what it names was dropped."""
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
        behavior, sync = replacement.start if ref.sync == "start" else replacement.end
        return str(SyncRef(behavior=behavior, sync=sync, offset=ref.offset))

    def constraint(self, constraint: Constraint) -> Constraint | None:
        """None if nothing is left of it."""
        operators = tuple(new for old in constraint.operators for new in self._operators(old))
        return replace(constraint, operators=operators) if operators else None

    def timing(self, behavior: Behavior) -> tuple[Timing, ...]:
        """The inline timing of a behavior that stays."""
        texts = ((timing.sync, self.text(timing.ref)) for timing in behavior.timing)
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

    def _operators(self, operator: Operator) -> Iterator[Operator]:
        if isinstance(operator, Synchronize):
            yield from self._synchronize(operator)
            return
        reference = self.text(operator.ref)
        syncs = tuple(text for sync in operator.syncs if (text := self.text(sync)) is not None)
        if reference is not None and syncs:
            yield replace(operator, ref=reference, syncs=syncs)

    def _synchronize(self, operator: Synchronize) -> Iterator[Operator]:
        members = [member for member in (operator.ref, *operator.syncs) if member]
        loose = [member for member in members if self._is_loose(member)]
        fast = [text for member in members if member not in loose and (text := self.text(member)) is not None]
        if len(fast) > 1:
            yield Synchronize(ref=fast[0], syncs=tuple(fast[1:]), line=operator.line)
        if fast and loose:
            syncs = tuple(text for member in loose if (text := self.text(member)) is not None)
            yield After(ref=fast[0], syncs=syncs, line=operator.line)

    def _is_loose(self, text: str) -> bool:
        ref = self._parse(text)
        if ref is None or ref.sync != "start":
            return False
        replacement = self.replacements.get(ref.behavior)
        return replacement is not None and replacement.loose_start

    def _parse(self, text: str) -> SyncRef | None:
        """None for what is not of this fragment."""
        if not text:
            return None
        ref = SyncRef.parse(text)
        return ref if ref.block in ("", self.fragment) else None


def points_named(
    fragment: str, behaviors: tuple[Behavior, ...], constraints: tuple[Constraint, ...]
) -> frozenset[tuple[str, str]]:
    """(behavior, sync) of every point that the input times or names, on either side of a constraint."""
    named: set[tuple[str, str]] = set()
    texts: list[str] = []
    for behavior in behaviors:
        for timing in behavior.timing:
            named.add((behavior.id, timing.sync))
            texts.append(timing.ref)
    for constraint in constraints:
        for operator in constraint.operators:
            texts += [operator.ref, *operator.syncs]
    for text in filter(None, texts):
        ref = SyncRef.parse(text)
        if ref.block in ("", fragment):
            named.add((ref.behavior, ref.sync))
    return frozenset(named)
