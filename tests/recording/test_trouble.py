"""What others do to a file while it is recorded: remove it, rename it, or record into it as well."""

from pathlib import Path

import pytest

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.recording.disk import RecordingFile, read
from engage_hri.services.recording.writing import Line

LINE = Line(topic="r/x", form="json", key="engage/v1/evt/there/x", sender="there")


class Told:
    """A file that is recorded, and what its recorder says about it."""

    def __init__(self, path: Path, *, overwrite: bool = False) -> None:
        self.lines: list[str] = []
        self.folder = path.parent
        self.file = RecordingFile(path, {"robot": "r", "clock": "c", "began": "0.0", "wall": "0"}, self._tell,
                                  overwrite=overwrite)  # fmt: skip

    def _tell(self, text: str) -> None:
        self.lines.append(text.replace(str(self.folder), ""))

    def add(self, *numbers: int) -> bool:
        for number in numbers:
            self.file.writer.add(LINE, b"{}", number, number)
        return self.file.write()


def test_a_file_that_is_removed_is_told_once_and_has_no_end(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    told = Told(path)
    assert told.add(1, 2)
    path.unlink()
    path.write_text("mine")

    assert not told.add(3)
    assert not told.add(4)
    assert not told.file.close({})
    assert told.file.is_removed
    assert told.lines == ["/a.mcap: removed while it is recorded, and lost with the end of its recorder"]
    assert path.read_text() == "mine"


def test_a_file_that_is_renamed_is_recorded_on(tmp_path: Path) -> None:
    told = Told(tmp_path / "a.mcap")
    told.add(1)
    (tmp_path / "a.mcap").rename(tmp_path / "b.mcap")
    told.add(2, 3)

    assert told.file.close({})
    assert len(read(tmp_path / "b.mcap")) == 3
    assert not (tmp_path / "a.mcap").exists()
    assert told.lines == []


@pytest.mark.parametrize("name", ["a.mcap", "b.mcap"])
def test_nobody_records_into_a_file_that_is_recorded_whatever_its_name_by_now(tmp_path: Path, name: str) -> None:
    told = Told(tmp_path / "a.mcap")
    told.add(1)
    (tmp_path / "a.mcap").rename(tmp_path / name)

    with pytest.raises(InputRefused, match=r"\.mcap: another recorder writes this file \(give another one\)"):
        Told(tmp_path / name, overwrite=True)
    told.add(2)
    assert told.file.close({})
    assert len(read(tmp_path / name)) == 2

    again = Told(tmp_path / name, overwrite=True)
    again.add(1)
    assert again.file.close({})
    assert len(read(tmp_path / name)) == 1
