// A job type of Flamenco 3 for Candela: chunks of frames, slices of samples, and what puts the slices together.
// It holds for the job that it was written for, and stands in the folder `scripts` beside the manager. Nodes need Blender
// with Candela, and a shared folder of files.

// What the job that this file was written for asks of every task, and of those that render: `farm` puts it here.
const OF_EVERY_TASK = [];
const OF_RENDERING = [];

const JOB_TYPE = {
    label: "Candela",
    description: "Render by Candela; the samples of a picture may be shared by several workers",
    settings: [
        { key: "frames", type: "string", required: true,
          eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
          description: "Frames, such as 1-100 or 1,3,7" },
        { key: "chunk_size", type: "int32", default: 5, propargs: { min: 1 },
          description: "Frames of a task" },
        { key: "split_samples", type: "int32", default: 1, propargs: { min: 1 },
          description: "Slices of a picture, each rendered by a task of its own" },
        { key: "format", type: "string", default: "exr", choices: ["exr", "png"],
          description: "Format of the pictures" },
        { key: "render_output_root", type: "string", subtype: "dir_path", required: true,
          description: "Folder of the pictures, on storage that all workers reach" },
        { key: "blendfile", type: "string", required: true, visible: "web",
          description: "The file that is rendered" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    const name = settings.blendfile.split(/[\\/]/).pop().replace(/\.blend$/, "");
    const root = settings.render_output_root.replace(/[\\/]$/, "");
    const picture = `${root}/${name}_####.${settings.format}`;
    const split = settings.split_samples;
    const sliceFile = (k) => `${root}/slices/${name}_####_${k}of${split}.exr`;

    for (const chunk of frameChunker(settings.frames, settings.chunk_size)) {
        const rendered = [];
        for (let k = 1; k <= split; k++) {
            const title = split > 1 ? `render-${chunk}-slice-${k}` : `render-${chunk}`;
            const share = split > 1 ? ["--slice", `${k}/${split}`, "--output", sliceFile(k)] : ["--output", picture];
            const task = author.Task(title, "blender");
            task.addCommand(candela(
                ["render", settings.blendfile, `--frames=${chunk}`, ...OF_RENDERING, ...share]));
            job.addTask(task);
            rendered.push(task);
        }
        if (split > 1) {
            const slices = [];
            for (let k = 1; k <= split; k++) slices.push(sliceFile(k));
            const task = author.Task(`assemble-${chunk}`, "blender");
            task.addCommand(candela(
                ["merge", ...slices, "--file", settings.blendfile, `--frames=${chunk}`, "--output", picture]));
            for (const before of rendered) task.addDependency(before);
            job.addTask(task);
        }
    }
}

function candela(args) {
    const all = ["--command", "candela", ...args, ...OF_EVERY_TASK, "--progress"];
    return author.Command("exec", { exe: "{blender}", args: all });
}
