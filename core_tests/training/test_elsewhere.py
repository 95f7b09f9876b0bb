"""A training packed for another machine runs there from its folder alone, and its weights come back whole."""

from __future__ import annotations

import importlib
import re
import shutil
import subprocess
import tarfile

import captures
import pytest

pytest.importorskip("torch", reason="training needs PyTorch")

from nsm_core.commands import pack
from nsm_core.errors import OutputError, WeightsError
from nsm_core.model.inference.model import BUNDLED
from nsm_core.model.inference.weights_file import load_weights


@pytest.mark.skipif(shutil.which("bash") is None, reason="the packed script is for bash")
def test_its_script_asks_the_packed_code_for_what_that_knows(tmp_path, tmp_path_factory, capsys):
    folder = pack.pack(
        captures.capture_folder(tmp_path_factory),
        tmp_path / "away",
        tmp_path,
        BUNDLED,
        minutes=8,
        data_minutes=120,
        starts=4,
    )
    script = folder / "train.sh"
    assert subprocess.run(["bash", "-n", str(script)]).returncode == 0
    asked = re.findall(r"python3 -m nsm_core (\w+) ((?:.|\\\n)*?)(?=\n[^ ]|\n\Z)", script.read_text())
    assert [name for name, _ in asked] == ["compose", "train", "pack", "evaluate"]
    for name, options in asked:
        with pytest.raises(SystemExit):
            importlib.import_module(f"nsm_core.commands.{name}").main(["--help"])
        told = capsys.readouterr().out
        for option in re.findall(r"--[a-z-]+", options):
            assert re.search(rf"{option}\b", told), (name, option)
    with tarfile.open(folder / "code.tar.gz") as tar:
        assert {"nsm_core/__main__.py", "nsm_core/commands/train.py"} <= set(tar.getnames())
    with tarfile.open(folder / "captures.tar.gz") as tar:
        assert any(name.endswith(".bvh") for name in tar.getnames())
    assert load_weights(folder / "start.npz").metadata == load_weights(BUNDLED).metadata


def test_weights_come_back_byte_for_byte_and_a_lost_or_damaged_piece_is_named(tmp_path):
    pieces = pack.cut(BUNDLED, tmp_path / "out", 20.0)
    assert pack.join(tmp_path / "out", tmp_path / "back.npz").read_bytes() == BUNDLED.read_bytes()
    whole = pieces[1].read_bytes()
    pieces[1].write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
    with pytest.raises(WeightsError, match=rf"{pieces[1].name}.*damaged"):
        pack.join(tmp_path / "out", tmp_path / "bad.npz")
    pieces[1].unlink()
    with pytest.raises(WeightsError, match=rf"{pieces[1].name} is missing"):
        pack.join(tmp_path / "out", tmp_path / "bad.npz")
    assert not (tmp_path / "bad.npz").exists()
    with pytest.raises(WeightsError, match="holds no pieces"):
        pack.join(tmp_path, tmp_path / "bad.npz")


def test_a_folder_that_is_not_there_is_told(tmp_path):
    with pytest.raises(OutputError, match="no folder .*nowhere"):
        pack.pack(tmp_path / "nowhere", tmp_path / "away", minutes=1, data_minutes=1, starts=0)
