"""Command `engage watch`: follow a running system, as text or as JSON lines."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Annotated, NamedTuple, get_args

import typer

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import EventKind
from engage_hri.schemas.blocks import BlockProgress, BodyHeld, Held, SyncPointProgress, WarningFeedback
from engage_hri.schemas.body_faults import BodyFaults
from engage_hri.schemas.faults import Fault, InputRefused, raised_as
from engage_hri.schemas.fragments import HeadOwner, StudyCondition
from engage_hri.schemas.messages import Message, line
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.recognition import ConnectionEvent, Floor, Interjection, Statistics
from engage_hri.schemas.units import Seconds
from engage_hri.services.commandline.shell.options import Connected
from engage_hri.services.commandline.shell.outputs import FORMAT, Patient, Terminal, as_file, settle, standard_output
from engage_hri.services.commandline.shell.process import DONE, forever, run_until_signal, unique_name
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.console.follow import FOLLOWED, Sink, following
from engage_hri.services.console.terminal.live import Log, NetLog
from engage_hri.services.console.terminal.log import Telling

OTHERS = (
    keys.UTTERANCE,
    keys.ANY_FEEDBACK,
    keys.ANY_INTERJECTION,
    keys.FLOOR,
    keys.HEAD_OWNER,
    keys.HELD,
    keys.BODY_HELD,
    keys.BODY_FAULTS,
    keys.STUDY_CONDITION,
    keys.ANY_FAULT,
)
SUBJECTS: dict[str, tuple[type[Message], ...]] = {
    "events": (ConnectionEvent,),
    "statistics": (Statistics,),
    "words": (Utterance, Interjection, Floor),
    "feedback": (BlockProgress, SyncPointProgress, WarningFeedback),
    "head": (HeadOwner,),
    "holds": (Held, BodyHeld),
    "faults": (Fault, BodyFaults),
    "condition": (StudyCondition,),
}


@dataclass(frozen=True, kw_only=True)
class Options(Connected):
    json: Annotated[bool, typer.Option("--json", help="JSON lines instead of text.")] = False
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="WHAT",
            help="events, statistics, words, feedback, head, holds, faults or condition; may be repeated.",
        ),
    ] = None
    net: Annotated[
        bool,
        typer.Option("--net", help="Petri nets of live blocks: a line for each instant and token."),
    ] = False
    actor: Annotated[str, typer.Option(metavar="ID", help="Only what goes on with this person.")] = ""
    kind: Annotated[
        list[str] | None, typer.Option(metavar="KIND", help="Only these connection events; may be repeated.")
    ] = None


class Wanted(NamedTuple):
    """Selection of what to show. Empty fields select all.

    only: subjects. actor: a person, who has only events, statistics and words. kinds: of connection events.
    """

    only: tuple[str, ...] = ()
    actor: str = ""
    kinds: tuple[str, ...] = ()

    def check(self) -> None:
        """Refuse unknown subjects and kinds, and bad ids. Raises InputRefused."""
        known = (("--only", self.only, SUBJECTS), ("--kind", self.kinds, get_args(EventKind)))
        for option, given, good in known:
            for name in set(given) - set(good):
                advice = f"known: {', '.join(good)}"
                raise InputRefused(Fault(reason=f"unknown {name!r}", where=option, advice=advice))
        with raised_as(InputRefused, ValueError, "--actor"):
            keys.chunk(self.actor)

    @property
    def is_everything(self) -> bool:
        return self == Wanted()

    @property
    def subjects(self) -> Collection[str]:
        if self.only:
            return self.only
        return ("events",) if self.kinds else ("events", "statistics", "words") if self.actor else tuple(SUBJECTS)

    @property
    def patterns(self) -> Collection[str]:
        if not (self.actor or self.kinds):
            return FOLLOWED
        return (*keys.event_stream(self.actor, self.kinds), keys.statistics(keys.chunk(self.actor)), *OTHERS)

    def includes(self, message: Message) -> bool:
        if isinstance(message, Utterance | Interjection) and self.actor not in ("", message.actor):
            return False
        return any(isinstance(message, SUBJECTS[subject]) for subject in self.subjects)


def main(options: Options) -> int:
    config = options.load()
    wanted = Wanted(tuple(options.only or ()), options.actor, tuple(options.kind or ()))
    wanted.check()
    if options.net and not wanted.is_everything:
        reason, advice = "shows nets and nothing else", "leave out --only, --actor and --kind"
        raise InputRefused(Fault(reason=reason, where="--net", advice=advice))
    out = standard_output(encoding=FORMAT if options.json else "")
    run_until_signal(_watch(options, config, wanted, out))
    settle(out)
    return DONE


async def _watch(options: Options, config: RobotConfig, wanted: Wanted, out: Patient) -> None:
    from engage_hri.services.bus.zenoh.neighbors import hinting

    async with await options.open(config.bus, "viewer") as hub:
        bus = hub.join(unique_name("watch"))
        # Text without a selection includes what people do and say, but no statistics, which would drown the rest.
        everything = wanted.is_everything and not options.json
        show: Sink
        if options.json:
            show = _as_json(out)
        elif options.net:
            show = NetLog(Terminal(file=as_file(out)), bus.now())
        else:
            show = Log(Terminal(file=as_file(out)), config.robot, bus.now(), Telling(statistics=not everything))

        def tell(message: Message, at: Seconds) -> None:
            if options.net or everything or wanted.includes(message):
                show(message, at)

        patterns = (keys.NET, keys.HELD) if options.net else wanted.patterns
        async with following(bus, (tell,), patterns=patterns, kinds=wanted.kinds):
            bus.declare_alive()
            async with hinting(bus, config.bus.connect):
                await forever()


def _as_json(out: Patient) -> Sink:
    def show(message: Message, at: Seconds) -> None:
        out.write(f"{line(message)}\n")

    return show
