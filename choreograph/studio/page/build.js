// A repertoire from the user's own takes: a folder of files is sent, checked, built with a log, and danced with.

import { post, remove, upload } from "./api.js";
import { attempt, say } from "./messages.js";

const TAKES = /\.(bvh|c3d|glb|npz|fbx|wav|mp3|flac|ogg|m4a|csv|json|txt)$/i;

export class Build {
  constructor(store, jobs) {
    Object.assign(this, { store, jobs });
    this.log = document.getElementById("build-log");
    this.button = document.getElementById("build-choose");
    this.names = document.getElementById("repertoire-names");
    this.names.addEventListener("change", () => this.use(this.names.value));
    const files = document.getElementById("build-files");
    this.button.addEventListener("click", () => files.click());
    files.addEventListener("change", () => { const chosen = [...files.files]; files.value = ""; if (chosen.length) this.build(chosen); });
    store.addEventListener("state", () => this.show());
  }

  show() {
    const { repertoire } = this.store.state;
    const { name, takes, clips, genres } = repertoire;
    this.names.replaceChildren(...(repertoire.names ?? [name]).map((one) => new Option(one, one)));
    this.names.value = name;
    document.getElementById("repertoire-row").hidden = this.names.options.length < 2;
    document.getElementById("repertoire").textContent =
      `${name}: ${takes} takes, ${clips} clips${genres.length ? `, ${genres.length} genres` : ""}.`;
  }

  // files: takes and their songs, as chosen or dropped.
  async build(files) {
    this.button.disabled = true;
    this.log.hidden = false;
    const lines = [];
    const write = (line) => { lines.push(line); this.log.textContent = lines.join("\n"); };
    await attempt(async () => {
      const takes = files.filter(({ name }) => TAKES.test(name) && !name.startsWith("."));
      if (!takes.length) throw new Error(`expected takes (.bvh, .fbx, .glb, .npz, .c3d) and their songs, got ${files[0].name}`);
      await remove("build");
      for (const [i, file] of takes.entries()) {
        write(`${i + 1} of ${takes.length}: ${file.name}`);
        await upload("build", file);
      }
      await this.#job("build/check", {}, "Checking the takes", lines);
      const name = document.getElementById("build-name").value.trim() || "my-takes";
      const { name: built } = await this.#job("build/start", { name }, "Building the repertoire", lines);
      await this.store.refresh();
      await this.use(built);
    });
    this.button.disabled = false;
  }

  // A job whose log is added to the lines.
  async #job(path, body, label, lines) {
    let latest = [];
    const onLog = (log) => {
      latest = log;
      this.log.textContent = [...lines, ...log].join("\n");
      this.log.scrollTop = this.log.scrollHeight;
    };
    this.log.scrollIntoView({ block: "nearest" });
    const result = await this.jobs.finish(await post(path, body), label, { onLog });
    lines.push(...latest);
    return result;
  }

  // Make the dance again with another repertoire.
  use(name) {
    return attempt(async () => {
      await this.jobs.finish(await this.store.change("repertoire", { name }), `Dancing with ${name}`);
      say(`Dances are made with ${name} now.`);
    });
  }
}
