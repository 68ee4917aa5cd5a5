"""`python -m services` is `engage`."""

from services.cli import main

main()
