// The questions as a form with a row of points each. Number keys answer the highlighted question.

import { createElement } from "./elements.js";

const POINTS = [0, 1, 2, 3, 4, 5];

export class Questions {
  constructor(form, questions, onAnswer) {
    Object.assign(this, { form, questions, onAnswer, marked: 0 });
    this.rows = questions.map((question, i) => this.#row(question, i));
    form.replaceChildren(...this.rows);
    form.addEventListener("change", ({ target }) => {
      this.#give(Number(target.name), Number(target.value));
      this.rows[Number(target.name) + 1]?.scrollIntoView({ block: "nearest" });
    });
    form.addEventListener("submit", (event) => event.preventDefault());
    form.addEventListener("focusin", ({ target }) => { if (target.name) this.mark(Number(target.name)); });
  }

  #row({ title, text }, i) {
    const labels = POINTS.map((points) => {
      const input = createElement("input");
      Object.assign(input, { type: "radio", name: `${i}`, value: `${points}` });
      const ends = { 0: "0, very poor", 5: "5, excellent" };
      input.setAttribute("aria-label", ends[points] ?? `${points}`);
      return createElement("label", "", [input, `${points}`]);
    });
    const ends = createElement("div", "ends", [createElement("span", "", ["very poor"]), createElement("span", "", ["excellent"])]);
    ends.setAttribute("aria-hidden", "true");
    return createElement("fieldset", "", [
      createElement("legend", "", [title]), createElement("p", "", [text]), createElement("div", "scale", labels), ends,
    ]);
  }

  // Shows the answers for a dance and highlights its first unanswered question.
  show(answers) {
    this.form.reset();
    this.questions.forEach(({ id }, i) => {
      if (id in answers) this.rows[i].querySelectorAll("input")[answers[id]].checked = true;
    });
    this.form.scrollTop = 0;
    const open = this.questions.findIndex(({ id }) => !(id in answers));
    this.mark(Math.max(0, open));
  }

  mark(index) {
    this.marked = Math.max(0, Math.min(this.rows.length - 1, index));
    this.rows.forEach((row, i) => row.classList.toggle("marked", i === this.marked));
    this.rows[this.marked].scrollIntoView({ block: "nearest" });
  }

  // Answers the highlighted question and highlights the next.
  answer(points) {
    const index = this.marked;
    this.rows[index].querySelectorAll("input")[points].checked = true;
    this.#give(index, points);
    this.mark(index + 1);
  }

  #give(index, points) { this.onAnswer(this.questions[index].id, points); }
}
