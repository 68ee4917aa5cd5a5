"""What a robot's head did in a conversation, as an annotator would find it: from arrivals and departures alone.

Input is what was on the bus. Looks are those that control has reported of the eyes, at the instants at which they
came to rest and left; speech is that which was heard. Of generation only the fragments count, as the manager sent
them: to whom a turn was. What the head was ordered to do, and why, is not read. Times are seconds.
"""

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from engage_hri.schemas.fragments import FragmentOutcome, PerformFragment, TurnClosed, ids_in
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.recognition import Floor
from engage_hri.schemas.world import World

BRIEF = 0.3
"""Below this a fixation is too brief for anybody to have seen something."""
AT_ONCE = 0.02
"""Below this it is no fixation at all."""
AWAY = (0.5, 3.0)
"""Length of a look away from a face: nine of ten of people's are within."""
MUTUAL = 0.8
"""Time for which eyes that have met are not to be drawn away by a hand."""
INSTANT = 1e-6


class Span(NamedTuple):
    """Something that went on. what: id of what was looked at, or of the behavior that was said."""

    began: float
    ended: float
    what: str = ""

    @property
    def length(self) -> float:
        return self.ended - self.began


def spans(messages: Iterable[Message], actor: str, action: str) -> list[Span]:
    """Actions of one kind of one actor that are over. One that is told anew ends the one before."""
    found: list[Span] = []
    began: ActionBegan | None = None
    for message in messages:
        if isinstance(message, ActionBegan | ActionEnded) and (message.actor, message.action) == (actor, action):
            if began is not None:
                found.append(Span(began.at.seconds, message.at.seconds, _what(began)))
            began = message if isinstance(message, ActionBegan) else None
    return found


def _what(action: ActionBegan) -> str:
    return action.behavior if action.action == "speak" else next(iter(action.targets), "")


def shared(one: Span, others: Iterable[Span]) -> Iterator[Span]:
    """Parts of a span within others."""
    for other in others:
        began, ended = max(one.began, other.began), min(one.ended, other.ended)
        if ended > began:
            yield Span(began, ended, other.what)


def seconds(one: Span, other: Span) -> float:
    """Length of what two have in common."""
    return max(0.0, min(one.ended, other.ended) - max(one.began, other.began))


def moments(speeches: Sequence[Span], looks: Sequence[Span]) -> Iterator[tuple[Span, frozenset[str]]]:
    """Parts of the time in which somebody speaks: each with what the eyes rest on, and all who speak then.

    Eyes are at one place only: of two who speak to the robot at once, either is who speaks to it.
    """
    for began, ended in pairwise(sorted({at for each in (*speeches, *looks) for at in (each.began, each.ended)})):
        if who := frozenset(each.what for each in speeches if each.began <= began and ended <= each.ended):
            on = (look.what for look in looks if look.began <= began and ended <= look.ended)
            yield Span(began, ended, next(on, "")), who


class HeadFindings(NamedTuple):
    """Findings in one conversation, or in several. Counts can be added; each share is of a sum."""

    minutes: float
    looks: int
    brief: Counter[str]
    """Looks below `BRIEF`, by the kind of what was looked at."""
    at_once: int
    """Looks of no length."""
    turns: int
    turns_on_face: int
    """Turns at whose last word the eyes rested on one of those spoken to."""
    turns_soon: int
    """Turns within half a second after whose last word they did."""
    heard: float
    """Seconds for which somebody spoke to the robot."""
    heard_on_face: float
    """Seconds of these in which the eyes rested on one who did."""
    aways: tuple[float, ...]
    """Lengths of looks away from a face, until the next look at a face. A turn from one face to another, without a
    look at anything between, is none: a head takes half a second for it."""
    mutual: int
    """Times that eyes met."""
    broken_by_hands: int
    """Those that the robot left within `MUTUAL` for a hand."""
    lengths: tuple[float, ...] = ()

    def __add__(self, other: "HeadFindings") -> "HeadFindings":  # type: ignore[override]
        return HeadFindings(*(one + another for one, another in zip(self, other, strict=True)))  # type: ignore[operator]

    @property
    def on_face(self) -> float:
        return self.turns_on_face / self.turns

    @property
    def brief_share(self) -> float:
        return sum(self.brief.values()) / self.looks

    @property
    def on_speaker(self) -> float:
        return self.heard_on_face / self.heard

    @property
    def aways_a_minute(self) -> float:
        """Looks away from a face of a length within `AWAY`."""
        return sum(AWAY[0] <= each <= AWAY[1] for each in self.aways) / self.minutes

    def told(self) -> str:
        away = sorted(self.aways)
        return (
            f"{self.minutes:.1f} min, {self.looks} looks: < {BRIEF:g} s {self.brief_share:.1%} {dict(self.brief)}, "
            f"at once {self.at_once}; turns {self.turns}: on the face {self.on_face:.1%}, "
            f"0.5 s later {self.turns_soon / self.turns:.1%}; on who speaks to it {self.on_speaker:.1%} of "
            f"{self.heard:.0f} s; away {AWAY[0]:g}-{AWAY[1]:g} s {self.aways_a_minute:.1f} a minute (of all "
            f"{len(away)}: median {away[len(away) // 2] if away else 0:.2f}); eyes met {self.mutual}, "
            f"left for a hand within {MUTUAL:g} s {self.broken_by_hands}"
        )


def findings(messages: list[Message], robot: str = "robot") -> HeadFindings:
    """Find what the head did. messages: all that was on the bus, in order."""
    looks = spans(messages, robot, "look")
    kinds = {entity.id: entity.kind for each in messages if isinstance(each, World) for entity in each.entities}
    people = sorted(id for id, kind in kinds.items() if kind == "person" and id != robot)
    brief = [each for each in looks if each.length < BRIEF - INSTANT]
    ends = list(turn_ends(messages, robot))
    on_face = [_is_on(looks, at, to or people) for at, to in ends]
    soon = [_is_on(looks, at, to or people, 0.5) for at, to in ends]
    at_faces = [each for each in looks if each.what in people]
    heard = list(moments(list(to_robot(messages, robot)), looks))
    following = dict(pairwise(looks))
    gaps = (
        later.began - one.ended
        for one, later in pairwise(at_faces)
        if later.what == one.what or following[one] != later
    )
    mutual = list(_mutual(messages, looks, people, robot))
    broken = [
        each for each, look in mutual
        if each.length < MUTUAL and each.ended == look.ended
        and look in following and kinds.get(following[look].what) == "hand"
    ]  # fmt: skip
    instants = [each.at.seconds for each in messages if isinstance(each, ActionBegan | ActionEnded)]
    return HeadFindings(
        minutes=(max(instants) - min(instants)) / 60,
        looks=len(looks),
        brief=Counter(kinds.get(each.what, "other") for each in brief),
        at_once=sum(each.length < AT_ONCE for each in looks),
        turns=len(ends),
        turns_on_face=sum(on_face),
        turns_soon=sum(soon),
        heard=sum(each.length for each, _ in heard),
        heard_on_face=sum(each.length for each, who in heard if each.what in who),
        aways=tuple(gap for gap in gaps if gap > AT_ONCE),
        mutual=len(mutual),
        broken_by_hands=len(broken),
        lengths=tuple(each.length for each in looks),
    )


def turn_ends(messages: list[Message], robot: str = "robot") -> Iterator[tuple[float, tuple[str, ...]]]:
    """Find each turn that was said to its end: when its last word ended, and to whom it was."""
    said = spans(messages, robot, "speak")
    outcomes = {each.fragment: each.status for each in messages if isinstance(each, FragmentOutcome)}
    told = {id: each for each in messages if isinstance(each, TurnClosed) for id in each.fragments}
    for message in messages:
        if isinstance(message, PerformFragment) and message.fragment.turn_status in ("end", "full"):
            fragment = message.fragment
            words = [each.ended for each in said if each.what.startswith(f"{fragment.id}:")]
            if words and outcomes.get(fragment.id) == "done":
                turn = told.get(fragment.id)
                named = ids_in(fragment.addressee) if fragment.addressee != "*" else ()
                yield max(words), named or ((turn.addressee, *turn.others) if turn else ())


def _is_on(looks: list[Span], at: float, faces: Iterable[str], within: float = 0.0) -> bool:
    """True if the eyes rest on one of the faces at an instant, or come there `within` seconds from then."""
    here = bisect_right(looks, at + within + INSTANT, key=lambda each: each.began)
    return any(look.ended > at and look.what in faces for look in looks[max(0, here - 3) : here])


def to_robot(messages: list[Message], robot: str) -> Iterator[Span]:
    """Find the speech of people to the robot: of one person all; of several that of which recognition knew so."""
    people = sorted({each.id for world in messages if isinstance(world, World) for each in world.people} - {robot})
    floors = [each for each in messages if isinstance(each, Floor)]
    known = {
        (speech.actor, round(speech.since.seconds, 3))
        for floor in floors for speech in (*floor.speeches, *floor.ended) if robot in speech.to
    }  # fmt: skip
    for person in people:
        for speech in spans(messages, person, "speak"):
            if len(people) == 1 or (person, round(speech.began, 3)) in known:
                yield Span(speech.began, speech.ended, person)


def _mutual(
    messages: list[Message], looks: list[Span], people: Iterable[str], robot: str
) -> Iterator[tuple[Span, Span]]:
    """Find where eyes met: for how long, and within which look of the robot."""
    for person in people:
        theirs = [each for each in spans(messages, person, "look") if each.what == robot]
        for look in looks:
            if look.what == person:
                yield from ((Span(each.began, each.ended, person), look) for each in shared(look, theirs))
