"""Which tests `make test` leaves to `make test-long`, and why.

People run `make test` after each small change, and wait for it. It must take minutes, so most of it runs in one
process and in virtual time. The long share is the rest: the operating system, sockets, browsers and packages.
They wait for other processes, and few changes of the code touch what they guard. CI runs them for each change.

`conftest.py` marks the long share with `long`: each test that is marked `real_time`, and each in a file or folder
below. A test that is not long and starts a process fails, unless its file is in `SHORT_PROCESSES`. So no test of real
processes makes `make test` slow unseen.
"""

import subprocess
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

TESTS = Path(__file__).parent

LONG = {
    "lab": "several machines on this one: it needs root, and waits for routers that start",
    "test_wheel.py": "it builds the wheel and installs it in environments of their own",
    "docs/test_site.py": "it builds the whole site",
    "mutants": "each test runs pytest on a copy of the tree; it guards a tool and not the robot",
    "cli/test_early_ctrl_c.py": "each test starts `engage` and interrupts it while it loads",
    "control/test_espeak.py": "each of its bodies starts eSpeak NG as a process",
    "control/test_own_synthesizer.py": "a synthesizer is a process",
    "control/test_synthesizer_that_fails.py": "a synthesizer is a process",
    "control/test_voice_outlets.py": "loudspeakers are programs of the system",
    "control/test_voice_recognized.py": "eSpeak NG speaks, and a recognizer listens",
    "recording/test_pictures.py": "it draws pictures and films of recordings, and has ffmpeg write them",
    "control/mujoco/test_described_contract.py": "another robot on the driver that test_mujoco_contract.py has",
    "scenario/test_raw_perception.py": "whole tasks seen by cameras; recognition/ has the parts",
    "recording/test_commands_on_damage.py": "each command on each damage; test_damage.py has what reading finds",
    "scenario/test_on_physics.py": "a whole task in physics; test_appendix_b.py has it on the simulated torso",
    "scenario/test_appendix_b_varied.py": "six more whole tasks; test_appendix_b.py has that of the thesis",
    "growth": "half a day of a robot in virtual time",
    "cli/test_check_body.py": "each test checks a whole body by the command; control/ has the laws themselves",
    "access/test_table.py": "each row of the table over real sockets; test_denials.py has what a router tells",
    "recording/test_conditions.py": "a whole session with conditions",
    "recording/test_in_the_window.py": "a whole session in the window, compared at each jump",
    "recording/test_annotation_files.py": "a whole session as files for ELAN and Praat, and a film",
    "recording/test_tiers_at_random.py": "a whole session against an oracle; test_tiers.py has the rules",
    "recording/test_window_oracle.py": "a whole session against an oracle; test_player.py has the rules",
    "simulation/test_stochastic_task.py": "whole tasks with a person drawn by chance",
    "test_skips.py": "each test runs pytest; it guards a tool and not the robot",
    "control/mujoco/test_pictures.py": "it draws films of physics, and has ffmpeg write them",
}
"""Files and folders whose tests are long though they are not marked `real_time`, with the reason."""

SMOKE = "cli/test_smoke.py"
"""The one file of real processes that stays short: without it a robot that does not start at all would pass."""

SHORT_PROCESSES: dict[str, str] = {
    SMOKE: "it is what real processes do at the least",
    "test_architecture.py": "it asks git for the names of files",
    "test_shares.py": "it asks make and pytest, and no robot",
    "test_public_names.py": "it asks Python once what an import loads",
    "cli/test_demo.py": "it plays a demo on the virtual clock in one process, for all its tests",
    "cli/test_formats.py": "terminals of other encodings need a process, which prints a page and ends",
    "cli/test_loading.py": "it asks Python once how a command is loaded",
    "control/test_liars.py": "it asks pytest once, and no robot",
    "control/test_offers.py": "it asks Python once what a package on the path offers",
    "docs/test_changes.py": "it asks towncrier thrice, and no robot",
    "recording/test_annotation_files.py": "it has ffmpeg write a film of an instant",
    "runtime/test_installation.py": "it asks Python once where a package is",
}
"""Files of the short share that may start processes, with the reason."""


def is_long(path: Path, *, real_time: bool) -> bool:
    """Whether a test in this file belongs to the long share."""
    name = path.relative_to(TESTS).as_posix()
    return name != SMOKE and (real_time or any(name == each or name.startswith(f"{each}/") for each in LONG))


def _is_importing() -> bool:
    """Whether whoever calls this does so while a module is loaded."""
    return any(frame.f_code.co_filename.startswith("<frozen importlib") for frame, _ in traceback.walk_stack(None))


class Started:
    """Counts processes that are started from here, by `subprocess` or by asyncio, which uses it."""

    def __init__(self) -> None:
        self.number = 0

    def watching(self, patch: pytest.MonkeyPatch) -> None:
        """Count from now on, until the patch is undone.

        What a library starts while it is imported is not counted: MuJoCo's glfw does so, in whichever test loads it.
        """
        begin = subprocess.Popen.__init__

        def counted(process: "subprocess.Popen[Any]", *arguments: Any, **options: Any) -> None:
            self.number += not _is_importing()
            begin(process, *arguments, **options)

        patch.setattr(subprocess.Popen, "__init__", counted)

    def guarded(self, item: pytest.Item) -> Iterator[None]:
        """Fail if a test of the short share has started a process meanwhile."""
        before = self.number
        yield
        name = item.path.relative_to(TESTS).as_posix()
        if self.number > before and item.get_closest_marker("long") is None and name not in SHORT_PROCESSES:
            pytest.fail(f"it starts a process: mark it `real_time`, or list {name} in tests/long_share.py")


class Left:
    """Tells in one line how many tests `-m "not long"` has left out, also where only workers know it."""

    def __init__(self, config: pytest.Config) -> None:
        self.number, self._asked = 0, "long" in config.option.markexpr

    def pytest_deselected(self, items: list[pytest.Item]) -> None:
        if self._asked:
            self.number += sum(item.get_closest_marker("long") is not None for item in items)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if hasattr(session.config, "workeroutput"):
            session.config.workeroutput["left"] = self.number

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """Each worker has the same tests."""
        self.number = max(self.number, getattr(node, "workeroutput", {}).get("left", 0))

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if self.number:
            terminalreporter.write_line(f"{self.number} tests are left to `make test-long` (tests/long_share.py)")
