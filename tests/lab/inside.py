"""First process of a machine of the laboratory: a network card of its own, and an heir for orphans. Linux, root.

`python -m tests.lab.inside SOCKET NUMBER BOOT_ID_FILE`, in new namespaces for network, mounts, processes and names.
The card is a TAP device; its other end goes to the switch over SOCKET. If this process ends, so does the machine.
"""

import array
import fcntl
import os
import signal
import socket
import struct
import subprocess
import sys
from pathlib import Path

from tests.lab.fabric import address_of

TUNSETIFF = 0x400454CA
IFF_TAP, IFF_NO_PI = 0x0002, 0x1000
SIOCSIFFLAGS, SIOCSIFADDR, SIOCSIFNETMASK, SIOCSIFHWADDR = 0x8914, 0x8916, 0x891C, 0x8924
IFF_UP, IFF_RUNNING = 0x1, 0x40
ARPHRD_ETHER = 1
CARD = "lab0"


def ip_of(machine: int) -> str:
    """Address of a machine, for those that connect to it."""
    return f"10.77.0.{machine}"


def card(machine: int) -> int:
    """Make the network card of this namespace, and bring it up; returns the switch's end of it."""
    tap = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(tap, TUNSETIFF, struct.pack("16sH22x", CARD.encode(), IFF_TAP | IFF_NO_PI))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as door:
        hardware = struct.pack("16sH6s16x", CARD.encode(), ARPHRD_ETHER, address_of(machine))
        fcntl.ioctl(door, SIOCSIFHWADDR, hardware)
        for request, ip in ((SIOCSIFADDR, ip_of(machine)), (SIOCSIFNETMASK, "255.255.255.0")):
            address = struct.pack("16sHH4s16x", CARD.encode(), socket.AF_INET, 0, socket.inet_aton(ip))
            fcntl.ioctl(door, request, address)
        for name in (CARD, "lo"):
            fcntl.ioctl(door, SIOCSIFFLAGS, struct.pack("16sH22x", name.encode(), IFF_UP | IFF_RUNNING))
    return tap


def main() -> None:
    """Set the machine up, hand its card to the switch, and wait as long as that runs."""
    door, machine, boot_id = sys.argv[1], int(sys.argv[2]), sys.argv[3]
    subprocess.run(["mount", "--bind", boot_id, "/proc/sys/kernel/random/boot_id"], check=True)
    socket.sethostname(f"lab{machine}")
    tap = card(machine)
    switch = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    switch.connect(door)
    rights = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [tap]).tobytes())]
    switch.sendmsg([bytes([machine])], rights)
    os.close(tap)
    signal.signal(signal.SIGCHLD, reap)
    while switch.recv(1):  # until the switch has ended: then the laboratory has
        pass


def reap(number: int, frame: object) -> None:
    """Bury children of which nobody else knows."""
    try:
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    except ChildProcessError:
        pass


if __name__ == "__main__":
    sys.path.insert(0, str(Path.cwd()))
    main()
