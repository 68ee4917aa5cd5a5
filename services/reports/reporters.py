"""Participants that report what people, or the robot, do: what they say holds as long as they are there. Pure.

A reporter tells changes as events, and may tell as a state what goes on. An event that was missed shows in the state.
When the reporter vanishes from the bus, mostly its link is gone and not itself: what it said holds for a grace. If it
stays away, all of that has ended when it went; so it has if the reporter comes back as another life. The same life
goes on with what it said.
"""

from collections import deque
from collections.abc import Callable
from typing import Literal, NamedTuple

from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions
from engage_hri.schemas.presence import PeerAlive, PeerGone
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.reports.ongoing_actions import ActionEvent
from engage_hri.services.reports.reports import Report, TimedReport

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


class Reporters:
    """All reporters around `robot`, and what they say.

    grace: time for which what one has said holds after it has gone. clock: of local time. instant: local time of a
    stamp, at most now.
    """

    def __init__(self, robot: str, grace: Seconds, clock: str, instant: Callable[[Stamp], Seconds]) -> None:
        self._robot = robot
        self._grace = grace
        self._clock = clock
        self._instant = instant
        self._reporters: dict[str, _Reporter] = {}

    # -- time ---------------------------------------------------------------------------------------------------

    @property
    def deadline(self) -> Seconds | None:
        """Time at which `advance` has something to do."""
        return min((due for one in self._reporters.values() if (due := self._due(one)) is not None), default=None)

    def _due(self, one: _Reporter) -> Seconds | None:
        match one.standing:
            case "away":
                return one.since + self._grace
            case "back":
                return one.since + CATCH_UP
        return None

    def advance(self, now: Seconds) -> list[TimedReport]:
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

    def forget(self, actor: str) -> None:
        """Drop a person who has been gone for long from all reporters."""
        for name, one in tuple(self._reporters.items()):
            one.reports.pop(actor, None)
            self._clear(name)
