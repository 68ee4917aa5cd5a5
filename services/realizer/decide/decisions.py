"""Decisions of the realizer, without a clock: how far each behavior may go, given the sync points measured so far.

Facts go in (`arrive`, `reach`), `advance(now)` says what to do about them (`Effect`), `deadline` when to ask again.
What is decided comes from the marking of the net (grants.py) and from what is expected (foresee/expectations.py). For
another plan of the block they tell what holds have stopped of it (`stopped`).

*Lateness.* A behavior that reports nothing in time is told late, then given up: else a block with one dead arm never
ends. While something is held, and until all that was under way then has come to its next point, a body may be
anywhere between two words or on its way to a hold point: what is late by no more than was held is late for that. Then
it is known what the hold has cost: the times that are expected now are compared with those that were expected before,
and what is expected to be late by so much more is late for the hold (`HeldUp`). Without this a hold would be told as
a fault of whoever was held.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence, Set
from math import isfinite

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import Sight, Silences
from engage_hri.services.realizer.config import LATE, RealizerConfig
from engage_hri.services.realizer.decide.grants import Grants
from engage_hri.services.realizer.foresee.expectations import Foresight, Outlook, Pace, differ_noticeably
from engage_hri.services.realizer.net.facts import NO_STOPS, STANDING, Facts, Stops
from engage_hri.services.realizer.net.running import Observer, RunningNet
from engage_hri.services.realizer.plan.plan import Broken, Plan, Promises
from engage_hri.services.realizer.points import EPSILON, ORIGIN, Point, performer, stands_soon

# -- lateness -----------------------------------------------------------------------------------------------------


LATE_FACTOR = 1.0
"""Share of its natural time by which a phase may take longer besides: a long one misses by more. Ours."""
STALL_FACTOR = 5.0
"""The same for a phase whose behavior counts as failed (`realizer.stall`): motors that take four times as long pass.
Ours."""


class Late(Struct, frozen=True):
    """`behavior` is taking much longer to `sync` than it should."""

    behavior: str
    sync: str
    overdue: Seconds

    @property
    def point(self) -> Point:
        return Point(self.behavior, self.sync)


class Stalled(Struct, frozen=True):
    """`behavior` has been late for `sync` so long that it must be given up."""

    behavior: str
    sync: str
    overdue: Seconds


class LatenessWatch:
    """The next report of each behavior under way, and when it becomes too late."""

    def __init__(self, config: RealizerConfig, sight: Sight) -> None:
        self._stall = config.stall
        self._awaited: dict[str, tuple[str, Seconds, Seconds]] = {}
        """Next report of each behavior, when it is expected, and how long the phase before it lasts."""
        self._warned: set[str] = set()
        self._alarms = Silences[tuple[str, bool]](sight, lambda name: name)
        """Times from which a behavior is late, and those from which it is stalled, too."""

    def expect(self, behavior: str, sync: str, expected: Seconds, natural: Seconds, now: Seconds) -> None:
        """Expect `sync` as the next report, about at `expected`. natural: the duration of the phase before it."""
        awaited = (sync, expected, natural)
        if awaited != self._awaited.get(behavior):
            self._awaited[behavior] = awaited
            late = expected + LATE + LATE_FACTOR * natural
            stalled = expected + self._stall + STALL_FACTOR * natural
            if behavior not in self._warned:
                self._alarms.set((behavior, False), max(now, late))
            self._alarms.set((behavior, True), max(now, stalled))

    def forget(self, behavior: str) -> None:
        """Stop expecting a report: the behavior has ended, or holds until it may go on."""
        self._awaited.pop(behavior, None)
        self._alarms.clear((behavior, False))
        self._alarms.clear((behavior, True))

    @property
    def deadline(self) -> Seconds | None:
        """Time of the next call of `overdue` that may find something; None if no report is expected."""
        return self._alarms.earliest

    def overdue(self, now: Seconds) -> list[Late | Stalled]:
        """Behaviors that are late (told once for each), and behaviors that have been late for too long."""
        found: list[Late | Stalled] = []
        for behavior, is_stalled in [*iter(lambda: self._alarms.due(now + EPSILON), None)]:
            sync, expected, _ = self._awaited[behavior]
            if is_stalled:
                found.append(Stalled(behavior, sync, now - expected))
                self.forget(behavior)
            else:
                self._warned.add(behavior)
                found.append(Late(behavior, sync, now - expected))
        return found


class HeldUp:
    """For how much of a lateness the holds account."""

    def __init__(self) -> None:
        self._costs: list[tuple[Outlook, Outlook]] = []
        """For each time in which something was held, what was expected before it, and after."""
        self._before: Outlook | None = None
        """What was expected before the hold that has its effect now; None: none has."""
        self._began: Seconds = 0.0
        self._lasted: Seconds = 0.0
        """Seconds for which it has lasted, up to `_since` if it still lasts."""
        self._since: Seconds | None = None
        self._settled_at: Seconds = 0.0
        """Time before which not all of its effect is known, once it is over."""
        self._under_way: dict[str, int] = {}
        """Behaviors that were under way when it was over, with the number of their next points."""

    @property
    def has_effect(self) -> bool:
        """True if something is held, or was and not all that follows from it is known."""
        return self._before is not None

    def hold(self, outlook: Outlook, now: Seconds) -> None:
        """Note that something is held from now on. outlook: what was expected until now."""
        if self._before is None:
            self._before, self._began, self._lasted = outlook, now, 0.0
        if self._since is None:
            self._since = now

    def let_go(self, now: Seconds, under_way: Mapping[str, int]) -> None:
        """Note that nothing is held any more. under_way: behaviors on their way to a point, with its number."""
        if self._since is not None:
            self._lasted, self._since = self._lasted + now - self._since, None
            self._settled_at, self._under_way = now + STANDING, dict(under_way)

    def is_settled(self, now: Seconds, under_way: Mapping[str, int]) -> bool:
        """True if the hold is over and its effect is known, but not noted yet (see `settle`)."""
        if self._before is None or self._since is not None or now < self._settled_at:
            return False
        return not any(under_way.get(behavior) == number for behavior, number in self._under_way.items())

    def settle(self, outlook: Outlook) -> None:
        """Note what the hold has cost: all that it was the cause of is in `outlook`."""
        if self._before is not None:
            self._costs.append((self._before, outlook))
            self._before = None

    # -- what it accounts for ------------------------------------------------------------------------------------

    def between(self, point: Point, other: Point, allowed: Seconds, late: Seconds, at: Seconds) -> Seconds:
        """Seconds for which holds account, of those by which `point` is later than `allowed` after another point.

        late: these. at: when the later of the two points came.
        """
        apart = [(one.apart(point, other), after.apart(point, other)) for one, after in self._costs]
        known = sum(_more(one - allowed, after - allowed) for one, after in apart)
        if self._before is None or at <= self._began:
            return known
        # The effect of this one is not known yet. What was expected to be late before it is not late for it.
        lasted = self._lasted + (0.0 if self._since is None else max(0.0, at - self._since))
        already = max(0.0, self._before.apart(point, other) - allowed - known)
        return known + min(lasted + STANDING, max(0.0, late - known - already))


def _more(before: Seconds, after: Seconds) -> Seconds:
    """Seconds by which a lateness has grown."""
    return max(0.0, after - max(0.0, before))


# -- decisions ----------------------------------------------------------------------------------------------------


class Begin(Struct, frozen=True):
    """Start `behavior`; it may go through `through` without asking."""

    behavior: str
    through: str
    pace: Pace = ()


class Extend(Struct, frozen=True):
    """Let `behavior` go through `through` now, and come to its points as `pace` says.

    held: wait where it next can, whatever `through` says.
    """

    behavior: str
    through: str
    pace: Pace = ()
    held: bool = False


Effect = Begin | Extend | Late | Stalled


def stopped(plan: Plan, facts: Facts, held_up: HeldUp, times: Mapping[Point, Seconds], now: Seconds) -> Stops:
    """Tell what holds have stopped. times: of all points, measured or expected, by the loop's clock."""
    began = facts.began

    def cost(late: Point, early: Point, allowed: Seconds, by: Seconds) -> Seconds:
        return held_up.between(late, early, allowed, by, max(times.get(late, now), times.get(early, now)))

    return Stops(
        holds=facts.holds_so_far(now),
        phases={point: seconds for point, seconds in _stood(plan, facts, now) if seconds},
        reached={point: at - began for point, at in facts.reached.items()},
        times={ORIGIN: 0.0} | {point: at - began for point, at in times.items()},
        cost=cost,
    )


def _stood(plan: Plan, facts: Facts, now: Seconds) -> Iterator[tuple[Point, Seconds]]:
    """Seconds for which behaviors stood on their way to each point that they have come to, and to the next.

    A voice stands between two words, a clock at once; a movement goes on to where it can wait, and stands there.
    """
    for behavior in facts.begun:
        if (chain := plan.chains.get(behavior)) is None:
            continue
        stands = stands_soon(chain.behavior)
        for before, point in zip(chain.points, chain.points[1 : facts.next_number(behavior) + 1], strict=False):
            until = facts.reached.get(point, now)
            if stands:
                yield point, facts.stood_between(facts.reached[before], until, behavior)
            elif point in facts.arrived:
                yield point, facts.held_between(facts.arrived[point], until, behavior)


class Decisions:
    """The state of one performance: facts, the net that they move, and what is decided.

    began: loop time of the block's start; all times are of that clock. observers: told what happens in the net, but
    not again what had happened before another plan. is_free: False for a behavior that is not to begin before
    there is another plan. sight: what this process knows of its own standstills. is_ending: see the property.
    """

    def __init__(
        self,
        plan: Plan,
        began: Seconds,
        config: RealizerConfig,
        observers: Callable[[Plan, RunningNet, Seconds], Sequence[Observer]] = lambda plan, net, began: (),
        is_free: Callable[[str], bool] = lambda behavior: True,
        sight: Sight | None = None,
        is_ending: Callable[[], bool] = lambda: False,
    ) -> None:
        self._is_ending = is_ending
        self.began = began
        self.facts = Facts(began)
        self.foresight = Foresight(plan, self.facts)
        self.grants = Grants(self.facts, self.foresight, is_free)
        self.lateness_watch = LatenessWatch(config, sight or Sight("realizer"))
        self._unwatched: set[str] = set()
        """Behaviors about which there is news, so that another report of theirs is to be expected than before."""
        self._awaited_since: dict[str, Seconds] = {}
        """Time from which the start of each behavior is awaited. A loop that is late gets to that long after this was
        decided, and the body cannot be blamed for it."""
        self._asking: dict[str, Point] = {}
        """Behaviors that were told to pass a point, and are to ask again: something was held since."""
        self._kept_back: set[str] = set()
        """Those that were told to wait until they are told to pass."""
        self.held_up = HeldUp()
        self._observers = observers
        self.replan(plan)
        self.foresight.is_surprised = False

    def replan(self, plan: Plan) -> None:
        """Go on with another plan of the same block, from the same facts: something was dropped."""
        self.plan = plan
        self.net = net = RunningNet(plan.net, plan.members, plan.at, (self.foresight, self.grants))
        self.promises = Promises(plan.relations)
        for point in self.facts.reached.keys() | {ORIGIN}:
            self.promises.come(point, self.facts.reached.get(point, self.began))
        self.foresight.look_ahead(plan, net)
        self.grants.adopt(plan, net)
        self.facts.adopt(net, {id: chain.points for id, chain in plan.chains.items()})
        self.foresight.recall_holds()
        net.observe(self._observers(plan, net, self.began))
        for behavior in self.facts.begun:
            if behavior not in plan.chains:
                self.lateness_watch.forget(behavior)
            elif not self.facts.has_ended(behavior):
                self.grants.look_again(behavior)
                self.grants.touched.add(behavior)  # What it waited for may be gone, at a word gap, too.
                self.foresight.expect_next(behavior)

    # -- facts ---------------------------------------------------------------------------------------------------

    def arrive(self, point: Point, at: Seconds) -> None:
        """Note that the behavior holds at `point`. A report that cannot be true is ignored."""
        if isfinite(at) and self.facts.is_ahead(point) and point not in self.facts.arrived:
            self.foresight.learn(point, self.facts.bounded(point, at))
            self.facts.arrive(point, at)
            self._unwatched.add(point.behavior)

    def reach(self, point: Point, at: Seconds) -> tuple[Point, ...]:
        """Note that the behavior has passed `point`, and earlier ones that were not reported; returns what is news.

        A report that cannot be true is ignored.
        """
        if not isfinite(at) or not self.facts.is_ahead(point):
            return ()
        if not self.facts.holds(point):
            self.foresight.learn(point, self.facts.bounded(point, at))
        news = self.facts.reach(point, at)
        self._unwatched.add(point.behavior)
        self.grants.look_again(point.behavior)
        self.foresight.expect_next(point.behavior)
        return news

    def say(self, behavior: str, position: int, at: Seconds, now: Seconds) -> bool:
        """Note that a voice has finished a word; True if that changes what is expected.

        position: characters of the text said so far. A report that cannot be true is ignored.
        """
        if behavior not in self.facts.begun or not isfinite(at):
            return False
        at = min(at, now)
        self.facts.say(behavior, at)
        return self.foresight.hear(behavior, position, at, now)

    def can_wait(self, behavior: str) -> bool:
        """True if a behavior of the plan can still be made to wait; a voice always can, between two words."""
        chain, facts = self.plan.chains[behavior], self.facts
        is_moving = behavior in facts.begun and performer(chain.behavior) == "body" and chain.type != "speech"
        ahead = chain.points[facts.next_number(behavior) :]
        return not is_moving or any(self.net.part_of[point].can_wait for point in ahead)

    def hold_up(self, is_held: bool, now: Seconds) -> None:
        """Note that something is held from now on, of whatever block, or nothing any more.

        To be called before what is held stops (see `hold`).
        """
        if is_held:
            self.held_up.hold(self.foresight.outlook(now), now)
        else:
            self.held_up.let_go(now, self._under_way())

    def _under_way(self) -> dict[str, int]:
        """Behaviors that are on their way to a point, with its number."""
        facts = self.facts
        going = {id: facts.next_number(id) for id in facts.under_way}
        return {id: number for id, number in going.items() if not facts.holds(self.plan.chains[id].points[number])}

    def hold(
        self,
        behaviors: Collection[str] | None,
        now: Seconds,
        stuck: Collection[Point] = (),
        standing: Collection[Point] = (),
    ) -> list[Effect]:
        """Hold these behaviors, and no others, from now on: each waits where it next can. None: all of them.

        The marking stays, and clocks before their instants stop. Those that were held and are not go on from there.
        Who was told to pass a point asks again: what it is tied to may come later now.

        stuck: points of other blocks that do not come before what is held goes on. standing: those of them that come
        no nearer either.
        """
        facts = self.facts
        under_way = sorted(facts.under_way)
        before = {each for each in under_way if facts.is_held(each)}
        goes_on = any(facts.is_held(id) and behaviors is not None and id not in behaviors for id in self.plan.chains)
        if goes_on or facts.stuck.difference(stuck):
            self.foresight.is_surprised = True  # How much later all is, nobody knew before.
        for behavior in under_way:
            if performer(self.plan.chains[behavior].behavior) == "body" and (point := self.grants.revoke(behavior)):
                self._asking[behavior] = point
        facts.hold(behaviors, now, stuck, standing)
        self.foresight.prolong()
        self.foresight.none_before(now)
        changed = [each for each in under_way if facts.is_held(each) != (each in before)]
        going_on = [each for each in changed if each in before]
        for behavior in going_on:
            self.foresight.go_on(behavior, now)
        self._conclude(now)
        for behavior in going_on:
            self.foresight.paces[behavior] = self.foresight.pace(behavior, now, self.grants.may_pass)
        effects: list[Effect] = []
        for behavior in changed:
            effects.append(self._command(behavior, max(0, self.grants.through(behavior)), now))
            if behavior in self._asking:
                self._kept_back.add(behavior)
            self._unwatched.add(behavior)
        for transition in range(len(self.plan.members)):
            self.grants.on_opened(transition)
        return effects

    @property
    def is_ending(self) -> bool:
        """True if the behaviors of the block are being ended, whatever was planned."""
        return self._is_ending()

    def broken(self, point: Point) -> list[Broken]:
        """Constraints that are broken, now that a point was reached: one of this block, or of another.

        To be asked once for each point. What holds account for does not count.
        """
        at = self.facts.reached.get(point)
        if at is None:
            return []
        found = (self._unheld(each) for each in self.promises.come(point, at))
        return [each for each in found if each.seconds > 0.0]

    def stops(self, now: Seconds) -> Stops:
        """Tell what holds have stopped of the block, for another plan of it."""
        if not self.facts.has_held:
            return NO_STOPS
        return stopped(self.plan, self.facts, self.held_up, self.foresight.times(now), now)

    def _unheld(self, broken: Broken) -> Broken:
        """The same without the seconds for which holds account."""
        times = self.facts.reached | {ORIGIN: self.began}
        early, late = times[broken.early], times[broken.late]
        allowed, last = late - early - broken.seconds, max(early, late)
        held = self.held_up.between(broken.late, broken.early, allowed, broken.seconds, last)
        return replace(broken, seconds=broken.seconds - held)

    # -- decisions -----------------------------------------------------------------------------------------------

    def urgent(self, now: Seconds) -> list[Effect]:
        """Decide what measured events alone decide; `advance` decides the rest, and is to be called soon."""
        return self._effects(self._decide(now, only_measured=True), now)

    def advance(self, now: Seconds) -> list[Effect]:
        """Decide what to do now. Extensions come first: a behavior hands over before another takes its place."""
        self.net.tick(now)
        self._conclude(now)
        self.grants.wake(now)
        effects = self._effects(self._decide(now, only_measured=False), now)
        if self.held_up.has_effect and self.held_up.is_settled(now, self._under_way()):
            self.held_up.settle(self.foresight.outlook(now))
        for behavior in sorted(self._unwatched):
            self._watch(behavior, now)
        self._unwatched.clear()
        return [*effects, *self.lateness_watch.overdue(now)]

    def _conclude(self, now: Seconds) -> None:
        """Decide again about instants that are expected at another time than before."""
        for transition in self.foresight.update(now, self.grants.may_pass):
            self.grants.moved(transition)

    def _decide(self, now: Seconds, *, only_measured: bool) -> list[str]:
        """Decide the instants that something has changed for until nothing follows; returns behaviors that begin."""
        beginning: list[str] = []
        while taken := self.grants.take(only_measured=only_measured):
            new: list[str] = []
            for transition in taken:
                new += self.grants.decide(transition, now)
            for behavior in new:
                self.facts.begin(behavior, now)
                if not only_measured:
                    self._conclude(now)
            beginning += new
        return beginning

    def _effects(self, beginning: list[str], now: Seconds) -> list[Effect]:
        effects = self._keep_back(now)
        touched, self.grants.touched = self.grants.touched, set()
        for behavior in sorted(touched.difference(beginning)):
            if behavior in self.facts.begun and not self.facts.has_ended(behavior):
                effects += self._extension(behavior, now)
        for behavior in self.plan.begun_in_order(beginning) if len(beginning) > 1 else beginning:
            through = self.grants.extend(behavior, now)
            pace = self.foresight.paces[behavior] = self.foresight.pace(behavior, now, self.grants.may_pass)
            effects.append(Begin(behavior, self.plan.chains[behavior].points[through].sync, pace))
            self._unwatched.add(behavior)
        return effects

    def _keep_back(self, now: Seconds) -> list[Effect]:
        """Keep back those that ask again before they pass a point (see `hold`), until they are told to pass."""
        commands: list[Effect] = []
        for behavior, point in sorted(self._asking.items()):
            is_over = self.facts.has_ended(behavior) or point not in self.plan.at
            if is_over or self.grants.may_pass(point):
                del self._asking[behavior]
                self.grants.touched.add(behavior)
            elif behavior not in self._kept_back and not self.facts.is_held(behavior):
                self._kept_back.add(behavior)
                commands.append(self._command(behavior, max(0, self.grants.through(behavior)), now))
        return commands

    def _extension(self, behavior: str, now: Seconds) -> Iterable[Extend]:
        """The command to go on, if the behavior may go further than before or is to go at another pace."""
        known, before = self.grants.through(behavior), self.foresight.paces.get(behavior, ())
        through = self.grants.extend(behavior, now)
        after = self.foresight.pace(behavior, now, self.grants.may_pass)
        is_free = behavior in self._kept_back and behavior not in self._asking
        if is_free:
            self._kept_back.remove(behavior)
        if is_free or through > known or differ_noticeably(before, after):
            self.foresight.paces[behavior] = after
            self._unwatched.add(behavior)
            yield self._command(behavior, through, now)

    def _command(self, behavior: str, through: int, now: Seconds) -> Extend:
        sync = self.plan.chains[behavior].points[through].sync
        is_held = self.facts.is_held(behavior) or behavior in self._asking
        return Extend(behavior, sync, self.foresight.paces.get(behavior, ()), is_held)

    @property
    def deadline(self) -> Seconds | None:
        """Time at which to call `advance` even if nothing happens until then; None: there is no need."""
        alarms = (
            self.grants.deadline, self.net.next_ripe, self.lateness_watch.deadline, self.foresight.next_check
        )  # fmt: skip
        return min((at for at in alarms if at is not None), default=None)

    def _watch(self, behavior: str, now: Seconds) -> None:
        """Expect the next report of a behavior that is under way."""
        chain, facts = self.plan.chains.get(behavior), self.facts
        if chain is None or behavior not in facts.begun or performer(chain.behavior) != "body":
            return
        points, number = chain.points, facts.next_number(behavior)
        is_there = number < len(points) and facts.holds(points[number])
        waits = is_there and not self.grants.may_pass(self.net.part_of[points[number]].point)
        if number >= len(points) or waits or facts.is_held(behavior):
            self.lateness_watch.forget(behavior)
            return
        since = facts.reached[points[number - 1]] if number else self._awaited_since.setdefault(behavior, now)
        natural = chain.segments[number - 1].natural if number else 0.0
        asked = self.foresight.asked(points[number], since + natural)
        granted = self.grants.granted_at[behavior] if is_there else 0.0
        expected = max(since + natural, asked, granted) + facts.held_between(since, now, behavior)
        self.lateness_watch.expect(behavior, points[number].sync, expected, natural, now)

    # -- other blocks --------------------------------------------------------------------------------------------

    def stuck(self, elsewhere: Set[Point], standing: Set[Point]) -> Set[Point]:
        """Points that other blocks are tied to and that do not come before what is held goes on.

        elsewhere: points of other blocks of which the same is true. standing: see `hold`.
        """
        return self.grants.stuck(elsewhere, standing).among(self.foresight.followed)

    def running(self, elsewhere: Set[Point], running: Set[Point]) -> Set[Point]:
        """Points that other blocks are tied to and that come nearer. running: those of others that do."""
        return self.grants.stuck(elsewhere, frozenset()).running(self.foresight.followed, running)

    def follow(self, points: Iterable[Point]) -> None:
        """Expect these points from now on: other blocks are tied to them (see `Foresight.ahead`)."""
        if not self.foresight.follow(points):
            self.replan(self.plan)
