"""The commands of `engage`, one file each. They put services together; what those do is decided in the services."""
