"""Who does what, from raw perception: looks from head poses, speech from voice levels, manipulations from the world.

    attention = Attention("robot", RecognitionConfig(), clock="loop")
    actions = attention.feed(pose, at)              # at: its own time; late, double and impossible poses are dropped
    actions = attention.advance(now)                # whenever `attention.deadline` has been reached

Where perception says itself what a person does, it is believed: from the first symbolic observation of an action of
somebody on, raw perception of the same is ignored, as long as this lives. Actions carry the times at which they
began and ended, though they are known only later; until then `undecided` says from when on.
"""

from collections.abc import Iterable, Iterator

from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.body import RobotState
from engage_hri.schemas.perception import HeadPose, VoiceActivity
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.schemas.world import World
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.presence import NEVER
from engage_hri.services.recognition.events.scene import Covered
from engage_hri.services.recognition.perceive.gaze_targets import GazeTargets, is_direction, is_place
from engage_hri.services.recognition.perceive.looks import ROUNDING, Change, Looking
from engage_hri.services.recognition.perceive.manipulation import Manipulation
from engage_hri.services.recognition.perceive.speech import Voice

Raw = HeadPose | VoiceActivity | World | RobotState
Symbolic = ActionBegan | ActionEnded | ActorFound | ActorLost


class _Actor:
    """What is known of one person."""

    def __init__(self, id: str, number: int, config: RecognitionConfig) -> None:
        self.id = id
        self.number = number
        """In the order in which they came."""
        self.looking = Looking(config.sensing.dwell)
        self.voice = Voice(config.sensing)
        self.posed_at = self.heard_at = self.alive_at = NEVER
        """Times of the latest head pose and voice level, and of the latest sign of life."""
        self.seen = False
        """The face has been found, and not been lost since."""
        self.told: set[Action] = set()
        """Actions that perception reports itself."""
        self.presence_told = False
        self._grace = config.lost_face_grace

    @property
    def face_lost_at(self) -> Seconds | None:
        return self.posed_at + self._grace if self.looking.nearest is not None else None

    @property
    def lost_at(self) -> Seconds | None:
        return self.alive_at + self._grace if self.seen and not self.presence_told else None

    @property
    def deadlines(self) -> Iterator[Seconds]:
        yield from (at for at in (self.face_lost_at, self.lost_at, self.voice.deadline) if at is not None)

    @property
    def is_attended(self) -> bool:
        """Something may happen by itself, or is yet undecided."""
        return any(True for _ in self.deadlines) or any(True for _ in self.undecided)

    @property
    def undecided(self) -> Iterator[Seconds]:
        for action, since in (("look", self.looking.undecided_since), ("speak", self.voice.undecided_since)):
            if since is not None and action not in self.told:
                yield since


class Attention:
    """Everybody around `robot`. clock: of the stamps of the actions."""

    def __init__(self, robot: str, config: RecognitionConfig, clock: str = "loop") -> None:
        self._robot = robot
        self._config = config
        self._clock = clock
        self._sight = GazeTargets(robot, config)
        self._manipulation = Manipulation(robot, config)
        self._actors: dict[str, _Actor] = {}
        self._attended: dict[str, _Actor] = {}
        """Of those, whom the passing of time concerns."""
        self._told_of: dict[str, Seconds] = {}
        """When somebody last told of each actor; the longest ago first."""
        self._came = 0
        self._world_at = NEVER

    @property
    def deadline(self) -> Seconds | None:
        """When something ends, or somebody has gone, unless perception says otherwise before."""
        times = [at for actor in self._attended.values() for at in actor.deadlines]
        if self._manipulation.deadline is not None:
            times.append(self._manipulation.deadline)
        return min(times, default=None)

    @property
    def undecided(self) -> list[Seconds]:
        """Since when gazes and voices do something that may be a look, or speech, or the end of one."""
        return [since for actor in self._attended.values() for since in actor.undecided]

    @property
    def covered(self) -> Covered:
        """Which pieces are under hands of people of whom nobody says when they move some."""
        of = self._manipulation.covering
        return Covered(frozenset(one for one in of if not self._tells(one.actor, "act")))

    def feed(self, observation: Raw, at: Seconds) -> list[Symbolic]:
        """What has begun and ended, in order. at: when the observation was made."""
        self._forget(at)
        actions = self.advance(at)
        match observation:
            case HeadPose():
                actions += self._faces(self._actor(observation.actor, at), observation, at)
                self._attend(observation.actor)
            case VoiceActivity():
                actions += self._sounds(self._actor(observation.actor, at), observation, at)
                self._attend(observation.actor)
            case World() if at >= self._world_at and all(is_place(one.position) for one in observation.entities):
                self._world_at = at
                self._sight.see(observation, at)
                for actor, changes in self._manipulation.feed(observation, at):
                    actions += self._tell(self._actor(actor, at), changes)
                    self._attend(actor)
            case RobotState() if is_place(observation.gaze.origin):
                self._sight.see_face(self._robot, observation.gaze.origin)
        return actions

    def believe(self, told: Symbolic, at: Seconds) -> list[Symbolic]:
        """Perception itself says what somebody does: no need to find it out any more. Nothing follows from it."""
        self._forget(at)
        actor = self._actor(told.actor, at)
        match told:
            case ActionBegan() | ActionEnded():
                actor.told.add(told.action)
            case ActorFound():
                actor.presence_told = True
            case ActorLost():
                actor.presence_told = True
                self._lose(actor, at)
        self._attend(actor.id)
        return []

    def advance(self, now: Seconds) -> list[Symbolic]:
        actions: list[Symbolic] = []
        for owner, changes in self._manipulation.advance(now):
            actions += self._tell(self._actor(owner, now), changes)
            self._attend(owner)
        for actor in sorted(self._attended.values(), key=lambda actor: actor.number):
            actions += self._tell(actor, actor.voice.advance(now))
            if self._manipulation.acts(actor.id):
                actor.alive_at = max(actor.alive_at, now)
            if actor.lost_at is not None and now >= actor.lost_at - ROUNDING:
                at = actor.alive_at
                self._lose(actor, at)
                actions.append(ActorLost(actor=actor.id, at=self._stamp(at)))
            elif actor.face_lost_at is not None and now >= actor.face_lost_at - ROUNDING:
                actions += self._tell(actor, actor.looking.lose(actor.posed_at))
            self._attend(actor.id)
        return actions

    def give_up(self, at: Seconds) -> list[Symbolic]:
        """Whatever has been found out is over, for a successor to begin with nothing."""
        ends: list[Symbolic] = []
        for actor in self._attended.values():
            stamp = self._stamp(max(at, actor.alive_at))
            piece = self._manipulation.acting(actor.id)
            if piece and "act" not in actor.told:
                ends.append(ActionEnded(actor=actor.id, action="act", at=stamp, targets=piece))
            if actor.voice.speaks and "speak" not in actor.told:
                ends.append(ActionEnded(actor=actor.id, action="speak", at=stamp))
            if actor.seen and not actor.presence_told:
                ends.append(ActorLost(actor=actor.id, at=stamp))
        return ends

    # -- who there is -------------------------------------------------------------------------------------------

    def _tells(self, actor: str, action: Action) -> bool:
        """Does perception itself say when this person does that?"""
        return actor in self._actors and action in self._actors[actor].told

    def _actor(self, id: str, at: Seconds) -> _Actor:
        """at: when it is told of."""
        if id not in self._actors:
            self._came += 1
            self._actors[id] = _Actor(id, self._came, self._config)
        self._told_of.pop(id, None)
        self._told_of[id] = at
        return self._actors[id]

    def _attend(self, id: str) -> None:
        if self._actors[id].is_attended:
            self._attended[id] = self._actors[id]
        else:
            self._attended.pop(id, None)

    def _forget(self, now: Seconds) -> None:
        """Whoever has not been told of for long, as the session does. Who is attended to has been."""
        while self._told_of:
            id, at = next(iter(self._told_of.items()))
            if at + self._config.forgotten_after > now:
                return
            del self._told_of[id], self._actors[id]
            self._attended.pop(id, None)
            self._sight.forget_face(id)

    # -- one person ---------------------------------------------------------------------------------------------

    def _faces(self, actor: _Actor, pose: HeadPose, at: Seconds) -> list[Symbolic]:
        credible = pose.confidence >= self._config.least_confidence
        if at <= actor.posed_at or not credible or not (is_place(pose.position) and is_direction(pose.direction)):
            return []
        actions: list[Symbolic] = []
        if not actor.seen and not actor.presence_told:
            actions.append(ActorFound(actor=actor.id, at=self._stamp(at)))
        actor.seen, actor.posed_at = True, at
        actor.alive_at = max(actor.alive_at, at)
        self._sight.see_face(actor.id, pose.position, at)
        if "look" in actor.told:
            return actions
        gaze, present = (pose.position, pose.direction), actor.looking.nearest
        seen = self._sight.target(actor.id, gaze, present=present, at=at, sure=pose.confidence)
        return actions + self._tell(actor, actor.looking.feed(seen, at))

    def _sounds(self, actor: _Actor, voice: VoiceActivity, at: Seconds) -> list[Symbolic]:
        if at <= actor.heard_at or voice.confidence < self._config.least_confidence:
            return []
        actor.heard_at = at
        changes = actor.voice.feed(voice.active, at, voice.confidence)
        if voice.active and actor.voice.speaks:
            actor.alive_at = max(actor.alive_at, at)
        return self._tell(actor, changes)

    def _lose(self, actor: _Actor, at: Seconds) -> None:
        """The person has gone: all they did ends with that."""
        actor.seen = False
        actor.looking.lose(at)
        actor.voice.lose(at)
        self._manipulation.lose(actor.id)

    def _tell(self, actor: _Actor, changes: Iterable[Change]) -> list[Symbolic]:
        actions: list[Symbolic] = []
        for began, action, at, targets, confidence in changes:
            kind = ActionBegan if began else ActionEnded
            if action != "look":
                actor.alive_at = max(actor.alive_at, at)
            if action not in actor.told:
                stamp = self._stamp(at)
                actions.append(kind(actor=actor.id, action=action, at=stamp, targets=targets, confidence=confidence))
        return actions

    def _stamp(self, at: Seconds) -> Stamp:
        return Stamp(self._clock, at)
