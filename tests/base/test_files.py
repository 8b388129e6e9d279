"""Files are whole or absent."""

from pathlib import Path

import pytest

from auvsim.base.files import whole


def test_file_appears_when_it_is_whole(tmp_path: Path) -> None:
    """Until the end there is the old file, then the new one; the temporary name keeps the suffix and goes."""
    path = tmp_path / "track.png"
    path.write_text("old")
    with whole(path) as partial:
        partial.write_text("new")
        assert path.read_text() == "old"
        assert partial.suffix == ".png"
        assert partial.parent == tmp_path  # a rename within one file system is atomic
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_failure_leaves_what_was_there(tmp_path: Path, error: type[BaseException]) -> None:
    """A failure half way changes nothing, Ctrl-C included."""
    path = tmp_path / "trial.nc"
    path.write_text("old")

    def fail_half_way() -> None:
        with whole(path) as partial:
            partial.write_text("half")
            raise error

    with pytest.raises(error):
        fail_half_way()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
