// What a laboratory has learned: errors and parameters against the number of pushes.

import { BOTTOM, LEFT, TOP, bottomAxis, canvas, levels } from "./charts.js";
import { draw, find, make, onWidth } from "./elements.js";
import { ticks } from "./figures.js";

const CLASSES = { planar: "physics", physics: "distance" };

function band(points, x, y) {
  const known = points.filter(([, , low, high]) => low !== null && high !== null);
  const edge = (index) => known.map((row) => `${x(row[0]).toFixed(1)} ${y(Math.max(row[index], 0)).toFixed(1)}`);
  return known.length ? `M${[...edge(2), ...edge(3).reverse()].join("L")}Z` : "";
}

function drawErrors(box, width, learning) {
  const height = 230, curves = learning.errors.map(({ name, pushes, rows }) =>
    ({ name, points: rows.map((row, i) => [pushes[i], ...row.map((v) => v === null ? null : 1000 * v)]).filter((row) => row[1] !== null) }));
  const steps = ticks(Math.max(0.1, ...curves.flatMap(({ points }) => points.map((row) => row[1]))) * 1.2, 4);
  const across = ticks(Math.max(learning.pushes, 1), 6).filter((value) => value <= Math.max(learning.pushes, 1));
  const x = (count) => LEFT + (count / Math.max(learning.pushes, 1)) * (width - LEFT - 8);
  const y = (value) => height - BOTTOM - 16 - (Math.min(value / steps.at(-1), 1)) * (height - BOTTOM - 38);
  const svg = canvas(box, width, height, curves.map(({ name, points }) => `${name}: ${points.at(-1)?.[1].toFixed(2) ?? "–"} mm`).join(", "));
  levels(svg, steps, width, y, "mean error of the latest 50 pushes [mm], 95 % interval");
  bottomAxis(svg, across, x, height, width, "pushes learned from");
  curves.forEach(({ name, points }, place) => {
    const kind = CLASSES[name] ?? "expected", line = points.map((row) => `${x(row[0]).toFixed(1)} ${y(row[1]).toFixed(1)}`);
    svg.append(draw("path", { class: `band ${kind}`, d: band(points, x, y) }), draw("path", { class: `line ${kind}`, "data-name": name, d: `M${line.join("L")}` }),
      draw("text", { class: kind, x: width - 8, y: TOP + 12 + 14 * place, "text-anchor": "end" }, name));
  });
}

function showLearning({ learning }) {
  if (!learning) return;
  find("learning").hidden = false;
  find("learning-note").textContent = `${learning.laboratory}: ${learning.pushes} pushes; in service: ${learning.service}`;
  onWidth(find("learning-errors"), (width) => drawErrors(find("learning-errors"), width, learning));
  const text = (row) => { const [value, low, high] = (row ?? []).map((v) => v === null ? "–" : Number(v.toPrecision(3))); return row ? `${value} [${low}, ${high}]` : "–"; };
  find("learning-parameters").append(...learning.parameters.map(({ name, unit, rows }) =>
    make("tr", {}, ...[name, unit, text(rows[0]), text(rows.at(-1))].map((cell) => make("td", {}, cell)))));
  find("learning-events").append(...learning.events.map(([pushes, kind, what]) => make("li", {}, `${pushes}: ${kind}: ${what}`)));
}

export { showLearning };
