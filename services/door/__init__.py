"""A door for programs in any language: what the client `Robot` can, over HTTP and WebSockets, as JSON."""
