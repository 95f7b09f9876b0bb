"""Files are written whole or not at all, and read whatever program saved them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from nsm_core import validate
from nsm_core.errors import CaptureError, NsmError
from nsm_core.files import atomic_path


def test_the_new_file_or_the_old_one_and_nothing_beside(tmp_path):
    final = tmp_path / "a.txt"
    with atomic_path(final) as path:
        assert path.parent == tmp_path and path.suffix == ".txt" and path != final
        path.write_text("old")
    os.chmod(final, 0o640)
    with pytest.raises(KeyboardInterrupt), atomic_path(final) as path:
        path.write_text("half")
        raise KeyboardInterrupt
    assert final.read_text() == "old" and os.listdir(tmp_path) == ["a.txt"]
    (tmp_path / "link.txt").symlink_to(final)
    with atomic_path(tmp_path / "link.txt") as path:
        path.write_text("new")
    assert (
        final.read_text() == "new"
        and (tmp_path / "link.txt").is_symlink()
        and final.stat().st_mode & 0o777 == 0o640
    )
    with pytest.raises(OSError), atomic_path(tmp_path / "gone" / "a.txt") as path:
        path.write_text("nowhere")
    with atomic_path(Path(os.devnull)) as path:
        path.write_text("away")


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "latin-1"]
)
def test_texts_of_any_encoding(tmp_path, encoding):
    (tmp_path / "a.txt").write_bytes("größe = 1\n".encode(encoding))
    assert validate.read_text(tmp_path / "a.txt", CaptureError) == "größe = 1\n"


@pytest.mark.parametrize(
    "content",
    [
        b"a = " + b"[" * 100_000,
        b"a = " + b"9" * 10_000,
        b"a = \x00",
        b"a = 1979-99-99",
        b"a = 1\na = 2",
        b"\xff\xfe\x00",
    ],
)
def test_what_is_no_toml_is_a_sentence(tmp_path, content):
    (tmp_path / "a.toml").write_bytes(content)
    with pytest.raises(NsmError, match=r"^a\.toml is not valid TOML: .*; correct that line\.$"):
        validate.read_toml(tmp_path / "a.toml", CaptureError)


@pytest.mark.parametrize(
    "value",
    [True, "1", None, float("nan"), float("inf"), 10**400, 10**9999, 11, [1]],
    ids=lambda v: type(v).__name__,
)
def test_what_is_no_number_in_bounds_is_shown_in_short(value):
    with pytest.raises(CaptureError, match=r"^a\.toml: size is .{1,45}; it must be a number from 0 to 10\.$"):
        validate.number(value, "a.toml: size", CaptureError, 0, 10)
