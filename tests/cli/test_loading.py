"""What a process of `engage` does while it loads, and no longer."""

import subprocess
import sys

WATCHED = """
import gc

from engage_hri.services.commandline.talk import plan

garbage_is_searched_for = []
garbage_is_searched_for.append(gc.isenabled())


def main(options):
    garbage_is_searched_for.append(gc.isenabled())
    print(garbage_is_searched_for, gc.get_freeze_count() > 10_000)
    return 0


plan.main = main

from engage_hri.services.commandline import app

loaded, app.command = app.command, lambda name: garbage_is_searched_for.append(gc.isenabled()) or loaded(name)

from engage_hri.services.__main__ import main as engage

engage(["plan", "block.xml"])
"""


def test_garbage_is_searched_for_before_and_after_a_command_is_loaded_but_not_meanwhile() -> None:
    ended = subprocess.run([sys.executable, "-c", WATCHED], capture_output=True, text=True, check=False)

    assert (ended.stdout, ended.stderr, ended.returncode) == ("[True, False, True] True\n", "", 0)
