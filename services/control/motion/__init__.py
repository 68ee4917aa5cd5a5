"""Motion of one joint in time: paths and their clocks. Pure."""
