"""Command `engage play FILE...`: perform fragments and blocks, in a running system or in a private one."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block, BlockOutcome, WarningFeedback, WarningKind
from engage_hri.schemas.faults import EngageError, Fault, InputRefused, NoReply, RunFailed
from engage_hri.schemas.fragments import FragmentOutcome, TurnFragment
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import AskStatus
from engage_hri.schemas.references import SyncRef, sites
from engage_hri.schemas.units import A_DAY, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.bus.interface import Hub
from engage_hri.services.client.language_models import summary_of
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.embedding import in_memory, services
from engage_hri.services.commandline.shell.options import (
    Connected,
    Embodied,
    Strict,
    VirtualTime,
    WorldFile,
    Written,
    strict_refusal,
)
from engage_hri.services.commandline.shell.outputs import Outputs, Terminal, complain
from engage_hri.services.commandline.shell.process import DONE, FAILED, REFUSED, readable, run, unique_name
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.commandline.shell.sources import InputFile, Thing, read_source, read_world, still
from engage_hri.services.commandline.talk.played import Played, Prose, Warnings
from engage_hri.services.console.follow import Sink, following
from engage_hri.services.console.terminal.live import Log
from engage_hri.services.console.terminal.log import Telling
from engage_hri.services.generation.intake import WORLD_PATIENCE

NOTHING = World(entities=())
PATIENCE: Seconds = 5.0
"""Time in which a running system must answer at all."""


@dataclass(frozen=True, kw_only=True)
class Options(Written, Embodied, Connected):
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILE...", help="EBML turn fragments or BML blocks (XML), or JSON of either."),
    ]
    embedded: Annotated[
        bool, typer.Option("--embedded", help="In a private system with a simulated body, instead of a running one.")
    ] = False
    world: WorldFile = None
    virtual_time: VirtualTime = False
    at: Annotated[
        str | None,
        typer.Option(metavar="S,S,...", help="When to submit each file, seconds; else one after the other."),
    ] = None
    outcomes: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write what became of each fragment, for a language model; - as above."),
    ] = None
    human: Annotated[
        Literal["attentive", "none"] | None,
        typer.Option(
            help="With --embedded: one who follows the robot's gaze and answers, or nobody who does.",
            show_default="attentive",
        ),
    ] = None
    strict: Strict = False
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print each sync point, too.")] = False


def main(options: Options) -> int:
    private = {
        "--body": options.body,
        "--voice": options.voice,
        "--world": options.world,
        "--human": options.human,
        "--virtual-time": options.virtual_time,
    }
    for option, given in private.items():
        if given and not options.embedded:
            raise InputRefused(Fault(reason=f"{option} is for a private system", advice="add --embedded"))
    if options.connect and options.embedded:
        raise InputRefused(Fault(reason="--connect is for a running system", advice="leave out --embedded"))
    config = options.load()
    times = submission_times(options.at, len(options.files))
    with Outputs(options.events, options.feedback, options.outcomes) as outputs:
        world = read_world(options.world)
        sources = read_all(options.files, outputs)
        check(sources, world if options.embedded else None, config.robot, outputs)
        play = PlayedFiles(options, sources, times, outputs)
        performing = play.embedded(config, world) if options.embedded else play.remote(config)
        code = run(performing, virtual_time=options.virtual_time)
    if options.strict and play.warnings.count and code == DONE:
        raise strict_refusal(play.warnings.count)
    return code


def submission_times(text: str | None, files: int) -> tuple[Seconds, ...] | None:
    """Read `--at`: `0,1.5` is a time for each of two files; None: one after the other. Raises InputRefused."""
    if text is None:
        return None
    try:
        times = tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise InputRefused(Fault(reason=f"--at {text!r} is not a list of seconds", advice="--at 0,1.5")) from error
    if len(times) != files:
        reason = f"--at gives {len(times)} times for {files} files"
        raise InputRefused(Fault(reason=reason, advice="one for each file"))
    if not all(0 <= time <= A_DAY for time in times):
        raise InputRefused(Fault(reason=f"--at {text!r}: not from 0 to {A_DAY:g} seconds", advice="seconds from now"))
    return times


class PlayedFiles:
    """Sources that are performed, with all that follows them. warnings: those of what is played.

    sources: files, in order. times: when to submit each, seconds from the start; None: one after the other.
    """

    def __init__(
        self, options: Options, sources: tuple[InputFile, ...], times: tuple[Seconds, ...] | None, outputs: Outputs
    ) -> None:
        self.warnings = Warnings(Terminal(stderr=True))
        self._options = options
        self._sources = sources
        self._times = times
        self._outputs = outputs
        self._things = [thing for source in sources for thing in source.things]
        self._played = Played(self._things)
        outputs.wanted = self._played.concerns
        self._console = outputs.console(quiet=options.quiet)
        self._prose = Prose(self._console, outputs, self._played.words_will_come)

    @property
    def _servers(self) -> set[str]:
        """Services that perform the sources."""
        return {"generation" if isinstance(thing, TurnFragment) else "realizer" for thing in self._things}

    async def embedded(self, config: RobotConfig, world: World) -> int:
        """Perform all in a private system: simulated body and still world; generation only if there is a fragment.

        So without a fragment only the blocks themselves move the head.
        """
        perception = still(world, is_attentive=self._options.human != "none")
        names = {"realizer", "recognition", "control"} | self._servers
        async with in_memory(config, {"simulation": perception, **services(config, *sorted(names))}) as hub:
            return await self._perform_all(hub, None)

    async def remote(self, config: RobotConfig) -> int:
        """Perform all in a running system. Raises RunFailed: it is not there."""
        async with await self._options.open(config.bus, "manager", patience=PATIENCE) as hub:
            await _somebody_there(hub, self._servers, config)
            async with connect(hub=hub) as robot:
                world = await world_with_people(robot, self._things, config.robot, WORLD_PATIENCE)
            if "generation" in self._servers:
                # Without perception generation itself waits or refuses.
                check(self._sources, world, config.robot, self._outputs)
            return await self._perform_all(hub, PATIENCE)

    async def _perform_all(self, hub: Hub, patience: Seconds | None) -> int:
        """Perform all sources. Returns the worst exit code. patience: time in which a service must answer at all."""
        bus = hub.join(unique_name("play-log"))
        telling = Telling(head=False, points=self._options.verbose, warnings=False)
        log = Log(self._console, hub.robot, bus.now(), telling)

        def tell(message: Message, at: Seconds) -> None:
            if self._played.concerns(message):
                if deed := self._played.deed(message):
                    log.say(f"{hub.robot} {deed}", at)
                log(message, at)
                self.warnings(message, at)
                self._prose(message, at)

        sinks: tuple[Sink, ...] = (self._played, tell, self._outputs)
        async with following(bus, sinks, past=False), connect(hub=hub) as robot:

            async def perform(source: InputFile, after: Seconds = 0.0) -> int:
                await asyncio.sleep(after)
                outcomes = [await self._perform(thing, source, robot, patience, log) for thing in source.things]
                return max(outcomes)

            if self._times is None:
                code = max([await perform(source) for source in self._sources])
            else:
                async with asyncio.TaskGroup() as group:
                    pairs = zip(self._sources, self._times, strict=True)
                    tasks = [group.create_task(perform(*pair), name=str(pair[0].path)) for pair in pairs]
                code = max(task.result() for task in tasks)
            await self._played.settle()
        self._prose.finish()
        self.warnings.finish()
        return code

    async def _perform(
        self, thing: Thing, source: InputFile, robot: Robot, patience: Seconds | None, log: Log
    ) -> int:
        """Perform a block or fragment of a file. Returns its exit code; a failure is told and ends nothing else."""
        self.warnings.ask(thing.id)
        outcome: FragmentOutcome | BlockOutcome
        try:
            if isinstance(thing, Block):
                outcome = await robot.realize(thing, timeout=patience)
            else:
                outcome = await robot.perform(thing, timeout=patience)
        except EngageError as error:
            if isinstance(error, InputRefused):
                self.warnings.refused(thing.id)
            complain(readable(error.fault, source.path))
            if isinstance(thing, TurnFragment):
                self._outputs.outcome(thing.id, summary_of(error))
            return REFUSED if isinstance(error, InputRefused) else FAILED
        if isinstance(outcome, FragmentOutcome):
            self._prose.expect(outcome)
        elif outcome.dropped:
            complain(f"{source.path}: {thing.id} was {outcome.status} without {', '.join(outcome.dropped)}")
        if end := self._played.end_before_turn(outcome):
            log.say(end, robot.now())
        code = self._played.exit_code(outcome)
        if code != DONE:
            why = f": {outcome.fault.reason}" if outcome.fault is not None else ""
            complain(f"{source.path}: {thing.id} was {outcome.status}{why}")
        return code


async def _somebody_there(hub: Hub, servers: set[str], config: RobotConfig) -> None:
    """Wait for the servers, at most `PATIENCE` for all of them. Raises RunFailed for the first that is missing."""
    from engage_hri.services.bus.zenoh.neighbors import hinting

    bus = hub.join(unique_name("play-asks"))
    deadline = bus.now() + PATIENCE
    async with hinting(bus, config.bus.connect):
        for server in sorted(servers):
            try:
                await bus.query(keys.status(server), AskStatus(), max(0.0, deadline - bus.now()))
            except NoReply as error:
                reason = f"no answer within {PATIENCE:g} s"
                advice = f"is {server} running? `engage up` starts everything"
                raise RunFailed(Fault(reason=reason, where=server, advice=advice)) from error


async def world_with_people(robot: Robot, things: Sequence[Thing], name: str, patience: Seconds) -> World | None:
    """Return what is perceived; while it lacks people whom these things need, wait for them, as fragments do.

    name: the robot's actor id. patience: time to wait; then it is what there is. None: nothing is known, or needed.
    """
    deadline, world = robot.now() + patience, None
    with robot.worlds() as worlds:
        while any(lacks_people(thing, world or NOTHING, name) for thing in things):
            newer = await worlds.next(max(0.0, deadline - robot.now()))
            if newer is None:
                break
            world = newer
    return world


def read_all(files: Sequence[Path], outputs: Outputs) -> tuple[InputFile, ...]:
    """Read all files. Raises InputRefused for the first bad one, after its warning has gone to the feedback."""
    sources = []
    for path in files:
        try:
            sources.append(read_source(path))
        except InputRefused as error:
            _warn(outputs, error.block, error.fault)
            raise
    return tuple(sources)


def check(sources: Sequence[InputFile], world: World | None, robot: str, outputs: Outputs) -> None:
    """Check blocks for contradictions, and fragments against a world, if it is known. Raises InputRefused."""
    from engage_hri.services.generation.fragment_check import performable
    from engage_hri.services.realizer.plan.known import Known
    from engage_hri.services.realizer.plan.planner import plan_block
    from engage_hri.services.realizer.plan.relations import BlockRefused

    for source in sources:
        for thing in source.things:
            try:
                with source.naming_file():
                    if isinstance(thing, Block):
                        # The realizer will check that the other blocks are alive when this one comes.
                        plan_block(thing, known=Known(blocks=dict.fromkeys(_others(thing))))
                    elif world is not None:
                        performable(thing, world, robot)
            except InputRefused as error:
                refusal = error.__cause__
                kind = refusal.kind if isinstance(refusal, BlockRefused) else "PARSING_FAILURE"
                _warn(outputs, thing.id, error.fault, kind)
                raise


def lacks_people(thing: Thing, world: World, robot: str) -> bool:
    """True if a fragment or block speaks to somebody, or has a target that is not known, and the world has no people.

    robot: its actor id, which may be a target.
    """
    from engage_hri.services.generation import fragment_check

    if world.people:
        return False
    known = {robot, "", *(entity.id for entity in world.entities)}
    if any(getattr(behavior, "target", "") not in known for behavior in thing.behaviors):
        return True
    return isinstance(thing, TurnFragment) and fragment_check.lacks_people(thing, world)


def _others(block: Block) -> set[str]:
    """Ids of the other blocks to whose points a block refers."""
    return {SyncRef.parse(site.text).block for site in sites(block)} - {"", block.id}


def _warn(outputs: Outputs, block: str | None, fault: Fault, kind: WarningKind = "PARSING_FAILURE") -> None:
    outputs(WarningFeedback(block=block, kind=kind, message=readable(fault)), 0.0)
