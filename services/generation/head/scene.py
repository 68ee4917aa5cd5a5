"""Knowledge that all policies of the head share: who is in sight, and who was spoken to or is to answer. Pure."""

import math
from itertools import takewhile

from engage_hri.schemas.body import RobotState
from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, Utterance
from engage_hri.schemas.recognition import ConnectionEvent, Floor, Statistics
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.deadlines import Absent
from engage_hri.services.reports.action_reports import FACE_GRACE

OfPeople = ActionBegan | ActionEnded | ActorFound | ActorLost
"""News of people; each policy takes what concerns it."""
Observation = World | RobotState | Statistics | ConnectionEvent | Floor | Utterance | OfPeople
NOBODY = Claim(kind="none", priority=0, reason="nobody has been seen")


class PeopleInSight:
    """People with a face that is seen, or was a moment ago. robot: its id; it is no person."""

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._people: dict[str, Entity] = {}
        self._here: set[str] = set()
        """Those with a face who have not been lost; the world may still tell of one who has."""
        self._lost: Absent[str] = Absent()
        """Those with a face who have been lost since; they are known until they are forgotten."""
        self.has_met = False
        """True if anybody has ever been seen."""

    def feed(self, message: Observation, now: Seconds) -> None:
        match message:
            case World():
                seen = {person.id: person for person in message.people if person.id != self._robot}
                for id in self._people.keys() - seen.keys():
                    self._lose(id, now)
                for id in seen.keys() - self._people.keys():
                    self._find(id)
                self._people = seen
                self.has_met |= bool(seen)
            case ActorLost(actor=actor):
                self._lose(actor, now)
            case ActorFound(actor=actor):
                if actor in self._lost:
                    self._find(actor)

    def _lose(self, id: str, now: Seconds) -> None:
        if id in self._here:
            self._here.discard(id)
            self._lost.leaves(id, now)

    def _find(self, id: str) -> None:
        self._lost.comes(id)
        self._here.add(id)

    def join(self, other: str, name: str) -> None:
        """Take two ids for one person: `other` has not been lost, but is `name`."""
        if other in self._people:
            self._people[name] = self._people.pop(other)
            self._find(name)
        self.forget(other)

    def forget(self, id: str) -> None:
        """Drop somebody who has been gone for long."""
        self._here.discard(id)
        self._lost.comes(id)

    def present(self, now: Seconds) -> list[str]:
        """Ids of the people with a face that is seen, or was a moment ago; the nearest first."""

        def distance(id: str) -> tuple[float, str]:
            person = self._people.get(id)
            return (math.hypot(person.position[0], person.position[1]) if person else math.inf, id)

        missed = takewhile(lambda lost: now < lost[1] + FACE_GRACE, self._lost.latest())
        return sorted((*self._here, *(id for id, _ in missed)), key=distance)

    def changes_after(self, seen: Seconds) -> list[Seconds]:
        """Times after `seen` at which somebody who has been lost counts as gone."""
        due = (since + FACE_GRACE for _, since in self._lost.latest())
        return [*takewhile(lambda at: at > seen, due)]

    def is_face(self, target: str) -> bool:
        return target in self._here or target in self._lost

    def is_missed(self, person: str) -> bool:
        """True if the world has told of them and does no longer."""
        return person in self._lost and person not in self._people


class HeadScene:
    """Knowledge that the policies share. Each of them may read it; what is one policy's alone stays with that.

    half_angle: half the angle of the robot's gaze cone, as people perceive it.
    """

    def __init__(self, robot: str, half_angle: Radians) -> None:
        self.robot = robot
        self.half_angle = half_angle
        self.sight = PeopleInSight(robot)
        self.world: World | None = None
        self.state: RobotState | None = None
        self.partner = ""
        """Id of the person spoken to last, or who has answered last."""
        self.waits = False
        """True if the robot's last turn is over, and no other has begun."""
        self.has_turn = False
        """True while a turn of the robot goes on, pauses included, or is to begin."""
        self.to_robot: tuple[str, ...] = ()
        """Those of whom it is known that they speak to the robot now, if a policy cares for that."""
        self.listens_to = ""
        """Who is heard, and may speak to the robot: to whom is known late, of short speeches when they are over."""
        self.signed: dict[str, Seconds] = {}
        """When each has been given the last sign of a listener."""
        self.words = 0.0
        """Number of words of the robot's fragment that was sent last."""
        self.has_trunk = False
        """True if it is known that the body has a part that turns beneath its head."""
        self.facing: Radians = 0.0
        """Direction to which the trunk has turned, to the left, whether it came all the way or not."""
        self.owner = NOBODY
        self.head_on = ""
        """The target that the head is on or on its way to."""
        self._asked: dict[str, str] = {}
        """Who is to answer each open adjacency pair of the robot."""

    def feed(self, message: Observation, now: Seconds) -> None:
        self.sight.feed(message, now)
        match message:
            case World():
                self.world = message
            case RobotState():
                self.state = message
            case ConnectionEvent(kind="adjacency_pair", initiator=self.robot):
                self.partner = message.answered_by or self.partner
                if message.state == "started":
                    self._asked[message.id] = message.responder
                else:
                    self._asked.pop(message.id, None)

    def recognition_lost(self) -> None:
        """Drop what recognition told: the ends of its events and speeches will never come."""
        self.to_robot, self.listens_to, self._asked = (), "", {}

    def join(self, other: str, name: str) -> None:
        """Take two ids for one person, who is called `name` from now on."""
        self.sight.join(other, name)
        self.signed.pop(other, None)
        self.partner = name if self.partner == other else self.partner

    @property
    def landmark(self) -> str:
        """Id of what lies before the robot and is nobody: a surface, else an object; "": there is none."""
        entities = self.world.entities if self.world else ()
        things = [[each.id for each in entities if each.kind == kind] for kind in ("surface", "object")]
        return next((each[0] for each in things if each), "")

    @property
    def asked(self) -> tuple[str, ...]:
        """Ids of the people whose answers the robot waits for, in the order in which it named them."""
        return tuple(dict.fromkeys(self._asked.values()))

    def drawing(self, now: Seconds) -> list[str]:
        """People who may draw the look: those asked who speak; else who was asked; else who speaks to the robot; else
        all in sight."""
        present = self.sight.present(now)
        answer = [who for who in self.asked if who in self.to_robot]
        return [who for who in answer or self.asked or self.to_robot if who in present] or present
