"""Live blocks on the event loop: they send, receive and tell what happens."""
