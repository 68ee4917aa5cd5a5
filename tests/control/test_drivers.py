"""Bodies by name: which class is taken, with which settings, and what is said where there is none."""

import sys
from collections.abc import AsyncGenerator, Iterator
from pathlib import Path
from typing import Annotated, Literal

import pytest
from msgspec import Meta, Struct

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.world import World
from engage_hri.services.control.bases import drivers
from engage_hri.services.control.bases.composed import ComposedBody
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import Body, BodyState, MovementAuthority, Progress
from engage_hri.services.control.torso.body import SimulatedBody

PLAIN = '''
import beside
from tests.control.test_drivers import Bare

class Mine(Bare):
    """A driver in a file."""

class Half(Bare):
    pass
'''


class Bare(Body):
    """A body that can do nothing, with one part."""

    def __init__(self) -> None:
        self.capabilities = Capabilities(body="bare", types=(), parts=("head",))

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        return Estimate(behavior=behavior.id, feasible=False)

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        for nothing in ():
            yield nothing

    async def home(self, parts: tuple[str, ...] = ()) -> None: ...

    def state(self) -> BodyState:
        return BodyState(pose=BodyPose(), moving=False)

    def see(self, world: World) -> None: ...


class Pin(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    use: Literal["in", "out"]


class Port(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    device: str = "/dev/null"
    baud: int = 9600
    parity: Literal["none", "even"] | None = None
    stops: Annotated[int, Meta(ge=1, le=2)] = 1
    pins: tuple[Pin, ...] = ()


class Serial(Bare):
    Settings = Port

    def __init__(self, settings: Port) -> None:
        super().__init__()
        self.settings = settings


@pytest.fixture
def file(tmp_path: Path) -> Iterator[Path]:
    path = tmp_path / "my_robot.py"
    path.write_text(PLAIN)
    (tmp_path / "beside.py").write_text("")
    yield path
    sys.path[:] = [place for place in sys.path if place != str(tmp_path)]
    for module in ("engage_hri_body_my_robot", "beside"):
        sys.modules.pop(module, None)


def _write(file: Path, text: str) -> None:
    file.write_text(text)


def _made(config: ControlConfig) -> Body:
    """The body as its driver makes it."""
    return drivers.made(config, is_guarded=False)


async def test_the_simulated_torso_is_the_default():
    assert type(_made(ControlConfig())) is SimulatedBody


async def test_a_class_of_a_file_may_import_what_lies_beside_it(file: Path):
    body = _made(ControlConfig(body=f"{file}:Mine"))

    assert (type(body).__name__, body.capabilities.body) == ("Mine", "bare")
    assert type(_made(ControlConfig(body=f"{file}:Mine"))) is type(body)


async def test_a_driver_is_made_with_its_settings():
    name = f"{__name__}:Serial"
    body = _made(ControlConfig(body=name, drivers={"Serial": {"baud": 4800}}))

    assert isinstance(body, Serial)
    assert body.settings == Port(baud=4800)


def _forget_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another test may have named its driver so, and its folder stays on Python's path."""
    monkeypatch.delitem(sys.modules, "my_robot", raising=False)
    monkeypatch.setattr(sys, "path", [each for each in sys.path if not Path(each, "my_robot.py").exists()])


async def test_a_module_may_lie_in_the_current_folder(file: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(file.parent)
    _forget_others(monkeypatch)

    assert type(_made(ControlConfig(body="my_robot:Mine"))).__name__ == "Mine"
    sys.modules.pop("my_robot")


def test_a_function_may_make_the_body(file: Path):
    file.write_text(PLAIN + "\ndef make():\n    return Mine()\n")

    assert type(_made(ControlConfig(body=f"{file}:make"))).__name__ == "Mine"


async def test_a_subclass_of_a_configured_body_with_a_constructor_of_its_own_is_made_by_that(file: Path):
    _write(
        file,
        "from engage_hri.services.control.torso.body import SimulatedBody\n"
        "class Twin(SimulatedBody):\n    def __init__(self):\n        super().__init__()\n",
    )

    assert isinstance(_made(ControlConfig(body=str(file))), SimulatedBody)


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("{file}", PLAIN, "which class of it? (it has Half, Mine: "),
        ("{file}:Mien", PLAIN, "no class 'Mien' in it (do you mean Mine?)"),
        ("{file}:beside", PLAIN, "'beside' in it is no class"),
        ("{file}:Mine", "import nowhere_at_all", "No module named 'nowhere_at_all' (see "),
        ("{file}:Mine", "class Mine(:", "SyntaxError"),
        ("{file}:Mine", "raise SystemExit(4)", "SystemExit: 4 (see "),
        ("{file}:Mine", "1 / 0", "my_robot.py, line 1"),
        ("{file}:Mine", "from engage_hri import Body\nclass Mine(Body): ...", "Mine lacks estimate, home, perform"),
        ("{file}:Mine", "class Mine:\n    def __init__(self, port): ...", "missing 1 required positional argument"),
        ("{file}:Mine", "class Mine: ...", "it makes a Mine, and no body"),
        ("{file}:Mine", PLAIN + "    def __init__(self): ...\nMine = Half", "no `capabilities`"),
        ("{file}.py", PLAIN, "no file"),
        ("nowhere:Body", "", "is the package installed here?"),
        ("simulatd", "", "do you mean simulated?"),
        ("head=", "", "names no body"),
        (f"neck={__name__}:Bare", "", "it has no part neck (it has head)"),
    ],
)
def test_what_is_no_body_is_refused_with_what_to_do(file: Path, name: str, text: str, reason: str):
    file.write_text(text)
    with pytest.raises(InputRefused) as refused:
        drivers.made(ControlConfig(body=name.format(file=file)))

    assert reason in str(refused.value)
    assert "engage_hri_body_my_robot" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "settings", "reason"),
    [
        (
            "Serial",
            {"bauds": 1},
            "control.drivers.Serial: no setting bauds (known are device, baud, parity, stops, pins)",
        ),
        ("Serial", {"baud": "fast"}, "control.drivers.Serial.baud: Expected `int`, got `str`"),
        ("Serial", {"parity": "evn"}, "control.drivers.Serial.parity: 'evn' is none of 'none', 'even'"),
        ("Serial", {"stops": 3}, "control.drivers.Serial.stops: Expected `int` <= 2"),
        ("Serial", {"pins": [{"use": "in"}, {"use": "on"}]}, "Serial.pins[1].use: 'on' is none of 'in', 'out'"),
        ("Serial", {"pins": [{"uses": "in"}]}, "Serial.pins[0]: unknown key `uses`; do you mean `use`?"),
        (
            "Bare",
            {"baud": 1},
            "control.drivers.Bare: this driver has no settings, and baud are given (leave them out)",
        ),
    ],
)
async def test_wrong_settings_are_refused_by_their_key(name: str, settings: dict[str, object], reason: str):
    with pytest.raises(InputRefused) as refused:
        drivers.made(ControlConfig(body=f"{__name__}:{name}", drivers={name: settings}))

    assert reason in str(refused.value)


@pytest.mark.parametrize("does", [drivers.check, drivers.made])
async def test_a_voice_is_refused_as_a_voice_and_a_body_of_the_same_name_as_a_body(does):
    with pytest.raises(InputRefused, match=r"^voice nosuch: no voice 'nosuch' \(known are espeak, silent; or NAME"):
        does(ControlConfig(voice="nosuch"))
    with pytest.raises(InputRefused, match=r"^body nosuch: no body 'nosuch' \(known are espeak"):
        does(ControlConfig(body="nosuch"))
    with pytest.raises(InputRefused, match=r"^voice .*: it has no part voice"):
        drivers.made(ControlConfig(voice=f"{__name__}:Bare"))


async def test_a_voice_takes_the_place_of_the_one_of_the_body():
    body = drivers.made(ControlConfig(body="simulated", voice="simulated"))

    assert isinstance(body, ComposedBody)
    assert body.capabilities.parts.count("voice") == 1


async def test_settings_by_the_name_of_the_class_or_of_the_file_and_no_others(file: Path):
    _write(file, PLAIN + SETTING)
    for name in ("Set", "my_robot"):
        body = _made(ControlConfig(body=str(file), drivers={name: {"port": "/dev/x"}}))
        assert body.settings.port == "/dev/x"  # type: ignore[attr-defined]
    with pytest.raises(InputRefused, match=r"control\.drivers\.Set: no setting prot \(known are port\)"):
        drivers.made(ControlConfig(body=str(file), drivers={"Set": {"prot": "/dev/x"}}))
    with pytest.raises(InputRefused, match=r"drivers\.Sett: no driver of this name .* \(do you mean Set\?\)"):
        drivers.made(ControlConfig(body=str(file), drivers={"Sett": {"port": "/dev/x"}}))
    drivers.made(ControlConfig(body=str(file), drivers={"espeak": {"file": "a.wav"}, "Other": {"port": "/dev/x"}}))


SETTING = """
import msgspec
del Mine, Half

class Settings(msgspec.Struct, frozen=True):
    port: str = "/dev/null"

class Set(Bare):
    Settings = Settings

    def __init__(self, settings):
        super().__init__()
        self.settings = settings
"""
