"""Command `engage talk`: a robot with voice, ears and a manager of a few rules in this process, to talk with at once.

In a tab of the browser, whose microphone and loudspeaker it takes, or with `--from` on devices.
"""

import asyncio
import inspect
import runpy
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from contextlib import asynccontextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import typer
from msgspec import json
from rich.console import Console

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed, raised_as
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Hub
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.embedding import services
from engage_hri.services.commandline.look.window import can_open, looking_on, seat_refusal, web, windowed
from engage_hri.services.commandline.shell.options import Embodied, Hearing, Kiosk, Shown, Written
from engage_hri.services.commandline.shell.outputs import LOG, Outputs, complain
from engage_hri.services.commandline.shell.process import DONE, first_of, run_until_signal
from engage_hri.services.commandline.shell.roster import ROBOT, complete
from engage_hri.services.commandline.shell.settings import AT_PAGES, RobotConfig
from engage_hri.services.console.follow import following
from engage_hri.services.console.terminal.live import scene_view
from engage_hri.services.control.bases.driver_guard import seen_at, words_of
from engage_hri.services.runtime.installation import extra_command, has_hearing
from engage_hri.services.runtime.service import running

if TYPE_CHECKING:
    from engage_hri.services.client.conversation.talk import Conversation
    from engage_hri.services.client.conversation.tools import ToolSource

RULES = {"en": Path(__file__).with_name("small_talk.py"), "de": Path(__file__).with_name("small_talk_de.py")}
"""Our managers, by language."""
AGAIN: Seconds = 2.0
"""Time from the failure of a manager until it begins again."""
LAST_WORDS: Seconds = 2.0
"""Silence after which all is said, when the sound that was heard is over."""


@dataclass(frozen=True, kw_only=True)
class Options(Written, Embodied, Hearing, Shown):
    """Options of the command. window: None: unless the sound is that of a device, or of a file."""

    manager: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.py",
            help="What the robot says, as `async def talk(robot)`; written for you to change if there is none.",
            show_default="a few rules",
        ),
    ] = None
    model: Annotated[
        str | None,
        typer.Option(
            metavar="MODEL",
            help="A model leads the talk in place of rules: openai:NAME, anthropic:NAME, ollama:NAME, with @ADDRESS "
            "of another server; or http://HOST:PORT/v1#NAME. Its key is in OPENAI_API_KEY, ANTHROPIC_API_KEY, or for "
            "another server in ENGAGE_MODEL_KEY.",
            show_default=False,
        ),
    ] = None
    tools: Annotated[
        list[str] | None,
        typer.Option(
            metavar="TOOLS",
            help="Tools that the model may call: FILE.py, its functions; or an MCP server: its address, or the "
            "command that starts it. May be repeated.",
            show_default=False,
        ),
    ] = None
    prompt: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="What the model is told of its part, a text.", show_default=False),
    ] = None
    window: Annotated[
        bool | None, typer.Option(help="Talk in the browser; with --from it is not.", show_default=False)
    ] = None
    kiosk: Kiosk = False

    @property
    def has_window(self) -> bool:
        """True if one talks in the browser."""
        return (self.kiosk or self.source is None) if self.window is None else self.window


@dataclass(frozen=True)
class ManagerFile:
    """Manager that a file has. phrases: what people may say to it, for a recognizer that knows phrases alone.

    examples: those of them that the page shows.
    """

    talk: Callable[[Robot], Coroutine[Any, Any, None]]
    phrases: tuple[str, ...]
    examples: tuple[str, ...]


def main(options: Options) -> int:
    """Talk until a signal, or until the file that is heard is over."""
    if options.kiosk and not options.has_window:
        raise seat_refusal("--kiosk")
    language = options.read(complete()).hearing.language.replace("_", "-").split("-")[0].lower()
    manager = read_manager(options.manager, language) if options.model is None else led_by_model(options)
    config = options.read(complete(), defaults=tuple(_defaults(manager, options.has_window, language)))
    for lack in _lacks(config):
        complain(lack)
    if options.has_window:
        web()
    with Outputs(options.events, options.feedback) as outputs:
        console = outputs.console(quiet=options.quiet)
        run_until_signal(_talk(config, manager, outputs, console, options))
    return DONE


def read_manager(path: Path | None, language: str = "en") -> ManagerFile:
    """Read a manager from its file, which is written if there is none; None: ours, of a language.

    Raises InputRefused: it cannot be run, or has no `talk`, or there is none of ours. Raises RunFailed: it cannot be
    written.
    """
    if (path is None or not path.exists()) and language not in RULES:
        advice = "--manager FILE.py with rules of yours, as docs/talk.md has them, or --model"
        reason = f"no rules that come with it are in {language!r}, only in {', '.join(RULES)}"
        raise InputRefused(Fault(reason=reason, where="hearing.language", advice=advice))
    if path is not None and not path.exists():
        with raised_as(RunFailed, OSError, path, "it cannot be written"):
            path.write_bytes(RULES[language].read_bytes())
            complain(f"{path} is written: change it, and start again")
    names = _run(path or RULES[language])
    if not inspect.iscoroutinefunction(names.get("talk")):
        advice = "`async def talk(robot)`: it gets a Robot, and talks until it is cancelled"
        raise InputRefused(Fault(reason="there is no talk in it", where=str(path), advice=advice))
    phrases = _phrases(names, "PHRASES", path)
    return ManagerFile(names["talk"], phrases, _phrases(names, "EXAMPLES", path) or phrases)


def led_by_model(options: Options) -> ManagerFile:
    """Make the manager that has a model lead the talk. Raises InputRefused."""
    from engage_hri.services.client.conversation.models import model_of
    from engage_hri.services.client.conversation.talk import Conversation

    if options.manager is not None:
        raise InputRefused(Fault(reason="either --manager or --model leads the talk", where="--model"))
    assert options.model is not None
    model_of(options.model)
    tools = [tool for source in options.tools or () for tool in _tools(source)]
    with raised_as(InputRefused, (OSError, UnicodeDecodeError), options.prompt, "it cannot be read"):
        prompt = options.prompt.read_text(encoding="utf-8") if options.prompt else ""
    named = options.model

    async def talk(robot: Robot) -> None:
        async with (
            Conversation(robot, named, tools=tools, prompt=prompt) as conversation,
            asyncio.TaskGroup() as beside,
        ):
            telling = beside.create_task(_tell_problems(conversation), name="problems")
            known: set[str] = set()
            with robot.worlds() as worlds:
                async for world in worlds:
                    here = {each.id for each in world.people}
                    for person in here - known:
                        conversation.answer(person)
                    known = here
            telling.cancel()

    return ManagerFile(talk, (), ())


async def _tell_problems(conversation: "Conversation") -> None:
    """Tell the terminal what goes wrong with the model and its tools, each problem once until there is another."""
    last = ""
    async for _ in conversation.entries():
        for problem in conversation.problems:
            if problem != last:
                complain(problem)
            last = problem
        conversation.problems.clear()


def _tools(source: str) -> "list[ToolSource]":
    """Find the tools that a source of the command line has. Raises InputRefused."""
    from engage_hri.services.client.conversation.tools import function_tool, server_of

    if not source.endswith(".py") or " " in source:
        return [server_of(source)]
    names = _run(Path(source))
    found = [
        function_tool(each)
        for name, each in names.items()
        if inspect.isfunction(each) and each.__module__ == names["__name__"] and not name.startswith("_")
    ]
    if not found:
        raise InputRefused(Fault(reason="there is no function in it", where=source))
    return list(found)


def _run(path: Path) -> dict[str, Any]:
    """Run a file, for the names that it has then. Raises InputRefused."""
    try:
        return runpy.run_path(str(path))
    except (Exception, SystemExit) as error:  # a file that exits as it is read never gets to talk
        raise InputRefused(
            Fault(reason=f"it cannot be run: {words_of(error)}", where=str(path), advice=seen_at(error))
        ) from error


def _phrases(names: dict[str, Any], name: str, path: Path | None) -> tuple[str, ...]:
    """Phrases that a manager has under a name. Raises InputRefused."""
    try:
        return msgspec.convert(names.get(name, ()), tuple[str, ...])
    except msgspec.ValidationError as error:
        advice = f'{name} = ("what can you do",), with a comma also after a single one'
        raise InputRefused(Fault(reason=f"{name} are no phrases", where=str(path), advice=advice)) from error


def _has(package: str) -> bool:
    return find_spec(package) is not None


def _defaults(manager: ManagerFile, has_window: bool, language: str) -> Iterator[str]:
    """Settings that hold where nothing else is said. language: of the people, who hear it of the robot as well."""
    yield "simulation.human=none"
    if _has("espeakng_loader"):
        yield "control.voice=espeak"
        if language != "en":
            yield f"control.drivers.espeak.language={language}"
    if has_window:
        yield from AT_PAGES
    if _has("pocketsphinx") and manager.phrases and language == "en":
        yield "hearing.recognizer=sphinx"
        yield f"hearing.phrases={json.encode(manager.phrases).decode()}"


def _lacks(config: RobotConfig) -> Iterator[str]:
    """Tell what is missing for a spoken exchange, and what to do."""
    if not has_hearing():
        yield f"nobody is heard, for the extra `hearing` is not installed: {extra_command('hearing')}; you can type"
    elif not config.hearing.recognizer:
        yield "voices are heard, and no words, which people type: --set hearing.recognizer=NAME, of docs/hearing.md"
    if not config.control.voice and not _has("espeakng_loader"):
        yield f"the robot has no voice, for the extra `voice` is not installed: {extra_command('voice')}"


async def _talk(
    config: RobotConfig, manager: ManagerFile, outputs: Outputs, console: Console, options: Options
) -> None:
    """Run all services and the manager on a bus in memory."""
    began = asyncio.get_running_loop().time()
    tell = partial(console.print, highlight=False, markup=False, soft_wrap=True)
    ears = ("hearing",) if has_hearing() else ()
    names = (*ROBOT, *ears, *(("eyes",) if options.has_window else ()), "simulation")

    @asynccontextmanager
    async def page(hub: Hub) -> AsyncIterator[None]:
        async with looking_on(hub, began) as shown:
            shows = windowed(
                shown, options, tell, language=config.hearing.language, examples=manager.examples,
                kiosk=options.kiosk, opens=can_open(console.is_terminal),
            )  # fmt: skip
            async with shows:
                yield

    async with MemoryHub(config.robot, decodes=False) as hub:
        bus = hub.join("console")
        with scene_view(console, config.robot, began, live=False) as show:
            async with (
                following(bus, (show, outputs)),
                running(hub, services(config, *names)) as over,
                page(hub) if options.has_window else nullcontext(),
                connect(hub=hub, name="manager") as robot,
            ):
                if config.hearing.recognizer == "sphinx":
                    tell(f"It understands these alone: {', '.join(config.hearing.phrases)}.")
                await first_of(_managed(manager, robot), _over(over, robot))


async def _managed(manager: ManagerFile, robot: Robot) -> None:
    """Run a manager until it returns. One that fails begins again, and the robot stays."""
    while True:
        talking = asyncio.create_task(manager.talk(robot), name="manager's talk")
        try:
            await asyncio.wait([talking])
        finally:
            talking.cancel()
            await asyncio.wait([talking])
        try:
            talking.result()
        except (Exception, asyncio.CancelledError) as error:  # the latter is of its own, and not ours: we go on
            LOG.debug("the manager has failed", exc_info=error)
            cause = error
            while isinstance(cause, ExceptionGroup):
                cause = cause.exceptions[0]
            place = seen_at(cause)
            complain(
                f"the manager has failed: {words_of(cause)}{place and f', {place}'}; it begins again in {AGAIN:g} s"
            )
            await asyncio.sleep(AGAIN)
        else:
            complain("the manager has returned: the talk is over")
            return


async def _over(over: asyncio.Event, robot: Robot) -> None:
    """Wait until the sound is over, and nobody speaks any more."""
    await over.wait()
    with robot.floor() as floor:
        told = await floor.next(LAST_WORDS)
        while told is not None:
            told = await floor.next(None if told.speeches else LAST_WORDS)
