// Long work of the server: its progress, a button that cancels it, and its result.

import { createElement } from "/page/elements.js";
import { get, remove } from "./api.js";

const SHOWN_AFTER_MS = 350;
const WAIT_S = [0.4, 0.25]; // of the server for the end of a job, in the first second, later

export class Cancelled extends Error {
  constructor() { super("cancelled"); this.name = "AbortError"; }
}

export class Jobs extends EventTarget {
  constructor(store) {
    super();
    this.store = store;
    this.box = document.getElementById("jobs");
    this.running = 0;
  }

  // Wait for the job of an answer { job }, and give its result. An answer without a job is the result.
  // onLog gets the lines of its log. onFirst gets a part of its result that is there first, or null if the job then
  // ends without a result. A quiet job has no progress bar.
  async finish(answer, label, { onLog = null, onFirst = null, quiet = false, signal = null } = {}) {
    if (!answer || !("job" in answer)) return answer;
    const row = new Row(label, () => remove(`jobs/${answer.job}`).catch(() => {}));
    const show = setTimeout(() => { if (!quiet) this.box.append(row.element); }, SHOWN_AFTER_MS);
    const cancel = () => remove(`jobs/${answer.job}`).catch(() => {});
    signal?.addEventListener("abort", cancel, { once: true });
    this.#count(1);
    try {
      return await this.#wait(answer.job, row, onLog, onFirst);
    } catch (error) {
      onFirst?.(null);
      throw error;
    } finally {
      clearTimeout(show);
      row.element.remove();
      this.#count(-1);
    }
  }

  #count(more) {
    this.running += more;
    document.body.setAttribute("aria-busy", String(this.running > 0));
    document.body.classList.toggle("working", this.running > 0);
  }

  async #wait(id, row, onLog, onFirst) {
    const since = performance.now();
    for (;;) {
      const early = performance.now() - since < 1000;
      const job = await get(`jobs/${id}?wait=${WAIT_S[early ? 0 : 1]}${onFirst ? "&first=true" : ""}`);
      if (job.first) { onFirst(job.first); onFirst = null; }
      onLog?.(job.log ?? []);
      if (job.state === "done") return this.#result(job.result);
      if (job.state === "cancelled") throw new Cancelled();
      if (job.state === "failed") throw new Error(job.error ?? "the work failed");
      row.show(job);
    }
  }

  // The result of a job that has changed the dance is its revision.
  async #result(result) {
    if (result && "revision" in result) await this.store.refresh(result.revision);
    return result ?? {};
  }
}

class Row {
  constructor(label, cancel) {
    this.bar = createElement("progress");
    this.bar.max = 1;
    this.bar.setAttribute("aria-label", label);
    this.label = label;
    this.stage = createElement("span", "stage");
    const button = createElement("button", "", ["Cancel"]);
    button.type = "button";
    button.addEventListener("click", () => { button.disabled = true; cancel(); });
    this.element = createElement("div", "job", [createElement("b", "", [label]), this.stage, this.bar, button]);
  }

  show({ stage, done, total }) {
    this.stage.textContent = stage?.toLowerCase() === this.label.toLowerCase() ? "" : stage ?? "";
    if (total > 0) this.bar.value = done / total;
  }
}
