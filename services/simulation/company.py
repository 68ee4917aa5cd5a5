"""People who sit with the robot, as perception tells of them. Pure."""

from collections.abc import Iterator, Mapping

from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.client.people.actions import PersonActions
from engage_hri.services.reports.ongoing_actions import ActionEvent
from engage_hri.services.simulation.human import FACE, Act, Ears, Human, LookAt, Pause, SpokenWords, Start, Stop


class Bystander:
    """Actions and words of a person who looks, gestures and speaks, and moves nothing.

    life: of the program that tells of the person.
    """

    def __init__(self, person: str, robot: str, life: str = "") -> None:
        self._robot = robot
        self._actions = PersonActions(person)
        self._actions.is_here = True
        self._words = SpokenWords(person, life)

    def does(self, act: Act, at: Stamp) -> Iterator[ActionEvent | Utterance]:
        yield from self._words.does(act, at)
        match act:
            case LookAt(target=target):
                yield from self._actions.looks((self._robot if target == FACE else target,) if target else (), at)
            case Start(action=action, target=target):
                yield from self._actions.begins(action, (target,) if target else (), at)
            case Stop(action=action, target=target):
                yield from self._actions.ends(action, (target,) if target else (), at)


class Company:
    """People who sit there and are found at once. humans: what each does, by actor id.

    life: of the program that tells of them.
    """

    def __init__(self, humans: Mapping[str, Human], robot: str, life: str = "") -> None:
        self._humans = humans
        self._bodies = {person: Bystander(person, robot, life) for person in humans}
        self._ears = Ears()

    @property
    def deadline(self) -> Seconds | None:
        """Time at which `advance` has something to do; None: not before the robot does something."""
        return min((at for human in self._humans.values() if (at := human.deadline) is not None), default=None)

    def feed(self, message: Message, now: Seconds) -> None:
        """Take a message about the robot."""
        if self._ears.hear(message):
            self._hear(message, now)

    def _hear(self, message: Message, now: Seconds) -> None:
        for human in self._humans.values():
            human.feed(message, now)

    def advance(self, now: Seconds, stamp: Stamp) -> Iterator[ActionEvent | Utterance]:
        """Acts that are due, as perception tells of them. stamp: of `now`."""
        for person, human in self._humans.items():
            while acts := human.due(now):
                yield from self._bodies[person].does(acts[0], stamp)
                human.schedule(acts[1:], now + (acts[0].seconds if isinstance(acts[0], Pause) else 0.0))
