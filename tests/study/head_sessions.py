"""Sessions of the whole robot in virtual time, and what its head did in them.

python -m tests.study.head_sessions --seeds 20 --from 900 [--people 3] [--set generation.policies_off='["aversion"]']
"""

import argparse
import asyncio
from functools import reduce
from operator import add

from engage_hri.schemas import keys
from engage_hri.schemas.messages import Message
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.embedding import services
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.commandline.shell.roster import PLAY
from engage_hri.services.runtime.configuration import read
from engage_hri.services.runtime.service import Service, running
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.study.robot_head import HeadFindings, findings


def settings_of(seed: int, people: int = 0) -> tuple[str, ...]:
    """Settings of a session. people: of a party; 0: one person lays the tangram."""
    who = (
        ("simulation.human=party", f"simulation.people={people}", "collaboration.mode=host")
        if people
        else ("simulation.human=stochastic", "collaboration.mode=task", f"control.variability.seed={seed}")
    )
    return (*who, f"simulation.seed={seed}", "recognition.gaze_resolution=object")


def session(seed: int, people: int = 0, settings: tuple[str, ...] = ()) -> list[Message]:
    """Play a session to its end: all that was on the bus. May be called where no loop runs."""
    config = read(Config, settings=(*settings_of(seed, people), *settings))
    return run_virtual(played(config))


async def played(config: Config, **instead: Service) -> list[Message]:
    """All that is on the bus until the task is over. instead: services in place of those with these names."""
    async with MemoryHub(config.robot, decodes=False) as hub:
        with hub.join("annotator").subscribe(keys.EVERYTHING, capacity=10**7) as inbox:
            async with running(hub, services(config, *PLAY) | instead) as over:
                await over.wait()
                await asyncio.sleep(5.0)  # answers to the goodbye
            messages = []
            while len(inbox) and (received := await inbox.next()):
                messages.append(received.message)
    return messages


def sum_of(found: list[HeadFindings]) -> HeadFindings:
    return reduce(add, found)


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument("--seeds", type=int, default=5)
    options.add_argument("--from", type=int, default=900, dest="first")
    options.add_argument("--people", type=int, default=0)
    options.add_argument("--set", action="append", default=[], dest="settings")
    given = options.parse_args()
    found = []
    for seed in range(given.first, given.first + given.seeds):
        found.append(findings(session(seed, given.people, tuple(given.settings))))
        print(seed, found[-1].told(), flush=True)
    print("all", sum_of(found).told())


if __name__ == "__main__":
    main()
