"""Presence of the participant that publishes a state: what a crash takes away is unknown, as at start. Pure."""

from engage_hri.schemas.messages import Message
from engage_hri.schemas.presence import PeerAlive, PeerGone


class Publisher:
    """The participant that published a state last. is_there: it has published, and has not gone since.

    name: its; empty: not known. It is there again when the same life comes back, as after a cut. A new life has to
    publish first.
    """

    def __init__(self) -> None:
        self.is_there = False
        self.name = ""
        self._run = ""

    def published(self, name: str, run: str) -> None:
        """Take the news that a participant has published the state. Empty: who or which life it is, nothing tells."""
        self.is_there, self.name, self._run = True, name, run

    def feed(self, message: Message) -> bool:
        """Take any other message: only those about presence count. Returns True if it is there again."""
        before = self.is_there
        match message:
            case PeerGone(participant=name) if name == self.name:
                self.is_there = False
            case PeerAlive(participant=name, run=run) if name == self.name:
                self.is_there = run == self._run
        return self.is_there and not before
