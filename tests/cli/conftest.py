import pytest

from tests.cli import command


@pytest.fixture
def engage(capsys: pytest.CaptureFixture[str]) -> command.Engage:
    return command.engage(capsys)
