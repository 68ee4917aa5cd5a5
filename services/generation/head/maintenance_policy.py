"""The maintenance policy: three watches, each with a claim on the head. Thesis 3.3.4.

Engagement is kept up also while nothing is said or shown: people look at what the other's hands do, else at the face,
and when nothing has connected them for longer than usual they check with a glance whether the other still attends.
"""

import math
from collections import Counter
from collections.abc import Sequence

from msgspec import Struct

from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorLost
from engage_hri.schemas.recognition import ConnectionEvent, Statistics
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.policy import HeadPolicy
from engage_hri.services.generation.head.scene import HeadScene, Observation

HAND_SPEED = 0.05
"""Speed in m/s above which a hand counts as moving: below it is the noise of vision. Ours."""
HAND_ONSET: Seconds = 0.2
"""Time that a hand moves before the head tracks it. Thesis 3.3.4 tracks hands; the number is ours."""
HAND_STILLNESS: Seconds = 0.8
"""Time that a hand is still before the head leaves it. Ours."""
GLANCE_DURATION: Seconds = 0.9
"""Time that a glance at the face lasts before the head goes back. Ours."""
ROUND: Seconds = 1.2
"""Time for which the head is on each of several people who were asked, until one of them speaks. Ours."""
MTBCE_PRIOR: Seconds = 5.7
"""Mean time between connection events that is assumed until `MTBCE_EVENTS` of them were seen. Table 2.1."""
MTBCE_LOW: Seconds = 3.0
"""Least value that the recent mean counts as: a burst of events is no reason to glance all the time. Ours."""
MTBCE_HIGH: Seconds = 15.0
"""Greatest value that the recent mean counts as: silence is no reason to glance no more. Ours."""
MTBCE_EVENTS = 5
"""Number of connection events, without the robot's glances, from which on the mean is believed. Ours."""


class _Hand(Struct):
    """A hand that has moved. active: it is tracked, for it has moved for long, and has not been still for long."""

    moving_since: Seconds | None = None
    still_since: Seconds | None = None
    active: bool = False


class HandWatch(HeadPolicy):
    """A hand that moves, or with which its owner manipulates something, until it has been still."""

    kind = "hands"

    def __init__(self, scene: HeadScene, config: GenerationConfig) -> None:
        super().__init__(scene, config)
        self._hands: dict[str, _Hand] = {}
        """Hands that move, or are tracked."""
        self._places: dict[str, Entity] = {}
        self._acts: dict[tuple[str, tuple[str, ...]], str] = {}
        """Manipulations under way: actor and targets -> the hand, or the object if no hand of the actor is known."""
        self._watched = ""

    def feed(self, message: Observation, now: Seconds) -> None:
        match message:
            case World():
                self._places = {entity.id: entity for entity in message.entities}
                self._see(message, now)
            case ActionBegan(action="act", actor=actor, targets=targets):
                id = self._acts.setdefault((actor, targets), self._hand_at(actor, targets))
                self._hands.setdefault(id, _Hand()).active = True
            case ActionEnded(action="act", actor=actor, targets=targets):
                self._rest((actor, targets), now)
            case ActorLost(actor=actor):
                for act in [act for act in self._acts if act[0] == actor]:
                    self._rest(act, now)
                self._lose(actor, now)

    def _rest(self, act: tuple[str, tuple[str, ...]], now: Seconds) -> None:
        """End a manipulation: its hand counts as still from now, unless it goes on moving."""
        id = self._acts.pop(act, None)
        if id is not None and (hand := self._hands[id]).moving_since is None:
            hand.still_since = now

    def _lose(self, owner: str, now: Seconds) -> None:
        """Let the hands of somebody who is lost be still: of hands that nobody sees, no world says that they stop."""
        for id, hand in self._hands.items():
            place = self._places.get(id)
            if place is not None and place.owner == owner and hand.moving_since is not None:
                hand.moving_since, hand.still_since = None, now

    def _see(self, world: World, now: Seconds) -> None:
        hands = (each for each in world.entities if each.kind == "hand" and each.owner != self.scene.robot)
        fast = {hand.id for hand in hands if math.hypot(*hand.velocity) > HAND_SPEED}
        for id in sorted(fast):
            hand = self._hands.setdefault(id, _Hand())
            if hand.moving_since is None:
                hand.moving_since = now
            hand.still_since = None
        for id, hand in self._hands.items():
            if id not in fast and (hand.moving_since is not None or hand.still_since is None):
                hand.moving_since = None
                hand.still_since = now

    def _hand_at(self, actor: str, targets: tuple[str, ...]) -> str:
        """The hand of `actor` that moves, else the one nearest to what it manipulates, else that thing itself."""
        hands = [entity for entity in self._places.values() if entity.kind == "hand" and entity.owner == actor]
        moving = [hand.id for hand in hands if self._hands.get(hand.id, _Hand()).moving_since is not None]
        if moving:
            return moving[0]
        thing = self._places.get(targets[0]) if targets else None
        if hands and thing is not None:
            return min(hands, key=lambda hand: (math.dist(hand.position, thing.position), hand.id)).id
        return hands[0].id if hands else targets[0] if targets else actor

    def _acting(self, id: str) -> bool:
        return id in self._acts.values()

    @property
    def deadline(self) -> Seconds | None:
        due = []
        for id, hand in self._hands.items():
            if hand.moving_since is not None and not hand.active:
                due.append(hand.moving_since + HAND_ONSET)
            elif hand.still_since is not None and hand.active and not self._acting(id):
                due.append(hand.still_since + HAND_STILLNESS)
        return min(due, default=None)

    def claim(self, now: Seconds, weaker: Sequence[Claim]) -> Claim | None:
        for id, hand in self._hands.items():
            if hand.moving_since is not None and now >= hand.moving_since + HAND_ONSET:
                hand.active = True
            elif hand.still_since is not None and not self._acting(id) and now >= hand.still_since + HAND_STILLNESS:
                hand.active = False
        self._hands = {id: hand for id, hand in self._hands.items() if hand.active or hand.moving_since is not None}
        active = [id for id, hand in self._hands.items() if hand.active]
        if not active:
            self._watched = ""
            return None
        if self._watched not in active:  # stay with a hand while it moves, however many others do
            self._watched = active[0]
        reason = "manipulates" if self._acting(self._watched) else "moves"
        return self.wish(self._watched, reason)


class FaceWatch(HeadPolicy):
    """The face of the person spoken to last, else the nearest one; if all are lost, the last direction.

    While several people are to answer, the face of one after the other: the one named first comes last, for the look
    at the end of the turn was for that one.
    """

    kind = "face"

    def __init__(self, scene: HeadScene, config: GenerationConfig) -> None:
        super().__init__(scene, config)
        self._seen: Seconds = float("-inf")
        self._followed = ""
        self._goes_round = False
        self._next_at: Seconds | None = None
        """Time to go on to the next one who is to answer; None: the head is not on a face by this claim."""

    def join(self, other: str, name: str) -> None:
        self._followed = name if self._followed == other else self._followed

    @property
    def deadline(self) -> Seconds | None:
        lost = self.scene.sight.changes_after(self._seen)
        return min((*lost, *([] if self._next_at is None else [self._next_at])), default=None)

    def has_head(self, has: bool, now: Seconds) -> None:
        if not has or not self._goes_round:
            self._next_at = None
        elif self._next_at is None:
            self._next_at = now + ROUND

    def claim(self, now: Seconds, weaker: Sequence[Claim]) -> Claim | None:
        self._seen = now
        present, partner = self.scene.sight.present(now), self.scene.partner
        to_answer = [who for who in self.scene.asked if who in present] if self.scene.waits else []
        if len(to_answer) > 1:
            is_due = self._next_at is not None and now >= self._next_at
            if is_due or not self._goes_round or self._followed not in to_answer:
                place = to_answer.index(self._followed) if self._followed in to_answer else -1
                self._followed = to_answer[(place + 1) % len(to_answer)]
                self._next_at = None
            self._goes_round = True
            return self.wish(self._followed, "is to answer: others are, too")
        self._goes_round = False
        if not present:
            return self.wish("", "lost: hold the direction") if self.scene.sight.has_met else None
        if partner in present:
            self._followed = partner
        elif self._followed not in present:  # stay with a face while it is seen, however people move about
            self._followed = present[0]
        return self.wish(self._followed, "spoken with last" if self._followed == partner else "nearest when it came")


class GlanceWatch(HeadPolicy):
    """A quick look at the face when nothing has connected for longer than usual.

    The quiet is counted from the last start of a connection event or from when the head last was on a face,
    whichever is later: a robot that has just looked need not check.
    """

    kind = "glance"

    def __init__(self, scene: HeadScene, config: GenerationConfig) -> None:
        super().__init__(scene, config)
        self._statistics: dict[str, Statistics] = {}
        self._quiet_since: Seconds | None = None
        self._on_face = False
        self._session = ""
        self._own: Counter[str] = Counter()
        """Number of the robot's glances in this session of recognition, by person; "": at all together."""
        self._until: Seconds | None = None
        self.face = ""
        """Id of the person at whom a glance would look; empty: there is none."""

    def feed(self, message: Observation, now: Seconds) -> None:
        match message:
            case Statistics(actor=actor):
                self._statistics[actor] = message
            case ConnectionEvent(state="started", cause=cause, responder=responder, session=session):
                self._quiet_since = now
                if session != self._session:  # another life of recognition counts from zero
                    self._session = session
                    self._own.clear()
                if cause == "maintenance":
                    self._own.update((responder, ""))

    def forget(self, person: str) -> None:
        self._statistics.pop(person, None)
        self._own.pop(person, None)

    def has_head(self, has: bool, now: Seconds) -> None:
        if has and self._until is None:
            self._until = now + GLANCE_DURATION
        elif not has and self._until is not None:
            self._until, self._quiet_since = None, now
        on_face = self.scene.sight.is_face(self.scene.head_on)
        if self._on_face != on_face or self._quiet_since is None:
            self._quiet_since = now
        self._on_face = on_face

    @property
    def pace(self) -> Seconds:
        """Mean time between connection events, without the robot's glances, within its limits."""
        actor = self.face if self.face in self._statistics else ""
        seen = self._statistics.get(actor)
        if seen is None or seen.session.events - self._own[actor] < MTBCE_EVENTS:
            return MTBCE_PRIOR
        recent = seen.recent.mtbce_without_maintenance
        if recent is None:
            return MTBCE_HIGH  # nothing in the window: slower than it can show
        return min(max(recent, MTBCE_LOW), MTBCE_HIGH)

    @property
    def _due(self) -> Seconds | None:
        if self._on_face or not self.face or self._quiet_since is None:
            return None
        return self._quiet_since + self.config.glance_factor * self.pace

    @property
    def deadline(self) -> Seconds | None:
        return self._until if self._until is not None else self._due

    def claim(self, now: Seconds, weaker: Sequence[Claim]) -> Claim | None:
        self.face = next((claim.target for claim in weaker if claim.kind == FaceWatch.kind), "")
        wanted = now < self._until if self._until is not None else self._due is not None and now >= self._due
        if not wanted or not self.face:
            return None
        quiet = self.config.glance_factor * self.pace
        return self.wish(self.face, f"quiet for longer than {quiet:.1f} s")
