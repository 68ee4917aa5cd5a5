"""Entry of `engage` and `python -m engage_hri`. It sees to signals before it loads anything at all."""

import os


def main(arguments: list[str] | None = None) -> None:
    """Run a command of `services/commandline/app.py`."""
    # Loading takes half a second. A KeyboardInterrupt during it would be a traceback, or lost in a callback. Nothing
    # has begun yet, so leaving at once is orderly. `services/commandline/shell/process.py` takes over later.
    try:
        import signal

        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda number, frame: os._exit(128 + number))
    except KeyboardInterrupt:
        os._exit(130)
    import gc

    # What is loaded stays: to search it for garbage would be a sixth of the time of loading.
    # `services/commandline/app.py` switches the search on again when the command has been loaded.
    gc.disable()
    from engage_hri.services.commandline import app as cli

    cli.main(arguments)


if __name__ == "__main__":
    main()
