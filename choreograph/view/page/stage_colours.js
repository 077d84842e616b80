// The stage's colours, from the style sheet, so that they follow the colour scheme.

export function stageColours() {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => {
    const hex = style.getPropertyValue(name).trim();
    return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
  };
  return {
    stage: colour("--stage"), floor: colour("--floor"), line: colour("--line"), shade: colour("--shadow"),
    exposure: Number(style.getPropertyValue("--light")),
  };
}
