import re
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.bus.config import BusConfig, Mode, mode_of
from engage_hri.services.commandline.robot import up
from engage_hri.services.commandline.shell.config import Config, load
from engage_hri.services.commandline.shell.roster import NAMES, service
from engage_hri.services.commandline.shell.settings import ELSEWHERE, RobotConfig
from engage_hri.services.commandline.study import simulate
from engage_hri.services.runtime.configuration import read
from engage_hri.services.tangram.people.config import HumanKind

ROOT = Path(__file__).parents[2]


def test_every_key_says_what_it_means() -> None:
    page = (ROOT / "docs" / "configuration.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| `(.+?)` \| (?:`.+?`|required) \| (.*) \|$", page, re.MULTILINE)

    assert len(rows) == len(re.findall(r"^\| `", page, re.MULTILINE)) > 50
    assert [name for name, _, meaning in rows if len(meaning.split()) < 2] == []


def test_without_a_file_everything_has_its_default() -> None:
    assert load() == Config()


def test_a_setting_is_stronger_than_the_file_and_the_file_than_a_default(tmp_path: Path) -> None:
    path = tmp_path / "engage.toml"
    path.write_text(
        "[bus]\nrobot = 'file'\n[recognition]\ngaze_resolution = 'object'\n[control.variability]\nseed = 3\n"
    )

    config = load(
        path,
        settings=["bus.robot=setting", "control.variability.noise=0.1"],
        defaults=["recognition.gaze_resolution=table", "generation.barge_in=0.7"],
    )

    assert config.robot == "setting"
    assert config.recognition.gaze_resolution == "object"
    assert config.generation.barge_in == 0.7
    assert (config.control.variability.seed, config.control.variability.noise) == (3, 0.1)


def test_a_robot_passes_over_the_sections_of_others_but_not_over_what_nobody_has(tmp_path: Path) -> None:
    path = tmp_path / "engage.toml"
    path.write_text("[bus]\nrobot = 'file'\n[simulation]\nseed = 3\n[collaboration]\nmode = 'task'\n")

    found = read(RobotConfig, path, settings=["simulation.human=none"], elsewhere=ELSEWHERE)
    assert found == RobotConfig(bus=BusConfig(robot="file"))
    assert {*ELSEWHERE} == {*Config.__struct_fields__} - {*RobotConfig.__struct_fields__}
    path.write_text("[simulaton]\nseed = 3\n")
    for kind in (RobotConfig, Config):
        with pytest.raises(InputRefused, match="unknown key `simulaton`"):
            read(kind, path, elsewhere=ELSEWHERE)


def test_all_who_remember_covered_objects_do_so_for_as_long() -> None:
    config = load(settings=["covered_for=3"])

    told = {name: getattr(service(name, config), "keywords", {}).get("covered_for") for name in NAMES}

    assert {name for name, seconds in told.items() if seconds == 3.0} == {"generation", "control"}
    with pytest.raises(InputRefused, match="covered_for must not be negative"):
        load(settings=["covered_for=-1"])


def test_the_example_on_the_page_is_good(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "configuration.md").read_text()
    path = tmp_path / "engage.toml"
    path.write_text(page.partition("```toml\n")[2].partition("```")[0])

    assert load(path).robot == "melvin"


@pytest.mark.parametrize(
    ("setting", "reason"),
    [
        ("bus.robot", "no value"),
        ("=3", "bad setting"),
        ("bus.robot=3", "Expected `str`"),
        ("generation.barge_in=long", "`generation.barge_in`"),
        ("bus.robot=a b", "cannot be part of a key"),
    ],
)
def test_a_bad_setting_is_refused_with_its_key(setting: str, reason: str) -> None:
    with pytest.raises(InputRefused, match=reason):
        load(settings=[setting])


@pytest.mark.parametrize(
    ("setting", "reason"),
    [
        ("collaboration.placement=-1", "placement must not be negative"),
        ("realizer.longest_hold=-0.1", "longest_hold must not be negative, not -0.1, in `realizer`"),
        ("realizer.stall=inf", "stall must be a finite number, not inf, in `realizer`"),
        ("realizer.stall=0.0", "stall 0.0 s must not be below 0.5 s"),
        ("realizer.held_after=4", "held_after 4.0 s must be below 4 s"),
        ("control.variability.lost=1.5", "<= 1.0, in `control.variability.lost`"),
        ("covered_for=-1", "covered_for must not be negative, not -1.0"),
    ],
)
def test_a_number_out_of_its_range_is_refused_and_says_the_range(setting: str, reason: str) -> None:
    with pytest.raises(InputRefused, match=reason):
        load(settings=[setting])


def test_a_setting_is_stronger_than_an_option_of_the_simulation_and_the_robots_name_than_a_setting() -> None:
    options = up.Options(seed=3, human="listening", robot="melvin", settings=["simulation.seed=4", "bus.robot=other"])
    config = options.read(Config)

    assert (config.simulation.seed, config.simulation.human, config.robot) == (4, "listening", "melvin")


def test_the_environment_is_stronger_than_the_file_and_weaker_than_a_setting(tmp_path: Path) -> None:
    path = tmp_path / "engage.toml"
    path.write_text("[bus]\nrobot = 'file'\nmode = 'peer'\nconnect = ['tcp/192.0.2.1:1']\n")
    variables = {
        "ENGAGE_CONFIG": str(path), "ENGAGE_BUS_ROBOT": "shell", "ENGAGE_BUS_CONNECT": "tcp/a:1,tls/b:2 tcp/[::1]:3",
        "HOME": "/",
    }  # fmt: skip

    found = read(RobotConfig, variables=variables, settings=["bus.robot=option"]).bus

    assert found == BusConfig(robot="option", mode="peer", connect=("tcp/a:1", "tls/b:2", "tcp/[::1]:3"))
    assert read(RobotConfig, variables=variables).robot == "shell"
    with pytest.raises(InputRefused, match="ENGAGE_BUS_CONECT: unknown variable of the environment"):
        read(RobotConfig, variables={"ENGAGE_BUS_CONECT": "tcp/a:1"})
    with pytest.raises(InputRefused, match="'tcp/a' is not an endpoint"):
        read(RobotConfig, variables={"ENGAGE_BUS_CONNECT": "tcp/a"})
    with pytest.raises(InputRefused, match="'client' takes an endpoint"):
        read(RobotConfig, variables={"ENGAGE_BUS_MODE": "client"})


@pytest.mark.parametrize(
    ("mode", "connect", "listen", "found"),
    [
        ("auto", (), (), "peer"),
        ("auto", ("tcp/127.0.0.1:7447", "tcp/localhost:1", "tcp/[::1]:1"), (), "peer"),
        ("auto", ("tcp/127.0.0.1:7447", "tcp/192.0.2.1:7447"), (), "client"),
        ("auto", ("tcp/localhost.example:7447",), (), "client"),
        ("auto", ("tcp/192.0.2.1:7447",), ("tcp/192.0.2.2:0",), "peer"),
        ("client", ("tcp/127.0.0.1:7447",), (), "client"),
        ("peer", ("tcp/192.0.2.1:7447",), (), "peer"),
    ],
)
def test_who_connects_to_another_machine_is_a_client_unless_others_connect_to_it(
    mode: Mode, connect: tuple[str, ...], listen: tuple[str, ...], found: str
) -> None:
    assert mode_of(mode, connect, listen) == found


@pytest.mark.parametrize("command", [up.Options, simulate.Options])
def test_a_simulated_human_is_called_the_same_on_the_command_line_and_in_the_configuration(
    command: type,
) -> None:
    offered = set(re.findall(r"'([\w-]+)'", str(get_type_hints(command)["human"])))

    assert len(offered) > 3
    assert offered < set(get_args(HumanKind))
