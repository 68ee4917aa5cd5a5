"""Plots of a study as PNG. Conditions have colors that color-blind people can tell apart (Okabe and Ito).

Needs matplotlib, the extra `study`; imported only when plots are wanted. No pyplot, so no state.
"""

import io
from collections.abc import Callable, Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from engage_hri.schemas.behaviors import EVENT_KINDS, EventKind
from engage_hri.services.study.records import EventRecord, SessionRecord
from engage_hri.services.study.summary import RESPONDED, by_condition, pooled

COLORS = ("#0072B2", "#E69F00", "#009E73")
HATCHES = ("", "//", "..")
"""Hatches of the bars, for prints without color."""
DPI = 120

Groups = Mapping[str, Sequence[SessionRecord]]
Height = Callable[[str, EventKind], tuple[float, str]]
"""Height of the bar for a condition and a kind, with the words above it."""


def draw(records: Sequence[SessionRecord], events: Sequence[EventRecord]) -> dict[str, bytes]:
    """Draw the finished sessions: PNGs by file name."""
    groups = by_condition(records)
    finished = {(record.condition, record.session) for record in records if record.finished}
    counted = [event for event in events if (event.condition, event.session) in finished]
    return {
        "events.png": _png(_events(groups)),
        "delays.png": _png(_delays(groups, counted)),
        "failure_rates.png": _png(_failure_rates(groups)),
        "mtbce.png": _png(
            _each_session(groups, "mean time between connection events (s)", lambda one: one.statistics.mtbce)
        ),
        "completion_time.png": _png(_each_session(groups, "completion time (s)", lambda one: one.completion_time)),
    }


# -- what is drawn ----------------------------------------------------------------------------------------------


def _events(groups: Groups) -> Figure:
    def mean(name: str, kind: EventKind) -> tuple[float, str]:
        group = groups[name]
        height = pooled(group, kind).count / len(group) if group else 0.0
        return height, f"{height:.1f}"

    figure, axes = _one_panel()
    _bars(axes, groups, tuple(EVENT_KINDS), mean)
    axes.set_ylabel("connection events per session")
    return figure


def _failure_rates(groups: Groups) -> Figure:
    def rate(name: str, kind: EventKind) -> tuple[float, str]:
        all_of = pooled(groups[name], kind)
        decided = all_of.succeeded + all_of.failed
        return 100 * (all_of.failure_rate or 0.0), f"{all_of.failed}/{decided}"

    figure, axes = _one_panel()
    _bars(axes, groups, RESPONDED, rate)
    axes.set_ylabel("failure rate (%), without optional events")
    axes.set_ylim(0, 105)
    return figure


def _delays(groups: Groups, events: Sequence[EventRecord]) -> Figure:
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    for axes, kind in zip(figure.subplots(1, len(RESPONDED)), RESPONDED, strict=True):
        _tidy(axes)
        samples = [
            [
                event.delay
                for event in events
                if (event.condition, event.kind, event.outcome) == (name, kind, "succeeded")
                and event.delay is not None
            ]
            for name in groups
        ]
        _boxes(axes, groups, samples, whiskers=(5, 95))
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
        axes.set_title(EVENT_KINDS[kind].title, fontsize=10)
    figure.axes[0].set_ylabel("delay of those that succeeded (s)")
    figure.supxlabel("box: quartiles and median; whiskers: 5th and 95th percentile", fontsize=8)
    return figure


def _each_session(groups: Groups, label: str, measure: Callable[[SessionRecord], float | None]) -> Figure:
    """Draw a point for each session, over a box."""
    figure, axes = _one_panel()
    samples = [[value for record in group if (value := measure(record)) is not None] for group in groups.values()]
    _boxes(axes, groups, samples, whiskers=(0, 100))
    for index, sample in enumerate(samples):
        # Side by side within the box, in the order of the sessions, so that none hides another.
        step = 0.36 / max(1, len(sample) - 1)
        places = [index - 0.18 + number * step for number in range(len(sample))] if len(sample) > 1 else [index]
        axes.plot(places[: len(sample)], sample, "o", markersize=3, color="0.25", alpha=0.6, linestyle="none")
    if not any(samples):
        axes.text(0.5, 0.5, "no session has any", ha="center", transform=axes.transAxes)
        axes.set_yticks([])
    axes.set_ylabel(label)
    axes.set_xlabel("box: quartiles and median; a point for each session", fontsize=8)
    axes.set_ylim(bottom=0)
    return figure


# -- how --------------------------------------------------------------------------------------------------------


def _one_panel() -> tuple[Figure, Axes]:
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    _tidy(axes)
    return figure, axes


def _tidy(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_axisbelow(True)
    axes.grid(axis="y", color="0.9")


def _bars(axes: Axes, groups: Groups, kinds: Sequence[EventKind], height: Height) -> None:
    """Draw for each kind a bar for each condition, side by side."""
    width = 0.84 / max(1, len(groups))
    for index, name in enumerate(groups):
        places = [number + (index - (len(groups) - 1) / 2) * width for number in range(len(kinds))]
        heights, words = zip(*(height(name, kind) for kind in kinds), strict=True)
        bars = axes.bar(
            places, heights, 0.92 * width, label=f"{name} ({len(groups[name])} sessions)",
            color=COLORS[index % len(COLORS)], hatch=HATCHES[index % len(HATCHES)], edgecolor="white",
        )  # fmt: skip
        axes.bar_label(bars, words, fontsize=7, padding=1)
    axes.set_xticks(range(len(kinds)), [EVENT_KINDS[kind].title for kind in kinds])
    if groups:
        # Above the bars: any of them may be as high as the axes.
        axes.legend(frameon=False, fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=len(groups))


def _boxes(axes: Axes, groups: Groups, samples: Sequence[Sequence[float]], whiskers: tuple[float, float]) -> None:
    """Draw a box from quartile to quartile for each condition with a sample. whiskers: percentiles."""
    for index, sample in enumerate(samples):
        if sample:
            axes.boxplot(
                [list(sample)], positions=[index], widths=0.6, whis=whiskers, showfliers=False, manage_ticks=False,
                patch_artist=True, medianprops={"color": "black"},
                boxprops={"facecolor": COLORS[index % len(COLORS)], "alpha": 0.7},
            )  # fmt: skip
    names = [
        f"{name.replace('degraded-', 'degraded' + chr(10))}\n(n = {len(sample)})"
        for name, sample in zip(groups, samples, strict=True)
    ]
    axes.set_xticks(range(len(groups)), names, fontsize=8)
    axes.set_xlim(-0.6, len(groups) - 0.4)


def _png(figure: Figure) -> bytes:
    """Write a figure as PNG: the same bytes each time."""
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=DPI, metadata={"Software": None})
    return picture.getvalue()
