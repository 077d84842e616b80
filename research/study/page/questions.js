// The questions about a dance or a pair, a row of choices each. Keys answer the highlighted question.

import { createElement } from "./elements.js";

const POINTS = [0, 1, 2, 3, 4, 5];
const ENDS = { 0: "0, very poor", 5: "5, excellent" };
export const SIDES = ["A", "B"];

export class Questions {
  constructor(form, onAnswer) {
    Object.assign(this, { form, onAnswer, item: null, rows: [], marked: 0 });
    form.addEventListener("change", ({ target }) => {
      this.#give(Number(target.name), Number(target.value));
      this.rows[Number(target.name) + 1]?.scrollIntoView({ block: "nearest" });
    });
    form.addEventListener("submit", (event) => event.preventDefault());
    form.addEventListener("focusin", ({ target }) => { if (target.name) this.mark(Number(target.name)); });
  }

  get isPair() { return this.item.dances.length > 1; }

  #row({ title, text }, i) {
    const choices = this.isPair ? SIDES : POINTS;
    const labels = choices.map((choice, number) => {
      const input = createElement("input");
      Object.assign(input, { type: "radio", name: `${i}`, value: `${number}` });
      input.setAttribute("aria-label", ENDS[choice] ?? `${choice}`);
      return createElement("label", "", [input, `${choice}`]);
    });
    const parts = [
      createElement("legend", "", [title]), createElement("p", "", [text]),
      createElement("div", this.isPair ? "scale two" : "scale", labels),
    ];
    if (!this.isPair) {
      const ends = createElement("div", "ends", [createElement("span", "", ["very poor"]), createElement("span", "", ["excellent"])]);
      ends.setAttribute("aria-hidden", "true");
      parts.push(ends);
    }
    return createElement("fieldset", "", parts);
  }

  // Shows the questions about an item with its answers, and highlights the first unanswered one.
  show(item, answers) {
    this.item = item;
    this.rows = item.questions.map((question, i) => this.#row(question, i));
    this.form.replaceChildren(...this.rows);
    item.questions.forEach(({ id }, i) => {
      if (id in answers) this.#inputs(i)[this.isPair ? item.dances.indexOf(answers[id]) : answers[id]].checked = true;
    });
    this.form.scrollTop = 0;
    const open = item.questions.findIndex(({ id }) => !(id in answers));
    this.mark(Math.max(0, open));
  }

  #inputs(index) { return this.rows[index].querySelectorAll("input"); }

  mark(index) {
    this.marked = Math.max(0, Math.min(this.rows.length - 1, index));
    this.rows.forEach((row, i) => row.classList.toggle("marked", i === this.marked));
    this.rows[this.marked].scrollIntoView({ block: "nearest" });
  }

  // Answers the highlighted question with its n-th choice and highlights the next.
  answer(number) {
    const index = this.marked;
    this.#inputs(index)[number].checked = true;
    this.#give(index, number);
    this.mark(index + 1);
  }

  #give(index, number) {
    const { item } = this;
    this.onAnswer(item.questions[index].id, this.isPair ? item.dances[number] : number);
  }
}
