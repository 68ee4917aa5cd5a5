"""Command `engage hearing install`: fetch the model of how turns end."""

from engage_hri.services.commandline.robot import eyes

Options = eyes.Options


def main(options: Options) -> int:
    """Install the models of hearing."""
    return eyes.main(options, "hearing")
