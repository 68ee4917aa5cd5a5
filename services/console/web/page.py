"""The page: what stands where. The pictures in it are drawn by the modules in `page`, from the frames."""

from pathlib import Path

from nicegui import ui

MODULES = Path(__file__).parent / "page"


class Stage(ui.element, component=MODULES / "stage.js", esm={"engage-window": str(MODULES)}):
    """All that is drawn from the frames."""


def build(robot: str) -> None:
    """Lay out the page for one browser."""
    import nicegui.elements.scene  # noqa: F401  # its three.js is served from here

    ui.add_css(MODULES / "window.css")
    ui.query(".nicegui-content").classes(remove="nicegui-content")
    Stage().props(f'robot="{robot}"')
