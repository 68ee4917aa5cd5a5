"""Backchannel: a short sign of the listener while the other holds the floor. Thesis 2.2.4.

It starts with the responder, has no delay and cannot fail. Speech shows only at its end, or after the limit,
whether it was one; longer speech is a change of floor, and so is speech that outlasts the other's turn.
"""

from math import inf

from engage_hri.schemas.units import Seconds
from engage_hri.services.recognition.events.machine import (
    IDLE,
    EventWriter,
    Machine,
    OngoingEvent,
    TransitionRow,
    table,
)

UNDECIDED, BRIEF = "undecided", "brief"

TABLE = table(
    TransitionRow(IDLE, "speaks", UNDECIDED),
    TransitionRow(IDLE, "gestures", BRIEF, ("started", "succeeded")),
    TransitionRow(IDLE, "announced", BRIEF, ("started", "succeeded")),
    TransitionRow(UNDECIDED, "ends", IDLE, ("started", "succeeded", "completed")),
    TransitionRow(UNDECIDED, "limit", IDLE),
    TransitionRow(UNDECIDED, "outlasts_turn", IDLE),
    TransitionRow(UNDECIDED, "announced", BRIEF, ("started", "succeeded")),
    TransitionRow(UNDECIDED, "person_gone", IDLE),
    TransitionRow(BRIEF, "ends", IDLE, ("completed",)),
    TransitionRow(BRIEF, "person_gone", IDLE, ("completed",)),
)


class Backchannel(Machine):
    """The backchannels of one listener to one speaker."""

    TABLE = TABLE

    def __init__(self, writer: EventWriter, *, limit: Seconds) -> None:
        super().__init__(writer)
        self._limit = limit
        self.last: tuple[Seconds, str] | None = None
        """Start and id of the last backchannel that was published."""

    @property
    def undecided_since(self) -> Seconds | None:
        """Start of speech that may still become a backchannel."""
        return self.event.started if self.event is not None and self.state == UNDECIDED else None

    @property
    def deadline(self) -> Seconds:
        since = self.undecided_since
        return inf if since is None else since + self._limit

    def announced(self, event: OngoingEvent) -> None:
        """Begin a backchannel that the robot announces. Its speech may have been noticed already."""
        if self.state == BRIEF:
            self.ends(event.started)
        if self.state == UNDECIDED and self.event is not None:
            event.started = min(event.started, self.event.started)
        self.event = event
        self.step("announced", event.started)
        self.last = (event.started, event.id)

    def begin(self, event: OngoingEvent, given: str) -> None:
        """Begin speech, or a gesture (given: `speaks`, `gestures`); while speech is undecided it is part of that."""
        if self.state == BRIEF:
            self.ends(event.started)
        if self.state == UNDECIDED:
            return
        self.event = event
        self.step(given, event.started)
        if given == "gestures":
            self.last = (event.started, event.id)

    def ends(self, at: Seconds) -> None:
        """End the speech or gesture."""
        event = self.event
        if event is None:
            return
        event.duration = max(0.0, at - event.started)
        self.step("ends", at)
        self.last = (event.started, event.id)

    def takes_floor(self, given: str, at: Seconds) -> Seconds:
        """Drop speech that turns out to be a turn (given: `limit`, `words` or `outlasts_turn`). Returns its start."""
        assert self.event is not None
        started = self.event.started
        self.step(given, at)
        return started

    def person_gone(self, at: Seconds, until: Seconds) -> None:
        if self.event is not None:
            self.event.duration = max(0.0, until - self.event.started)
            self.step("person_gone", at)
