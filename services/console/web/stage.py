"""View model of the stage: what a visitor sees of the picture, and nothing that is for researchers. Pure.

It has two sections: the scene as the workshop has it, and the talk, made here.
"""

from collections.abc import Iterable, Mapping
from typing import Literal

import msgspec
from msgspec import Struct

from engage_hri.schemas.behaviors import EventKind
from engage_hri.schemas.recognition import EngagementLevel
from engage_hri.schemas.units import Seconds
from engage_hri.services.console.web import sections
from engage_hri.services.console.web.picture import MEASURES, Picture
from engage_hri.services.console.web.seats import SIMULATION, TASK

HEARING = "hearing"
"""Service that hears people."""
EYES = "eyes"
"""Service that sees people."""
BUBBLES = 6
"""Turns that are told at most, the newest."""
Hears = Literal["", "voices", "words"]
"""What is heard of people: nothing, that they speak, or what they say."""
Readiness = Literal["ready", "held", "away"]
"""State of the robot: it acts, somebody has stopped it for a while, or a service of it is not there."""


class Bubble(Struct, frozen=True):
    """A turn of speech over a head. words: those that have been said. open: more may come."""

    actor: str
    since: Seconds
    words: str
    open: bool


class VoiceNow(Struct, frozen=True):
    """Voice of somebody who speaks at this instant. to: ids of those it is for; empty: nobody knows."""

    actor: str
    to: tuple[str, ...]


class Bond(Struct, frozen=True):
    """A connection event that goes on. met: the other has taken it up; else it is still waited for."""

    kind: EventKind
    by: str
    to: str
    about: tuple[str, ...]
    met: bool


class LevelShown(Struct, frozen=True):
    """The engagement of a person, in a word and as 0 to 1; None: too little is known."""

    actor: str
    level: EngagementLevel
    value: float | None


class StageTalk(Struct, frozen=True):
    """All of the stage but what has a place in space. played: people that a program plays.

    task: the robot does its task with whoever comes first. sees: it sees people.
    """

    state: Readiness
    bubbles: tuple[Bubble, ...]
    voices: tuple[VoiceNow, ...]
    bonds: tuple[Bond, ...]
    levels: tuple[LevelShown, ...]
    played: tuple[str, ...]
    task: bool
    hears: Hears
    sees: bool


def talk(
    words: Iterable[sections.UtteranceShown],
    floor: Iterable[sections.SpeechShown],
    events: Iterable[sections.EventShown],
    measures: Iterable[sections.PersonMeasures],
    health: Iterable[sections.Health],
    held: bool,
    reporters: Mapping[str, str],
    understands: bool,
) -> StageTalk:
    """Make the talk of sections of the picture.

    held: the robot is. reporters: the participant that tells of each. understands: who hears people knows words.
    """
    here = {each.name: each.here for each in health}
    services = [each.here for each in health if each.service]
    bubbles = [Bubble(each.actor, each.since, each.words, each.open) for each in words if each.words]
    return StageTalk(
        state="away" if not all(services) else "held" if held else "ready",
        bubbles=tuple(bubbles[-BUBBLES:]),
        voices=tuple(VoiceNow(each.actor, each.to) for each in floor if each.until is None),
        bonds=tuple(
            Bond(each.kind, each.by, each.to, each.about, each.state == "succeeded")
            for each in events
            if each.until is None and each.state in ("started", "succeeded")
        ),
        levels=tuple(
            LevelShown(each.actor, each.level, round(each.engagement[-1][1], 2) if each.engagement else None)
            for each in measures
            if each.actor
        ),
        played=tuple(person for person, reporter in reporters.items() if reporter == SIMULATION),
        task=here.get(TASK, False),
        hears="" if not here.get(HEARING) else "words" if understands else "voices",
        sees=here.get(EYES, False),
    )  # fmt: skip


class StageFace:
    """The picture as the stage shows it: a `Shown` as the picture itself."""

    def __init__(self, picture: Picture) -> None:
        self._picture = picture
        self._made_of: object = None
        self._talk = b""
        self._number = 0

    @property
    def versions(self) -> dict[str, int]:
        """Number of the newest state of each section."""
        made_of = (
            {name: version for name, version in self._picture.versions.items() if _is_talk(name)},
            dict(self._picture.reporters),
        )
        if made_of != self._made_of:
            self._made_of = made_of
            told = msgspec.json.encode(self._make())
            self._number += told != self._talk
            self._talk = told
        return {"scene": self._picture.versions["scene"], "talk": self._number}

    def section(self, name: str) -> bytes:
        """A section as JSON."""
        return self._talk if name == "talk" else self._picture.section(name)

    def zero(self, at: Seconds) -> Seconds:
        """Seconds of the picture at a local instant."""
        return self._picture.zero(at)

    def _make(self) -> StageTalk:
        made = self._picture.made
        people = [made(name) for name in self._picture.versions if name.startswith(MEASURES)]
        held = bool(made("switched").held)
        return talk(
            made("words"), made("floor"), made("events"), people, made("health"), held, self._picture.reporters,
            self._picture.understands,
        )  # fmt: skip


def _is_talk(name: str) -> bool:
    return name in ("words", "floor", "events", "health", "switched") or name.startswith(MEASURES)
