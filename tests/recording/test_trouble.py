"""What others do to a file while it is recorded: remove it, rename it, or record into it as well."""

import os
import shutil
from pathlib import Path

import pytest

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.recording import disk
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


def test_a_file_that_is_removed_is_written_anew_with_all_that_was_in_it(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    told = Told(path)
    told.add(1, 2)
    path.unlink()
    told.add(3)
    told.add(4)

    assert told.file.close({})
    assert (len(read(path)), read(path).is_whole) == (4, True)
    assert told.lines == ["/a.mcap: removed while it is recorded; written anew, with all that was in it"]


def test_a_file_whose_folder_is_removed_is_written_anew_as_soon_as_there_is_one(tmp_path: Path) -> None:
    path = tmp_path / "day" / "a.mcap"
    path.parent.mkdir()
    told = Told(path)
    told.add(1)
    shutil.rmtree(path.parent)
    assert not told.add(2)
    assert not told.add(3)
    path.parent.mkdir()
    assert told.add(4)

    assert told.file.close({})
    assert len(read(path)) == 4
    assert told.lines == [
        "/a.mcap: removed while it is recorded, and not written anew: No such file or directory",
        "/a.mcap: removed while it is recorded; written anew, with all that was in it",
        "/a.mcap: it is written again; messages lost: 0",
    ]


def test_a_file_that_is_lost_for_good_is_known_to_be(tmp_path: Path) -> None:
    path = tmp_path / "day" / "a.mcap"
    path.parent.mkdir()
    told = Told(path)
    shutil.rmtree(path.parent)

    assert not told.file.close({})
    assert told.file.is_removed


def test_another_file_that_took_the_name_of_a_removed_one_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    told = Told(path)
    path.unlink()
    path.write_text("mine")

    assert not told.add(1)
    assert told.lines == ["/a.mcap: removed while it is recorded, and not written anew: File exists"]
    assert path.read_text() == "mine"


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="this system does not tell the name of an open file")
def test_a_file_that_is_renamed_is_recorded_on_under_its_new_name_which_is_told_once(tmp_path: Path) -> None:
    told = Told(tmp_path / "a.mcap")
    told.add(1)
    (tmp_path / "a.mcap").rename(tmp_path / "b.mcap")
    told.add(2)
    told.add(3)

    assert told.file.close({})
    assert len(read(tmp_path / "b.mcap")) == 3
    assert not (tmp_path / "a.mcap").exists()
    assert told.lines == ["/a.mcap: renamed while it is recorded, which goes on in /b.mcap"]
    assert told.file.path == tmp_path / "b.mcap"


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


def test_a_file_that_cannot_be_copied_whole_leaves_no_half_copy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.mcap"
    told = Told(path)
    told.add(1)
    path.unlink()
    told.file.writer.add(LINE, b"{}", 2, 2)

    def full(file: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(disk.descriptor.os, "fsync", full)
        assert not told.file.write()
    assert not list(tmp_path.iterdir())

    assert told.file.close({})
    assert len(read(path)) == 2
    assert os.listdir(tmp_path) == ["a.mcap"]
