"""The command line. Options are declared here; what they do is in `services/commandline`, loaded only when called."""

import sys
from pathlib import Path
from typing import Annotated, Literal, NoReturn

import typer

from engage_hri.services.commandline.ends import exit_code
from engage_hri.services.commandline.roster import ServiceName

app = typer.Typer(
    name="engage",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Files = Annotated[
    list[Path], typer.Argument(metavar="FILE...", help="EBML turn fragments or BML blocks (XML), or JSON of either.")
]
ConfigFile = Annotated[
    Path | None, typer.Option("--config", metavar="FILE", help="TOML; see docs/configuration.md.", show_default=False)
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="One setting, stronger than the file: realizer.late=1."),
]
Events = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Write connection events as JSON lines; - for standard output.")
]
Feedback = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Write the blocks' feedback as JSON lines, into FILE.xml as XML; - for standard output.",
    ),
]
VirtualTime = Annotated[bool, typer.Option("--virtual-time", help="As fast as it goes, on a clock that jumps.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Robot = Annotated[
    str | None, typer.Option(metavar="NAME", help="The robot's namespace on the bus.", show_default="robot")
]
Connect = Annotated[
    list[str] | None, typer.Option(metavar="ENDPOINT", help="Zenoh endpoint to connect to; may be repeated.")
]
Listen = Annotated[
    list[str] | None, typer.Option(metavar="ENDPOINT", help="Zenoh endpoint to listen on; may be repeated.")
]
Human = Annotated[
    Literal["appendix-b", "misplacing", "listening", "stochastic", "attentive"] | None,
    typer.Option(help="How the simulated human behaves: docs/commands.md tells of each.", show_default=False),
]
Resolution = Annotated[
    Literal["table", "object"] | None,
    typer.Option(help="How finely perception tells what people look at."),
]
Seed = Annotated[int | None, typer.Option(metavar="N", help="Of all chance in the simulated body.")]
Strict = Annotated[bool, typer.Option("--strict", help="Exit 2 if there was any warning.")]
WorldFile = Annotated[
    Path | None, typer.Option("--world", metavar="FILE", help="JSON of the entities; without it the tangram table.")
]


def _print_version(asked: bool) -> None:
    if asked:
        from engage_hri.services.runtime.service import installed_version

        print(f"engage {installed_version()}")
        raise typer.Exit


@app.callback()
def engage(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """The engagement layer for robots that talk with people."""


@app.command()
def demo(
    virtual_time: VirtualTime = False,
    seed: Seed = None,
    human: Human = None,
    resolution: Resolution = None,
    events: Events = None,
    feedback: Feedback = None,
    config: ConfigFile = None,
    settings: Settings = None,
    quiet: Quiet = False,
) -> None:
    """Watch a robot and a person make a tangram: everything in this one process."""
    from engage_hri.services.commandline import demo
    from engage_hri.services.commandline import run as run_

    where = run_.Where(config, settings=(*demo.choices(seed, human, resolution), *(settings or ())))
    raise typer.Exit(demo.main(demo.Options(where, virtual_time, events, feedback, quiet)))


@app.command()
def up(
    task: Annotated[bool, typer.Option("--task", help="Also run the tangram task, and end when it ends.")] = False,
    seed: Seed = None,
    human: Human = None,
    resolution: Resolution = None,
    events: Events = None,
    feedback: Feedback = None,
    robot: Robot = None,
    connect: Connect = None,
    listen: Listen = None,
    config: ConfigFile = None,
    settings: Settings = None,
    quiet: Quiet = False,
) -> None:
    """Run the services as separate processes on this machine; Ctrl-C stops them all."""
    from engage_hri.services.commandline import demo, run, up

    chosen = (*demo.choices(seed, human, resolution), *(settings or ()))
    where = run.Where(config, robot, tuple(connect or ()), tuple(listen or ()), chosen)
    raise typer.Exit(up.main(up.Options(where, task, events, feedback, quiet)))


@app.command()
def run(
    service: Annotated[ServiceName, typer.Argument(help="Which service.", show_default=False)],
    robot: Robot = None,
    connect: Connect = None,
    listen: Listen = None,
    config: ConfigFile = None,
    settings: Settings = None,
    attended: Annotated[bool, typer.Option("--attended", hidden=True)] = False,
) -> None:
    """Run one service, on whatever machine this is, until Ctrl-C."""
    from engage_hri.services.commandline import run

    where = run.Where(config, robot, tuple(connect or ()), tuple(listen or ()), tuple(settings or ()))
    raise typer.Exit(run.main(service, where, attended))


@app.command()
def play(
    files: Files,
    embedded: Annotated[
        bool, typer.Option("--embedded", help="In a private system with a simulated body, instead of a running one.")
    ] = False,
    world: WorldFile = None,
    virtual_time: VirtualTime = False,
    at: Annotated[
        str | None,
        typer.Option(metavar="S,S,...", help="When to submit each file, seconds; else one after the other."),
    ] = None,
    events: Events = None,
    feedback: Feedback = None,
    feedback_format: Annotated[
        Literal["json", "xml"] | None, typer.Option(help="Form of the feedback, whatever its file is called.")
    ] = None,
    outcomes: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write what became of each fragment, for a language model; - as above."),
    ] = None,
    human: Annotated[
        Literal["attentive", "none"],
        typer.Option(help="With --embedded: one who follows the robot's gaze and answers, or nobody who does."),
    ] = "attentive",
    strict: Strict = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print each sync point, too.")] = False,
    robot: Robot = None,
    connect: Connect = None,
    config: ConfigFile = None,
    settings: Settings = None,
    quiet: Quiet = False,
) -> None:
    """Perform turn fragments and BML blocks. Exit 0 done, 2 input refused, 3 failed while running."""
    from engage_hri.services.commandline import play, run

    where = run.Where(config, robot, tuple(connect or ()), settings=tuple(settings or ()))
    options = play.Options(
        tuple(files), where, embedded, world, virtual_time, at, events, feedback, quiet, feedback_format, outcomes,
        human == "attentive", verbose, strict,
    )  # fmt: skip
    raise typer.Exit(play.main(options))


@app.command()
def plan(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A BML block (XML or JSON).", show_default=False)],
    format: Annotated[
        Literal["text", "json", "dot", "pnml"], typer.Option("--format", help="How to print the net.")
    ] = "text",
    world: WorldFile = None,
    strict: Strict = False,
    config: ConfigFile = None,
    settings: Settings = None,
) -> None:
    """Check a block and print its Petri net and predicted schedule. Nothing moves."""
    from engage_hri.services.commandline import plan, run

    where = run.Where(config, settings=tuple(settings or ()))
    raise typer.Exit(plan.main(file, format, world, where, strict=strict))


@app.command()
def bml(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="A turn fragment or a BML block (XML), or JSON of one or several.")
    ],
    dialect: Annotated[Literal["bml-1.0", "draft"], typer.Option("--dialect", help="How to spell it.")] = "bml-1.0",
    core: Annotated[
        bool, typer.Option("--core", help="Without connection events and all else that only Engage knows.")
    ] = False,
    world: WorldFile = None,
    config: ConfigFile = None,
    settings: Settings = None,
) -> None:
    """Print the BML that a turn fragment becomes, or a block in another dialect. Nothing moves."""
    from engage_hri.services.commandline import bml, run

    where = run.Where(config, settings=tuple(settings or ()))
    raise typer.Exit(bml.main(file, dialect, core, world, where))


@app.command()
def explain(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="EBML turn fragment (XML), or JSON of one or several.")
    ],
    format: Annotated[
        Literal["text", "json"], typer.Option("--format", help="A table for each reference, or a list of all pairs.")
    ] = "text",
    world: WorldFile = None,
    config: ConfigFile = None,
    settings: Settings = None,
) -> None:
    """Tell why each object reference is made as it is: all gestures with all phrases. Nothing moves."""
    from engage_hri.services.commandline import explain, run

    where = run.Where(config, settings=tuple(settings or ()))
    raise typer.Exit(explain.main(file, format, world, where))


@app.command()
def tool(
    format: Annotated[
        Literal["anthropic", "openai", "openai-chat"],
        typer.Option("--format", help="Of the Messages, Responses, or Chat Completions API."),
    ] = "anthropic",
    world: Annotated[
        Path | None, typer.Option("--world", metavar="FILE", help="JSON of the entities: only their ids are allowed.")
    ] = None,
) -> None:
    """Print the tool by which a language model speaks through the robot, for its API."""
    from engage_hri.services.commandline import tool

    raise typer.Exit(tool.main(format, world))


@app.command()
def simulate(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where the results go.", show_default=False)],
    sessions: Annotated[int, typer.Option(metavar="N", min=1, help="In each condition.")] = 20,
    seed: Annotated[int, typer.Option(metavar="S", help="Session k has the seed S + k, in each condition.")] = 0,
    condition: Annotated[
        list[str] | None,
        typer.Option(
            metavar="operational|degraded-generation|degraded-recognition",
            help="Repeatable; else all three.",
        ),
    ] = None,
    human: Annotated[
        Literal["stochastic", "listening", "appendix-b", "misplacing", "table-2-1"],
        typer.Option(help="How the simulated human behaves; table-2-1: two people and no robot."),
    ] = "stochastic",
    resolution: Resolution = None,
    jobs: Annotated[
        int | None, typer.Option(metavar="J", min=1, help="Processes; as many as processors.", show_default=False)
    ] = None,
    limit: Annotated[
        float,
        typer.Option(metavar="SECONDS", min=1, max=86_400, help="Break a session off after so long in its own time."),
    ] = 3600.0,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the results that are there.")] = False,
    config: ConfigFile = None,
    settings: Settings = None,
    quiet: Quiet = False,
) -> None:
    """Play many sessions in virtual time, and compare the conditions of the study. Exit 3 if one did not finish."""
    from engage_hri.services.commandline import run
    from engage_hri.services.commandline import simulate as simulate_

    where = run.Where(config, settings=tuple(settings or ()))
    options = simulate_.Options(
        sessions, seed, out, tuple(condition or ()), human, resolution, jobs, limit, overwrite, where, quiet
    )
    raise typer.Exit(simulate_.main(options))


@app.command("play-sessions", hidden=True)
def play_sessions() -> None:
    """Play the sessions that standard input orders: a child of `engage simulate`."""
    from engage_hri.services.commandline import session

    raise typer.Exit(session.serve())


@app.command()
def watch(
    json: Annotated[bool, typer.Option("--json", help="JSON lines instead of text.")] = False,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="WHAT", help="events, statistics, feedback, head or faults; may be repeated."),
    ] = None,
    actor: Annotated[str, typer.Option(metavar="ID", help="Only what goes on with this person.")] = "",
    kind: Annotated[
        list[str] | None, typer.Option(metavar="KIND", help="Only these connection events; may be repeated.")
    ] = None,
    robot: Robot = None,
    connect: Connect = None,
    config: ConfigFile = None,
) -> None:
    """Follow a running system: connection events, the open ones first, feedback, claims on the head, as they come."""
    from engage_hri.services.commandline import run, watch

    where = run.Where(config, robot, tuple(connect or ()), ())
    raise typer.Exit(watch.main(where, json, watch.Wanted(tuple(only or ()), actor, tuple(kind or ()))))


@app.command()
def hostile(
    runs: Annotated[int, typer.Option(metavar="N", min=1, help="Attacks, each with the next seed.")] = 20,
    seed: Annotated[int, typer.Option(metavar="S", help="Of the first.")] = 0,
    seconds: Annotated[float, typer.Option(min=1, max=3600, help="How long each lasts, in its own time.")] = 20.0,
    only: Annotated[
        list[str] | None, typer.Option(metavar="messages|requests|body", help="Repeatable; else all three.")
    ] = None,
    body: Annotated[str, typer.Option(metavar="MODULE:CLASS", help="Your own body, in place of the lying one.")] = "",
    config: ConfigFile = None,
    settings: Settings = None,
    quiet: Quiet = False,
) -> None:
    """Attack the whole robot, in memory and virtual time only. Exit 1 if anything came of it that should not have."""
    from engage_hri.services.commandline import hostile as hostile_
    from engage_hri.services.commandline import run

    where = run.Where(config, settings=tuple(settings or ()))
    raise typer.Exit(hostile_.main(hostile_.Options(where, seed, runs, seconds, tuple(only or ()), body, quiet)))


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run a command. Bad input is one line on standard error, never a traceback; a bug of ours is a traceback."""
    sys.exit(exit_code(app, arguments))
