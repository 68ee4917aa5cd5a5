"""A Ctrl-C while `engage` is still being loaded. It is sent at an import, so the instant is always the same."""

import subprocess
import sys

import pytest

HOOK = """
import os, signal, sys
sys.modules.pop("signal", None)  # a console script has not loaded it, and our `import os, signal` has

class Interrupts:
    def find_spec(self, name, path=None, target=None):
        if name == {at!r}:
            os.kill(os.getpid(), {number})

sys.meta_path.insert(0, Interrupts())
from engage_hri.services.__main__ import main
main([{command!r}, "--help"])
"""
LOADED = """
import os, sys  # Python itself has loaded both, but for -S
before = set(sys.modules)
import engage_hri.services.__main__
print(sorted(set(sys.modules) - before))
"""


@pytest.mark.parametrize("command", ["doctor", "demo", "play", "watch"])
@pytest.mark.parametrize(
    "at",
    ["signal", "typer", "engage_hri.services.commandline", "engage_hri.services.commandline.app"],
)
def test_a_ctrl_c_at_any_import_ends_the_command_with_130_and_without_a_word(at: str, command: str) -> None:
    ended = interrupted(at, command, 2)

    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "")


def test_a_sigterm_meanwhile_ends_it_with_143() -> None:
    ended = interrupted("engage_hri.services.commandline.app", "doctor", 15)

    assert (ended.returncode, ended.stdout, ended.stderr) == (143, "", "")


def test_nothing_but_three_small_modules_of_ours_is_loaded_before_ctrl_c_is_seen_to() -> None:
    """What is loaded before is out of our hands: Python itself would print a traceback."""
    program = f"import sys; sys.path[:] = {sys.path!r}{LOADED}"
    loaded = subprocess.run([sys.executable, "-S", "-c", program], capture_output=True, text=True, check=False)

    assert loaded.stdout == "['engage_hri', 'engage_hri.services', 'engage_hri.services.__main__']\n", loaded.stderr


def interrupted(at: str, command: str, number: int) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-c", HOOK.format(at=at, command=command, number=number)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
