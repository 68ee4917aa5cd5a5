"""The response policy: answers directed gaze and facial gaze that people initiate by looking there. Thesis 3.3.3.

A person who directs to something, or seeks the robot's eyes, waits for them: without an answer the connection fails.
So the robot always looks where people direct, and meets their gaze, unless its own is inhibited. What to answer to
words takes knowledge of the task: that is the collaboration manager's.
"""

import math
from collections.abc import Sequence
from statistics import fmean

from msgspec import Struct

from engage_hri.schemas.behaviors import EVENT_KINDS
from engage_hri.schemas.body import Ray
from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.schemas.world import Entity, World, each_of
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.policy import HeadPolicy
from engage_hri.services.generation.head.scene import HeadScene, Observation
from engage_hri.services.generation.references.pairs import TOLERANCE, angle_off_axis

RESPONSE_HOLD: Seconds = 0.8
"""Time that shared gaze lasts before the response lets go. Thesis 3.3.3 names no time; ours."""
ANSWERED = ("directed_gaze", "mutual_facial_gaze")
"""Kinds of event that this policy answers. Adjacency pairs and backchannels belong to the collaboration manager."""


class _Answer(Struct):
    """The robot's answer to an open event.

    targets: to be looked at one after the other. until: when the shared gaze will have lasted long enough.
    """

    event: ConnectionEvent
    targets: tuple[str, ...]
    since: Seconds
    until: Seconds | None = None


class ResponsePolicy(HeadPolicy):
    """The human-initiated events that are open, newest last."""

    kind = "response"

    def __init__(self, scene: HeadScene, config: GenerationConfig) -> None:
        super().__init__(scene, config)
        self._open: dict[str, _Answer] = {}
        self._seen: Seconds = float("-inf")

    def feed(self, message: Observation, now: Seconds) -> None:
        if isinstance(message, ConnectionEvent):
            self._take(message, now)

    def _take(self, event: ConnectionEvent, now: Seconds) -> None:
        """Take an event. While a fragment's gaze has the head, directing to anything else is not answered."""
        scene = self.scene
        if event.initiator == scene.robot or event.responder != scene.robot or event.kind not in ANSWERED:
            return
        if event.state == "started":
            targets: tuple[str, ...] = (event.initiator,)
            if event.kind == "directed_gaze":
                gaze = scene.state.gaze if scene.state is not None else None
                targets = viewing_order(event.objects, scene.world, gaze, scene.half_angle)
            told = each_of(scene.owner.target) if scene.owner.kind == "fragment" and scene.owner.target else targets
            if not {*told}.isdisjoint(targets):
                self._open[event.id] = _Answer(event, targets, now)
        elif event.state == "succeeded" and event.id in self._open:
            self._open[event.id].until = now + RESPONSE_HOLD
        else:
            self._open.pop(event.id, None)

    def recognition_lost(self) -> None:
        self._open.clear()

    @property
    def deadline(self) -> Seconds | None:
        """Time of the next change of the claim without an event."""
        due = [answer.until for answer in self._open.values() if answer.until is not None]
        for answer in self._open.values():
            due += [turn for turn in self._turns(answer) if turn > self._seen]
        return min(due, default=None)

    def claim(self, now: Seconds, weaker: Sequence[Claim]) -> Claim | None:
        self._seen = now
        # Who seeks the robot's eyes while it attends to somebody else seeks them in vain.
        attended = [self.scene.listens_to] if self.scene.listens_to else self.scene.drawing(now)
        others = {*self.scene.sight.present(now)} - {*attended}
        for id in [id for id, answer in self._open.items() if answer.until is not None and now >= answer.until]:
            del self._open[id]
        for answer in reversed(self._open.values()):
            if answer.event.kind == "mutual_facial_gaze" and answer.event.initiator in others:
                continue
            index = sum(now >= turn for turn in self._turns(answer))
            kind = EVENT_KINDS[answer.event.kind].title
            return self.wish(answer.targets[index], f"{kind} of {answer.event.initiator}")
        return None

    def _turns(self, answer: _Answer) -> list[Seconds]:
        """Times at which the gaze goes on from one of several objects to the next."""
        return [answer.since + index * RESPONSE_HOLD for index in range(1, len(answer.targets))]


def viewing_order(
    objects: Sequence[str], world: World | None, gaze: Ray | None, half_angle: Radians
) -> tuple[str, ...]:
    """Ids of the objects to look at, in order, when somebody directs to several.

    If one gaze cone holds all of them: the object nearest to their centroid, since gaze follows entities and not
    places. Else all of them, the one nearest to the present gaze first.
    """
    entities = [entity for id in objects if world is not None and (entity := world.entity(id)) is not None]
    if len(entities) < 2 or gaze is None:
        return tuple(entity.id for entity in entities) or tuple(objects[:1])
    centroid = map(fmean, zip(*(entity.position for entity in entities), strict=True))
    x, y, z = (there - eye for there, eye in zip(centroid, gaze.origin, strict=True))
    at_all = gaze if math.hypot(x, y, z) <= TOLERANCE else Ray(origin=gaze.origin, axis=(x, y, z))
    if all(angle_off_axis(at_all, entity.position) <= half_angle + TOLERANCE for entity in entities):
        return (min(entities, key=lambda entity: (angle_off_axis(at_all, entity.position), entity.id)).id,)

    def off(entity: Entity) -> tuple[float, str]:
        return angle_off_axis(gaze, entity.position), entity.id

    return tuple(entity.id for entity in sorted(entities, key=off))
