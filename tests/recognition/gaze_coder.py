"""Looks of one person and the robot, drawn at random, and the gaze events that a coder of the whole writes down.

Takes nothing from the code that it judges. Definitions: thesis 2.2.1 and 2.2.2, limits: docs/recognition.md. Where
the thesis leaves it open, the coder has it as that page: a look directs when it has lasted, and a glance of the robot
that is over by then is no answer. A request of the robot begins no look: its event starts when its look has arrived,
or when all that it announced has come.
"""

import random
from itertools import pairwise
from typing import NamedTuple

from engage_hri.schemas.behaviors import EventKind
from engage_hri.schemas.recognition import ConnectionEvent
from tests.recognition.coder import only_one_has
from tests.recognition.observations import HUMAN, ROBOT, Log

OBJECTS = ("blue-square", "rectangle")
FACE = {HUMAN: ROBOT, ROBOT: HUMAN}
FACIAL_LIMIT, DIRECTED_LIMIT = 1.9, 2.5
DIRECTS_AFTER = 0.6
AFTER_ROBOT = 2.0
ROUND = 1e-6
NEVER = float("inf")
PATIENCE = 12.0
"""Time after the limit for which an announced gesture is waited for that does not come."""


class Look(NamedTuple):
    since: float
    until: float
    target: str


class Request(NamedTuple):
    """shown: when all gestures have come with which the robot said that it would show the target."""

    at: float
    kind: EventKind
    target: str
    shown: float


class Gazed(NamedTuple):
    """An event. objects: none for a mutual gaze."""

    kind: str
    initiator: str
    started: float
    target: str
    state: str
    delay: float | None = None


class Gazes:
    """A timeline of looks. All begin at different times, but for those that begin with a limit."""

    def __init__(self, seed: int) -> None:
        self._chance = random.Random(seed)
        self.looks = {who: self._drawn(who) for who in (HUMAN, ROBOT)}
        self.requests = [
            Request(round(at + 0.003, 3), "mutual_facial_gaze" if target == HUMAN else "directed_gaze", target, 0.0)
            for at, _, target in self.looks[ROBOT] if target and self._chance.random() < 0.4
        ]  # fmt: skip
        late = [each for each in self.requests if self._chance.random() < 0.3]
        self.requests = [
            each._replace(at=round(each.at + self._chance.uniform(-1.0, 1.0), 3) + 0.0004) if each in late else each
            for each in self.requests
        ]
        self.requests = sorted(self._drawn_shown(each) for each in self.requests if each.at > 0)

    def _drawn_shown(self, request: Request) -> Request:
        later = round(request.at + self._chance.uniform(0.0, 2.0), 3) + 0.0007
        return request._replace(shown=self._chance.choice((request.at, request.at, later, later, NEVER)))

    def _drawn(self, who: str) -> list[Look]:
        chance, at, found = self._chance, 0.5 if who == HUMAN else 0.7, list[Look]()
        grid = 0.1 if chance.random() < 0.5 else 0.001
        for _ in range(30):
            lasts = max(0.2, round(chance.choice((chance.uniform(0.2, 1.5), chance.uniform(0.5, 6.0))) / grid) * grid)
            target = chance.choice((FACE[who], FACE[who], *OBJECTS, "table"))
            until = round(at + lasts, 6)
            if not found or found[-1].target != target:
                found.append(Look(at, until, target))
            else:
                found[-1] = found[-1]._replace(until=until)
            at = until
        return [*found[:-1], found[-1]._replace(until=NEVER)]

    def told(self) -> list[Gazed]:
        log = Log()
        steps = [(look.since, 0, who, look) for who, looks in self.looks.items() for look in looks]
        asked = [(each.at, 1, ROBOT, each) for each in self.requests]
        shown = [(each.shown, 2, ROBOT, f"b{each.at}") for each in self.requests if each.at < each.shown < NEVER]
        for at, _, who, what in sorted([*steps, *asked, *shown], key=lambda each: each[:3]):
            while (due := log.session.deadline) is not None and due < at - ROUND:
                log.until(due)
            if isinstance(what, Look):
                log.looks(who, what.target, at)
            elif isinstance(what, str):
                log.passes("gaze-1:stroke", at, block=what)
            else:
                objects = (what.target,) if what.kind == "directed_gaze" else ()
                anchors = () if what.shown == at else ("gaze-1:stroke",)
                log.requests_event(what.kind, at, *objects, block=f"b{at}", anchors=anchors)
        log.until(1e4)
        return as_told(log.events)


def as_told(events: list[ConnectionEvent]) -> list[Gazed]:
    """How each event was decided."""
    found: dict[str, Gazed] = {}
    for each in events:
        if each.id not in found and each.state != "started":
            delay = round(each.delay, 5) if each.state == "succeeded" and each.delay is not None else None
            target = each.objects[0] if each.objects else ""
            found[each.id] = Gazed(
                each.kind, each.initiator, round(each.started.seconds, 5), target, each.state, delay
            )
    return sorted(found.values())


class GazeCoder:
    """Reads looks and requests from beginning to end."""

    def __init__(self, gazes: Gazes) -> None:
        self._human, self._robot = gazes.looks[HUMAN], gazes.looks[ROBOT]
        self._requests = gazes.requests
        self._found: list[Gazed] = []
        self._answers: set[float] = set()
        """When looks have answered the robot's."""
        self._adopted: set[float] = set()
        """Requests that met an event that went on."""
        self._directed: list[tuple[float, float, str, str]] = []
        """Directed gazes: when each was recognized and over, who began it, and its object."""

    def events(self) -> list[Gazed]:
        self._directed_gazes()
        self._mutual_gazes()
        return sorted(self._found)

    def _note(
        self, kind: str, initiator: str, at: float, target: str, state: str, delay: float | None = None
    ) -> None:
        delay = None if delay is None else round(delay, 5)
        self._found.append(Gazed(kind, initiator, round(at, 5), target, state, delay))

    @staticmethod
    def _on(looks: list[Look], target: str, at: float) -> Look | None:
        """The look at the target that goes on at a time.

        Of the robot's also one that ends just then: of what happens at one time the person's is observed first.
        """
        found = [each for each in looks if each.target == target and each.since <= at <= each.until]
        return next((each for each in found if at < each.until or target == HUMAN), None)

    def _shows(self, at: float, begins: float, limit: float) -> tuple[float, float, str]:
        """When the robot shows what it asked for at a time, when that is over if nobody follows, and how it ends.

        begins: when the person's event is over, which it met; or `at`.
        """
        request = next(each for each in self._requests if each.at == at)
        looks = at if self._on(self._robot, request.target, at) else self._comes(self._robot, request.target, at)
        shown = min(looks, request.shown)
        if request.shown < NEVER:
            return shown, max(shown, request.shown, begins - limit) + limit, "failed"
        until = (shown if shown <= at + limit + PATIENCE else at) + limit + PATIENCE
        return shown, until, "withdrawn"

    @staticmethod
    def _comes(looks: list[Look], target: str, after: float) -> float:
        return min((each.since for each in looks if each.target == target and each.since > after), default=NEVER)

    # -- directed gaze ------------------------------------------------------------------------------------------

    def _directed_gazes(self) -> None:
        begins: list[tuple[float, Look | Request]] = [
            (each.since + DIRECTS_AFTER, each) for each in self._human
            if each.target in OBJECTS and each.until > each.since + DIRECTS_AFTER + ROUND
        ]  # fmt: skip
        begins += [(each.at, each) for each in self._requests if each.kind == "directed_gaze"]
        for at, what in sorted(begins, key=lambda each: (round(each[0], 6), isinstance(each[1], Look))):
            if isinstance(what, Request):
                if what.at not in self._adopted:
                    self._robot_directs(what.target, what.at, what.at)
            elif not self._is_answer(what, at):
                self._human_directs(what, at)

    def _is_answer(self, look: Look, at: float) -> bool:
        """True for a look that follows the robot's direction, or goes on with what both are about already."""
        for known, over, who, target in self._directed:
            if target != look.target or known > at:
                continue
            if over > at or (who == ROBOT and look.since <= over + AFTER_ROBOT + ROUND and look.until > known):
                return True
        return False

    def _asks(self, target: str, after: float) -> list[float]:
        """When the robot asks for a gaze there later. target: HUMAN: a mutual one."""
        return [each.at for each in self._requests if each.target == target and each.at > after]

    def _human_directs(self, look: Look, known: float) -> None:
        limit, target = look.since + DIRECTED_LIMIT, look.target
        there = self._on(self._robot, target, known)
        comes = max(there.since, look.since) if there is not None else self._comes(self._robot, target, known)
        if there is not None or comes <= limit + ROUND:
            self._note("directed_gaze", HUMAN, look.since, target, "succeeded", comes - look.since)
            over = self._part(target, max(comes, known), [])
            self._adopts(target, known, over)
            self._directed.append((known, over, HUMAN, target))
            return
        self._note("directed_gaze", HUMAN, look.since, target, "failed")
        self._directed.append((known, limit, HUMAN, target))
        if asked := self._adopts(target, known, limit):
            for at, after in pairwise(asked):
                shown, _, _ = self._shows(at, at, DIRECTED_LIMIT)
                self._note("directed_gaze", ROBOT, min(shown, after), target, "superseded")
            self._robot_directs(target, asked[-1], limit)

    def _adopts(self, target: str, since: float, until: float) -> list[float]:
        """Requests that meet an event that goes on: they are about it."""
        asked = [at for at in self._asks(target, since) if at < until]
        self._adopted |= {*asked}
        return asked

    def _robot_directs(self, target: str, at: float, begins: float) -> None:
        """Read a direction of the robot. begins: when the person's event is over, which it met; or when it asked."""
        asks, (shown, limit, ends) = self._asks(target, begins), self._shows(at, begins, DIRECTED_LIMIT)
        told = max(shown, begins)
        comes = told if self._on(self._human, target, told) else self._comes(self._human, target, told)
        next_asked = min(asks, default=NEVER)
        over = min(limit, next_asked)
        if comes <= limit + ROUND and comes < next_asked:
            self._note("directed_gaze", ROBOT, shown, target, "succeeded", comes - shown)
            over = self._part(target, comes, asks, begun=begins)
        else:
            self._note("directed_gaze", ROBOT, min(shown, over), target, ends if limit < next_asked else "superseded")
        self._directed.append((begins, over, ROBOT, target))

    def _part(self, target: str, at: float, asks: list[float], begun: float | None = None) -> float:
        """When the shared phase is over. begun: the robot's request, if it began; its gaze may follow."""
        face = ROBOT if target == HUMAN else target
        human, robot = self._on(self._human, face, at), self._on(self._robot, target, at)
        if human is None:
            return at
        ends = min(human.until, self._directs(at) if target == HUMAN else NEVER)
        had_come = begun is not None and any(
            each.target == target and each.until > begun and each.since < at for each in self._robot
        )
        if robot is not None and robot.since == at == human.since and had_come:
            return at  # it had left, and comes back when the person has been there
        if robot is None:
            if begun is None or had_come:
                return at
            comes = self._comes(self._robot, target, at)
            ends = min(ends, min((each for each in asks if at < each < comes), default=NEVER))
            if comes >= ends:
                return ends
            robot, at = self._on(self._robot, target, comes), comes
        over = min(ends, NEVER if robot is None else robot.until)
        self._adopts(target, at, over)
        return over

    # -- mutual facial gaze -------------------------------------------------------------------------------------

    def _mutual_gazes(self) -> None:
        looks = [(each.since, HUMAN, each.until) for each in self._human if each.target == ROBOT]
        asked = [(at, ROBOT, NEVER) for at in self._asks(HUMAN, 0.0)]
        over = -1.0
        for at, who, until in sorted([*looks, *asked]):
            if who == ROBOT and at not in self._adopted:
                over = self._robot_looks(at, at)
            elif who == HUMAN and over <= at and at not in self._answers:
                over = self._human_looks(at, until)

    def _human_looks(self, at: float, until: float) -> float:
        limit = at + FACIAL_LIMIT
        comes = at if self._on(self._robot, HUMAN, at) else self._comes(self._robot, HUMAN, at)
        is_met = comes <= limit + ROUND and comes < until
        over = comes if is_met else min(limit, until)
        waiting: float | None = None
        for asked in self._adopts(HUMAN, at, over):
            if waiting is not None:
                directs = self._directs(waiting, by=ROBOT)
                started = min(self._shows(waiting, waiting, FACIAL_LIMIT)[0], directs, asked)
                state = "withdrawn" if directs < asked else "superseded"
                self._note("mutual_facial_gaze", ROBOT, started, "", state)
            waiting = asked
        if waiting is not None and (directs := self._directs(waiting, by=ROBOT)) < over:
            started = min(self._shows(waiting, waiting, FACIAL_LIMIT)[0], directs)
            self._note("mutual_facial_gaze", ROBOT, started, "", "withdrawn")
            waiting = None
        if is_met:
            self._note("mutual_facial_gaze", HUMAN, at, "", "succeeded", comes - at)
            return self._part(HUMAN, comes, [])
        self._note("mutual_facial_gaze", HUMAN, at, "", "failed")
        return over if waiting is None else self._robot_looks(waiting, over)

    def _robot_looks(self, at: float, begins: float) -> float:
        """Read a request of the robot. begins: when the person's event is over, which it met; or when it asked."""
        asks, (shown, limit, ends) = self._asks(HUMAN, begins), self._shows(at, begins, FACIAL_LIMIT)
        told = max(shown, begins)
        comes = told if self._on(self._human, ROBOT, told) else self._comes(self._human, ROBOT, told)
        there = self._on(self._robot, HUMAN, begins) or self._on(
            self._robot, HUMAN, self._comes(self._robot, HUMAN, begins)
        )
        leaves = NEVER if there is None else there.until
        directs, next_asked = self._directs(begins, by=ROBOT), min(asks, default=NEVER)
        if comes <= limit + ROUND and comes < min(next_asked, directs) and comes <= leaves:
            self._note("mutual_facial_gaze", ROBOT, shown, "", "succeeded", comes - shown)
            self._answers.add(comes)
            return self._part(HUMAN, comes, asks, begun=begins)
        first = min(limit, leaves, next_asked, directs)
        state = "superseded" if first == next_asked else ends if first == limit else "withdrawn"
        self._note("mutual_facial_gaze", ROBOT, min(shown, first), "", state)
        return first

    def _directs(self, after: float, by: str = "") -> float:
        """When the next directed gaze is recognized, or asked for by the robot."""
        asked = [each.at for each in self._requests if each.kind == "directed_gaze"]
        known = [] if by == ROBOT else [known for known, _, who, _ in self._directed if who == HUMAN]
        return min((at for at in (*asked, *known) if at > after), default=NEVER)


def differences(seed: int) -> tuple[int, list[str]]:
    """Number of events of a drawn timeline, and what only one of recognition and the coder has."""
    gazes = Gazes(seed)
    told, coded = gazes.told(), GazeCoder(gazes).events()
    return only_one_has(told, coded)
