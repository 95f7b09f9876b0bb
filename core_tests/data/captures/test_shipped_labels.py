"""Labels that the program brings for the captures its weights were trained with: sidecars like any."""

from __future__ import annotations

import shutil
from pathlib import Path

import captures
import pytest

from nsm_core.__main__ import main
from nsm_core.data.captures import sidecar
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.data.matching.selection import load_bends, load_runs, load_sits, load_walks, neutral

FILES = sorted(sidecar.LABELS_FOLDER.rglob("*" + sidecar.SUFFIX))
NAMES = (
    "accad_male1/male1_a1_stand", "accad_male1/male1_a5_pickupbox", "accad_female1/female1_run_to_stand",
    "cmu/cmu_07_01", "opencap/opencap_sts1",
)  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Captures under the names of five of those that labels are brought for."""
    made = tmp_path_factory.mktemp("shipped")
    captures.write_shipped(made, *NAMES)
    return made


def chosen(folder: Path) -> dict[str, list[str]]:
    """Names of what each loader takes of a folder."""
    index = CaptureFolder(folder)
    return {
        "walk": [c.name for c in load_walks(index)],
        "run": [c.name for c in load_runs(index)],
        "sit": [s.clip.name for s in load_sits(index)],
        "bend": [b.clip.name for b in load_bends(index)],
        "stand": [neutral(index).name],
    }


def test_every_file_is_sound_and_says_what_its_capture_is_used_for():
    sheets = [sidecar.read_sheet(path) for path in FILES]
    assert len(sheets) > 100
    for path, sheet in zip(FILES, sheets, strict=True):
        assert sidecar.shipped(Path("anywhere", path.parent.name, f"{sheet.clip}.bvh")) == path
        use = sheet.use
        assert use.walk or use.run or use.bend or sheet.actions["sit"] or sheet.actions["carry"], path.name
        assert not use.sit or sheet.actions["sit"]
    assert len([sheet for sheet in sheets if sheet.use.stand is not None]) == 1


def test_captures_are_known_by_their_names_wherever_their_folder_lies(folder, tmp_path):
    found = chosen(folder)
    assert found["walk"] == ["accad_male1/male1_a1_stand", "cmu/cmu_07_01"]
    assert found["run"] == ["accad_female1/female1_run_to_stand"]
    assert found["stand"] == found["walk"][:1]
    assert [name.split("@")[0] for name in found["sit"]] == ["opencap/opencap_sts1"] * 4
    assert {name.split("@")[0] for name in found["bend"]} == {"accad_male1/male1_a5_pickupbox"}
    shutil.copytree(folder / "cmu", tmp_path / "deep" / "cmu")
    assert [c.name for c in load_walks(CaptureFolder(tmp_path))] == ["deep/cmu/cmu_07_01"]
    assert [c.name for c in load_walks(CaptureFolder(tmp_path / "deep" / "cmu"))] == ["cmu_07_01"]


def test_one_of_another_length_is_another_capture(tmp_path):
    captures.write_clip(tmp_path / "cmu" / "cmu_07_01.bvh", captures.walk(2.0, 0.0, 2.1))
    assert CaptureFolder(tmp_path).labelled == ()


def test_a_sidecar_beside_a_capture_comes_first(folder, tmp_path):
    shutil.copytree(folder / "cmu", tmp_path / "cmu")
    (tmp_path / "cmu" / "cmu_07_01.nsm.toml").write_text("frames = 79\n[use]\nrun = [[0, 40]]\n")
    index = CaptureFolder(tmp_path)
    assert load_walks(index) == [] and [c.name for c in load_runs(index)] == ["cmu/cmu_07_01@0"]


def test_annotating_keeps_what_the_program_says_of_them(folder, tmp_path, capsys):
    shutil.copytree(folder, tmp_path / "mine")
    assert main(["annotate", str(tmp_path / "mine"), "--no-pictures"]) == 0
    assert "cmu/cmu_07_01.bvh: 2.6 s, idle, walk; kept your use\n" in capsys.readouterr().out
    written = sidecar.read_sheet(tmp_path / "mine" / "cmu" / "cmu_07_01.nsm.toml")
    assert written.use.walk == ((0, 78),) and written.actions["walk"] and written.contacts["LeftAnkle"]
    assert main(["annotate", str(tmp_path / "mine"), "--no-pictures"]) == 0  # and again
    mine, brought = chosen(tmp_path / "mine"), chosen(folder)
    assert {kind: mine[kind] for kind in ("sit", "bend", "stand")} == {
        kind: brought[kind] for kind in ("sit", "bend", "stand")
    }
    assert set(brought["walk"]) <= set(mine["walk"]) and set(brought["run"]) <= set(mine["run"])
