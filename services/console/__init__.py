"""What people see of a running system: a live view, a plain log, and the tally at the end. It only reads."""
