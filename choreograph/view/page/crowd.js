// Several dancers at a time. The camera sees them as one wide dancer, whose joints are those of the first.

export class Crowd {
  constructor(dancers) {
    this.dancers = dancers;
    const stages = dancers.map((dancer) => dancer.path.stage());
    const reach = (sign) => [0, 1].map((k) => Math.max(...stages.map((s) => sign * s.middle[k] + s.radius)));
    const [high, low] = [reach(1), reach(-1).map((v) => -v)];
    const middle = high.map((v, k) => (v + low[k]) / 2);
    this.spread = (high[0] - low[0]) / 2;
    this.path = {
      places: dancers[0].path.places,
      at: () => middle,
      stage: () => ({ middle, radius: 0 }),
    };
  }

  get positions() { return this.dancers[0].positions; }

  pose(timeS) { for (const dancer of this.dancers) dancer.pose(timeS); }

  height() { return Math.max(...this.dancers.map((dancer) => dancer.height())); }
}
