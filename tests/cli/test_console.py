"""`engage console` and the window of `engage demo`, as far as no browser is needed: what is refused, and why."""

import importlib.util
import socket
import sys
from pathlib import Path

import pytest

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.commandline.look import console
from engage_hri.services.commandline.look import window as shown
from engage_hri.services.recording.disk import read
from engage_hri.services.web.tokens import kept_token
from tests.bus.places import free_endpoint
from tests.cli.command import Engage

needs_console = pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="needs the extra `console`")


def test_without_the_extra_the_window_names_it(engage: Engage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "engage_hri.services.console.web.server", raising=False)
    monkeypatch.setitem(sys.modules, "uvicorn", None)

    told = engage("console", "--port", "0")

    assert told.code == 2
    assert "uvicorn is not installed" in told.err
    assert "[console]'" in told.err


@pytest.mark.parametrize("option", ["--you", "--window"])
def test_a_demo_whose_window_is_not_installed_names_the_extra_and_ends(
    engage: Engage, monkeypatch: pytest.MonkeyPatch, option: str
) -> None:
    monkeypatch.setitem(sys.modules, "uvicorn", None)

    told = engage("demo", option)

    assert told.code == 2
    assert told.err.count("\n") == 1
    assert "uvicorn is not installed" in told.err


@needs_console
def test_a_demo_whose_window_cannot_listen_says_so_in_one_line_and_ends(engage: Engage) -> None:
    told = engage("demo", "--you", "--host", "203.0.113.9")

    assert told.code == 3
    assert told.err.count("\n") == 1
    assert "--host takes an address of this machine" in told.err


def test_a_demo_is_recorded(engage: Engage, tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    told = engage("demo", "--virtual-time", "--quiet", "--record", tmp_path / "demo.mcap")

    recording = read(tmp_path / "demo.mcap")
    assert told.code == 0
    assert recording.is_whole
    assert len(recording) > 1000
    assert engage("demo", "--virtual-time", "--record", tmp_path / "demo.mcap").code == 2


def test_a_token_is_made_for_its_owner_alone_and_stays(tmp_path: Path) -> None:
    file = tmp_path / "token"

    assert kept_token(file) == kept_token(file) == file.read_text().strip()
    assert len(kept_token(file)) >= 16
    assert file.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    ("content", "mode", "reason"),
    [("short", 0o600, "no token"), ("with spaces in it", 0o600, "no token"), ("a-good-token-here", 0o644, "others")],
)
def test_a_file_that_holds_no_secret_is_refused(tmp_path: Path, content: str, mode: int, reason: str) -> None:
    file = tmp_path / "token"
    file.write_text(content)
    file.chmod(mode)

    with pytest.raises(InputRefused, match=reason):
        kept_token(file)


@needs_console
def test_a_port_that_is_taken_is_told_with_what_to_do(engage: Engage) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        told = engage("console", "--connect", free_endpoint(), "--port", port)

    assert told.code == 3
    assert f"127.0.0.1:{port}" in told.err
    assert "--port 0" in told.err


def test_a_script_that_is_no_file_is_refused_before_anything_is_opened(engage: Engage) -> None:
    told = engage("console", "--script", "nowhere.json")

    assert (told.code, "nowhere.json" in told.err) == (2, True)


@pytest.mark.parametrize(
    "given", [("--window", "--virtual-time"), ("--you", "--virtual-time"), ("--you", "--no-window")]
)
def test_a_window_that_cannot_be_is_refused(engage: Engage, given: tuple[str, ...]) -> None:
    told = engage("demo", *given)

    assert told.code == 2
    assert "leave out" in told.err


@pytest.mark.parametrize(
    ("terminal", "display", "opens"), [(True, ":0", True), (True, "", False), (False, ":0", False)]
)
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is always a display")
@needs_console
def test_the_demo_opens_a_window_only_where_somebody_sees_it(
    monkeypatch: pytest.MonkeyPatch, terminal: bool, display: str, opens: bool
) -> None:
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)

    assert shown.can_open(terminal) is opens
    monkeypatch.setattr(shown, "NEEDED", ("no_such_package",))
    assert shown.can_open(terminal) is False


@needs_console
@pytest.mark.parametrize(("role", "has_token"), [("observer", False), ("operator", True), ("wizard", True)])
def test_the_address_has_a_token_only_where_the_role_of_the_window_has_rights(
    engage: Engage, monkeypatch: pytest.MonkeyPatch, role: str, has_token: bool
) -> None:
    async def at_once() -> None:
        pass

    monkeypatch.setattr(console, "forever", at_once)
    told = engage("console", "--connect", free_endpoint(), "--port", "0", "--role", role)

    assert told.code == 0
    assert ("?token=" in told.out) is has_token
