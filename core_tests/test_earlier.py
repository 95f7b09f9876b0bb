"""Scripts that import modules by their earlier names go on working, and are told the names of today."""

from __future__ import annotations

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

from nsm_core import earlier
from nsm_core.data.captures import bvh_writer, reader

CORE = [name for name in earlier.MOVED if name.startswith("nsm_core.")]


@pytest.mark.parametrize("name", CORE)
def test_an_earlier_name_is_what_stands_there_now(name):
    with pytest.warns(DeprecationWarning, match="is now nsm_core"):
        module = importlib.reload(importlib.import_module(name))
    for target in earlier.MOVED[name]:
        now = importlib.import_module(target)
        for public in (n for n in vars(now) if not n.startswith("_")):
            assert getattr(module, public) is getattr(
                importlib.import_module(earlier.MOVED[name][0]), public, getattr(now, public)
            )


def test_every_earlier_name_leads_to_modules_that_are_there():
    root = Path(__file__).resolve().parents[1]
    for name, targets in earlier.MOVED.items():
        for target in targets:
            path = root.joinpath(*target.split("."))
            assert path.with_suffix(".py").exists() or (path / "__init__.py").exists(), (
                f"{name} leads to {target}"
            )


def test_what_is_set_under_an_earlier_name_is_set_where_it_is_now():
    code = (
        "import warnings; warnings.simplefilter('ignore')\n"
        "from nsm_core import skeleton, body\nimport nsm_core.body.skeleton as now\n"
        "skeleton.HIP_OVER_SEAT = 2.0\nassert now.HIP_OVER_SEAT == 2.0 == skeleton.HIP_OVER_SEAT"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).resolve().parents[1])


def test_what_was_renamed_is_found_by_its_earlier_name():
    with pytest.warns(DeprecationWarning):
        bvh, writer = (
            importlib.reload(importlib.import_module(f"nsm_core.{n}")) for n in ("bvh", "bvh_write")
        )
    assert bvh.read is reader.read_clip and bvh.read_all is reader.read_clips
    assert writer.write is bvh_writer.write_bvh


def test_a_name_that_never_was_is_not_there():
    with pytest.raises(ImportError):
        importlib.import_module("nsm_core.never_was")
    with pytest.warns(DeprecationWarning), pytest.raises(ImportError):
        exec(
            "from importlib import reload, import_module; reload(import_module('nsm_core.clip')); from "
            "nsm_core.clip import never_was"
        )
