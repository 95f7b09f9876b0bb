// SPDX-License-Identifier: GPL-3.0-or-later
//
// A job type for Flamenco 3.3 or newer: the takes of a job file of NSM Character Motion, shared out as tasks.
// Put this file into the folder "scripts" beside the Flamenco Manager and restart it (docs/batch.md).

const JOB_TYPE = {
    label: "NSM Takes",
    description: "Make the character takes of a job file; every task makes its share of them",
    settings: [
        {
            key: "job_file", type: "string", subtype: "file_path", required: true, visible: "submission",
            description: "The job file (.toml), on storage that all workers see by the same path",
        },
        {
            key: "tasks", type: "int32", required: true, default: 4, propargs: { min: 1, max: 10000 },
            visible: "submission",
            eval: "max(1, sum(map(Path(bpy.path.abspath(settings.job_file)).read_text(encoding='utf-8').count,"
                + " ('[[take]]', '[[fill]]'))))",
            evalInfo: { showLinkButton: true, description: "As many tasks as the job file has takes" },
            description: "Number of tasks; as many as takes makes each take a task of its own",
        },
        {
            key: "batch_script", type: "string", subtype: "file_path", required: true, visible: "submission",
            eval: "next((str(Path(m.__file__).parent / 'batch.py') for n, m in __import__('sys').modules.items()"
                + " if n.split('.')[-1] == 'nsm_blender' and getattr(m, '__file__', None)), '')",
            evalInfo: { showLinkButton: true, description: "That of the add-on installed here" },
            description: "batch.py in the folder of the add-on, as the workers see it",
        },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    if (!settings.job_file || !settings.batch_script) {
        throw "Give the job file, and batch.py in the folder of the add-on.";
    }
    if (!(settings.tasks >= 1)) {
        throw "The number of tasks must be 1 or more.";
    }
    for (let number = 1; number <= settings.tasks; number++) {
        job.addTask(authorShare(settings, `${number}/${settings.tasks}`));
    }
}

// One task: every so many-th take, by itself; no share waits for another.
function authorShare(settings, shard) {
    const task = author.Task(`takes ${shard}`, "blender");
    task.addCommand(author.Command("exec", {
        exe: "{blender}",
        args: [
            "--background", "--python-exit-code", "1", "--python", settings.batch_script, "--",
            settings.job_file, "--shard", shard,
        ],
    }));
    return task;
}
