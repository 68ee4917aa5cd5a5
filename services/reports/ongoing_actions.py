"""Ongoing actions: what events have told of beginnings and ends, as the state that a reporter publishes. Pure."""

from collections.abc import Iterable

from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.runtime.absent import Absent

ActionEvent = ActionBegan | ActionEnded | ActorFound | ActorLost
Which = tuple[str, str, tuple[str, ...]]
MOST = 256
"""Number of actions of one actor that can go on: of more, the oldest are forgotten."""


def which(action: ActionBegan | ActionEnded) -> Which:
    """Name the action among those of its actor. A look has only its kind: a new one ends the last."""
    return (action.action, "", ()) if action.action == "look" else (action.action, action.behavior, action.targets)


class Ongoing:
    """The ongoing actions of one actor, by the events of one reporter. seen: as in `OngoingActions`."""

    def __init__(self) -> None:
        self.seen: bool | None = None
        self._actions: dict[Which, ActionBegan] = {}

    @property
    def actions(self) -> tuple[ActionBegan, ...]:
        """The actions, the one that began last at the end."""
        return tuple(self._actions.values())

    def get(self, action: ActionBegan) -> ActionBegan | None:
        """Return the ongoing action that is the same but for its time, or a look at something else."""
        return self._actions.get(which(action))

    def take(self, event: ActionEvent) -> None:
        match event:
            case ActionBegan():
                self._actions.pop(which(event), None)
                self._actions[which(event)] = event
                if len(self._actions) > MOST:
                    del self._actions[next(iter(self._actions))]
            case ActionEnded():
                ended = [key for key, begun in self._actions.items() if ends(event, begun)]
                for key in ended:
                    del self._actions[key]
            case ActorFound():
                self.seen = True
            case ActorLost():
                self.seen = False

    def become(self, actions: Iterable[ActionBegan]) -> None:
        """Take these actions for all that go on."""
        self._actions = {which(begun): begun for begun in actions}


def ends(ended: ActionEnded, begun: ActionBegan) -> bool:
    """Tell whether an end is that of this action. One without targets ends all that are else the same."""
    is_same = ended.action == begun.action and (ended.behavior == begun.behavior or ended.action == "look")
    return is_same and ended.targets in ((), begun.targets)


class OngoingActionTracker:
    """The states to publish after events: one for each actor of whom they tell."""

    def __init__(self) -> None:
        self._actors: dict[str, Ongoing] = {}
        self._idle: Absent[str] = Absent()
        """Actors who are not seen and do nothing."""

    def feed(self, events: Iterable[Message], at: Stamp) -> list[OngoingActions]:
        """Take events that are being published. Returns the states to publish after them. at: now.

        Other messages change nothing.
        """
        latest: dict[str, Seconds] = {}
        for event in events:
            if isinstance(event, ActionEvent):
                self._actors.setdefault(event.actor, Ongoing()).take(event)
                told = event.at.seconds if event.at.clock == at.clock else at.seconds
                latest[event.actor] = max(latest.get(event.actor, at.seconds), told)
        return [self._state(actor, Stamp(at.clock, last), at.seconds) for actor, last in latest.items()]

    def _state(self, actor: str, at: Stamp, now: Seconds) -> OngoingActions:
        ongoing = self._actors[actor]
        self._idle.comes(actor)
        if not ongoing.seen and not ongoing.actions:
            self._idle.leaves(actor, now)
        return OngoingActions(actor=actor, at=at, actions=ongoing.actions, seen=ongoing.seen)

    def forget(self, now: Seconds) -> list[str]:
        """Forget the actors of whom there has been nothing to tell for long. Returns whose states to withdraw."""
        forgotten = self._idle.forgotten(now)
        for actor in forgotten:
            del self._actors[actor]
        return forgotten
