"""Rehearsal of a plan on the simulated body: what its motions are if the behaviors begin and wait as planned.

A copy of the body moves on a clock of its own, by the very methods by which the body moves. So a behavior begins
where the others have brought its part by then, in motion if they are, and a stop costs what it will cost.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from copy import copy
from heapq import heapify, heappop, heappush
from itertools import pairwise
from math import inf

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import BodyPose, Estimate, EstimateItem, Phase
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import EARLY, Bell, MovementAuthority
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.contract.variability import Deviations
from engage_hri.services.control.figure import choreography, tracks
from engage_hri.services.control.figure.course import Course
from engage_hri.services.control.figure.estimates import beneath_a_look
from engage_hri.services.control.figure.runs import Run
from engage_hri.services.control.figure.torso import Torso, is_last_on_target
from engage_hri.services.control.motion.motion import Motion, is_shift
from engage_hri.services.control.motion.path import Path, resting
from engage_hri.services.runtime.steps import Steps

RELEASE, BEGIN = 0, 1
"""The two kinds of events, in the order in which those of one instant happen."""
ROUNDING = 6
"""Decimals of seconds that tell instants apart."""
SAME: Seconds = 0.1
"""Seconds by which a behavior may have begun at another time than who asks says."""
ELEMENTS, TO_FORESEE, TO_SETTLE, A_WAY_HOME = 256, 16, 4, 384
"""Elements that an event counts for (see `runtime.steps`), each behavior under way at it, and a way home of it."""
PLANNING, LAYING, TELLING, SETTING_OUT = 256, 512, 256, 512
"""Elements of the stages of a beginning, as many as where arms have to be kept clear. The copy stands still there."""
TRANSPARENT = 1e-6
"""Seconds: changes of a phase that are not worth telling."""


START = "start"
"""Name of the first sync point."""
HURRIED: Seconds = 0.0005
"""Seconds by which a point comes too early for a behavior that does not hurry."""


class ClockOfCopy(Bell):
    """An instant that only the rehearsal moves: in place of the loop, and of the bell of each run."""

    def __init__(self, at: Seconds) -> None:
        self.at = at

    def time(self) -> Seconds:
        return self.at

    def now(self) -> Seconds:
        return self.at

    def is_past(self, at: Seconds) -> bool:
        return self.at >= at - EARLY

    def ring(self) -> None:
        """Wake nobody: nobody waits."""


def beside(torso: Torso, clock: ClockOfCopy, world: World) -> Torso:
    """A copy of the torso that moves on `clock`; what it does changes nothing of the torso."""
    motions: dict[int, Motion] = {}

    def copied(motion: Motion) -> Motion:
        return motions.setdefault(id(motion), copy(motion))

    other = copy(torso)
    other.clock, other.world, other.attention = clock, world, copy(torso.attention)
    other.homeward = []
    other.misbelieved = dict(torso.misbelieved)
    other.tracks = {part: copy(track) for part, track in torso.tracks.items()}
    for track in other.tracks.values():
        track.motion, track.trunk = copied(track.motion), other.tracks["torso"]
    runs = {id(run): copy(run) for run in torso.runs.values()}
    for run in runs.values():
        run.motion, run.bell = copied(run.motion), clock
        # The body does not know of a fault before it has come: in the copy nobody would end a stall.
        run.pending = [point for point in run.pending if point.is_told]
        run.authority, run.gate = _alike(run), inf
    other.runs = {part: runs[id(run)] for part, run in torso.runs.items()}
    other.base = None
    return other


def _alike(run: Run) -> MovementAuthority:
    """An authority like that of `run`, which the rehearsal may revoke."""
    authority = MovementAuthority(run.behavior, run.authority.through, run.authority.pace)
    if run.authority.held:
        authority.hold()
    if run.authority.revoked is not None:
        authority.revoke(run.authority.revoked)
    return authority


class _Part:
    """One behavior of the rehearsal: its run, when its points were passed, and how long its phases take."""

    def __init__(self, run: Run, estimate: Estimate, waits: Mapping[str, Seconds], forced: Container[str]) -> None:
        self.run = run
        self.estimate = estimate
        self.waits = dict(waits)
        self.passed: dict[str, Seconds] = {}
        self._holds = {point.sync for point in run.course.points if point.held_with}
        self._stops = {point.sync for point in run.course.points if point.held_with in waits}
        self._forced = forced
        """Points for which it hurries or dawdles: the phases to them are told as they would be by themselves."""
        self._phases: dict[str, Seconds] = {}
        self._known: tuple[object, ...] = ()
        """What its way home depends on, as it was when that was last laid."""
        self._marks: Mapping[str, Seconds] = {}
        self._least: dict[str, Seconds] = {}
        """Phases that took longer than they were asked to, as fast as the body could."""
        self._cut: Mapping[str, Seconds] = {}
        """When it would have passed the points that it is asked for, as it moved when it last set out or was cut."""
        self._most: dict[str, Seconds] = {}
        """Phases that took less, as slow as it could be without a stop."""

    def settle(self, torso: Torso, clock: ClockOfCopy, now: Seconds) -> Steps[None]:
        """Note the points that it has passed by now. At a hold point where it waits it stays."""
        run = self.run
        while run.pending and not run.is_over and not run.holding:
            point = run.pending[0]
            due = run.due(point)
            if due is None or due > now + 10.0**-ROUNDING:
                return
            if point.held_with and not run.authority.covers(point.held_with):
                run.holding = True
                return
            run.pending.pop(0)
            self.passed[point.sync] = due
            if is_last_on_target(run.behavior, point.sync):
                clock.at = due
                torso.leave_target(run)
                yield A_WAY_HOME

    def note_coming(self) -> None:
        """Note when it will pass the points that it is asked for: another behavior may cut it before."""
        if (run := self.run).authority.pace and not (run.is_over or run.holding):
            coming = {each.sync: run.due(each) for each in run.pending}
            self._cut = {sync: due for sync, due in coming.items() if due is not None}

    def next_due(self) -> Seconds | None:
        """Instant at which a paced behavior passes its next point: then it is given the next one."""
        run = self.run
        if not (self._forced or run.authority.pace) or run.is_over or run.holding or not run.pending:
            return None
        return run.due(run.pending[0])

    def leave(self, passed: Sequence[str], now: Seconds, *, waited: bool) -> None:
        """Note that it has passed these points. waited: at the first of them; else it stood there already."""
        self.passed |= dict.fromkeys(passed, now)
        if not waited:
            self._phases |= dict.fromkeys(passed, 0.0)

    def foresee(self, torso: Torso, now: Seconds) -> Steps[None]:
        """Take the times of the phases to come from the motion as it is now, if nothing stopped it."""
        if self.run.is_over:
            return
        if self._forced:
            self._foresee_unpaced(now)
            return
        trial = copy(self.run.motion)
        trial.extend(inf, now)
        at, come = dict(self.passed), set(self.passed)
        for point in self.run.pending:
            crossing = trial.crossing(self.run.motion.path.marks[point.sync])
            assert crossing is not None, "nothing limits the trial"
            at[point.sync] = crossing
            if self.run.holding and point.held_with == self.run.pending[0].held_with:
                come.add(point.sync)
        pending = [point.sync for point in self.run.pending]
        last = next((sync for sync in pending if is_last_on_target(self.run.behavior, sync)), "")
        if last:
            way_home = yield from self._way_home(torso, trial, at[last])
            at |= {sync: at[last] + s for sync, s in way_home.items()}
        for since, to in pairwise([point.sync for point in self.run.course.points]):
            if to not in come:
                self._phases[to] = at[to] - at[since]

    def _way_home(self, torso: Torso, trial: Motion, at: Seconds) -> Steps[Mapping[str, Seconds]]:
        """Seconds from its target to each point on its way home, if that has to be laid anew."""
        leaning, base = torso.tracks["torso"].motion, torso.attention.angles
        known = (at, trial.path, leaning, leaning.end, base)
        if known != self._known:
            self._known, back = known, torso.way_home(self.run, trial, at)
            self._marks = {} if back is None else back.marks
            yield 0 if back is None else A_WAY_HOME
        return self._marks

    def _foresee_unpaced(self, now: Seconds) -> None:
        """Take the times from the path of a behavior that runs at another pace, if it has just left a hold point."""
        path, here = self.run.motion.path, self.run.motion.s(now)
        syncs = [point.sync for point in self.run.course.points]
        number = len(self.passed)
        if number and self.passed.get(syncs[number - 1]) == now:
            at = {syncs[number - 1]: here, **{sync: path.marks[sync] for sync in syncs[number:]}}
            self._phases |= {to: at[to] - at[since] for since, to in pairwise(syncs[number - 1 :])}

    def told(self) -> Estimate:
        """The estimate with the phases as they turned out."""
        if self._forced:
            syncs = [point.sync for point in self.run.course.points]
            for since, to in pairwise([sync for sync in syncs if sync in self.passed]):
                if to not in self._forced and to not in self._stops:
                    self._phases[to] = self.passed[to] - self.passed[since]
            self._note_misses()
        phases = tuple([self._updated(phase) for phase in self.estimate.phases])
        return replace(self.estimate, phases=phases)

    def _note_misses(self) -> None:
        """Note the phases to points that came later than it was asked to be there."""
        asked, at = self.run.authority.pace, {**self._cut, **self.passed}
        for since, to in pairwise([point.sync for point in self.run.course.points if point.sync in at]):
            if to in asked and at[to] > asked[to] + HURRIED:
                if (seconds := at[to] - at[since]) > asked[to] - asked.get(since, at[since]):
                    self._least[to] = seconds
            elif to in asked and at[to] < asked[to] - HURRIED:
                self._most[to] = at[to] - at[since]

    def _updated(self, phase: Phase) -> Phase:
        natural = max(0.0, self._phases.get(phase.to, phase.natural))
        if (most := self._most.get(phase.to)) is not None:
            natural = natural if phase.to in self._holds else min(natural, most)
            phase = replace(phase, longest=max(most, natural))
        if (least := self._least.get(phase.to, 0.0)) > phase.shortest:
            return replace(phase, shortest=min(natural, least), natural=natural)
        if abs(natural - phase.natural) < TRANSPARENT:
            return phase
        longest = phase.longest
        if longest is not None and phase.to not in self._most:
            longest = max(longest, natural) if phase.natural else None
        share = phase.shortest / phase.natural if phase.natural else 1.0
        return replace(phase, natural=natural, shortest=share * natural, longest=longest)


def rehearsed(
    torso: Torso, clock: ClockOfCopy, items: Sequence[EstimateItem], others: Sequence[EstimateItem] = ()
) -> Steps[tuple[Estimate, ...]]:
    """Estimate behaviors as one after the other moves the torso, a copy that `beside` has made; with pauses.

    A pose counts for the parts that none of the others moves before. others: behaviors that move the torso, too, and
    are not told.
    """
    count, items = len(items), [*items, *others]
    began = clock.at
    times: list[Mapping[str, Seconds]] = [
        {each.sync: round(began + each.at, ROUNDING) for each in item.times} for item in items
    ]
    passing = [{each.sync for each in item.times if each.through} for item in items]
    events: list[tuple[Seconds, int, int, str]] = []
    parts: dict[int, _Part] = {}
    moved: set[str] = set()
    told: dict[int, Estimate] = {}
    under_way = _under_way(torso, items, began)
    for number, item in enumerate(items):
        if (run := under_way.get(number)) is not None:
            part = parts[number] = yield from _go_on(torso, run, times[number], passing[number])
            moved.update(run.course.parts)
            events += [(until, RELEASE, number, sync) for sync, until in part.waits.items()]
        elif item.reached:  # It moves nothing: a shift beneath a look.
            told[number] = Estimate(behavior=item.behavior.id, feasible=True)
        else:
            events.append((times[number][START], BEGIN, number, ""))
    for number, part in parts.items():
        if number < count:
            yield from part.foresee(torso, clock.at)
    heapify(events)
    awaited: dict[int, Seconds] = {}
    """When each paced behavior passes its next point, by its number."""
    begun_at = -inf
    while events:
        at, kind, number, hold = heappop(events)
        # Those who begin at one instant have all begun before any of them passes a point.
        for part in () if begun_at == at else parts.values():
            yield from part.settle(torso, clock, at)
            if not part.run.pending:
                torso.release(part.run)
            yield TO_SETTLE
        begun_at = at if kind == BEGIN else begun_at
        clock.at = max(at + EARLY, clock.at)  # What ends then has ended.
        if kind == RELEASE:
            yield from _let_go(torso, parts[number], hold, clock.at)
        else:
            for part in parts.values():
                part.note_coming()
            begun = yield from _begin(torso, clock, items[number], times[number], passing[number], moved)
            if isinstance(begun, Estimate):
                told[number] = begun
            else:
                parts[number] = begun
                for sync, until in begun.waits.items():
                    heappush(events, (until, RELEASE, number, sync))
        yield SETTING_OUT if kind == BEGIN else ELEMENTS
        for each, part in parts.items():
            if each < count:
                yield from part.foresee(torso, clock.at)
                yield TO_FORESEE
            if (due := part.next_due()) is not None and due != awaited.get(each):
                awaited[each] = due
                heappush(events, (max(due, clock.at), RELEASE, each, ""))
    told |= {number: part.told() for number, part in parts.items() if number < count}
    return tuple([told[number] for number in range(count)])


def _under_way(torso: Torso, items: Sequence[EstimateItem], now: Seconds) -> dict[int, Run]:
    """The runs of the behaviors that are under way, by number: who asks knows of it, or says they begin by now.

    Two blocks may have the same behavior: of those the run is the one's that began when it did.
    """
    runs = {id(run): run for run in torso.runs.values() if not run.is_over}
    starts = [next((now + each.at for each in item.times if each.sync == START), inf) for item in items]
    pairs = sorted(
        (abs(run.began - starts[number]), number, key)
        for number, item in enumerate(items)
        for key, run in runs.items()
        if run.behavior == item.behavior and (item.reached or starts[number] <= now + EARLY)
    )
    found: dict[int, Run] = {}
    for apart, number, key in pairs:
        if number not in found and key in runs and apart < SAME:
            found[number] = runs.pop(key)
    return found


def _go_on(torso: Torso, run: Run, times: Mapping[str, Seconds], passing: Container[str]) -> Steps[_Part]:
    """Let a behavior that is under way go on up to the first point where it has to wait."""
    coming = [point for point in run.pending if point.sync in times]
    waits = {point.held_with: times[point.sync] for point in coming if point.held_with and point.sync not in passing}
    run.authority.extend(_through(run.behavior, list(waits)))
    if not run.holding:
        yield from torso.extended(run)
    yield TELLING
    part = _Part(run, torso.estimate(run.behavior, None, torso.world), waits, ())
    pending = {point.sync for point in run.pending}
    now = torso.clock.time()
    part.passed = {p.sync: times.get(p.sync, now) for p in run.course.points if p.sync not in pending}
    return part


def _begin(
    torso: Torso,
    clock: ClockOfCopy,
    item: EstimateItem,
    times: Mapping[str, Seconds],
    passing: Container[str],
    moved: set[str],
) -> Steps[_Part | Estimate]:
    """Begin a behavior on the copy. Returns its estimate alone if it moves nothing."""
    behavior = item.behavior
    if is_shift(behavior) and torso.is_overlaid():
        estimate = torso.estimate(behavior, None, torso.world)
        if estimate.feasible:
            course = choreography.plan(behavior, torso.situation(torso.world))
            torso.set_out(Run(behavior, course, MovementAuthority(behavior, START), Deviations(), 0))
        # Nothing moves: it ends at once, or whenever it is asked to.
        return beneath_a_look(estimate)
    situation = torso.situation(torso.world)
    try:
        course = choreography.plan(behavior, situation)
        if _place(torso, item.pose, [part for part in course.parts if part not in moved]):
            situation = torso.situation(torso.world)
            course = choreography.plan(behavior, situation)
        yield PLANNING
        path = yield from torso.laid(course)
        yield LAYING
        estimate = torso.told(behavior, course, path, situation)
        yield TELLING
    except Impossible as impossible:
        return impossible.estimate(behavior)
    waits, forced = _told_apart(course, path, times, passing)
    paced = _paced_by(course, path, times, forced)
    authority = MovementAuthority(behavior, _through(behavior, list(waits)), paced)
    run = Run(behavior, course, authority, Deviations(), 0)
    run.bell = clock
    yield from torso.taken_over(run, path)
    moved.update(course.parts)
    part = _Part(run, estimate, waits, forced)
    if paced:
        yield from torso.extended(run)
    return part


def _place(torso: Torso, pose: BodyPose | None, parts: Sequence[str]) -> bool:
    """Put parts to rest where `pose` has them; they stay where they are if it does not say. True if any is put."""
    is_put = False
    angles = {joint.joint: joint.angle for joint in pose.joints} if pose is not None else {}
    for part in parts:
        track = torso.tracks[part]
        if part != "nod" and all(joint in angles for joint in track.joints):
            start = resting([angles[joint] for joint in track.joints])
            track.play(Motion(Path(start, (), tracks.LIMITS[part]), torso.clock.time()))
            is_put = True
    return is_put


def _let_go(torso: Torso, part: _Part, hold: str, now: Seconds) -> Steps[None]:
    """Let a behavior pass the hold point at which it waits, or to which it is still on its way.

    hold: empty to let it go on at another pace.
    """
    run = part.run
    if run.is_over or not run.pending:
        return
    part.waits.pop(hold, None)
    run.authority.extend(_through(run.behavior, list(part.waits)))
    waited = True
    while hold and run.holding and run.authority.covers(hold):
        part.leave(torso.leave_hold(run, hold), now, waited=waited)
        hold, waited = run.pending[0].held_with, False
    if not run.holding:
        yield from torso.extended(run)


def _through(behavior: BlockBehavior, waits: Sequence[str]) -> str:
    """The last sync point that a behavior may pass if it has to wait at the first of `waits`."""
    return next(_before(behavior, waits[:1]), "end")


def _before(behavior: BlockBehavior, waits: Sequence[str]) -> Iterator[str]:
    points = MovementAuthority(behavior, START).points
    yield from (points[points.index(sync) - 1] for sync in waits)


def _told_apart(
    course: Course, path: Path, times: Mapping[str, Seconds], passing: Container[str]
) -> tuple[dict[str, Seconds], dict[str, Seconds]]:
    """Times of hold points at which it has to wait, and of points for which it hurries or dawdles.

    It hurries to a hold point if it would come there later by itself.
    """
    waits: dict[str, Seconds] = {}
    forced: dict[str, Seconds] = {}
    before, at = START, times[START]
    for point in course.points[1:]:
        if point.sync in times:
            natural = path.marks[point.sync] - path.marks[before]
            is_hurried = times[point.sync] - at < natural - HURRIED
            if point.held_with and not is_hurried and point.sync not in passing:
                waits[point.held_with] = times[point.sync]
            else:
                forced[point.sync] = times[point.sync]
            before, at = point.sync, times[point.sync]
    return waits, forced


def _paced_by(
    course: Course, path: Path, times: Mapping[str, Seconds], forced: Mapping[str, Seconds]
) -> dict[str, Seconds]:
    """Instants for all points up to the last that is forced: the others are asked for as they come by themselves."""
    paced: dict[str, Seconds] = {}
    at = times[START]
    for since, to in pairwise([point.sync for point in course.points]):
        if len(forced.keys() & paced.keys()) == len(forced):
            break
        at = paced[to] = times.get(to, at + path.marks[to] - path.marks[since])
    return paced
