"""A process killed in the middle of writing leaves the old file or the new one, and what it leaves beside
hinders nobody.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import bpy
import numpy as np
import pytest

from nsm_blender.pictures.outputs import blend_is_whole, png_is_whole
from nsm_blender.pictures.render import read_png
from nsm_core.data.captures import reader
from nsm_core.data.captures.folder import CaptureFolder

ROOT = Path(__file__).resolve().parents[2]
CORE = """
import numpy as np
from nsm_core.data.captures import bvh_writer
from nsm_core.model.inference.weights_file import save_weights
from nsm_core.model.networks.nsm_config import NsmConfig

def write(folder, n):
    arrays, statistics = {"a": np.full((4000, 1000), n)}, {"n": np.full(3, n)}
    save_weights(folder / "w.npz", arrays, statistics, config=NsmConfig(), layout={})
    rotations = np.zeros((600, 23, 4)); rotations[..., 0] = 1
    bvh_writer.write_bvh(folder / "a.bvh", np.tile((0.1 * n, 0, 0.95), (600, 1)), rotations)
"""
BLENDER = """
import bpy
import numpy as np
from nsm_blender.pictures.outputs import save_blend, write_json
from nsm_blender.pictures.render import write_png
mesh = bpy.data.meshes.new("Large")
mesh.vertices.add(300_000)
mesh.use_fake_user = True

def write(folder, n):
    bpy.context.scene["n"] = n
    save_blend(folder / "a.blend")
    noise = np.random.default_rng(0).integers(0, 2, (1000, 1000, 1)) / 255
    write_png(folder / "a.png", np.full((1000, 1000, 4), (n % 10) / 10) + noise)
    write_json(folder / "a.json", {"n": n, "numbers": list(range(200_000))})
"""
LOOP = """
import sys
from pathlib import Path
folder, n = Path(sys.argv[1]), 1
write(folder, 0)
print("ready", flush=True)
while True:
    write(folder, n)
    n += 1
"""


def begin(code: str, folder: Path) -> subprocess.Popen[str]:
    """Start a process that writes numbered files into ``folder`` without end, and wait for the first
    of them.
    """
    worker = subprocess.Popen(
        [sys.executable, "-c", code + LOOP, str(folder)], cwd=ROOT, stdout=subprocess.PIPE, text=True
    )
    assert any("ready" in line for line in worker.stdout)
    return worker


def hidden(folder: Path) -> set[str]:
    return {name for name in os.listdir(folder) if name.startswith(".")}


def kill_while_writing(code: str, folder: Path, ending: str, share: float) -> bool:
    """Kill a process when a passing file has grown to a share of the finished one; whether it was still being
    written then.
    """
    older = hidden(folder)
    worker = begin(code, folder)
    size = (folder / f"a{ending}" if ending != ".npz" else folder / "w.npz").stat().st_size
    until = time.monotonic() + 60
    while time.monotonic() < until and worker.poll() is None:
        new = hidden(folder) - older
        passing = [entry for entry in os.scandir(folder) if entry.name in new and ending in entry.name]
        try:
            if any(entry.stat().st_size >= share * size for entry in passing):
                break
        except FileNotFoundError:  # it has just taken its name
            pass
    worker.send_signal(signal.SIGKILL)
    worker.wait()
    worker.stdout.close()
    return bool(hidden(folder) - older)


def core_version(folder: Path) -> tuple[float, float]:
    with np.load(folder / "w.npz") as stored:
        numbers = np.unique(
            np.concatenate([stored[name].ravel() for name in ("parameters/a", "statistics/n")])
        )
    clip = reader.read_clip(folder / "a.bvh")
    assert len(clip) == 600 and np.ptp(clip.hips_position[:, 0]) < 1e-3 and len(numbers) == 1
    return float(numbers[0]), round(float(clip.hips_position[0, 0]) * 10)


def blender_version(folder: Path) -> tuple[float, float]:
    assert blend_is_whole(folder / "a.blend") and png_is_whole(folder / "a.png")
    with bpy.data.libraries.load(str(folder / "a.blend")) as (there, wanted):
        assert "Large" in there.meshes
        wanted.scenes = there.scenes
    assert read_png(folder / "a.png").shape == (1000, 1000, 4)
    report = json.loads((folder / "a.json").read_text())
    assert len(report["numbers"]) == 200_000
    return wanted.scenes[0]["n"], report["n"]


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="processes are killed otherwise here")
@pytest.mark.parametrize(
    ("code", "version", "moments"),
    [
        (CORE, core_version, [(".npz", 0.0), (".npz", 0.6), (".bvh", 0.0), (".bvh", 0.5)]),
        (BLENDER, blender_version, [(".blend", 0.0), (".blend", 0.5), (".png", 0.0)]),
    ],
    ids=["core", "blender"],
)
def test_killed_at_any_moment(tmp_path, code, version, moments):
    half = 0
    for ending, share in moments:
        half += kill_while_writing(code, tmp_path, ending, share)  # beside what those before have left
        first, second = version(tmp_path)
        # Whole, and of one round or of two that follow each other.
        assert first >= 0 and abs(first - second) <= 1
    assert half >= len(moments) // 2  # else nobody was killed in the middle
    assert all("-new" in name for name in hidden(tmp_path))
    if code is CORE:
        assert [c.path for c in CaptureFolder(tmp_path).captures] == [tmp_path / "a.bvh"]
    shutil.rmtree(tmp_path)
