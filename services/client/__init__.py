"""What drives a robot and follows it, from any process."""
