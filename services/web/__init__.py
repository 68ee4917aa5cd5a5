"""Parts of all servers of the house that speak HTTP: who is let in, how it serves, what waits for a slow program."""
