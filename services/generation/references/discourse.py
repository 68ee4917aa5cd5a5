"""Memory of the objects that the robot has referred to, in its turn and the one before: what "it" can mean. Pure."""

from collections.abc import Collection

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.recognition import ConnectionEvent


class Named(Struct, frozen=True):
    """An object that a fragment refers to."""

    fragment: str
    object: str


class Discourse(Struct, frozen=True):
    """The objects referred to. named: in the turn. before: in the turn before it. addressee: the person who heard."""

    turn: str = ""
    addressee: str = ""
    named: tuple[Named, ...] = ()
    before: tuple[Named, ...] = ()

    def in_turn(self, turn: str, addressee: str) -> "Discourse":
        """The discourse at a fragment of `turn`. For another addressee nothing was referred to before."""
        if turn == self.turn:
            return self
        before = self.named if addressee == self.addressee else ()
        return Discourse(turn=turn, addressee=addressee, before=before)

    def naming(self, fragment: str, objects: Collection[str]) -> "Discourse":
        """The discourse after a fragment that refers, or is going to refer, to `objects`."""
        return replace(self, named=(*self.named, *(Named(fragment, each) for each in objects)))

    def without(self, fragment: str, unmentioned: Collection[str]) -> "Discourse":
        """The discourse after a fragment that has ended before it referred to the objects in `unmentioned`."""

        def said(named: tuple[Named, ...]) -> tuple[Named, ...]:
            return tuple(each for each in named if each.fragment != fragment or each.object not in unmentioned)

        return replace(self, named=said(self.named), before=said(self.before))

    def hearing(self, event: ConnectionEvent, robot: str) -> "Discourse":
        """The discourse after an event: a person who directs to something else ends the topic of "it"."""
        directs = event.kind == "directed_gaze" and event.state == "started" and event.initiator != robot
        if not directs or not event.objects or set(event.objects) == {self.topic}:
            return self
        return replace(self, named=(), before=())

    @property
    def topic(self) -> str:
        """The only object that was referred to: in the turn or, as long as nothing was in it, in the one before."""
        objects = {each.object for each in self.named or self.before}
        return objects.pop() if len(objects) == 1 else ""


NO_DISCOURSE = Discourse()
