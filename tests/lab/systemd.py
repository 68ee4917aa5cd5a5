"""First process of a machine that runs systemd on units of ours alone: `python -m tests.lab.systemd FOLDER`. Root.

FOLDER, which is /run/lab on the machine, has `units`: all units that there are. What lies in its `etc` is /etc/engage
there; `bin` is added to /usr/local/bin, and the lines of `passwd` to those of the host.

It runs in new namespaces for processes, mounts, network, names and control groups. The host's /run, /tmp and /dev are
hidden, what is written in /etc and /usr/local/bin stays on the machine, and kernel settings cannot be written. So
nothing that systemd does at a boot reaches the host.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

INIT = next((path for path in ("/lib/systemd/systemd", "/usr/lib/systemd/systemd") if Path(path).exists()), "")
DEVICES = ("null", "zero", "random", "urandom", "tty")
OURS = sorted(set(map(Path, (sys.base_prefix, sys.prefix, Path(__file__).parents[2]))))
"""Folders of the host that units need: Python, our environment, our code. What is in another comes after it."""


def mount(*words: str) -> None:
    """Mount as `mount(8)` does."""
    subprocess.run(["mount", *words], check=True)


def hide(place: str) -> None:
    """Put an empty folder of this machine's own in place of one of the host."""
    mount("-t", "tmpfs", "-o", "mode=1777" if place == "/tmp" else "mode=755", "tmpfs", place)


def kept(place: Path, number: int) -> str:
    """Keep a folder of the host at another place, while what lies above it is hidden."""
    held = f"/run/host-{number}"
    Path(held).mkdir()
    mount("--bind", str(place), held)
    return held


def shown(place: Path, held: str) -> None:
    """Show a folder that was kept, to every user of the machine: Python may lie in somebody's home."""
    if barred := next((each for each in reversed(place.parents) if each.exists() and not _is_open(each)), None):
        hide(str(barred))
    if not place.exists():
        place.mkdir(parents=True)
        mount("--bind", held, str(place))


def _is_open(folder: Path) -> bool:
    return bool(folder.stat().st_mode & 0o001)


def main() -> None:
    """Hide the host, and become systemd."""
    folder = Path(sys.argv[1])
    mount("--make-rprivate", "/")
    hide("/run")
    Path("/run/lab").mkdir()
    mount("--bind", str(folder), "/run/lab")
    held = {place: kept(place, number) for number, place in enumerate(OURS)}
    hide("/tmp")
    Path("/run/dev/shm").mkdir(mode=0o1777, parents=True)
    for name in DEVICES:
        Path(f"/run/dev/{name}").touch()
        mount("--bind", f"/dev/{name}", f"/run/dev/{name}")
    mount("--rbind", "/run/dev", "/dev")
    for number, there in enumerate(("/etc", "/usr/local/bin")):
        upper, work = Path(f"/run/upper-{number}"), Path(f"/run/work-{number}")
        upper.mkdir()
        work.mkdir()
        mount("-t", "overlay", "-o", f"lowerdir={there},upperdir={upper},workdir={work}", "overlay", there)
    Path("/etc/engage").mkdir(exist_ok=True)
    mount("--bind", "/run/lab/etc", "/etc/engage")
    Path("/etc/passwd").write_text(Path("/etc/passwd").read_text() + Path("/run/lab/passwd").read_text())
    for command in Path("/run/lab/bin").iterdir():
        shutil.copy(command, "/usr/local/bin")
    for place, where in held.items():
        shown(place, where)
    hide("/sys/fs/cgroup")
    for name, words in (("systemd", ("cgroup", "-o", "none,name=systemd")), ("unified", ("cgroup2",))):
        Path(f"/sys/fs/cgroup/{name}").mkdir()
        mount("-t", *words, "cgroup", f"/sys/fs/cgroup/{name}")
    mount("--bind", "/proc/sys", "/proc/sys")
    mount("-o", "remount,ro,bind", "/proc/sys")
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    os.execve(INIT, [INIT, "--system", "--log-target=console", "--unit=multi-user.target"], {
        "container": "lab", "PATH": os.environ["PATH"], "SYSTEMD_UNIT_PATH": "/run/lab/units",
    })  # fmt: skip


if __name__ == "__main__":
    main()
