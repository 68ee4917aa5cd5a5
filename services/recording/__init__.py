"""Recordings: all that a robot says on its bus, kept in an MCAP file, read, played, and turned into other forms.

`writing`, `reading`, `player` and `tiers` are pure: bytes and instants in, bytes and messages out. `disk` and
`service` write on a disk, `replay` publishes on a bus.
"""
