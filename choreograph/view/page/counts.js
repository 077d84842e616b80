// The count and bar of a time. Bars are numbered from the first downbeat. An upbeat is in bar 0.

const LATE = 1.5; // beats after the last one, after which nothing is counted

export class Counts {
  constructor(dance) {
    this.times = dance.music_beats_s;
    this.numbers = dance.music_beat_numbers;
    let bar = 0;
    this.bars = this.numbers.map((number) => (number === 1 ? ++bar : bar));
  }

  // { bar, number } of the last beat until then. It is null before the first beat, long after one, or without bars.
  at(timeS) {
    const { times, numbers, bars } = this;
    if (numbers.length < 2 || timeS < times[0]) return null;
    let low = 0, high = times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= timeS) low = middle; else high = middle - 1;
    }
    const from = Math.max(0, low - 1);
    if (timeS - times[low] > LATE * (times[from + 1] - times[from])) return null;
    return { bar: bars[low], number: numbers[low] };
  }

  textAt(timeS) {
    const count = this.at(timeS);
    return count ? `bar ${count.bar}, count ${count.number}` : "";
  }
}
