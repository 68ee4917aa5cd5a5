"""First process of a machine that runs systemd on units of ours alone: `python -m tests.lab.systemd FOLDER`. Root.

FOLDER has `units` (all units that there are), `etc` (becomes /etc/engage), `bin` (is added to /usr/local/bin) and
`passwd` (is added to that of the host); it is /run/lab on the machine. In new namespaces for processes, mounts, network,
names and control groups. The host's /run, /tmp and /dev are hidden, what is written in /etc and /usr/local/bin stays on
the machine, and kernel settings cannot be written: nothing that an init does at a boot reaches the host.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

INIT = next((path for path in ("/lib/systemd/systemd", "/usr/lib/systemd/systemd") if Path(path).exists()), "")
DEVICES = ("null", "zero", "random", "urandom", "tty")


def mount(*words: str, holding: int = 0) -> None:
    """Mount as `mount(8)` does. holding: a descriptor that it needs."""
    subprocess.run(["mount", *words], check=True, pass_fds=[holding] if holding else [])


def reachable(place: Path) -> None:
    """Let every user of the machine come to a folder of the host: Python may lie in somebody's home."""
    if (barred := next((each for each in reversed(place.parents) if not each.stat().st_mode & 0o001), None)) is None:
        return
    held = os.open(place, os.O_PATH)
    mount("-t", "tmpfs", "-o", "mode=755", "tmpfs", str(barred))
    place.mkdir(parents=True)
    mount("--bind", f"/proc/self/fd/{held}", str(place), holding=held)
    os.close(held)


def main() -> None:
    """Hide the host, and become systemd."""
    folder = Path(sys.argv[1])
    mount("--make-rprivate", "/")
    held = os.open(folder, os.O_PATH)
    mount("-t", "tmpfs", "tmpfs", "/run")
    Path("/run/lab").mkdir()
    mount("--bind", f"/proc/self/fd/{held}", "/run/lab", holding=held)
    os.close(held)
    Path("/run/dev").mkdir()
    for name in DEVICES:
        Path(f"/run/dev/{name}").touch()
        mount("--bind", f"/dev/{name}", f"/run/dev/{name}")
    Path("/run/dev/shm").mkdir(mode=0o1777)
    mount("--rbind", "/run/dev", "/dev")
    mount("-t", "tmpfs", "-o", "mode=1777", "tmpfs", "/tmp")
    for number, there in enumerate(("/etc", "/usr/local/bin")):
        upper, work = Path(f"/run/upper-{number}"), Path(f"/run/work-{number}")
        upper.mkdir()
        work.mkdir()
        mount("-t", "overlay", "-o", f"lowerdir={there},upperdir={upper},workdir={work}", "overlay", there)
    Path("/etc/engage").mkdir(exist_ok=True)
    Path("/etc/passwd").write_text(Path("/etc/passwd").read_text() + Path("/run/lab/passwd").read_text())
    mount("--bind", "/run/lab/etc", "/etc/engage")
    for command in Path("/run/lab/bin").iterdir():
        shutil.copy(command, "/usr/local/bin")
    for place in (sys.base_prefix, sys.prefix):
        reachable(Path(place))
    mount("-t", "tmpfs", "-o", "mode=755", "tmpfs", "/sys/fs/cgroup")
    for name, words in (("systemd", ("cgroup", "-o", "none,name=systemd")), ("unified", ("cgroup2",))):
        Path(f"/sys/fs/cgroup/{name}").mkdir()
        mount("-t", *words, "cgroup", f"/sys/fs/cgroup/{name}")
    mount("--bind", "/proc/sys", "/proc/sys")
    mount("-o", "remount,ro,bind", "/proc/sys")
    subprocess.run(["ip", "link", "set", "lo", "up"], check=False)
    os.execve(INIT, [INIT, "--system", "--log-target=console", "--unit=multi-user.target"], {
        "container": "lab", "PATH": os.environ["PATH"], "SYSTEMD_UNIT_PATH": "/run/lab/units",
    })  # fmt: skip


if __name__ == "__main__":
    main()
