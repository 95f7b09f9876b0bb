"""The job type for Flamenco: its settings, and the tasks that its script makes, run by a JavaScript engine
where there is one.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
import pytest

import nsm_blender
from nsm_blender.jobs.options import read_options

SCRIPT = Path(nsm_blender.__file__).parent / "jobs" / "nsm_takes.js"
# What Flamenco's manager gives to a script: `author`, and a job that takes tasks.
HOST = """
const author = {
    Task(name, type) { return { name, type, commands: [], addCommand(c) { this.commands.push(c); } }; },
    Command(name, parameters) { return { name, parameters }; },
};
const job = { settings: SETTINGS, tasks: [], addTask(task) { this.tasks.push(task); } };
let error = null;
try { compileJob(job); } catch (problem) { error = String(problem); }
console.log(JSON.stringify({ type: JOB_TYPE, tasks: job.tasks, error }));
"""


def compiled(**settings) -> dict:
    """The job type, and the tasks of a job with ``settings``."""
    node = shutil.which("node")
    if not node:
        pytest.skip("no JavaScript engine is installed")
    text = SCRIPT.read_text(encoding="utf-8") + HOST.replace("SETTINGS", json.dumps(settings))
    done = subprocess.run([node, "-e", text], capture_output=True, text=True, encoding="utf-8", timeout=60)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_every_setting_says_what_it_is():
    settings = compiled(job_file="a.toml", batch_script="batch.py", tasks=1)["type"]["settings"]
    assert [s["key"] for s in settings] == ["job_file", "tasks", "batch_script"]
    for setting in settings:
        assert setting["type"] in ("string", "int32", "float", "bool") and setting["description"]
        assert setting["visible"] in ("visible", "hidden", "submission", "web")


def test_a_task_calls_the_batch_with_its_shard():
    made = compiled(job_file="/jobs/a b.toml", batch_script="/addon/batch.py", tasks=3)["tasks"]
    assert [(t["name"], t["type"], len(t["commands"])) for t in made] == [
        (f"takes {i}/3", "blender", 1) for i in (1, 2, 3)
    ]
    for number, task in enumerate(made, 1):
        command = task["commands"][0]
        assert command["name"] == "exec" and command["parameters"]["exe"] == "{blender}"
        arguments = command["parameters"]["args"]
        assert arguments[arguments.index("--python") + 1] == "/addon/batch.py"
        # What comes behind "--" is what the batch itself reads.
        options = read_options(arguments[arguments.index("--") + 1 :])
        assert (options.job, options.shard) == ("/jobs/a b.toml", (number, 3))


@pytest.mark.parametrize("wrong", [{"job_file": ""}, {"batch_script": ""}, {"tasks": 0}])
def test_what_is_missing_is_told(wrong):
    made = compiled(**{"job_file": "a.toml", "batch_script": "b.py", "tasks": 2} | wrong)
    assert made["error"] and made["error"].endswith(".") and not made["tasks"]


def test_its_values_are_found_in_blender(tmp_path):
    job = tmp_path / "job.toml"
    job.write_text('scene = "a.blend"\n[[take]]\nname = "a"\n[[take]]\nname = "b"\n', encoding="utf-8")
    text = re.sub(r'"\s*\+\s*"', "", SCRIPT.read_text(encoding="utf-8"))
    tasks, script = re.findall(r'eval: "(.*)"', text)
    names = {"bpy": bpy, "Path": Path, "settings": SimpleNamespace(job_file=str(job))}
    assert eval(tasks, dict(names)) == 2
    found = [name for name in sys.modules if name.endswith("nsm_blender")]
    assert found and Path(eval(script, dict(names))) == SCRIPT.parents[1] / "batch.py"
