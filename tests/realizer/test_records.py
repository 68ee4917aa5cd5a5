"""Small records of a running block, each against a model that keeps everything and computes the answer anew."""

import asyncio
from statistics import median_low

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.behaviors import Gaze, Mark, Pointing, Speech, Wait
from engage_hri.schemas.blocks import Block, BlockOutcome, PerformBlock, SpokenText, Unread
from engage_hri.schemas.body import BehaviorOutcome, Estimate
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Stamp
from engage_hri.services.realizer.foresee.pace import Experience
from engage_hri.services.realizer.net.running import Clocks, RunningNet
from engage_hri.services.realizer.perform.behavior_run import SyncPointFutures, has_lost_nothing, loss
from engage_hri.services.realizer.plan.remaining import kind_of
from engage_hri.services.realizer.points import FINISH, Point
from engage_hri.services.realizer.report import Spoken, completed
from engage_hri.services.realizer.together.live import Ending, Live
from engage_hri.services.realizer.together.live_blocks import Past
from tests.random_cases import share_of
from tests.realizer.planning import plan
from tests.realizer.stage import block

# -- clocks ------------------------------------------------------------------------------------------------------


@settings(max_examples=share_of(150), deadline=None)
@given(st.randoms(use_true_random=False))
def test_a_clock_that_was_stopped_rings_later_by_as_long_as_it_was_stopped(chance: object) -> None:
    """left: seconds to go of each clock. What is due in the same instant rings in the order of the places."""
    pick = chance.choice  # type: ignore[attr-defined]
    clocks, left, held, now, free = Clocks(), dict[int, float](), set[int](), 0.0, list(range(12))
    for _ in range(30):
        match pick(("set", "wait", "wait", "hold")):
            case "set" if free:
                place, seconds = free.pop(pick(range(len(free)))), pick((0.5, 1.0, 2.0))
                clocks.set(place, now + seconds, now, is_stopped=place in held)
                left[place] = seconds
            case "hold":
                held = {each for each in range(12) if pick((True, False, False))}
                was = {each for each in left if each in clocks.stopped}
                going_on = clocks.stop(held.__contains__, now)
                assert going_on == {each: now + left[each] for each in was - held}
            case "wait":
                later = now + pick((0.25, 0.5, 1.0))
                due = sorted((now + seconds, place) for place, seconds in left.items() if place not in held)
                for at, place in due:
                    if at <= later:
                        assert clocks.ripe(later) == (place, at)
                        del left[place]
                assert clocks.ripe(later) is None
                left = {each: seconds - (0.0 if each in held else later - now) for each, seconds in left.items()}
                now = later
        assert clocks.stopped == {each: seconds for each, seconds in left.items() if each in held}
        assert clocks.next == min((now + left[each] for each in left if each not in held), default=None)


# -- speed -------------------------------------------------------------------------------------------------------


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.sampled_from("abcx"), st.integers(1, 20), st.integers(1, 60)), max_size=40))
def test_speed_is_the_median_of_what_the_parts_did_lately(phases: list[tuple[str, int, int]]) -> None:
    """Each phase: who, estimated and measured, in hundredths of a second."""
    parts = {"a": ("arm",), "b": ("arm", "torso"), "c": ("torso",)}
    known = {id: Estimate(behavior=id, feasible=True, parts=each) for id, each in parts.items()}
    experience = Experience(known)
    ratios: dict[str, list[float]] = {"arm": [], "torso": []}
    factor = {"arm": 1.0, "torso": 1.0}
    for who, expected, took in phases:
        changed = set[str]()
        before = dict(factor)
        if expected >= 5 and 1 / 2 <= (took / 100) / (expected / 100) <= 4:
            for part in parts.get(who, ()):
                ratios[part].append((took / 100) / (expected / 100))
                middle = median_low(ratios[part][-9:])
                middle = middle if abs(middle - 1.0) > 0.02 else 1.0
                if abs(middle - factor[part]) > 0.02 * factor[part]:
                    factor[part] = middle
        changed = {id for id, each in parts.items() if any(before[part] != factor[part] for part in each)}
        assert set(experience.learn(who, expected / 100, took / 100)) == changed
        for id, each in parts.items():
            assert experience.factor(id) == max(factor[part] for part in each)
        assert experience.factor("x") == 1.0


# -- words -------------------------------------------------------------------------------------------------------

STORY = Speech(id="s", text="one two three", marks=(Mark("m", 4), Mark("n", 8)))
SHORT = Speech(id="t", text="four")


@settings(max_examples=150, deadline=None)
@given(st.lists(st.sampled_from(("s:m", "s:n", "s:start", "t:start", "g:m", "s=5", "s=0", "t=2", "x=3")), max_size=6))
def test_what_was_said_is_all_before_the_furthest_position(news: list[str]) -> None:
    spoken = Spoken((STORY, Gaze(id="g", target="a"), SHORT))
    at = {"s:m": 4, "s:n": 8, "s:start": 0, "t:start": 0, "s=5": 5, "s=0": 0, "t=2": 2}
    furthest: dict[str, int] = {}
    for each in news:
        id, position = each[0], int(each[2:]) if "=" in each else None
        if position is None:
            spoken.reach(Point(*each.split(":", 1)))
        else:
            spoken.hear(id, position)
        if each in at:
            furthest[id] = max(at[each], furthest.get(id, 0))
    texts = {
        each.id: SpokenText(behavior=each.id, text=each.text[: furthest[each.id]], complete=False)
        for each in (STORY, SHORT)
        if each.id in furthest
    }
    assert spoken.texts == tuple(texts.values())
    assert [spoken.of(id) for id in "stgx"] == [texts.get("s"), texts.get("t"), None, None]


def ended(id: str, status: str, **rest: object) -> BehaviorOutcome:
    return BehaviorOutcome(id="r", block="b", behavior=id, status=status, at=Stamp("x", 0.0), **rest)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("status", "told", "heard", "text"),
    [
        ("done", "", 3, "one two three"),
        ("done", "one", 3, "one two three"),
        ("aborted", "one two", 3, "one two"),
        ("aborted", "", 3, "one"),
        ("failed", "", 0, ""),
        ("taken_over", "one t", None, "one t"),
        ("failed", "", None, ""),
    ],
)
def test_the_voice_itself_tells_at_the_end_what_it_has_said(
    status: str, told: str, heard: int | None, text: str
) -> None:
    spoken = Spoken((STORY,))
    if heard is not None:
        spoken.hear("s", heard)
    spoken.end(ended("s", status, spoken=told))
    spoken.end(ended("nobody", "done"))

    assert spoken.texts == (SpokenText(behavior="s", text=text, complete=status == "done"),)
    assert spoken.of("s") == spoken.texts[0]


# -- how it ended ------------------------------------------------------------------------------------------------

WAITS = (Wait(id="v", duration=1.0), Wait(id="w", duration=1.0))
UNKNOWN = Unread(message="unknown element <foo>", kind="BEHAVIOR_TYPE_NOT_SUPPORTED")
CUSTOM = Unread(message="of another namespace", kind="CUSTOM_BEHAVIOR_NOT_SUPPORTED")
REMARK = Unread(message="no attribute", kind="PARSING_FAILURE")


@pytest.mark.parametrize(
    ("behaviors", "unread", "lost", "interrupted", "reason"),
    [
        (WAITS, (), {}, (), None),
        (WAITS, (), {"v": "v: late"}, (), None),
        (WAITS, (), {"w": "late", "v": "v: slow"}, (), "w: late; v: slow"),
        (WAITS, (), {"w": "", "v": "w: slow"}, (), "w; v: w: slow"),
        (WAITS, (), {"w": "late", "v": "asked"}, ("v",), None),
        (WAITS, (UNKNOWN,), {"v": "late"}, (), None),
        (WAITS, (UNKNOWN, REMARK), {"v": "late", "w": ""}, (), "v: late; w; unknown element <foo>"),
        ((), (), {}, (), None),
        ((), (REMARK,), {}, (), None),
        ((), (REMARK, CUSTOM), {}, (), "of another namespace"),
    ],
)
def test_a_block_has_failed_if_it_had_behaviors_and_each_was_dropped(
    behaviors: tuple[Wait, ...], unread: tuple[Unread, ...], lost: dict[str, str], interrupted: tuple[str, ...],
    reason: str | None,
) -> None:  # fmt: skip
    example = Block(id="b", behaviors=behaviors, unread=unread)
    said = (SpokenText(behavior="s", text="so", complete=True),)
    dropped = [id for id in lost if id not in interrupted]
    for status in ("done", "interrupted", "failed"):
        fault = None if status != "failed" else Fault(reason="broken")
        raw = BlockOutcome(id="r", block="b", status=status, fault=fault)
        found = completed(raw, example, said, lost, interrupted, Fault(reason=""))
        assert (found.spoken, found.dropped) == (said, tuple(dropped))
        assert found.reasons == tuple(lost[id] for id in dropped)
        assert found.interrupted == tuple(id for id in lost if id in interrupted)
        if status == "done" and reason is not None:
            text = f"no behavior of it came to its end ({reason})"
            assert (found.status, found.fault) == ("failed", Fault(reason=text, where="b"))
        else:
            assert (found.status, found.fault) == (status, fault)


def test_who_lost_its_part_has_lost_nothing_if_it_passed_all_that_it_keeps() -> None:
    made = plan(block((Pointing(id="p", target="can"), Wait(id="w", duration=1.0))))
    points = made.chains["p"].points
    kept = points.index(made.kept["p"])
    assert 0 < kept < len(points) - 1
    for missing in points:
        reached = set(points) - {missing}
        assert has_lost_nothing(made, ended("p", "taken_over"), reached) == (points.index(missing) > kept)
    assert has_lost_nothing(made, ended("p", "taken_over"), set(points[: kept + 1]))
    assert has_lost_nothing(made, ended("p", "done"), ())
    for status in ("failed", "aborted"):
        assert not has_lost_nothing(made, ended("p", status), points)
    assert not has_lost_nothing(made, ended("stranger", "taken_over"), points)
    assert has_lost_nothing(made, ended("stranger", "done"), ())


@pytest.mark.parametrize(
    ("outcome", "reason"),
    [
        (ended("p", "taken_over", passed="ready"), "another behavior took its part after ready"),
        (ended("p", "taken_over"), "another behavior took its part after nothing of it"),
        (ended("p", "taken_over", fault=Fault(reason="why")), "another behavior took its part after nothing of it"),
        (ended("p", "failed", fault=Fault(reason="why")), "why"),
        (ended("p", "aborted"), "the body aborted it"),
    ],
)
def test_why_a_behavior_has_not_come_to_its_end(outcome: BehaviorOutcome, reason: str) -> None:
    assert loss(outcome).reason == reason


def test_a_body_that_gives_no_kind_of_warning_cannot_create_the_behavior() -> None:
    assert kind_of("NO_SUCH_TARGET") == "NO_SUCH_TARGET"
    assert kind_of("no such target") == kind_of("") == "CANNOT_CREATE_BEHAVIOR"


# -- live blocks -------------------------------------------------------------------------------------------------


def live(id: str, *earlier: Live, follows: tuple[str, ...] = ()) -> Live:
    request = PerformBlock(id=f"r-{id}", requester="test", block=Block(id=id, behaviors=()), follows=follows)
    return Live(request, earlier, Past(lambda: 0.0))


async def test_blocks_end_with_what_they_follow_unless_that_is_done() -> None:
    """A chain of three, one beside it, and one that comes when all is over."""
    first = live("first")
    second = live("second", first, follows=("first",))
    third = live("third", first, second, follows=("second", "nobody"))
    beside = live("beside", first, second, third)
    assert (first.leaders, second.leaders, third.leaders, beside.leaders) == ((), (first,), (second,), ())
    assert third.earlier == [first, second]

    first.fail(Fault(reason="no arm"))
    first.stop(Ending("done"))
    late = live("late", first, second, follows=("second",))
    assert first.outcome == BlockOutcome(id="r-first", block="first", status="failed", fault=Fault(reason="no arm"))
    said = Fault(reason="first, which it follows, failed: no arm", where="second")
    assert second.outcome == BlockOutcome(id="r-second", block="second", status="interrupted", fault=said)
    for each in (third, late):
        words = "second, which it follows, was interrupted: first, which it follows, failed: no arm"
        assert each.outcome.fault == Fault(reason=words, where=each.request.block.id)
        assert each.ended_by is second
    assert (first.ended_by, second.ended_by) == (None, first)
    assert not beside.ending.done()
    assert str(beside) == "block beside"


async def test_who_follows_what_is_done_goes_on_and_who_was_replaced_says_by_whom() -> None:
    done, replaced = live("done"), live("replaced")
    after_done = live("after", done, replaced, follows=("done",))
    after_replaced = live("behind", done, replaced, follows=("done", "replaced"))

    done.stop(Ending("done"))
    assert not after_done.ending.done()
    assert live("later", done, follows=("done",)).ending.done() is False
    replaced.stop(Ending("interrupted", replaced_by="new"))
    assert after_replaced.outcome.replaced_by == "new"
    assert after_replaced.outcome.fault == Fault(reason="replaced, which it follows, was interrupted", where="behind")
    assert not after_done.ending.done()


async def test_who_has_ended_by_itself_does_not_end_again_with_what_it_followed() -> None:
    leader = live("leader")
    follower = live("follower", leader, follows=("leader",))
    follower.stop(Ending("done"))
    leader.fail(Fault(reason="no arm"))

    assert follower.outcome.status == "done"
    assert follower.ended_by is None


async def test_of_two_blocks_of_one_id_the_first_is_followed() -> None:
    one, other = live("same"), live("same")

    assert live("next", one, other, follows=("same",)).leaders == (one,)


async def test_a_block_is_settled_until_its_turn_comes() -> None:
    one = live("one")
    one.unsettle()
    before = one.settled
    one.settle()
    one.settle()
    assert before.done()
    assert one.settled is before
    one.unsettle()
    assert not one.settled.done()
    assert before.done()


# -- futures -----------------------------------------------------------------------------------------------------


async def test_futures_outlive_the_net_and_are_resolved_once() -> None:
    made = plan(block(WAITS))
    futures = SyncPointFutures()
    net = RunningNet(made.net, made.members, made.at, (futures,))
    assert futures.adopt(net) is futures
    start, end, over = Point("v", "start"), Point("v", "end"), FINISH

    net.start(1.0)
    waiting = futures.fired(end)
    assert futures.fired(end) is waiting
    assert not waiting.done()
    for point, at in ((start, 1.0), (end, 2.0)):
        net.reach(point, at)
    assert waiting.result() == 2.0
    other = RunningNet(made.net, made.members, made.at)
    finish, early = futures.fired(over), futures.fired(Point("w", "start"))
    assert not early.done()
    other.start(5.0)
    for point, at in ((start, 5.0), (end, 6.0), (Point("w", "start"), 6.0)):
        other.reach(point, at)
    other.observe((futures,))
    futures.adopt(other)
    assert early.result() == 6.0
    assert waiting.result() == 2.0
    assert not finish.done()
    other.reach(Point("w", "end"), 7.0)
    assert finish.result() == 7.0
    assert await futures.fired(Point("w", "end")) == 7.0


async def test_a_grant_is_given_once_and_what_is_awaited_at_the_end_is_cancelled() -> None:
    made = plan(block(WAITS))
    futures = SyncPointFutures()
    futures.adopt(RunningNet(made.net, made.members, made.at))
    start, end = Point("v", "start"), Point("v", "end")

    given_up = futures.granted(end)
    given_up.cancel()
    futures.grant(end)
    futures.grant(start)
    futures.grant(start)
    assert futures.granted(start).done()
    left, fired = futures.granted(Point("w", "start")), futures.fired(end)
    futures.cancel()
    assert left.cancelled()
    assert fired.cancelled()
    with pytest.raises(asyncio.CancelledError):
        await left


# -- limits ------------------------------------------------------------------------------------------------------
