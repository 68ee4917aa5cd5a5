"""The client library: drives a robot and follows it, from any process."""
