"""Command `engage play FILE...`: perform fragments and blocks, in a running system or in a private one."""

import asyncio
from collections.abc import Callable, Sequence
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import typer
from rich.console import Console

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block, BlockOutcome
from engage_hri.schemas.faults import EngageError, Fault, InputRefused, NoReply, RunFailed
from engage_hri.schemas.fragments import FragmentOutcome, TurnFragment
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import AskStatus
from engage_hri.schemas.units import A_DAY, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.bus.interface import Hub
from engage_hri.services.client.language_models import summary_of
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.embedding import in_memory, services
from engage_hri.services.commandline.shell.exit_codes import readable
from engage_hri.services.commandline.shell.failing_output import complain
from engage_hri.services.commandline.shell.options import Connected, Embodied, Strict, VirtualTime, WorldFile, Written
from engage_hri.services.commandline.shell.outputs import Outputs, Terminal
from engage_hri.services.commandline.shell.process import DONE, FAILED, REFUSED, run, unique_name
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.commandline.shell.sources import InputFile, Thing, read_world, still
from engage_hri.services.commandline.talk import input_check
from engage_hri.services.commandline.talk.play_state import Played
from engage_hri.services.commandline.talk.prose import Prose, Warnings, strict_refusal
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


class Job(NamedTuple):
    """Sources with all that is needed to perform them.

    times: when to submit each source, seconds from the start; None: one after the other.
    """

    options: Options
    sources: tuple[InputFile, ...]
    times: tuple[Seconds, ...] | None
    played: Played
    outputs: Outputs
    console: Console
    prose: Prose
    warnings: Warnings

    @property
    def servers(self) -> frozenset[str]:
        """Services that perform the sources."""
        return frozenset("generation" if isinstance(thing, TurnFragment) else "realizer" for thing in self.things)

    @property
    def things(self) -> list[Thing]:
        return [thing for source in self.sources for thing in source.things]

    @property
    def has_fragments(self) -> bool:
        return "generation" in self.servers


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
        sources = input_check.read_all(options.files, outputs)
        input_check.check(sources, world if options.embedded else None, config.robot, outputs)
        played = Played(thing for source in sources for thing in source.things)
        outputs.wanted = played.concerns
        console = outputs.console(quiet=options.quiet)
        warnings = Warnings(Terminal(stderr=True))
        prose = Prose(console, outputs, played.words_will_come)
        job = Job(options, sources, times, played, outputs, console, prose, warnings)
        performing = _embedded(job, config, world) if options.embedded else _remote(job, config)
        code = run(performing, virtual_time=options.virtual_time)
    if options.strict and warnings.count and code == DONE:
        raise strict_refusal(warnings.count)
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


def _private_system(job: Job, config: RobotConfig, world: World) -> AbstractAsyncContextManager[Hub]:
    """Run a private system: simulated body and still world; generation only if there is a fragment.

    So without a fragment only the blocks themselves move the head.
    """
    names = ["realizer", "recognition", "control"]
    if job.has_fragments:
        names.append("generation")
    perception = still(world, is_attentive=job.options.human != "none")
    return in_memory(config, {"simulation": perception, **services(config, *names)})


async def _embedded(job: Job, config: RobotConfig, world: World) -> int:
    async with _private_system(job, config, world) as hub:
        return await _perform_all(job, hub, None)


async def _remote(job: Job, config: RobotConfig) -> int:
    async with await job.options.open(config.bus, "manager", patience=PATIENCE) as hub:
        await _somebody_there(hub, job.servers, config)
        async with connect(hub=hub) as robot:
            world = await world_with_people(robot, job.things, config.robot, WORLD_PATIENCE)
        if job.has_fragments:
            # Without perception generation itself waits or refuses.
            input_check.check(job.sources, world, config.robot, job.outputs)
        return await _perform_all(job, hub, PATIENCE)


async def _somebody_there(hub: Hub, servers: frozenset[str], config: RobotConfig) -> None:
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
        while any(input_check.lacks_people(thing, world or NOTHING, name) for thing in things):
            newer = await worlds.next(max(0.0, deadline - robot.now()))
            if newer is None:
                break
            world = newer
    return world


async def _perform_all(job: Job, hub: Hub, patience: Seconds | None) -> int:
    """Perform all sources. Returns the worst exit code. patience: time in which a service must answer at all."""
    bus = hub.join(unique_name("play-log"))
    log = Log(job.console, hub.robot, bus.now(), Telling(head=False, points=job.options.verbose, warnings=False))

    def tell(message: Message, at: Seconds) -> None:
        if job.played.concerns(message):
            if deed := job.played.deed(message):
                log.say(f"{hub.robot} {deed}", at)
            log(message, at)
            job.warnings(message, at)
            job.prose(message, at)

    sinks: tuple[Sink, ...] = (job.played, tell, job.outputs)
    async with following(bus, sinks, past=False), connect(hub=hub) as robot:
        code = await _perform_each(job, robot, patience, lambda line: log.say(line, bus.now()))
        await job.played.settle()
    job.prose.finish()
    job.warnings.finish()
    return code


async def _perform_each(job: Job, robot: Robot, patience: Seconds | None, say: Callable[[str], None]) -> int:
    if job.times is None:
        return max([await _perform(job, source, robot, patience, say) for source in job.sources])
    loop = asyncio.get_running_loop()
    began = loop.time()

    async def later(source: InputFile, time: Seconds) -> int:
        await asyncio.sleep(began + time - loop.time())
        return await _perform(job, source, robot, patience, say)

    async with asyncio.TaskGroup() as group:
        pairs = zip(job.sources, job.times, strict=True)
        tasks = [group.create_task(later(source, time), name=str(source.path)) for source, time in pairs]
    return max(task.result() for task in tasks)


async def _perform(
    job: Job, source: InputFile, robot: Robot, patience: Seconds | None, say: Callable[[str], None]
) -> int:
    """Perform the content of a file, in order. say: prints a line of the log.

    Returns the worst exit code; a failure is told and ends nothing else.
    """
    worst = DONE
    for thing in source.things:
        job.warnings.ask(thing.id)
        try:
            outcome = await _submit(thing, robot, patience)
        except EngageError as error:
            if isinstance(error, InputRefused):
                job.warnings.refused(thing.id)
            complain(readable(error.fault, source.path))
            worst = max(worst, REFUSED if isinstance(error, InputRefused) else FAILED)
            if isinstance(thing, TurnFragment):
                job.outputs.outcome(thing.id, summary_of(error))
            continue
        if isinstance(outcome, FragmentOutcome):
            job.prose.expect(outcome)
        elif outcome.dropped:
            left_out = ", ".join(outcome.dropped)
            complain(f"{source.path}: {thing.id} was {outcome.status} without {left_out}")
        if end := job.played.end_before_turn(outcome):
            say(end)
        code = job.played.exit_code(outcome)
        if code != DONE:
            why = f": {outcome.fault.reason}" if outcome.fault is not None else ""
            complain(f"{source.path}: {thing.id} was {outcome.status}{why}")
        worst = max(worst, code)
    return worst


async def _submit(thing: Thing, robot: Robot, patience: Seconds | None) -> FragmentOutcome | BlockOutcome:
    if isinstance(thing, Block):
        return await robot.realize(thing, timeout=patience)
    return await robot.perform(thing, timeout=patience)
