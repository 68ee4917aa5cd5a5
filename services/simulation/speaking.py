"""Words of a simulated person, as a recognizer tells them: known for good a moment after they were said. Pure."""

from collections.abc import Iterator

from msgspec.structs import replace

from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.client.people.actions import RECOGNIZING, Utterances, speaking_time
from engage_hri.services.simulation.human import Act, Pause, Start, Stop, Understood


def speech(words: str, seconds: Seconds | None = None) -> tuple[Act, ...]:
    """Acts of saying these words. seconds: that it takes; None: as long as such words do."""
    return (
        Start("speak", words=words),
        Pause(speaking_time(words) if seconds is None else seconds),
        Stop("speak"),
        Pause(RECOGNIZING),
        Understood(),
    )


class SpokenWords:
    """The words of one person. life: of the program that simulates it."""

    def __init__(self, person: str, life: str) -> None:
        self._utterances = Utterances(person, life)
        self._said: Utterance | None = None

    def does(self, act: Act, at: Stamp) -> Iterator[Utterance]:
        """Take an act; only those that concern speech count."""
        match act:
            case Start(action="speak", words=words) if words:
                self._said = replace(self._utterances.begun(at), text=words)
                yield replace(self._said, text="")
            case Stop(action="speak") if self._said is not None:
                self._said = replace(self._said, ended=at)
            case Understood() if self._said is not None:
                yield replace(self._said, at=at, final=True)
                self._said = None
