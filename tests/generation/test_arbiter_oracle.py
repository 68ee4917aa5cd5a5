"""Random streams of what happens: the arbiter, which keeps deadlines, against the table asked at every tick."""

from contextlib import ExitStack
from unittest import mock

from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.recognition import Floor, FloorSpeech
from engage_hri.services.generation.head import arbiter, listening_policy, maintenance_policy, response_policy
from tests.generation.head_table import TICK, TIMES, HeadTable
from tests.generation.heads import AT, Stage, act, event, inhibition, statistics, world
from tests.random_cases import share_of


class Both:
    """One story told to the arbiter and to the table."""

    def __init__(self) -> None:
        self.stage = Stage(policies_off=("aversion",))
        self.table = HeadTable()
        self.events: list[str] = []
        self.see()

    def later(self, ticks: int) -> None:
        for _ in range(ticks):
            self.table.now += TICK
            self.table.ask()
        self.stage.until(self.table.now)

    def hand(self, fast: bool) -> None:
        self.table.move_hand(fast)
        self.see()

    def person(self, seen: bool) -> None:
        self.table.see(seen)
        self.see()

    def see(self) -> None:
        self.table.ask()
        self.stage.feed(world(0.3 if self.table.fast else 0.05, self.table.seen))

    def act(self, acting: bool) -> None:
        self.table.act(acting)
        self.table.ask()
        self.stage.feed(act(ends=not acting))

    def speak(self, speaks: bool) -> None:
        self.table.speak(speaks)
        self.table.ask()
        speeches = (FloorSpeech(actor="human", since=AT),) if speaks else ()
        self.stage.feed(Floor(at=AT, speeches=speeches))

    def direct(self, target: str) -> None:
        self.table.direct(len(self.events), target)
        self.table.ask()
        kind = "mutual_facial_gaze" if target == "human" else "directed_gaze"
        self.events.append(kind)
        objects = () if target == "human" else (target,)
        self.stage.feed(event(f"e{len(self.events) - 1}", "started", kind=kind, objects=objects))

    def decide(self, age: int, state: str) -> None:
        """The event that began as the last but `age`."""
        if age < len(self.events):
            number = len(self.events) - 1 - age
            self.table.decide(number, state == "succeeded")
            self.table.ask()
            self.stage.feed(event(f"e{number}", state, kind=self.events[number]))

    def inhibit(self, mode: str, target: str) -> None:
        self.table.inhibit(mode, target)
        self.table.ask()
        self.stage.do(lambda arbiter: arbiter.inhibit(inhibition(mode, target) if mode else None))

    def gaze(self, target: str | None) -> None:
        self.table.fragment = target
        self.table.ask()
        self.stage.do(
            lambda arbiter: arbiter.fragment_lets_go() if target is None else arbiter.fragment_gazes(target)
        )

    def rest(self) -> None:
        if self.table.fragment is not None:
            self.table.rest()
            self.table.ask()
            self.stage.do(lambda arbiter: arbiter.fragment_rests())

    def pace(self, seconds: float) -> None:
        self.table.pace = seconds
        self.table.ask()
        self.stage.feed(statistics(seconds))


HAPPENINGS = st.sampled_from(
    [
        *[("hand", fast) for fast in (True, False)],
        *[("person", seen) for seen in (True, False)],
        *[("act", acting) for acting in (True, False)],
        *[("speak", speaks) for speaks in (True, False)],
        *[("direct", target) for target in ("piece", "other", "human")],
        *[("decide", age, state) for age in (0, 1) for state in ("succeeded", "completed", "failed")],
        *[("inhibit", *lease) for lease in (("release", ""), ("hold", ""), ("target", "piece"), ("", ""))],
        *[("gaze", target) for target in ("other", "human", None)],
        ("rest",),
        *[("pace", seconds) for seconds in (3.0, 4.5)],
    ]
)
STORIES = st.lists(st.tuples(HAPPENINGS, st.sampled_from([0, 1, 2, 3, 5, 8, 16, 40])), max_size=30)


@settings(max_examples=share_of(300), deadline=None)
@given(STORIES)
def test_whatever_happens_the_owner_and_the_shifts_are_those_of_the_table(
    story: list[tuple[tuple[object, ...], int]],
) -> None:
    with ExitStack() as changed:
        for module in (arbiter, listening_policy, maintenance_policy, response_policy):
            times = {name: seconds for name, seconds in TIMES.items() if hasattr(module, name)}
            changed.enter_context(mock.patch.multiple(module, **times))
        both = Both()
        for (what, *how), pause in story:
            getattr(both, what)(*how)
            both.later(pause)
        both.later(80)

    assert both.stage.owners == both.table.changes
    assert [(at, target) for at, _, target in both.stage.shifts] == both.table.shifts
