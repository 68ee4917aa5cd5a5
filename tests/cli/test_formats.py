"""Bytes of a format are UTF-8 whatever the terminal's encoding is; what is read may come from standard input."""

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from lxml import etree

from engage_hri.services.commandline.shell import outputs
from tests.cli.command import Engage

WORDS = "Grüße, Привет"
BLOCK = f"<bml id='b'><speech id='s'><text>{WORDS}</text></speech></bml>"
CALL = {"turn_status": "full", "parts": [{"say": WORDS}]}
ENCODINGS = ("ascii", "cp1252", "latin-1", "utf-16")


def test_a_format_is_written_as_utf8_on_a_stream_of_any_encoding(monkeypatch: pytest.MonkeyPatch) -> None:
    for encoding in ENCODINGS:
        raw = io.BytesIO()
        monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding=encoding))

        outputs.print_format(WORDS)
        outputs.standard_output(encoding=outputs.FORMAT).write(f"{WORDS}\n")

        assert raw.getvalue().decode() == f"{WORDS}\n" * 2


@pytest.mark.parametrize("encoding", ENCODINGS[:2])
@pytest.mark.parametrize(
    "command",
    [("bml",), ("plan", "--format", "json"), ("plan", "--format", "pnml")],
)
def test_commands_write_formats_as_utf8(tmp_path: Path, encoding: str, command: tuple[str, ...]) -> None:
    done = subprocess.run(
        (sys.executable, "-m", "engage_hri", command[0], "-", *command[1:]), input=BLOCK.encode(), cwd=tmp_path,
        env={**os.environ, "PYTHONIOENCODING": encoding}, capture_output=True, check=True,
    )  # fmt: skip

    if "json" in command:
        assert json.loads(done.stdout.decode())
    else:
        etree.fromstring(done.stdout)


@pytest.mark.parametrize("command", ["play", "bml", "plan"])
def test_standard_input_is_named_where_it_is_wrong(
    engage: Engage, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"hello")))

    result = engage(command, "-", *(("--embedded",) if command == "play" else ()))

    assert (result.code, result.err.startswith("standard input: neither XML nor JSON")) == (2, True)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-32"])
def test_json_of_a_windows_shell_is_read(engage: Engage, tmp_path: Path, encoding: str) -> None:
    file = tmp_path / "call.json"
    file.write_bytes(json.dumps(CALL, ensure_ascii=False).encode(encoding))

    result = engage("play", file, "--embedded", "--virtual-time", "--quiet", "--outcomes", "-")

    assert json.loads(result.out)["said"] == WORDS
