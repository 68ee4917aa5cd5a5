"""Sources of pieces that come with Engage."""
