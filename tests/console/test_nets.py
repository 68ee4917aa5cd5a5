"""Nets as text: lines about those of live blocks, and the drawing of a plan's."""

import asyncio
from io import StringIO

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from rich.cells import cell_len
from rich.console import Console

from engage_hri.schemas.blocks import Fired, NetMarked, NetPlace, NetPlanned, NetPoint, NetTransition, NetWaiting
from engage_hri.schemas.units import Stamp
from engage_hri.services.commandline.talk.net_drawing import drawing, legend
from engage_hri.services.console import nets
from engage_hri.services.console.nets import NetInView, feed, in_view, laid_out, told, where
from engage_hri.services.console.terminal.live import NetLog
from tests.random_cases import share_of

AT = Stamp("clock", 0.0)
GAZE, POINT, SPEECH = "gaze-1", "point-1", "speech-1"


def instant(time: float, *points: str) -> NetTransition:
    pairs = [each.rpartition(":") for each in points]
    return NetTransition(
        points=tuple(NetPoint(behavior=behavior, sync=sync) for behavior, _, sync in pairs), time=time
    )


def place(kind: str, source: int, target: int, behavior: str = "", lag: float = 0.0) -> NetPlace:
    return NetPlace(kind=kind, source=source, target=target, behavior=behavior, lag=lag)


FIGURE_4_8 = NetPlanned(
    block="b",
    at=AT,
    transitions=(
        instant(0.0, ":start"),
        instant(0.0, "gaze-1:start", "gaze-1:ready", "gaze-1:stroke_start"),
        instant(0.5, "gaze-1:stroke", "point-1:start"),
        instant(1.0, "point-1:ready"),
        instant(1.25, "point-1:stroke_start", "speech-1:start"),
        instant(1.75, "point-1:stroke"),
        instant(2.0, "point-1:stroke_end"),
        instant(2.25, "point-1:relax"),
        instant(2.75, "point-1:end"),
        instant(2.25, "speech-1:end"),
        instant(2.75, "gaze-1:stroke_end", "gaze-1:relax"),
        instant(3.25, "gaze-1:end"),
        instant(3.25, ":end"),
    ),
    places=(
        place("order", 0, 1, GAZE), place("order", 0, 2, POINT), place("order", 0, 4, SPEECH), place("order", 0, 12),
        place("phase", 1, 2, GAZE, 0.5), place("phase", 2, 3, POINT, 0.5), place("phase", 2, 10, GAZE),
        place("phase", 3, 4, POINT, 0.25), place("phase", 4, 5, POINT, 0.5), place("phase", 4, 9, SPEECH, 1.0),
        place("phase", 5, 6, POINT, 0.25), place("phase", 6, 7, POINT, 0.25), place("phase", 7, 8, POINT, 0.5),
        place("series", 8, 10, GAZE), place("order", 8, 12, POINT), place("series", 9, 10, GAZE),
        place("order", 9, 12, SPEECH), place("phase", 10, 11, GAZE, 0.5), place("order", 11, 12, GAZE),
        place("idle", 12, 0),
    ),
    marked=(19,),
)  # fmt: skip


def test_figure_4_8_is_drawn() -> None:
    net = in_view(FIGURE_4_8)
    assert net is not None
    assert (
        "\n".join(drawing(net, 80, 40))
        == """\
block b: 13 instants, 1 ●
planned    0.00 0.00 0.50 1.00 1.25 1.75 2.00 2.25 2.25 2.75 2.75 3.25 3.25
bml      ● s─────────────────────────────○─────────────────────────────e
gaze-1      ┄○┄┄sr[○─*───────────────────○───────────────────]x─○─e┄○┄┄
point-1     ┄┄┄┄○┄┄┄┄s─○──r─○──[─○──*─○──]─○──x────○────e┄┄┄┄┄┄○┄┄┄┄┄┄┄
speech-1    ┄┄┄┄┄┄┄┄┄○┄┄┄┄┄┄┄┄┄s─────────○─────────e┄┄┄┄┄┄┄┄┄○┄┄┄┄┄┄┄┄┄
series                                                  ├┄○┄┄┤
series                                             ├┄┄┄┄○┄┄┄┄┤"""
    )
    assert legend(net) == "●=token s=start r=ready [=stroke_start *=stroke ]=stroke_end x=relax e=end"


def test_who_waits_for_its_start_is_told_with_what_it_waits_for() -> None:
    net = in_view(
        replace(
            FIGURE_4_8,
            places=(*FIGURE_4_8.places, place("order", 3, 4), place("series", 2, 4, SPEECH), place("series", 8, 9)),
        )
    )
    assert net is not None

    assert [where(net, each) for each in net.places[:3]] == [
        "gaze-1 waits for its start",
        "point-1 waits for its start, with gaze-1:stroke",
        "speech-1 waits for its start, after gaze-1:stroke = point-1:start and point-1:ready, "
        "with point-1:stroke_start",
    ]


def test_a_delay_has_its_seconds_and_its_token() -> None:
    net = in_view(
        NetPlanned(
            block="d",
            at=AT,
            transitions=(instant(0, ":start"), instant(0.5, "a:start"), instant(2.5, "b:start"), instant(3, ":end")),
            places=(place("delay", 1, 2, lag=2.0), place("order", 0, 1, "a"), place("order", 1, 2)),
            marked=(0,),
        )
    )
    assert net is not None

    assert (
        "\n".join(drawing(net, 40, 40))
        == """\
block d: 4 instants, 1 ●
planned     0.00  0.50  2.50  3.00
bml         s                 e
a            ┄┄○┄┄s
b                       s
delay 2 s         ├┄┄●┄┄┤
order             ├┄┄○┄┄┤"""
    )


def test_a_narrow_or_low_terminal_gets_less_and_is_told_how_much() -> None:
    net = in_view(FIGURE_4_8)
    assert net is not None

    assert (
        "\n".join(drawing(net, 40, 6))
        == """\
block b: 13 instants, 1 ●
planned    0.00  0.50  1.25  2.00  ·  …
bml      ● s────────────○─────────────…
gaze-1      ○┄s○─*─────────○──────────…
point-1     ┄┄○┄┄s○─r○─[○─*○─]○─x──○──…
… 3 more lines"""
    )


IDS = st.text(max_size=8) | st.sampled_from(("a:b", "[red]", "\x1b[2J", "手", "e\u0301", "a = b", "x" * 90, "\u202e"))


@st.composite
def any_nets(draw: st.DrawFn) -> NetPlanned:
    size = draw(st.integers(0, 12))
    number = st.integers(-1, size + 1)
    point = st.builds(NetPoint, behavior=IDS, sync=IDS | st.sampled_from(("start", "stroke", "end")))
    return NetPlanned(
        block=draw(IDS),
        at=AT,
        transitions=tuple(
            draw(st.lists(st.builds(NetTransition, points=st.lists(point, max_size=3).map(tuple), time=st.floats()),
                          min_size=size, max_size=size))
        ),
        places=tuple(
            draw(st.lists(st.builds(
                NetPlace, kind=st.sampled_from(("phase", "delay", "order", "idle", "??")),
                source=st.integers(0, max(0, size - 1)), target=number, lag=st.floats(), behavior=IDS,
            ), max_size=20))
        ),
        marked=tuple(draw(st.lists(number, max_size=10))),
        fired=tuple(draw(st.lists(st.builds(Fired, transition=number, time=st.floats()), max_size=10))),
    )  # fmt: skip


@settings(max_examples=share_of(100), deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(any_nets(), any_nets(), st.integers(1, 120), st.integers(1, 40))
def test_whatever_is_told_is_drawn_within_the_terminal(
    first: NetPlanned, second: NetPlanned, width: int, height: int
) -> None:
    """Anybody can put anything on the bus."""
    seen: nets.Nets = {}
    for message in (first, second, NetMarked(block=first.block, put=(0, 99, -5), taken=(3,), fired=(), is_over=True)):
        before, seen = seen, feed(seen, message, 0.0, 1.0)
        for block, net in seen.items():
            list(told(before.get(block), net))
    for net in seen.values():
        if net.waits_for:
            continue
        lines = drawing(net, width, height)
        assert all(cell_len(line) <= width for line in lines)
        assert all(line.isprintable() for line in lines)
        assert len(lines) <= max(height, 4)


def test_a_net_that_leads_nowhere_is_not_taken() -> None:
    start = (instant(0, ":start"),)

    assert in_view(NetPlanned(block="b", at=AT, transitions=start, places=(place("order", 0, 1),))) is None
    assert in_view(NetPlanned(block="b", at=AT, transitions=(), places=())) is None


def test_changes_are_told_one_by_one() -> None:
    began = feed({}, FIGURE_4_8, 0.0, 0.0)
    start = NetMarked(block="b", fired=(Fired(transition=0, time=0.0),), put=(0, 3), taken=(19,))
    moving = feed(began, start, 0.0, 0.1)
    gaze = NetMarked(block="b", fired=(Fired(transition=1, time=0.02),), put=(4,), taken=(0,))
    over = NetMarked(block="b", taken=(3, 4), is_over=True)

    assert list(told(None, began["b"])) == ["b: net of 13 instants and 20 places", "b: ● b at rest"]
    assert list(told(began["b"], moving["b"])) == [
        "b: bml:start fired at 0.00 s (planned 0.00 s)",
        "b: ● gaze-1 waits for its start",
        "b: ● order from bml:start to bml:end",
    ]
    after = feed(moving, gaze, 0.0, 0.2)
    assert list(told(moving["b"], after["b"])) == [
        "b: gaze-1:start = gaze-1:ready = gaze-1:stroke_start fired at 0.02 s (planned 0.00 s)",
        "b: ● gaze-1 from start to stroke",
    ]
    assert list(told(after["b"], feed(after, over, 0.0, 0.3)["b"])) == ["b: over"]
    assert list(told(after["b"], feed(after, FIGURE_4_8, 0.0, 0.3)["b"])) == ["b: ● b at rest"]


def test_of_a_net_that_is_planned_anew_only_the_tokens_are_told_that_lie_elsewhere() -> None:
    start = NetMarked(block="b", fired=(Fired(transition=0, time=0.0),), put=(0, 3), taken=(19,))
    before = feed(feed({}, FIGURE_4_8, 0.0, 0.0), start, 0.0, 0.1)
    speechless = replace(
        FIGURE_4_8,
        places=tuple(each for each in FIGURE_4_8.places if each.behavior != SPEECH),
        marked=(0, 1, 2),
        fired=(Fired(transition=0, time=0.0),),
    )
    assert list(told(before["b"], feed(before, speechless, 0.0, 0.2)["b"])) == [
        "b: net of 13 instants and 17 places, planned anew", "b: ● point-1 waits for its start, with gaze-1:stroke",
    ]  # fmt: skip


def test_letters_stand_for_points_as_a_block_spells_them_and_for_every_stroke() -> None:
    syncs = ("n:start", "n:strokeStart", "n:stroke", "n:stroke:2", "n:strokeEnd", "smile:attackPeak", "s:m1")
    message = NetPlanned(
        block="b", at=AT, places=(),
        transitions=(
            *(
                NetTransition(points=(NetPoint(behavior=id, sync=sync),), time=float(time))
                for time, (id, _, sync) in enumerate(each.partition(":") for each in syncs)
            ),
            instant(9.0, ":end"),
        ),
    )  # fmt: skip
    net = in_view(message)
    assert net is not None
    rows = {line.split()[0]: "".join(line.split()[1:]) for line in drawing(net, 80, 40)[2:]}
    assert rows["n"].replace("┊", "") == "s[**]"
    assert (rows["smile"].strip("┊"), rows["s"].strip("┊")) == ("p", "m")
    assert legend(net) == "●=token s=start p=attackPeak [=strokeStart *=stroke ]=strokeEnd e=end m=mark"


def test_a_block_that_waits_for_its_turn_is_told_with_those_that_it_waits_for() -> None:
    running = feed({}, FIGURE_4_8, 0.0, 0.0)
    waiting = feed(running, NetWaiting(block="c", since=AT, waits_for=("b", "a")), 0.0, 0.0)
    fewer = feed(waiting, NetWaiting(block="c", since=AT, waits_for=("b",)), 0.0, 1.0)
    again = feed(fewer, NetWaiting(block="c", since=AT, waits_for=("b",)), 0.0, 2.0)
    begun = feed(again, replace(FIGURE_4_8, block="c"), 3.0, 3.0)
    over = feed(again, NetMarked(block="c", is_over=True), 0.0, 3.0)

    assert list(told(None, waiting["c"])) == ["c: waits for b, a"]
    assert list(told(waiting["c"], fewer["c"])) == ["c: waits for b"]
    assert list(told(fewer["c"], again["c"])) == []
    assert list(told(again["c"], begun["c"])) == list(told(None, begun["c"]))
    assert list(told(again["c"], over["c"])) == ["c: over"]
    assert "c" not in nets.without_old(over, 5.0)


def test_a_net_goes_a_moment_after_its_end_and_when_nobody_speaks_of_it() -> None:
    running = feed({}, FIGURE_4_8, 0.0, 10.0)
    over = feed(running, NetMarked(block="b", is_over=True), 0.0, 11.0)

    assert nets.without_old(running, 14.0) == running
    assert nets.without_old(over, 12.0) == over
    assert nets.without_old(over, 13.0) == {}
    assert nets.without_old(running, 17.5) == {}
    assert feed({}, NetMarked(block="b", put=(1,)), 0.0, 0.0) == {}


def started(*fired: int) -> NetMarked:
    return NetMarked(block="b", fired=tuple(Fired(transition=one, time=0.5) for one in fired))


async def test_each_change_of_a_live_net_is_a_line() -> None:
    out = StringIO()
    log = NetLog(Console(file=out, width=80), asyncio.get_running_loop().time())

    log(FIGURE_4_8, 0.0)
    await asyncio.sleep(1.5)
    log(started(0), 0.0)
    log(FIGURE_4_8, 0.0)  # told again, nothing new
    log(NetMarked(block="b", is_over=True), 0.0)
    log(NetMarked(block="other", put=(3,)), 0.0)

    assert out.getvalue().splitlines() == [
        "  0:00.0  b: net of 13 instants and 20 places",
        "  0:00.0  b: ● b at rest",
        "  0:01.5  b: bml:start fired at 0.50 s (planned 0.00 s)",
        "  0:01.5  b: over",
    ]


def test_an_instant_joins_the_rows_of_its_behaviors_and_one_of_no_behavior_none_but_the_block() -> None:
    instants = (instant(0.0, ":start"), instant(0.5, "one:start", "two:start"), instant(0.7), instant(1.0, ":end"))
    net = NetInView(block="b", transitions=instants, places=(), marked=frozenset(), fired={})

    shown = laid_out(net, lambda at: at)

    assert [row.name for row in shown.rows] == ["bml", "one", "two"]
    assert [each.rows for each in shown.instants] == [(0, 0), (1, 2), (0, 0), (0, 0)]
