"""Command `engage console`: the window, a page in the browser that shows a running robot."""

from dataclasses import dataclass
from typing import Annotated

import typer

from engage_hri.services.commandline.config import Config
from engage_hri.services.commandline.options import Connected
from engage_hri.services.commandline.process import DONE, forever, run_until_signal, unique_name

PORT = 8137


@dataclass(frozen=True, kw_only=True)
class Options(Connected):
    port: Annotated[
        int, typer.Option(metavar="PORT", min=0, max=65535, help="Port of the page; 0: any that is free.")
    ] = PORT
    browser: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False


def main(options: Options) -> int:
    config = options.load()
    run_until_signal(_show(options, config))
    return DONE


async def _show(options: Options, config: Config) -> None:
    from engage_hri.services.console.web.server import application, serving
    from engage_hri.services.console.web.service import window

    async with await options.open(config.bus, "viewer") as hub:
        bus = hub.join(unique_name("console"), "observer")
        async with window(bus) as shown:
            bus.declare_alive()
            async with serving(application(shown, ("127.0.0.1", "localhost")), "127.0.0.1", options.port) as port:
                print(f"http://127.0.0.1:{port}/", flush=True)
                await forever()
