"""Bodies that lie, stammer, fall silent, die and come back: what is measured stays in order, and the block ends."""

import asyncio

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.body import Estimate, Estimates, HomeReached, Phase, SyncPointReached, WordSpoken
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Stamp
from engage_hri.services.realizer.perform.behavior_run import ABORT
from engage_hri.services.requests.ends import RequestRefused
from tests.realizer.puppet import BML_1_0, Puppet, bml, puppet

SEVEN = ("start", "ready", "stroke_start", "stroke", "stroke_end", "relax", "end")
SPEECH = '<speech id="s"><text>one <sync id="m"/>two three</text></speech>'
POINT = '<gesture id="p" type="POINT" target="can-1"/>'
FIGURE_4_4 = """
    <gaze id="gaze-1" target="can-1"/>
    <gesture id="point-1" type="POINT" target="can-1"/>
    <speech id="speech-1"><text>This can?</text></speech>
    <constraint id="constraint-1">
      <synchronize ref="gaze-1:stroke"><sync ref="point-1:start"/></synchronize>
      <synchronize ref="point-1:stroke_start"><sync ref="speech-1:start"/></synchronize>
    </constraint>"""


def in_order(body: Puppet, behavior: str) -> list[str]:
    return [point.partition(":")[2] for point in body.points() if point.startswith(f"{behavior}:")]


async def test_points_in_disorder_twice_and_after_the_end_are_told_once_and_in_order() -> None:
    async with puppet() as body:
        pending = body.ask(bml(POINT))
        await body.told("p")
        body.reach("p", "ready", "start", "start")
        await asyncio.sleep(0.5)
        body.accept("p")
        body.reach("p", "stroke", "stroke_start", "stroke")
        await asyncio.sleep(0.5)
        body.end("p")
        body.reach("p", "relax", "end", "start")
        await pending.outcome
        body.reach("p", "end")
        body.end("p")
        await asyncio.sleep(5.0)

    assert in_order(body, "p") == list(SEVEN)
    assert [body.time(f"p:{sync}") for sync in SEVEN] == [0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 1.0]
    assert body.course() == [("b", "start", ""), ("b", "end", "done")]
    assert body.feedback[-1].progress == "end"  # nothing after the end


async def test_when_it_came_to_where_it_waited_is_told_though_only_the_report_of_going_on_has_it() -> None:
    """The report that it waits was lost, and so was the one of the point before: of that one nobody knows more."""
    async with puppet() as body:
        pending = body.ask(bml(POINT))
        await body.told("p")
        body.accept("p")
        body.reach("p", "start")
        await asyncio.sleep(2.0)
        body.leave("p", "stroke_start", 0.75)
        body.end("p")
        await pending.outcome

    told = {sync: body.progress(f"p:{sync}") for sync in ("ready", "stroke_start")}
    assert {sync: (each.time, each.arrived) for sync, each in told.items()} == {
        "ready": (2.0, None),
        "stroke_start": (2.0, 0.75),
    }


async def test_what_is_reached_while_the_body_is_being_stopped_is_told() -> None:
    async with puppet() as body:
        body.aborts = False
        pending = body.ask(bml(POINT))
        await body.told("p")
        body.accept("p")
        body.reach("p", "start", "ready")
        body.requests.cancel("r-b")
        await body.until(lambda: body.aborted)
        await asyncio.sleep(1.0)
        told = in_order(body, "p")
        body.reach("p", "stroke_start")
        body.end("p", "aborted")
        await pending.outcome

    assert told == ["start", "ready"]  # not only once the body has stopped
    assert in_order(body, "p") == ["start", "ready", "stroke_start"]
    assert body.feedback[-1].progress == "end"


@pytest.mark.parametrize("dialect", ["org.mindmakers.bml", BML_1_0])
async def test_points_of_what_was_not_begun_or_does_not_exist_are_nobodys(dialect: str) -> None:
    async with puppet() as body:
        second = '<speech id="t" start="s:end"><text>so</text></speech>'
        pending = body.ask(bml('<speech id="s"><text>one</text></speech>' + second, dialect=dialect))
        await body.told("s")
        body.reach("s", "start", "stroke", "nonsense")
        body.reach("t", "start", "end")
        body.reach("nobody", "start")
        stamp = body.stamp()
        stray = SyncPointReached(id="r-b/s", block="b", behavior="t", sync="end", at=stamp, arrived=stamp)
        body.say(stray)
        await asyncio.sleep(1.0)
        body.end("s")
        await body.do("t", "start", "end", every=1.0)
        await pending.outcome

    assert [(point, body.time(point)) for point in body.points()] == [
        ("s:start", 0.0), ("s:end", 1.0), ("t:start", 1.0), ("t:end", 2.0)
    ]  # fmt: skip


async def test_times_that_cannot_be_are_bounded_by_what_is_known() -> None:
    """A clock that is off, or a lie: no point is before the one before it, nor after its report."""
    async with puppet() as body:
        pending = body.ask(bml(POINT))
        await body.told("p")
        await asyncio.sleep(0.25)
        body.reach("p", "start", at=-5.0)
        await asyncio.sleep(0.25)
        body.reach("p", "ready", at=0.4)
        body.reach("p", "stroke_start", at=0.1)
        body.reach("p", "stroke", at=99.0)
        await asyncio.sleep(1.0)
        body.end("p")
        await pending.outcome

    times = [body.time(f"p:{sync}") for sync in SEVEN]
    assert times == [0.0, 0.4, 0.4, 0.5, 1.5, 1.5, 1.5]


async def test_a_body_that_ends_all_at_once_lets_everything_follow() -> None:
    async with puppet() as body:
        pending = body.ask(bml(FIGURE_4_4))
        for behavior in ("gaze-1", "point-1", "speech-1"):
            await body.told(behavior)
            body.end(behavior)
        await pending.outcome

    assert body.outcomes["b"].status == "done"
    assert len(body.points()) == 7 + 7 + 2
    assert body.warnings() == []


async def test_a_body_that_says_nothing_at_all_is_late_once_and_given_up_once_for_each_behavior() -> None:
    async with puppet() as body:
        outcome = await body.perform(bml(FIGURE_4_4))

    behaviors = ("b:gaze-1", "b:point-1", "b:speech-1")
    assert body.warnings() == [(who, kind) for who in behaviors for kind in ("LATE", "EXECUTION_FAILURE")]
    assert outcome.dropped == ("gaze-1", "point-1", "speech-1")
    assert body.aborted == ["gaze-1", "point-1", "speech-1"]
    assert body.course()[-1] == ("b", "end", "failed")


async def test_what_waits_for_a_late_one_is_predicted_anew_as_it_is_found_late() -> None:
    async with puppet() as body:
        await body.perform(bml(FIGURE_4_4))

    first, late, dropped, *_ = body.predictions()
    assert (first["point-1:start"], first["speech-1:start"]) == (0.5, 1.25)
    assert (late["point-1:start"], late["speech-1:start"]) == (1.0, 1.75)
    # Nothing has moved by then: it all begins now, not in the past.
    assert (dropped["point-1:start"], dropped["point-1:ready"], dropped["speech-1:start"]) == (3.0, 3.5, 3.75)


async def test_what_comes_late_costs_one_warning_however_many_points_share_the_instant() -> None:
    block = bml(f'<gaze id="g" target="x"/>{POINT}<constraint><synchronize ref="g:start">'
                '<sync ref="p:start"/></synchronize></constraint>')  # fmt: skip
    async with puppet() as body:
        pending = body.ask(block)
        await body.told("g")
        body.reach("p", "start")
        await asyncio.sleep(0.25)
        body.reach("g", "start", "ready", "stroke_start")
        body.end("p")
        body.end("g")
        await pending.outcome

    assert body.warnings() == [("b:g", "LATE")]
    assert [body.progress(f"g:{sync}").skew for sync in ("start", "ready", "stroke_start")] == [0.25] * 3


@pytest.mark.parametrize("sync", SEVEN)
async def test_a_failure_at_any_point_is_one_warning_and_one_end(sync: str) -> None:
    async with puppet() as body:
        pending = body.ask(bml(POINT + SPEECH))
        await body.told("p")
        body.accept("p")
        body.reach("p", *SEVEN[: SEVEN.index(sync)])
        body.end("p", "failed")
        body.reach("p", *SEVEN)
        await body.do("s", "start", "m", "end", every=1.0)
        await pending.outcome

    assert body.warnings() == [("b:p", "EXECUTION_FAILURE")]
    assert in_order(body, "p") == list(SEVEN[: SEVEN.index(sync)])
    assert body.homes == [("right_arm",)]
    assert body.course()[1:] == [("b", "end", "done")]


async def test_a_body_that_dies_costs_one_warning_and_what_it_was_heard_to_say_is_told() -> None:
    async with puppet() as body:
        pending = body.ask(bml(SPEECH + POINT))
        await body.told("s")
        body.accept("s")
        body.reach("s", "start", "m")
        body.say(WordSpoken(block="b", behavior="s", word="two", position=7, at=body.stamp()))
        body.reach("p", "start")
        await asyncio.sleep(0.25)
        body.die()
        await pending.outcome
        body.revive()
        await asyncio.sleep(5.0)

    assert body.warnings() == [("b", "EXECUTION_FAILURE")]
    outcome = body.outcomes["b"]
    assert (outcome.status, outcome.fault and (outcome.fault.cause, outcome.fault.whose)) == (
        "failed",
        ("gone", "control"),
    )
    assert [(each.text, each.complete) for each in outcome.spoken] == [("one two", False)]
    assert body.homes == [("right_arm", "voice")]  # as soon as it is back


def a_home_reached(question: Message) -> Message:
    return HomeReached(id="?", at=Stamp("loop", 0.0))


async def test_nonsense_for_an_estimate_refuses_the_block_and_nothing_more() -> None:
    async with puppet() as body:
        body.bus.answer(keys.ESTIMATE, a_home_reached)
        with pytest.raises(RequestRefused, match="answered with a HomeReached"):
            await body.ask(bml(SPEECH)).outcome
        body.bus.answer(keys.ESTIMATE, lambda question: Estimates(items=()))
        pending = body.ask(bml(SPEECH, id="b2"))
        await body.do("s", "start", "m", "end", every=1.0, block="b2")
        await pending.outcome

    assert body.warnings() == [("b", "CANNOT_CREATE_BEHAVIOR")]
    assert body.outcomes["b2"].status == "done"


async def test_a_body_that_ends_a_behavior_with_nonsense_has_failed_at_it() -> None:
    async with puppet() as body:
        pending = body.ask(bml(SPEECH))
        await body.told("s")
        body.answer_to("s", "b", HomeReached(id="", at=body.stamp()))
        await pending.outcome

    assert body.warnings() == [("b:s", "EXECUTION_FAILURE")]
    assert body.outcomes["b"].dropped == ("s",)


@pytest.mark.parametrize("natural", [0.0, 0.25, 100.0])
async def test_estimates_that_are_far_off_spoil_only_the_prediction(natural: float) -> None:
    phases = (Phase(since="start", to="end", shortest=natural / 2, natural=natural),)
    estimate = Estimate(behavior="s", feasible=True, parts=("voice",), phases=phases)
    follower = '<speech id="t" start="s:end"><text>so</text></speech>'
    async with puppet({"s": estimate}) as body:
        pending = body.ask(bml('<speech id="s"><text>one</text></speech>' + follower))
        await body.do("s", "start", "end", every=1.0)
        await body.do("t", "start", "end", every=1.0)
        await pending.outcome

    assert (body.time("s:end"), body.time("t:start"), body.time("t:end")) == (1.0, 1.0, 2.0)
    assert body.outcomes["b"].dropped == ()


async def test_names_of_behaviors_are_nobodys_business() -> None:
    """`home` and `way` are what the realizer calls requests of its own."""
    async with puppet() as body:
        pending = body.ask(bml('<speech id="home" required="true"><text>so</text></speech>'))
        await body.told("home")
        body.reach("home", "start")
        replacing = bml('<speech id="way"><text>so</text></speech>', id="b2", composition="REPLACE")
        second = body.ask(replacing)
        await body.do("way", "start", "end", every=1.0, block="b2")
        await asyncio.gather(pending.outcome, second.outcome)

    assert {id: each.status for id, each in body.outcomes.items()} == {"b": "interrupted", "b2": "done"}
    assert body.warnings() == []


async def test_a_body_that_never_estimates_or_goes_home_or_aborts_keeps_nobody_for_ever() -> None:
    async with puppet() as body:
        body.goes_home = body.aborts = False
        first = body.ask(bml(SPEECH))
        await body.told("s")
        body.reach("s", "start", "m")
        await asyncio.sleep(0.5)
        await asyncio.gather(first.outcome, body.perform(bml("", id="b2", composition="REPLACE")))
        now = body.client.now()

    assert now == 0.5 + ABORT + ABORT
    assert [(each.text, each.complete) for each in body.outcomes["b"].spoken] == [("one ", False)]
