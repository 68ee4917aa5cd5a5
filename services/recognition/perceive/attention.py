"""Actions of people from raw perception: looks from head poses, speech from voices, manipulations from the world.

    attention = Attention("robot", RecognitionConfig(), clock="loop")
    actions = attention.feed(pose, at)              # at: of the pose; late, double and impossible ones are dropped
    actions = attention.advance(now)                # whenever `attention.deadline` has been reached

A symbolic report of an action has precedence: from the first one on, raw perception of that action of that person is
ignored, as long as the `Attention` lives. A look is always at something, if only away: so where none goes on for
`FACE_GRACE`, nobody reports looks any more, and heads count again, as of who played a person by hand and now lets a
camera see them. Actions carry the times at which they began and ended, though they are known only later; until then
`undecided` says from when on.

How much a head attends to the robot is a matter of degree, and of the person: see `attending.py`. So is where
somebody looks whose head's deviation is stated: while it is known from elsewhere what they look at, their head is
learned from (`sure_looks.py`).
"""

import math
from collections.abc import Iterable, Iterator
from itertools import chain
from typing import Literal

from msgspec.structs import replace

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.body import Ray, RobotState
from engage_hri.schemas.perception import (
    ActionBegan,
    ActionEnded,
    ActorFound,
    ActorLost,
    HeadPose,
    Looked,
    VoiceActivity,
)
from engage_hri.schemas.recognition import HeadHabit
from engage_hri.schemas.units import Probability, Seconds, Stamp, Vector, minus
from engage_hri.schemas.world import World
from engage_hri.services.bus.deadlines import Absent
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.interrupted_looks import Symbolic
from engage_hri.services.recognition.events.presence import NEVER
from engage_hri.services.recognition.events.scene import Covered
from engage_hri.services.recognition.perceive.attending import Attending
from engage_hri.services.recognition.perceive.gaze_targets import AWAY, GazeTargets, Spread, is_direction, is_place
from engage_hri.services.recognition.perceive.manipulation import Manipulation, PersonChanges
from engage_hri.services.recognition.perceive.onsets import ROUNDING, Change, Looking, SpeechDetector
from engage_hri.services.reports.action_reports import FACE_GRACE

Raw = HeadPose | Looked | VoiceActivity | World | RobotState
Known = Literal["mutual", "point", "act"]
"""From what it is known at what a person looks: eyes that have met, a finger, a piece in the hand."""


STALL: Seconds = 0.5
"""Longest time between two instants at which a source has looked all the while. More is a stall. Decision 0239."""


class _Actor:
    """State of one person: gaze, voice, last signs of life, and what perception reports itself."""

    def __init__(self, id: str, number: int, config: RecognitionConfig) -> None:
        self.id = id
        self.number = number
        """Position in the order in which people came."""
        self.looking = Looking()
        self.voice = SpeechDetector()
        self.posed_at = self.heard_at = self.alive_at = NEVER
        """Times of the latest head pose and voice level, and of the latest sign of life."""
        self.looked_at: Seconds | None = None
        """Time until which a source has looked for this face; None: none tells that."""
        self.missed: Seconds = 0.0
        """Time for which it has looked since the latest pose, and not seen it."""
        self.seen = False
        """True while the face is found and not lost since."""
        self.reported: set[Action] = set()
        """Actions that perception reports itself."""
        self.look_ended = NEVER
        """Time at which the last look that perception reported has ended; infinite: one goes on."""
        self.presence_reported = False
        self.attending = Attending()
        self.known: dict[Known, str] = {}
        """What the person looks at, as is known from what else they do."""
        self.to_robot: Probability | None = None
        """How much the head attends to the robot; None: it is not seen, or perception reports looks itself."""

    @property
    def may_be_lost(self) -> bool:
        """True if no news are a sign of absence: the source has looked in vain, or never tells when it looks."""
        return self.looked_at is None or self.missed >= FACE_GRACE - ROUNDING

    @property
    def face_lost_at(self) -> Seconds | None:
        return self.posed_at + FACE_GRACE if self.looking.nearest is not None and self.may_be_lost else None

    @property
    def lost_at(self) -> Seconds | None:
        is_counted = self.seen and not self.presence_reported and self.may_be_lost
        return self.alive_at + FACE_GRACE if is_counted else None

    def is_looked_for(self, at: Seconds, *, is_seen: bool) -> None:
        """Take that a source has looked for this face. Of the time between only that counts in which it does."""
        step = at - (self.looked_at if self.looked_at is not None else at)
        self.missed = 0.0 if is_seen else self.missed + (step if step <= STALL else 0.0)
        self.looked_at = at

    @property
    def deadlines(self) -> Iterator[Seconds]:
        yield from (at for at in (self.face_lost_at, self.lost_at, self.voice.deadline) if at is not None)

    @property
    def is_attended(self) -> bool:
        """True if a deadline or an undecided action is pending."""
        return any(True for _ in chain(self.deadlines, self.undecided))

    @property
    def undecided(self) -> Iterator[Seconds]:
        for action, since in (("look", self.looking.undecided_since), ("speak", self.voice.undecided_since)):
            if since is not None and action not in self.reported:
                yield since


class Attention:
    """Actions of all people around `robot`, from what cameras and microphones report. clock: of the stamps."""

    def __init__(self, robot: str, config: RecognitionConfig, clock: str = "loop") -> None:
        self._robot = robot
        self._config = config
        self.attended: dict[str, Probability | None] = {}
        """How much heads attend to the robot, of those of which that has changed since somebody emptied this."""
        self.learned: dict[str, HeadHabit] = {}
        """What is known of heads, of those of whom something has been learned since somebody emptied this."""
        self._clock = clock
        self._gaze_targets = GazeTargets(robot, config)
        self._manipulation = Manipulation(robot, config)
        self._actors: dict[str, _Actor] = {}
        self._attended: dict[str, _Actor] = {}
        """The actors for whom a deadline or an undecided action is pending."""
        self._mentioned: Absent[str] = Absent()
        """All actors, each by its last observation."""
        self._came = 0
        self._world_at = NEVER

    @property
    def deadline(self) -> Seconds | None:
        """Time at which an action ends or a person has gone, unless perception says otherwise before."""
        times = [at for actor in self._attended.values() for at in actor.deadlines]
        if self._manipulation.deadline is not None:
            times.append(self._manipulation.deadline)
        return min(times, default=None)

    @property
    def undecided(self) -> list[Seconds]:
        """Start times of what may yet turn out to be a look, speech, or the end of one."""
        return [since for actor in self._attended.values() for since in actor.undecided]

    @property
    def covered(self) -> Covered:
        """The pieces under hands of people whose manipulations perception does not report itself."""
        coverings = self._manipulation.covering
        return Covered(frozenset(one for one in coverings if not self._reports(one.actor, "act")))

    def feed(self, observation: Raw, at: Seconds) -> list[Symbolic]:
        """Take an observation made at `at`. Returns the actions that began and ended, in order."""
        self._forget(at)
        actions = self.advance(at)
        match observation:
            case HeadPose():
                actions += self._take_pose(self._actor(observation.actor, at), observation, at)
                self._attend(observation.actor)
            case Looked():
                for id in (*observation.seen, *observation.missed):
                    if (actor := self._actors.get(id)) is not None and at > (actor.looked_at or NEVER):
                        actor.is_looked_for(at, is_seen=id in observation.seen)
                        self._attend(id)
                actions += self.advance(at)
            case VoiceActivity():
                actions += self._take_voice(self._actor(observation.actor, at), observation, at)
                self._attend(observation.actor)
            case World() if at >= self._world_at and all(is_place(one.position) for one in observation.entities):
                self._world_at = at
                self._gaze_targets.see(observation, at)
                actions += self._manipulated(self._manipulation.feed(observation, at), at)
            case RobotState(gaze=Ray(origin=eyes)) if is_place(eyes):
                self._gaze_targets.see_face(self._robot, eyes)
        return actions

    def take_report(self, report: Symbolic, at: Seconds) -> list[Symbolic]:
        """Take a symbolic report: raw perception of the same is ignored from now on. Returns no actions itself."""
        self._forget(at)
        actor = self._actor(report.actor, at)
        match report:
            case ActionBegan() | ActionEnded():
                actor.reported.add(report.action)
                self._know(report)
                if report.action == "look":
                    actor.look_ended = at if isinstance(report, ActionEnded) else float("inf")
                    self._attends(actor, None)
            case ActorFound():
                actor.presence_reported = True
            case ActorLost():
                actor.presence_reported = True
                self._lose(actor, at)
        self._attend(actor.id)
        return []

    def advance(self, now: Seconds) -> list[Symbolic]:
        actions = self._manipulated(self._manipulation.advance(now), now)
        for actor in sorted(self._attended.values(), key=lambda actor: actor.number):
            actions += self._tell(actor, actor.voice.advance(now))
            if self._manipulation.is_acting(actor.id):
                actor.alive_at = max(actor.alive_at, now)
            if actor.lost_at is not None and now >= actor.lost_at - ROUNDING:
                at = actor.alive_at
                self._lose(actor, at)
                actions.append(ActorLost(actor=actor.id, at=self._stamp(at)))
            elif actor.face_lost_at is not None and now >= actor.face_lost_at - ROUNDING:
                self._attends(actor, 0.0)
                actions += self._tell(actor, actor.looking.lose(actor.posed_at))
            self._attend(actor.id)
        return actions

    def give_up(self, at: Seconds) -> list[Symbolic]:
        """End all actions and presences found so far, so that a successor can begin with nothing."""
        ends: list[Symbolic] = []
        for actor in self._attended.values():
            stamp = self._stamp(max(at, actor.alive_at))
            piece = self._manipulation.first_piece(actor.id)
            if piece and "act" not in actor.reported:
                ends.append(ActionEnded(actor=actor.id, action="act", at=stamp, targets=piece))
            if actor.voice.speaks and "speak" not in actor.reported:
                ends.append(ActionEnded(actor=actor.id, action="speak", at=stamp))
            if actor.seen and not actor.presence_reported:
                ends.append(ActorLost(actor=actor.id, at=stamp))
        return ends

    # -- people ------------------------------------------------------------------------------------------------

    def _reports(self, actor: str, action: Action) -> bool:
        """True if perception itself reports this action of this person."""
        return actor in self._actors and action in self._actors[actor].reported

    def _actor(self, id: str, at: Seconds) -> _Actor:
        """The actor with this id, made if it is new, and mentioned at `at`."""
        if id not in self._actors:
            self._came += 1
            self._actors[id] = _Actor(id, self._came, self._config)
        self._mentioned.leaves(id, at)
        return self._actors[id]

    def _attend(self, id: str) -> None:
        if self._actors[id].is_attended:
            self._attended[id] = self._actors[id]
        else:
            self._attended.pop(id, None)

    def join(self, other: str, kept: str, at: Seconds) -> None:
        """Forget an actor who is `kept`, with what goes on; what was learned of their head is kept."""
        if other in self._actors:
            actor = self._actor(kept, at)
            actor.attending.sure.remember(self._actors[other].attending.sure.looks)
            if (habit := actor.attending.sure.habit()) is not None:
                self.learned[kept] = habit
            self._manipulation.lose(other)
            self._mentioned.comes(other)
            self._drop(other)

    def _forget(self, now: Seconds) -> None:
        """Forget actors who have not been observed for long, as the session does."""
        for id in self._mentioned.forgotten(now):
            self._drop(id)

    def _drop(self, id: str) -> None:
        del self._actors[id]
        self._attended.pop(id, None)
        self.attended.pop(id, None)
        self.learned.pop(id, None)
        self._gaze_targets.forget_face(id)

    # -- one person ---------------------------------------------------------------------------------------------

    def _take_pose(self, actor: _Actor, pose: HeadPose, at: Seconds) -> list[Symbolic]:
        credible = pose.confidence >= self._config.least_confidence
        if at <= actor.posed_at or not credible or not (is_place(pose.position) and is_direction(pose.direction)):
            return []
        actions: list[Symbolic] = []
        if not actor.seen and not actor.presence_reported:
            actions.append(ActorFound(actor=actor.id, at=self._stamp(at)))
        actor.seen, actor.posed_at = True, at
        actor.alive_at = max(actor.alive_at, at)
        self._gaze_targets.see_face(actor.id, pose.position, at)
        if at > actor.look_ended + FACE_GRACE:
            actor.reported.discard("look")
        if "look" in actor.reported:
            return actions
        targets, present = self._gaze_targets, actor.looking.nearest
        gaze, spread = self._mended(actor, pose, at)
        seen = targets.target(actor.id, gaze, present=present, at=at, sure=pose.confidence, spread=spread)
        is_free = seen.targets in (AWAY, (self._robot,))
        offset = targets.offset_of_robot((pose.position, pose.direction))
        self._attends(actor, round(actor.attending.judge(offset, at, is_free=is_free), 1))
        return actions + self._tell(actor, actor.looking.feed(seen, at))

    def _mended(self, actor: _Actor, pose: HeadPose, at: Seconds) -> tuple[tuple[Vector, Vector], Spread | None]:
        """Eyes and direction of a gaze, by what is known of this person's head, and its deviation if it is stated.

        What somebody looks at now, if it is known, is learned from.
        """
        eyes, targets, sure = pose.position, self._gaze_targets, actor.attending.sure
        if pose.yaw_spread is None or pose.pitch_spread is None:
            return (eyes, pose.direction), None
        spread = math.degrees(pose.yaw_spread), math.degrees(pose.pitch_spread)
        head = targets.beside_robot(eyes, pose.direction)
        there = targets.place(next(reversed(actor.known.values()))) if actor.known else None
        if there is not None and there != eyes:
            known = targets.beside_robot(eyes, minus(there, eyes))
            if sure.is_another(known, at):
                self._learned(actor)
            sure.take(head, known, spread, at)
        aim, (aside, above) = sure.aim(head, spread)
        return (eyes, targets.towards(eyes, aim)), (math.radians(aside), math.radians(above))

    def knows(self, person: str, by: Known, target: str) -> None:
        """Take what a person is known to look at from now on, until it is not; empty: this tells no more of it."""
        if person not in self._actors:
            return
        actor = self._actors[person]
        if target:
            actor.known[by] = target
        elif actor.known.pop(by, None) is not None:
            self._learned(actor)

    def resume_head(self, person: str, head: HeadHabit, at: Seconds) -> None:
        """Go on from what a former life has learned of somebody's head."""
        self._actor(person, at).attending.sure.remember(head.looks)

    def _learned(self, actor: _Actor) -> None:
        """End the look that is known, and note what has been learned of it."""
        if actor.attending.sure.rest() and (habit := actor.attending.sure.habit()) is not None:
            self.learned[actor.id] = habit

    def _attends(self, actor: _Actor, much: Probability | None) -> None:
        if much != actor.to_robot:
            actor.to_robot = much
            self.attended[actor.id] = much

    def _know(self, action: ActionBegan | ActionEnded) -> None:
        """Take what a person points at, or has in the hand: that is looked at, mostly."""
        if action.action in ("point", "act"):
            is_sure = isinstance(action, ActionBegan) and len(action.targets) == 1
            self.knows(action.actor, action.action, action.targets[0] if is_sure else "")

    def _take_voice(self, actor: _Actor, voice: VoiceActivity, at: Seconds) -> list[Symbolic]:
        if at <= actor.heard_at or voice.confidence < self._config.least_confidence:
            return []
        actor.heard_at = at
        changes = actor.voice.feed(voice.active, at, voice.confidence)
        if voice.active and actor.voice.speaks:
            actor.alive_at = max(actor.alive_at, at)
        return self._tell(actor, changes)

    def _lose(self, actor: _Actor, at: Seconds) -> None:
        """End all that the person did, for the person has gone."""
        actor.seen = False
        actor.known.clear()
        self._learned(actor)
        self._attends(actor, None if actor.to_robot is None else 0.0)
        actor.looking.lose(at)
        actor.voice.lose(at)
        self._manipulation.lose(actor.id)

    def _manipulated(self, found: Iterable[PersonChanges], at: Seconds) -> list[Symbolic]:
        actions: list[Symbolic] = []
        for actor, changes in found:
            told = self._tell(self._actor(actor, at), changes)
            for action in told:
                if isinstance(action, ActionBegan | ActionEnded):
                    self._know(action)
            actions += told
            self._attend(actor)
        return actions

    def _tell(self, actor: _Actor, changes: Iterable[Change]) -> list[Symbolic]:
        actions: list[Symbolic] = []
        for began, action, at, targets, confidence, one_of in changes:
            if action != "look":
                actor.alive_at = max(actor.alive_at, at)
            if action in actor.reported:
                continue
            kind, stamp = ActionBegan if began else ActionEnded, self._stamp(at)
            told = kind(actor=actor.id, action=action, at=stamp, targets=targets, confidence=confidence)
            actions.append(replace(told, one_of=True) if one_of else told)
        return actions

    def _stamp(self, at: Seconds) -> Stamp:
        return Stamp(self._clock, at)
