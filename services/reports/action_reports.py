"""Actions of people and of the robot, as all reporters together tell them, and when who is unseen has gone. Pure.

    reports = ActionReports("robot", REPORT_GRACE, clock, instant)
    told = reports.take(message, key, source, life, now)    # any message
    told = reports.advance(now)                             # whenever `deadline` has been reached

A reader of nothing but `ActionBegan` and its like keeps a person for ever whose reporter was killed, for nobody is
left to tell that this person has gone. `Reporters` tells it: what a reporter says holds as long as it is there.

A reporter tells changes as events, and may tell as a state what goes on. An event that was missed shows in the state.
When the reporter vanishes from the bus, mostly its link is gone and not itself: what it said holds for a grace. If it
stays away, all of that has ended when it went; so it has if the reporter comes back as another life. The same life
goes on with what it said.
"""

from collections import OrderedDict, deque
from collections.abc import Callable, Collection, Iterable, Iterator
from typing import Literal, NamedTuple

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions
from engage_hri.schemas.recognition import SamePeople
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.reports.ongoing_actions import MOST, ActionEvent, GoesOn, Report, TimedReport
from engage_hri.services.reports.same_people import PeopleNames

OLDEST: Seconds = 60.0
"""Age from which on a stamp is not believed: an older event would stay for ever in the windows of the statistics."""
CATCH_UP: Seconds = 0.5
"""Time from the return of a reporter until what it said before goes on: what it has said meanwhile comes first."""
LATER: Seconds = 1e-6
"""Distance of what is told late, and so cannot have its own time any more."""
SILENCED_KEPT = 64
"""Number of reporters that are remembered after all that they said has ended: each may come back as the same life."""
FORMER = 8
"""Number of lives of a reporter that are remembered, as what they said may come late."""

Standing = Literal["here", "away", "silenced", "back"]
"""`away`: gone, but what it said holds. `silenced`: that has ended. `back`: there again, and catching up."""
Given = Literal["gone", "alive", "reborn", "grace_over", "caught_up"]
Effect = Literal["", "end", "resume"]
"""`end`: all that the reporter said ends. `resume`: it goes on, whatever was assumed meanwhile."""


class StandingRow(NamedTuple):
    """A transition of a reporter's standing. reborn: the reporter is there as another life."""

    next: Standing
    effect: Effect = ""


TABLE: dict[tuple[Standing, Given], StandingRow] = {
    ("here", "gone"): StandingRow("away"),
    ("here", "alive"): StandingRow("here"),
    ("here", "reborn"): StandingRow("here", "end"),
    ("away", "gone"): StandingRow("away"),
    ("away", "alive"): StandingRow("back"),
    ("away", "reborn"): StandingRow("here", "end"),
    ("away", "grace_over"): StandingRow("silenced", "end"),
    ("silenced", "gone"): StandingRow("silenced"),
    ("silenced", "alive"): StandingRow("back"),
    ("silenced", "reborn"): StandingRow("here"),
    ("back", "gone"): StandingRow("away", "resume"),
    ("back", "alive"): StandingRow("back"),
    ("back", "reborn"): StandingRow("here", "end"),
    ("back", "caught_up"): StandingRow("here", "resume"),
}
"""Every standing has a row for each input that can come then: the two timers run in one standing each."""


class _Reporter:
    """One participant. since: time at which its standing last changed. run: its life; empty: unknown.

    is_alive: its token is there. floor: time before which nothing can be told of its actors any more: the session has
    been told what was assumed. former: its lives that have gone; what they said may come late.
    """

    def __init__(self, now: Seconds) -> None:
        self.is_alive = False
        self.standing: Standing = "here"
        self.since = now
        self.run = ""
        self.former: deque[str] = deque(maxlen=FORMER)
        self.reports: dict[str, Report] = {}
        self.floor = float("-inf")


FACE_GRACE: Seconds = 2.0
"""Time for which a person may be out of sight, and come back under the same id, before the person has gone. Trackers
lose faces for 0.5 to 2 s all day."""
REPORT_GRACE: Seconds = 4.0
"""Time for which what a reporter said holds after it has vanished, where no configuration says otherwise."""
STRANGERS_KEPT = 256
"""Number of programs of others whose name as a reporter is remembered."""
Read = ActionEvent | OngoingActions | PeerAlive | PeerGone | SamePeople
"""Messages of which it takes notice."""


class ActionReports:
    """The reports of actions, of all reporters around `robot`.

    grace: time for which what one has said holds after it has gone. clock: of local time. instant: local time of a
    stamp, at most now.
    """

    def __init__(self, robot: str, grace: Seconds, clock: str, instant: Callable[[Stamp], Seconds]) -> None:
        self._robot = robot
        self._grace = grace
        self._clock = clock
        self._instant = instant
        self._reporters: dict[str, _Reporter] = {}
        self._strangers: OrderedDict[str, str] = OrderedDict()
        """Names of reporters whose messages name no participant, by their life."""
        self._names = PeopleNames()

    def take(
        self, message: object, key: str, source: str, life: str, now: Seconds, *, past: bool = False
    ) -> list[TimedReport]:
        """Take a message as it was received. Returns what follows, in order; nothing for what tells of no action."""
        told = self.advance(now)
        if isinstance(message, PeerAlive | PeerGone):
            return told + self.feed(message, now)
        if isinstance(message, SamePeople):
            return told + self._take_same(message, now)
        if isinstance(message, ActionEvent | OngoingActions) and is_proper(message, key, source, self._robot):
            name, of = self._named(key, source, life)
            return told + self.hear(self._names.named(message), name, of, now, past=past)
        return told

    def _take_same(self, message: SamePeople, now: Seconds) -> list[TimedReport]:
        """Take news of who is one person: one of the two is lost, and what this one does goes on with the other.

        Whoever was taken for another by mistake is somebody else again first.
        """
        parted = self._names.parted(message)
        if not self._names.take(message):
            return []
        told = [report for id, name in parted for report in self.part({id}, name, id, now)]
        at = Stamp(self._clock, now)
        for other, name in ((each.actor, each.name) for each in message.people):
            known = [one.reports[other] for one in self._reporters.values() if other in one.reports]
            is_known = any(name in one.reports for one in self._reporters.values())
            going = self.join(other, name)
            if known:
                told.append(TimedReport(ActorLost(actor=other, at=at), now, is_sure=False))
                if any(report.seen for report in known) and not is_known:
                    told.append(TimedReport(ActorFound(actor=name, at=at), now, is_sure=False))
            told += [TimedReport(each, now) for each in going]
        return told

    def _named(self, key: str, source: str, life: str) -> tuple[str, str]:
        """Name and life of who tells of actions. The robot's are told by its body, whoever speaks for it."""
        is_event = key in (keys.PERCEIVED_ACTION, keys.RECOGNIZED_ACTION)
        name = source if is_event else keys.reporter_of(key) or "control"
        if source:
            return name, life if name == source else ""
        if is_event:
            return self._strangers.get(life, ""), ""
        if life and name != "control":
            self._strangers[life] = name
            self._strangers.move_to_end(life)
            if len(self._strangers) > STRANGERS_KEPT:
                self._strangers.popitem(last=False)
        return name, ""

    # -- time ---------------------------------------------------------------------------------------------------

    @property
    def deadline(self) -> Seconds | None:
        """Time at which `advance` has something to tell."""
        return min((due for one in self._reporters.values() if (due := self._due(one)) is not None), default=None)

    def _due(self, one: _Reporter) -> Seconds | None:
        match one.standing:
            case "away":
                return one.since + self._grace
            case "back":
                return one.since + CATCH_UP
        return None

    def advance(self, now: Seconds) -> list[TimedReport]:
        """Let time pass. Returns what follows, in order."""
        told = []
        for one in self._reporters.values():
            due = self._due(one)
            if due is not None and due <= now:
                told += self._step(one, "grace_over" if one.standing == "away" else "caught_up", now)
        if told:
            self._forget_silenced()
        return told

    def _forget_silenced(self) -> None:
        silenced = [name for name, one in self._reporters.items() if one.standing == "silenced"]
        for name in sorted(silenced, key=lambda name: self._reporters[name].since)[:-SILENCED_KEPT]:
            del self._reporters[name]

    # -- presence -----------------------------------------------------------------------------------------------

    def feed(self, message: PeerAlive | PeerGone, now: Seconds) -> list[TimedReport]:
        """Take the news that a participant has come or gone."""
        match message:
            case PeerGone(participant=name) if (one := self._reporters.get(name)) is not None:
                one.is_alive = False
                told = self._step(one, "gone", now)
                self._clear(name)
                return told
            case PeerAlive(participant=name, run=run):
                one = self._reporter(name, now)
                one.is_alive = True
                return self._lives(one, run, now) or self._step(one, "alive", now)
        return []

    def _reporter(self, name: str, now: Seconds) -> _Reporter:
        if name not in self._reporters:
            self._reporters[name] = _Reporter(now)
        return self._reporters[name]

    def _clear(self, name: str) -> None:
        """Drop a reporter of which nothing has to be remembered."""
        if not self._reporters[name].is_alive and not self._reporters[name].reports:
            del self._reporters[name]

    def _lives(self, one: _Reporter, run: str, now: Seconds) -> list[TimedReport]:
        """Note the life of a reporter. If it is another one, all that the last one said has ended."""
        before = one.run
        if run in ("", before):
            return []
        one.run = run
        if not before:
            return []
        if run in one.former:
            one.former.remove(run)
        if one.standing != "here":  # else both may be there: that is told only once all of a name have gone
            one.former.append(before)
        told = self._step(one, "reborn", now)
        one.reports.clear()
        return told

    def _step(self, one: _Reporter, given: Given, now: Seconds) -> list[TimedReport]:
        row = TABLE[one.standing, given]
        told: list[TimedReport] = []
        if row.effect == "end":
            told = self._end(one, one.since if one.standing == "away" else now)
        elif row.effect == "resume":
            told = self._resume(one, now)
        if row.next != one.standing:
            one.standing, one.since = row.next, now
        return told

    def _end(self, one: _Reporter, at: Seconds) -> list[TimedReport]:
        one.floor = max(one.floor, at)
        told = []
        for actor, report in sorted(one.reports.items()):
            told += self._ends(one, report, at)
            if actor != self._robot and not any(other.seen for other in self._others(actor, one)):
                told.append(TimedReport(ActorLost(actor=actor, at=Stamp(self._clock, at)), at, is_sure=False))
        return told

    def _resume(self, one: _Reporter, now: Seconds) -> list[TimedReport]:
        one.floor = now
        told = []
        for actor, report in sorted(one.reports.items()):
            if actor != self._robot and report.seen is not False:
                told.append(TimedReport(ActorFound(actor=actor, at=Stamp(self._clock, now)), now, is_sure=False))
            told += [TimedReport(action, now) for action in report.going()]
        return told

    # -- what they say ------------------------------------------------------------------------------------------

    def hear(
        self, said: ActionEvent | OngoingActions, reporter: str, life: str, now: Seconds, *, past: bool = False
    ) -> list[TimedReport]:
        """Take what a reporter says. Returns what follows for the recognizer, in order.

        reporter: empty: unknown; nothing holds then for longer than it is told. life: of its process; empty: unknown.
        past: it is from the history, in which another life than the present one may speak.
        """
        one = self._reporter(reporter, now)
        told: list[TimedReport] = []
        is_over = life in one.former or (past and one.is_alive and life not in ("", one.run))
        if not is_over:
            told += self._lives(one, life, now)
            more = self._corrected(one, said, now) if isinstance(said, OngoingActions) else self._event(one, said)
            one.floor = max(one.floor, now - OLDEST)
            if one.standing != "silenced":
                told += [self._not_before(one, each) for each in more]
        if not reporter:
            one.reports.clear()
        self._clear(reporter)
        return told

    def _event(self, one: _Reporter, event: ActionEvent) -> list[TimedReport]:
        at = self._instant(event.at)
        if not isinstance(event, ActorLost):
            self._report(one, event.actor).take(event)
            return [TimedReport(event, at)]
        told = [TimedReport(event, at)]
        if (report := one.reports.get(event.actor)) is not None:
            if self._is_seen(event.actor, one):
                told = self._ends(one, report, at)
            report.take(event)
            self._forget_empty(one, event.actor)
        elif self._is_seen(event.actor, one):
            told = []
        return told

    def _corrected(self, one: _Reporter, state: OngoingActions, now: Seconds) -> list[TimedReport]:
        known = one.reports.get(state.actor)
        if known is None and not (state.seen or (state.actions and state.seen is None)):
            return []
        told = self._report(one, state.actor).correct(state, now)
        if state.seen is False:
            self._forget_empty(one, state.actor)
        if self._is_seen(state.actor, one):
            told = [each for each in told if not isinstance(each.observation, ActorLost)]
        return told

    def _forget_empty(self, one: _Reporter, actor: str) -> None:
        if one.reports[actor].is_empty:
            del one.reports[actor]

    def _report(self, one: _Reporter, actor: str) -> Report:
        if actor not in one.reports:
            one.reports[actor] = Report(self._instant)
        return one.reports[actor]

    def _not_before(self, one: _Reporter, told: TimedReport) -> TimedReport:
        """Put off what is from before a time of which the session has been told what was assumed."""
        if isinstance(told.observation, ActionBegan | ActionEnded | ActorFound | ActorLost) and told.at <= one.floor:
            one.floor += LATER
            return TimedReport(told.observation, one.floor, is_sure=False)
        return told

    def _ends(self, one: _Reporter, report: Report, at: Seconds) -> list[TimedReport]:
        """End what a reporter says, but not what another says, too."""

        def is_over(action: ActionBegan) -> bool:
            return not any(other.says(action) for other in self._others(action.actor, one))

        return [TimedReport(ended, at, is_sure=False) for ended in report.ends(is_over)]

    def _is_seen(self, actor: str, one: _Reporter) -> bool:
        """Tell whether another reporter, which is there, sees this person."""
        return any(report.seen for report in self._others(actor, one, alive=True))

    def _others(self, actor: str, one: _Reporter, *, alive: bool = False) -> list[Report]:
        """List what others say, as it holds. alive: only of those that are there now.

        Of a program without a token nobody can tell whether it is there: it does not count.
        """
        return [
            other.reports[actor]
            for other in self._reporters.values()
            if other is not one
            and (other.is_alive or (other.standing == "away" and not alive))
            and actor in other.reports
        ]

    def join(self, other: str, kept: str) -> list[GoesOn]:
        """Take two persons for one, who is `kept` from now on. Returns what the other does."""
        going: list[GoesOn] = []
        for one in self._reporters.values():
            if (report := one.reports.pop(other, None)) is not None:
                is_new = kept not in one.reports
                joined = self._report(one, kept)
                going += joined.join(report, kept)
                joined.was = other if is_new else ""
        return going

    def part(self, ids: Collection[str], kept: str, other: str, now: Seconds) -> list[TimedReport]:
        """Take two for persons of their own that were taken for one, `kept`. Returns what follows.

        ids: those of the other, by which it is not `kept` from now on, but `other`. A reporter that has told of both
        is taken to tell of `kept`, until it tells more.
        """
        told: list[TimedReport] = []
        at = Stamp(self._clock, now)
        for one in self._reporters.values():
            if (report := one.reports.get(kept)) is None or report.was not in ids:
                continue
            del one.reports[kept]
            going = self._report(one, other).join(report, other)
            if one.standing == "silenced":
                continue
            told += [TimedReport(each, now, is_sure=False) for each in report.ends(self._is_over)]
            if report.seen:
                if not any(each.seen for each in self._all(kept)):
                    told.append(TimedReport(ActorLost(actor=kept, at=at), now, is_sure=False))
                told.append(TimedReport(ActorFound(actor=other, at=at), now, is_sure=False))
            told += [TimedReport(each, now) for each in going]
        return told

    def _all(self, actor: str) -> list[Report]:
        return [one.reports[actor] for one in self._reporters.values() if actor in one.reports]

    def _is_over(self, action: ActionBegan) -> bool:
        return not any(report.says(action) for report in self._all(action.actor))

    def forget(self, actor: str) -> None:
        """Drop a person who has been gone for long from all reporters."""
        for name, one in tuple(self._reporters.items()):
            one.reports.pop(actor, None)
            self._clear(name)


def events(told: Iterable[TimedReport], clock: str) -> Iterator[tuple[ActionEvent, Seconds]]:
    """Events for readers that know nothing of reporters, each with its local time. clock: that of local time.

    An action that goes on is told as begun. Of a speech that goes on nothing is told: nobody heard its beginning.
    """
    for observation, at, is_sure in told:
        if isinstance(observation, GoesOn):
            if observation.began.action != "speak":
                yield observation.began, observation.since
        else:
            yield observation if is_sure else replace(observation, at=Stamp(clock, at)), at


def is_proper(message: ActionEvent | OngoingActions, key: str, source: str, robot: str) -> bool:
    """True for what came from its proper sender: the robot's body for the robot, perception for people."""
    match message:
        case ActionBegan(actor=actor) | ActionEnded(actor=actor):
            return (actor == robot) == (key == keys.ROBOT_ACTION)
        case ActorFound(actor=actor) | ActorLost(actor=actor):
            return actor != robot
    if len(message.actions) > MOST or any(action.actor != message.actor for action in message.actions):
        return False
    reporter = keys.reporter_of(key)
    if not reporter:
        return message.actor == robot
    is_own = source in ("", reporter)
    return is_own and message.actor != robot and key == keys.perceived_ongoing(reporter, message.actor)
