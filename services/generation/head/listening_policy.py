"""The listening policy: while the robot is silent and people speak, it looks at the speaker, as a listener does.

It looks at who spoke first of those who speak. While it waits for an answer only those whom it asked draw it; while
somebody speaks to it nobody else does.
"""

from collections.abc import Collection

from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.recognition import ConnectionEvent, Floor
from engage_hri.schemas.units import Seconds

ONSET: Seconds = 0.6
"""Time for which somebody has to speak until the robot looks there: an "uh-huh" is shorter. Ours."""
STAYS: Seconds = 1.0
"""Time after a speech for which the robot still looks at the speaker: most who pause go on. Ours."""


class ListeningPolicy:
    """People who speak, and those who were asked something."""

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._speaking: dict[str, Seconds] = {}
        """Since when each speaks, as it was heard here; the first first."""
        self._to_robot: list[str] = []
        """Those of them of whom it is known that they speak to the robot."""
        self._asked: dict[str, str] = {}
        """Who is to answer each open adjacency pair of the robot."""
        self._speaker = ""
        self._until: Seconds | None = None
        """Time at which the robot looks at the speaker no longer; None: not before the end of the speech."""
        self._seen: Seconds = float("-inf")

    def feed(self, message: Floor | ConnectionEvent, now: Seconds) -> None:
        match message:
            case Floor(speeches=speeches):
                known, self._speaking = self._speaking, {each.actor: now for each in speeches}
                self._speaking |= {who: since for who, since in known.items() if who in self._speaking}
                self._to_robot = [each.actor for each in speeches if self._robot in each.to]
            case ConnectionEvent(kind="adjacency_pair", initiator=self._robot, state="started"):
                self._asked[message.id] = message.responder
            case ConnectionEvent():
                self._asked.pop(message.id, None)

    def forget(self) -> None:
        """Drop everything: who told it has gone."""
        self._speaking, self._to_robot, self._asked, self._speaker, self._until = {}, [], {}, "", None

    @property
    def asked(self) -> tuple[str, ...]:
        """Ids of the people whose answers the robot waits for, in the order in which it named them."""
        return tuple(dict.fromkeys(self._asked.values()))

    def drawing(self, present: Collection[str]) -> list[str]:
        """People who draw the look, of those whose faces are to be seen."""
        return [who for who in self.asked or self._to_robot if who in present] or [*present]

    @property
    def deadline(self) -> Seconds | None:
        """Time of the next change of the claim without a message."""
        due = [since + ONSET for since in self._speaking.values()]
        due += [self._until] if self._until is not None else []
        return min((each for each in due if each > self._seen), default=None)

    def claim(self, now: Seconds, present: Collection[str]) -> Claim | None:
        """present: people whose faces are to be seen."""
        self._seen = now
        if self._robot in self._speaking:
            self._speaker, self._until = "", None
            return None
        draws = self.drawing(present)
        heard = [who for who, since in self._speaking.items() if who in draws and now >= since + ONSET]
        if heard:
            self._speaker, self._until = heard[0], None
        elif self._speaker not in draws:
            self._speaker = ""
        elif self._speaker not in self._speaking and self._until is None:
            self._until = now + STAYS
        if not self._speaker or (self._until is not None and now >= self._until):
            self._speaker, self._until = "", None
            return None
        return Claim(kind="response", priority=4, target=self._speaker, reason=f"speech of {self._speaker}")
