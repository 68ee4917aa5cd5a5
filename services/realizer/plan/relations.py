"""Relations between sync points, read from a block: which are one instant, and which come in order.

Constraints and inline timing mean the same thing and become the same relations; so do `before` and `after`.

Points that are one instant, give or take fixed offsets, make a class (a weighted union-find): synchronizations that
share a point merge, whatever their number, direction and sign of offset. Thesis 4.4 had limits here. Two that
contradict each other are found as they are merged, with the lines that say so.
"""

import re
from collections import defaultdict, deque
from collections.abc import Collection, Mapping
from functools import cached_property

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.advice import suggestion
from engage_hri.schemas.behavior_types import canonical_sync, dialect_sync, sync_points
from engage_hri.schemas.behaviors import (
    After,
    Before,
    Behavior,
    BlockBehavior,
    Head,
    Speech,
    Synchronize,
    Unknown,
    Wait,
    is_empty,
)
from engage_hri.schemas.blocks import Block, WarningKind
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.references import BLOCK_ITSELF, SyncRef, type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.points import EPSILON, ORIGIN, Point

LASTING: Seconds = 60.0
"""Seconds for which a block is known after its end: longer than a pause within a turn, or than a message is late."""


class BlockRefused(InputRefused):
    """Raised if the whole block is refused. kind: of the warning that says so."""

    def __init__(self, fault: Fault, kind: WarningKind = "PARSING_FAILURE") -> None:
        super().__init__(fault)
        self.kind = kind


Elsewhere = Mapping[str, Block | None]
"""Other blocks that are known, live or of the past, by id. None: the content of the block is not known, so any point
may be in it."""


class Term(Struct, frozen=True, gc=False):
    """A point and an offset: the instant `offset` seconds after the point. text: as the block has it.

    stroke: of a repeated movement, which of its strokes is meant, from 1; 0 of anything else.
    """

    point: Point
    offset: Seconds
    text: str
    line: int = 0
    stroke: int = 0


class Equal(Struct, frozen=True, gc=False):
    """Terms that are one instant; a single term is only named. behavior: the one that says so in its own timing."""

    terms: tuple[Term, ...]
    behavior: str = ""


class Order(Struct, frozen=True, gc=False):
    """`later` is no earlier than `earlier`. placed: the behavior of which this says when it comes."""

    earlier: Term
    later: Term
    placed: str = ""


NO_SUCH_BLOCK = "no block is known as"
"""Part of what is told of a tie to a block that is not there."""
IGNORED = "it is ignored"
"""What becomes of a time or a tie that cannot be read."""
EMPTY = "has nothing in it that says what to show; it moves nothing"
"""What is told of a face or posture that names nothing."""
DROPPED = "; the behavior is dropped"
"""End of the message of a problem that costs a behavior, but for an advice."""


def as_dropped(reason: str, advice: str = "") -> str:
    """The message of a problem that costs a behavior. advice: what to do about it."""
    return f"{reason}{DROPPED} ({advice})" if advice else f"{reason}{DROPPED}"


class Problem(Struct, frozen=True):
    """A warning about a behavior (empty: about the block)."""

    kind: WarningKind
    message: str
    behavior: str = ""


def at_line(line: int, reason: str) -> str:
    """The reason with its place in the XML, if it came from there."""
    return f"line {line}: {reason}" if line else reason


class Relations(Struct, frozen=True, dict=True):
    """Everything that a block says about its points.

    unusable: behaviors that cannot be performed as written. required: those without which the block fails. blocks:
    other blocks that it refers to. untied: points that were tied to another block, for which there is no time.
    """

    equals: tuple[Equal, ...]
    orders: tuple[Order, ...]
    required: frozenset[str]
    problems: tuple[Problem, ...] = ()
    unusable: frozenset[str] = frozenset()
    blocks: frozenset[str] = frozenset()
    untied: frozenset[Point] = frozenset()

    @cached_property
    def named(self) -> frozenset[Point]:
        """Every point that is written anywhere."""
        return self.constrained | {term.point for equal in self.equals for term in equal.terms}

    @cached_property
    def placed(self) -> frozenset[str]:
        """Behaviors of which it is said when they come. Timing of another that names one says nothing of it."""
        placed = {order.placed for order in self.orders}
        for equal in self.equals:
            placed |= {equal.behavior} if equal.behavior else {term.point.behavior for term in equal.terms}
        return frozenset(placed)

    @cached_property
    def awaited(self) -> Mapping[str, frozenset[Point]]:
        """For each behavior, the points that it is to come after."""
        found: dict[str, set[Point]] = {}
        for order in self.orders:
            found.setdefault(order.later.point.behavior, set()).add(order.earlier.point)
        return {behavior: frozenset(points) for behavior, points in found.items()}

    @cached_property
    def constrained(self) -> frozenset[Point]:
        """Every point that is tied to another."""
        return self.held | {order.earlier.point for order in self.orders}

    @cached_property
    def held(self) -> frozenset[Point]:
        """Every point that must share an instant or wait for one: it cannot come at any earlier time."""
        instants = ({term.point for term in equal.terms} for equal in self.equals)
        shared = {point for points in instants if len(points) > 1 for point in points}
        return frozenset(shared | {order.later.point for order in self.orders})


class _Absent(Problem, frozen=True, kw_only=True):
    """A tie to what another block does not have. refusal: to be raised if a required behavior has it."""

    refusal: BlockRefused


class _Reader:
    def __init__(self, block: Block, elsewhere: Elsewhere) -> None:
        self.block = block
        self.untied: list[tuple[Collection[str], BlockRefused]] = []
        """Behaviors that were tied to what another block does not have, and the refusal if one is required."""
        self.elsewhere = elsewhere
        self.theirs: dict[str, Mapping[str, Behavior]] = {}
        """Behaviors of other blocks that are named, by block and id."""
        self.behaviors: Mapping[str, Behavior] = {behavior.id: behavior for behavior in block.behaviors}
        self.points = {id: frozenset(sync_points(behavior)) for id, behavior in self.behaviors.items()}
        self.equals: list[Equal] = []
        self.orders: list[Order] = []
        self.problems = [Problem(each.kind, each.message, each.behavior) for each in block.unread]
        self.unusable: set[str] = set()
        self.required = {behavior.id for behavior in block.behaviors if behavior.required}

    def term(self, text: str, where: str, line: int) -> "Term | Problem | _Absent":
        """The point and offset of a reference; a Problem if its behavior has no such sync point."""
        try:
            ref = SyncRef.parse(text)
            if isinstance(speech := self.behaviors.get(ref.behavior or ref.block), Speech) and speech.marks:
                ref = SyncRef.parse(text, [mark.id for mark in speech.marks])
        except ValueError as error:
            raise self.refusal(str(error), where, line) from error
        if ref.block not in ("", self.block.id):
            return self._elsewhere(ref, text, where, line)
        if ref.behavior in ("", BLOCK_ITSELF):
            if ref.sync == "end":
                raise self.refusal(f"{text!r}: nothing in a block can wait for its own end", where, line)
            return Term(ORIGIN, ref.offset, text, line)
        behavior = self.behaviors.get(ref.behavior)
        if behavior is None:
            advice = suggestion(ref.behavior, self.behaviors, "the block has no behaviors")
            raise self.refusal(f"unknown behavior {ref.behavior!r}", where, line, advice)
        sync = canonical_sync(ref.sync, type_name(behavior), self.block.dialect)
        if isinstance(behavior, Unknown):
            return Term(Point(behavior.id, sync), ref.offset, text, line)  # It is dropped with its behavior.
        strokes = behavior.repetition if isinstance(behavior, Head) else 1
        if not self._has(behavior, sync) or ref.repetition > strokes:
            lacks = f"{where}: {self._lacks(behavior, text, ref.sync)}"
            return Problem("PARSING_FAILURE", lacks, behavior.id)
        return Term(Point(behavior.id, sync), ref.offset, text, line, ref.repetition)

    def _has(self, behavior: Behavior, sync: str) -> bool:
        """True if the behavior has this point in the block's dialect, or is unknown: then it may have any point."""
        spelled = dialect_sync(sync, type_name(behavior), self.block.dialect)
        is_known = spelled is not None and sync in self.points[behavior.id]
        return is_known or isinstance(behavior, Unknown)

    def _lacks(self, behavior: Behavior, text: str, sync: str) -> str:
        """Say that the behavior has no such point, and which was meant. text: what is written."""
        kind = type_name(behavior)
        spelled = (dialect_sync(each, kind, self.block.dialect) for each in self.points[behavior.id])
        advice = suggestion(sync, [each for each in spelled if each is not None])
        return f"{kind} has no sync point {text!r} ({advice})"

    def _elsewhere(self, ref: SyncRef, text: str, where: str, line: int) -> "Term | _Absent":
        """The term for a point of another block, spelled as in this one.

        What is not there costs the tie, and not the words: whether a block is still known, and which of two that had
        one id, may be a matter of milliseconds.
        """
        if ref.block not in self.elsewhere:
            advice = suggestion(ref.block, self.elsewhere, "none is")
            advice = f"a block is known from its request until {LASTING:g} s after its end; {advice}"
            return self._absent(f"{text!r}: {NO_SUCH_BLOCK} {ref.block!r}", where, line, advice)
        other = self.elsewhere[ref.block]
        if ref.block not in self.theirs:
            self.theirs[ref.block] = {each.id: each for each in other.behaviors} if other is not None else {}
        known = self.theirs[ref.block]
        if isinstance(behavior := known.get(ref.behavior), Speech):
            ref = SyncRef.parse(text, [mark.id for mark in behavior.marks])
        sync = canonical_sync(ref.sync, type_name(behavior) if behavior else "", self.block.dialect)
        if other is not None and ref.behavior not in ("", BLOCK_ITSELF):
            if behavior is None:
                advice = suggestion(ref.behavior, known, "it has no behaviors")
                reason = f"{text!r}: block {ref.block!r} has no behavior {ref.behavior!r}"
                return self._absent(reason, where, line, advice)
            of = f"{type_name(behavior)} {ref.behavior!r} of block {ref.block!r}"
            if isinstance(behavior, Unknown):
                pass  # It is dropped there, and the tie with it.
            elif sync not in sync_points(behavior):
                spelled = (
                    dialect_sync(each, type_name(behavior), self.block.dialect) for each in sync_points(behavior)
                )
                advice = suggestion(ref.sync, [each for each in spelled if each is not None])
                return self._absent(f"{text!r}: {of} has no sync point {ref.sync!r}", where, line, advice)
            elif ref.repetition > 1:
                advice = "leave out the number, or put both into one block"
                return self._absent(f"{text!r}: of {of} only the first stroke can be named", where, line, advice)
        return Term(Point(f"{ref.block}:{ref.behavior or BLOCK_ITSELF}", sync or "start"), ref.offset, text, line)

    def _absent(self, reason: str, where: str, line: int, advice: str) -> "_Absent":
        refusal = self.refusal(reason, where, line, f"what is required is tied to it; {advice}")
        return _Absent("PARSING_FAILURE", f"{where}: {reason} ({advice})", refusal=refusal)

    def refusal(self, reason: str, where: str, line: int, advice: str = "") -> BlockRefused:
        return BlockRefused(Fault(reason=reason, where=f"{self.block.id}: {where}", line=line, advice=advice))

    def read_constraints(self) -> None:
        for number, constraint in enumerate(self.block.constraints, 1):
            where = constraint.id or f"constraint {number}"
            for operator in constraint.operators:
                line = operator.line or constraint.line
                texts = (*([operator.ref] if operator.ref else []), *operator.syncs)
                terms = self._terms(texts, where, line, required=constraint.required)
                self._relate(operator, terms)
                if constraint.required:
                    self.required |= {term.point.behavior for term in terms.values()} & self.behaviors.keys()

    def _terms(self, texts: tuple[str, ...], where: str, line: int, *, required: bool) -> dict[str, Term]:
        terms: dict[str, Term] = {}
        absent = list[BlockRefused]()
        for text in texts:
            match self.term(text, where, line):
                case Term() as term:
                    terms[text] = term
                case _Absent(refusal=refusal) if required:
                    raise refusal
                case Problem(message=message) if required:
                    raise self.refusal(message.removeprefix(f"{where}: "), where, line, "the constraint is required")
                case Problem(message=message) as problem:
                    told = at_line(line, f"{message}; {IGNORED}")
                    self.problems.append(Problem("PARSING_FAILURE", told))
                    absent += [problem.refusal] if isinstance(problem, _Absent) else []
        self.untied += [({term.point.behavior for term in terms.values()}, each) for each in absent]
        return terms

    def _relate(self, operator: Synchronize | Before | After, terms: dict[str, Term]) -> None:
        if isinstance(operator, Synchronize):
            if terms:
                self.equals.append(Equal(tuple(terms.values())))
            return
        ref = terms.get(operator.ref)
        for text in operator.syncs:
            if ref is not None and (sync := terms.get(text)) is not None:
                ends = (ref, sync) if isinstance(operator, After) else (sync, ref)
                self.orders.append(Order(*ends, (ref if sync.point == ORIGIN else sync).point.behavior))

    def read_timing(self) -> None:
        for behavior in self.block.behaviors:
            self._read_timing_of(behavior)

    def _read_timing_of(self, behavior: BlockBehavior) -> None:
        equals: list[Equal] = []
        for timing in behavior.timing:
            sync = canonical_sync(timing.sync, type_name(behavior), self.block.dialect)
            if self._has(behavior, sync):
                other = self.term(timing.ref, behavior.id, behavior.line)
            else:
                other = Problem("PARSING_FAILURE", self._lacks(behavior, timing.sync, timing.sync))
            is_kept = isinstance(behavior, Speech) and behavior.id not in self.required
            if isinstance(other, _Absent):
                self.untied.append(({behavior.id}, other.refusal))
                is_kept = True
            if isinstance(other, Problem) and is_kept:
                message = at_line(behavior.line, f"{other.message}; {IGNORED}")
                self.problems.append(Problem("PARSING_FAILURE", message, behavior.id))
                continue  # Its words are not lost for the sake of a time.
            if isinstance(other, Problem):
                self.unusable.add(behavior.id)
                message = at_line(behavior.line, as_dropped(other.message))
                self.problems.append(Problem("PARSING_FAILURE", message, behavior.id))
                return
            own = Term(Point(behavior.id, sync), 0.0, f"{behavior.id}:{timing.sync}", behavior.line)
            equals.append(Equal((own, other), behavior.id))
        self.equals += equals

    def result(self) -> Relations:
        for tied, refusal in self.untied:
            if not self.required.isdisjoint(tied):
                raise refusal
        found = Relations(
            tuple(self.equals),
            tuple(self.orders),
            frozenset(self.required),
            tuple(self.problems),
            frozenset(self.unusable),
            frozenset(self.theirs),
        )
        message = "wait has neither a duration nor an end; it ends at once"
        endless = tuple(
            Problem("PARSING_FAILURE", at_line(behavior.line, message), behavior.id)
            for behavior in self.block.behaviors
            if isinstance(behavior, Wait)
            and behavior.duration is None
            and behavior.id not in self.unusable
            and Point(behavior.id, "end") not in found.held
        )
        empty = tuple(
            Problem("PARSING_FAILURE", at_line(behavior.line, f"{type_name(behavior)} {EMPTY}"), behavior.id)
            for behavior in self.block.behaviors
            if is_empty(behavior) and behavior.id not in self.unusable
        )
        return replace(found, problems=found.problems + endless + empty)


def relations_of(block: Block, elsewhere: Elsewhere | None = None) -> Relations:
    """Read everything that `block` says about its points. Raises InputRefused: a malformed or dangling reference.

    elsewhere: other live blocks, by id. Their points become `Point("block:behavior", sync)`.
    """
    reader = _Reader(block, elsewhere or {})
    reader.read_constraints()
    reader.read_timing()
    return reader.result()


def extent(block: Block) -> int:
    """Number of elements to plan: behaviors, marks in speech, and sync references."""
    marks = sum(len(each.marks) for each in block.behaviors if isinstance(each, Speech))
    inline = sum(len(each.timing) for each in block.behaviors)
    operators = (operator for constraint in block.constraints for operator in constraint.operators)
    return len(block.behaviors) + marks + inline + sum(1 + len(operator.syncs) for operator in operators)


def needing(block: Block, elsewhere: Elsewhere, points: Collection[Point]) -> list[tuple[str, Point]]:
    """Behaviors that are required, or in a required constraint, and tied to one of these points of other blocks."""
    relations = relations_of(block, elsewhere)
    ties = [equal.terms for equal in relations.equals] + [(each.earlier, each.later) for each in relations.orders]
    return [
        (one.point.behavior, other.point)
        for terms in ties
        for other in terms
        if other.point in points
        for one in terms
        if one.point.behavior in relations.required
    ]


_OFFSET = re.compile(r"\s*[+-]\s*[0-9.]+(e[+-]?[0-9]+)?\s*$", re.IGNORECASE)
"""Offset behind the point that a reference names: `+0.5`."""


class Instant(Struct, frozen=True, gc=False):
    """Points that happen together.

    class_id, offset: its class, and seconds from the first instant of that. at: seconds from the block's start.
    """

    points: tuple[Point, ...]
    class_id: int
    offset: Seconds
    at: Seconds | None = None


Link = tuple[Term, Term]
"""A tie: what is said of the point where it begins, and of the one where it ends."""


class Classes:
    """Classes of points that are tied together, each so many seconds from the others.

    Times of the clock contradict each other as well, but make no class: two behaviors that are both to end at 10 s
    do not wait for each other.
    """

    def __init__(self) -> None:
        self._clock: dict[Point, Seconds] = {}
        """Seconds from the block's start at which a representative is to happen, if given."""
        self._parent: dict[Point, Point] = {}
        self._offset: dict[Point, Seconds] = {}
        """Seconds from a point's parent to the point."""
        self._links: dict[Point, list[tuple[Point, Link]]] = defaultdict(list)

    def copy(self) -> "Classes":
        """The same classes, to be merged further."""
        other = Classes()
        other._clock |= self._clock
        other._parent |= self._parent
        other._offset |= self._offset
        other._links |= {point: [*links] for point, links in self._links.items()}
        return other

    def add(self, point: Point) -> None:
        """Take in a point, in a class of its own."""
        if point not in self._parent:
            self._parent[point], self._offset[point] = point, 0.0

    def find(self, point: Point) -> tuple[Point, Seconds]:
        """The representative of the point's class, and the seconds from it to the point."""
        above = self._parent[point]
        if self._parent[above] == above:  # as of nearly all points
            return above, self._offset[point]
        path = []
        while self._parent[point] != point:
            path.append(point)
            point = self._parent[point]
        offset = 0.0
        for each in reversed(path):
            offset += self._offset[each]
            self._parent[each], self._offset[each] = point, offset
        return point, offset

    def place(self, point: Point) -> tuple[Point, Seconds]:
        """The start of the block if the point has a time, or else its representative; and the seconds from there."""
        if point == ORIGIN:
            return ORIGIN, 0.0
        root, offset = self.find(point)
        clock = self._clock.get(root)
        return (root, offset) if clock is None else (ORIGIN, clock + offset)

    def at(self, point: Point) -> Seconds | None:
        """Seconds from the block's start at which the point is to happen; None if not given."""
        tied_to, seconds = self.place(point)
        return seconds if tied_to == ORIGIN else None

    def offset_between(self, one: Point, other: Point) -> Seconds | None:
        """Seconds from `one` to `other`; None if nothing ties them."""
        (root, start), (other_root, end) = self.place(one), self.place(other)
        return end - start if root == other_root else None

    def tie(self, equal: Equal, block: str) -> None:
        """Merge the classes of these points. Raises BlockRefused, with points and lines, at a contradiction."""
        first, *others = sorted(equal.terms, key=lambda term: term.point == ORIGIN)
        for term in others:
            self.add(first.point)
            self.add(term.point)
            apart = first.offset - term.offset  # first + first.offset = term + term.offset
            known = self.offset_between(first.point, term.point)
            if known is not None and abs(known - apart) > EPSILON:
                raise self._contradiction(first, term, known, block)
            self._links[first.point].append((term.point, (first, term)))
            self._links[term.point].append((first.point, (term, first)))
            self._merge(first.point, term.point, apart)

    def _merge(self, one: Point, other: Point, apart: Seconds) -> None:
        root, start = self.find(one)
        if other == ORIGIN:
            self._clock[root] = -apart - start
            return
        joined, end = self.find(other)
        if joined == root:
            return
        self._parent[joined], self._offset[joined] = root, start + apart - end
        if (clock := self._clock.pop(joined, None)) is not None:
            self._clock[root] = clock - self._offset[joined]

    def tie_if_possible(self, equal: Equal) -> bool:
        """Merge the classes of these points; False if that contradicts what is known."""
        try:
            self.tie(equal, "")
        except BlockRefused:
            return False
        return True

    def lines(self, one: Point, other: Point) -> set[int]:
        """Lines that tie the two points; empty if nothing does."""
        return {term.line for _, term in self._chain(one, other)} - {0}

    def _contradiction(self, first: Term, second: Term, known: Seconds, block: str) -> BlockRefused:
        chain = self._chain(first.point, second.point)
        lines = sorted({term.line for term in (first, second, *(term for _, term in chain))} - {0})
        sooner, later = map(_named, (first, second) if known >= 0 else (second, first))
        apart = f"{abs(round(known, 6)):g} s after {sooner}" if known else f"the same instant as {sooner}"
        said = ", ".join(f"{one.text} = {other.text}" for one, other in chain)
        why = f"{later} is already {apart} ({said})" if chain else "they are one sync point, with two offsets"
        reason = f"{first.text!r} and {second.text!r} cannot be one instant: {why}"
        advice = "leave one of them out" + (f"; see lines {', '.join(map(str, lines))}" if len(lines) > 1 else "")
        fault = Fault(reason=reason, where=block, line=max(lines, default=0), advice=advice)
        return BlockRefused(fault, "IMPOSSIBLE_TO_SCHEDULE")

    def _chain(self, start: Point, end: Point) -> "list[Link]":
        """The ties that lead from one point to another."""
        came: dict[Point, tuple[Point, Link] | None] = {start: None}
        queue = deque([start])
        while queue and end not in came:
            here = queue.popleft()
            for there, link in self._links[here]:
                if there not in came:
                    came[there] = (here, link)
                    queue.append(there)
        chain = []
        while (step := came.get(end)) is not None:
            chain.append(step[1])
            end = step[0]
        return chain[::-1]


def _named(term: Term) -> str:
    """Name of the point as the block spells it: what is written, without the offset."""
    return str(ORIGIN) if term.point == ORIGIN else _OFFSET.sub("", term.text)


def instants(classes: Classes, points: Collection[Point]) -> list[Instant]:
    """`points` (in a canonical order) grouped into instants: classes by their first point, each by offset."""
    members: dict[Point, list[tuple[Seconds, int, Point]]] = {}
    for number, point in enumerate(points):
        classes.add(point)
        root, offset = classes.find(point)
        members.setdefault(root, []).append((offset, number, point))
    found: list[Instant] = []
    for class_id, group in enumerate(members.values()):
        if len(group) == 1:
            alone = group[0][2]
            found.append(Instant((alone,), class_id, 0.0, classes.at(alone)))
            continue
        group.sort()
        lowest = group[0][0]
        together: list[tuple[Seconds, int, Point]] = []
        for member in group:
            if together and member[0] - together[0][0] > EPSILON:
                found.append(_instant(classes, together, class_id, lowest))
                together = []
            together.append(member)
        found.append(_instant(classes, together, class_id, lowest))
    return found


def _instant(classes: Classes, together: list[tuple[Seconds, int, Point]], class_id: int, lowest: Seconds) -> Instant:
    points = tuple(point for _, _, point in sorted(together, key=lambda member: member[1]))
    return Instant(points, class_id, round(together[0][0] - lowest, 9), classes.at(points[0]))
