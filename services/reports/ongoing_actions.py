"""Ongoing actions: what events have told of beginnings and ends, as the state that a reporter publishes. Pure.

An event can be lost, and a state cannot say when something began. So a report keeps what its reporter has told of one
actor (`Report`), and finds in each state which beginnings and ends were missed.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.deadlines import Absent

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


class GoesOn(Struct, frozen=True):
    """Observation: an action goes on that began long ago, or before its actor was found. Its beginning is no news.

    since: local time at which it began.
    """

    began: ActionBegan
    since: Seconds


class TimedReport(NamedTuple):
    """An observation, and its local time. is_sure: False: that time is the latest possible."""

    observation: ActionEvent | GoesOn
    at: Seconds
    is_sure: bool = True


class Report:
    """The report of one actor by one reporter. local: converts stamps to local time."""

    def __init__(self, local: Callable[[Stamp], Seconds]) -> None:
        self._local = local
        self._ongoing = Ongoing()
        self._found: Seconds | None = None
        """Time at which the person was last found."""
        self._latest: Stamp | None = None
        """Time of the newest event."""
        self._tells_states = False
        self._before_loss: dict[tuple[object, ...], ActionBegan] = {}
        """What went on when the person was lost, until a state says what has become of it."""
        self.was = ""
        """Another id of the same person, by which all of it was told."""

    @property
    def actions(self) -> tuple[ActionBegan, ...]:
        return self._ongoing.actions

    @property
    def seen(self) -> bool | None:
        return self._ongoing.seen

    def says(self, action: ActionBegan) -> bool:
        """Tell whether the same goes on, with the same targets."""
        known = self._ongoing.get(action)
        return known is not None and known.targets == action.targets

    @property
    def is_empty(self) -> bool:
        """True if nothing of it has to be remembered."""
        return not (self.seen or self.actions or self._before_loss)

    def take(self, event: ActionEvent) -> None:
        """Take an event, which is told as it is. With a loss, all that the person does is unknown."""
        if isinstance(event, ActorLost):
            if self._tells_states:
                self._before_loss = {
                    _exactly(one): one for one in (*self._before_loss.values(), *self.actions)[-MOST:]
                }
            self._ongoing.become(())
        self._ongoing.take(event)
        if isinstance(event, ActorFound):
            self._found = self._local(event.at)
        if self._latest is None or not _is_before(event.at, self._latest):
            self._latest = event.at

    def correct(self, state: OngoingActions, now: Seconds) -> list[TimedReport]:
        """Take a state. Returns what it shows to have been missed, in order; mostly nothing.

        What has ended meanwhile has ended when something else of its kind began, or else by the state's last change.
        One that is older than an event has been overtaken.
        """
        if self._latest is not None and _is_before(state.at, self._latest):
            return []
        self._tells_states, at = True, self._local(state.at)
        told = [TimedReport(ended, when, is_sure=False) for ended, when in self._ended(state, at)]
        was_seen, self._ongoing.seen = self.seen, state.seen
        if state.seen and not was_seen:
            self._found = at
            told.append(TimedReport(ActorFound(actor=state.actor, at=state.at), at, is_sure=False))
        if state.seen is False:
            # Of somebody who is lost nothing new is believed.
            self._ongoing.become(action for action in state.actions if self.says(action))
            lost = TimedReport(ActorLost(actor=state.actor, at=state.at), at, is_sure=False)
            return [*told, lost] if was_seen else told
        missed = [action for action in state.actions if not self._knows(action)]
        self._ongoing.become(state.actions)
        return told + [self._begun(action, now) for action in missed]

    def _knows(self, action: ActionBegan) -> bool:
        known = self._ongoing.get(action)
        return known is not None and _exactly(known) == _exactly(action)

    def _ended(self, state: OngoingActions, at: Seconds) -> list[tuple[ActionEnded, Seconds]]:
        """The ends that were missed, each with its time. at: local time of the state."""
        still = {_exactly(action) for action in state.actions}
        ended = []
        for known in (*self._before_loss.values(), *self.actions):
            if _exactly(known) not in still:
                since = self._local(known.at)
                next_ones = (self._local(each.at) for each in state.actions if each.action == known.action)
                when = min((other for other in next_ones if since <= other <= at), default=at)
                ended.append((_end(known), max(when, since)))
        is_lost = state.seen is False
        self._before_loss = {one: each for one, each in self._before_loss.items() if is_lost and one in still}
        return sorted(ended, key=lambda one: one[1])

    def _begun(self, action: ActionBegan, now: Seconds) -> TimedReport:
        """Tell a beginning that was missed, as news only if it is as recent as the history that late readers get."""
        since = self._local(action.at)
        is_news = now - since <= keys.HISTORY_MAX_AGE and (self._found is None or since >= self._found)
        return TimedReport(action, since) if is_news else TimedReport(GoesOn(action, since), now)

    def going(self) -> list[GoesOn]:
        """List what goes on, for a session that has been told that it had ended."""
        return [GoesOn(action, self._local(action.at)) for action in self.actions]

    def join(self, other: "Report", actor: str) -> list[GoesOn]:
        """Take over what goes on by the report of another id of the same person. Returns it, as this person's."""
        going = [GoesOn(replace(one.began, actor=actor), one.since) for one in other.going()]
        for one in going:
            self._ongoing.take(one.began)
        self._ongoing.seen = self.seen or other.seen
        return going

    def ends(self, is_over: Callable[[ActionBegan], bool]) -> list[ActionEnded]:
        """List the ends of what goes on, if `is_over`."""
        return [_end(action) for action in self.actions if is_over(action)]


def _exactly(action: ActionBegan) -> tuple[object, ...]:
    """Name an action among those of its actor, from its beginning on."""
    return which(action), action.targets, action.at


def _end(began: ActionBegan) -> ActionEnded:
    return ActionEnded(
        actor=began.actor, action=began.action, at=began.at, targets=began.targets, behavior=began.behavior
    )


def _is_before(one: Stamp, other: Stamp) -> bool:
    """Tell whether an instant is certainly before another: only those of one clock compare without error."""
    return one.clock == other.clock and one.seconds < other.seconds
