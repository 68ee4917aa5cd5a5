"""Recognition as its subscribers hear it: messages of perception and of the robot in, what is published out."""

from typing import TypeVar

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.blocks import BlockProgress
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, Utterance
from engage_hri.schemas.recognition import ConnectionEvent, Floor, Interjection, RequestEvent, SignalTurn
from engage_hri.schemas.world import World
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.intake import Intake, Output
from engage_hri.services.runtime.intake import Input, PublishMessage, StepClock
from tests.recognition.observations import ROBOT, stamp

KEYS: dict[type, str] = {
    World: keys.WORLD, Utterance: keys.UTTERANCE, RequestEvent: keys.EVENT, SignalTurn: keys.TURN,
    BlockProgress: keys.FEEDBACK,
}  # fmt: skip
"""Keys of what is no action."""
Told = TypeVar("Told", bound=Message)


class HeardLog:
    """Recognition of one robot, and all that it has told. Each call is one message."""

    def __init__(self, limit: float) -> None:
        config = RecognitionConfig(adjacency_pair_limit=limit)
        self._intake = Intake(ROBOT, config, StepClock("loop"), "session")
        self.told: list[Message] = []
        """All that was published."""
        self._numbers: dict[tuple[str, float], str] = {}

    def until(self, end: float) -> None:
        """Let all happen that is due before `end`."""
        while (due := self._intake.deadline) is not None and due < end:
            self._note(self._intake.advance(due))

    def take(self, message: Message, at: float) -> None:
        """Take a message that arrives at `at`."""
        actor = getattr(message, "actor", ROBOT)
        key = KEYS.get(type(message)) or (keys.ROBOT_ACTION if actor == ROBOT else keys.PERCEIVED_ACTION)
        source = "body" if actor == ROBOT else "camera"
        self._note(self._intake.take(Input(key, message, source, at), at))

    def _note(self, outputs: list[Output]) -> None:
        self.told += [each.message for each in outputs if isinstance(each, PublishMessage)]

    def _of(self, kind: type[Told]) -> list[Told]:
        return [each for each in self.told if isinstance(each, kind)]

    @property
    def events(self) -> list[ConnectionEvent]:
        return self._of(ConnectionEvent)

    @property
    def interjections(self) -> list[Interjection]:
        return self._of(Interjection)

    @property
    def floors(self) -> list[Floor]:
        return self._of(Floor)

    # -- what happens -------------------------------------------------------------------------------------------

    def begins(self, actor: str, action: Action, at: float, target: str = "", behavior: str = "") -> None:
        targets = (target,) if target else ()
        self.take(ActionBegan(actor=actor, action=action, at=stamp(at), targets=targets, behavior=behavior), at)

    def ends(self, actor: str, action: Action, at: float, target: str = "", behavior: str = "") -> None:
        targets = (target,) if target else ()
        self.take(ActionEnded(actor=actor, action=action, at=stamp(at), targets=targets, behavior=behavior), at)

    def found(self, actor: str, at: float, same_as: str = "") -> None:
        self.take(ActorFound(actor=actor, at=stamp(at), same_as=same_as), at)

    def lost(self, actor: str, at: float) -> None:
        self.take(ActorLost(actor=actor, at=stamp(at)), at)

    def block_ends(self, at: float, status: str, block: str) -> None:
        self.take(BlockProgress(block=block, progress="end", at=stamp(at), status=status), at)  # type: ignore[arg-type]

    def hears(
        self, actor: str, since: float, until: float, text: str, at: float, *, to: frozenset[str] | None = None,
        final: bool = True,
    ) -> None:  # fmt: skip
        """Words of what was said from `since` to `until`. to: for whom, if perception knows."""
        id = self._numbers.setdefault((actor, since), f"{actor}-{len(self._numbers)}")
        said = Utterance(
            actor=actor, id=id, text=text, began=stamp(since), ended=stamp(until), at=stamp(at), final=final,
            to=tuple(sorted(to or ())),
        )  # fmt: skip
        self.take(said, at)
