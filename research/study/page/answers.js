// The rater's answers: stored in the browser if it allows that, and saved as a file.

export class Answers extends EventTarget {
  constructor(study) {
    super();
    this.study = study;
    this.items = itemsOf(study);
    this.storageKey = `choreograph-study-${study.study}`;
    this.state = this.#load() ?? newState();
  }

  #load() {
    try {
      return JSON.parse(localStorage.getItem(this.storageKey));
    } catch {
      return null; // no storage, or something else under our key
    }
  }

  #store() {
    try {
      localStorage.setItem(this.storageKey, JSON.stringify(this.state));
    } catch {
      // The answers then last as long as the page, and can still be saved.
    }
    this.dispatchEvent(new Event("change"));
  }

  get name() { return this.state.rater_name; }
  set name(name) { this.state.rater_name = name.trim(); this.#store(); }
  get at() { return Math.min(this.state.at, this.items.length - 1); }
  set at(index) { this.state.at = index; this.#store(); }

  of(id) { return this.state.answers[id] ?? {}; }

  // An answer is the points of a dance, or the chosen dance of a pair.
  give(id, question, answer) {
    this.state.answers[id] = { ...this.of(id), [question]: answer };
    this.#store();
  }

  isDone({ id, questions }) { return questions.every(({ id: question }) => question in this.of(id)); }
  get open() { return this.items.map((item, i) => [item, i]).filter(([item]) => !this.isDone(item)).map(([, i]) => i); }

  // Name and text of the rating file, see `data_schema/rating.schema.json`.
  file() {
    this.state.save += 1;
    this.#store();
    const { rater_id, rater_name, save, answers } = this.state;
    const rating = {
      format: "choreograph-rating", version: 1, study: this.study.study, rater_id, rater_name, save, answers,
    };
    return { name: `rating-${rater_id}.json`, text: `${JSON.stringify(rating, null, 1)}\n` };
  }

  startOver() {
    this.state = newState();
    this.#store();
  }
}

// What is asked about, in order: every dance if there are questions about one, then the pairs.
function itemsOf({ dances, questions, pairs }) {
  const single = questions.length ? dances.map(({ id }) => ({ id, dances: [id], questions })) : [];
  return [...single, ...pairs];
}

function newState() {
  const bytes = crypto.getRandomValues(new Uint8Array(8));
  const rater_id = Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
  return { rater_id, rater_name: "", save: 0, at: 0, answers: {} };
}
