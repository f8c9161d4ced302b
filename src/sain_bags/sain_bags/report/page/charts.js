// Charts: each is drawn into a box of a known width, in pixels.

import { draw } from "./elements.js";
import { counted, fineMillimetres, milliseconds, tickText, ticks } from "./figures.js";
import { goalDistance, wantedName } from "./geometry.js";
import { size } from "./things.js";

const NAMES = { physics: "physics", expected: "planner" };
const LEFT = 34, BOTTOM = 22, TOP = 12;

function canvas(box, width, height, label) {
  const svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, height, "aria-hidden": "true" });
  box.setAttribute("aria-label", label);
  box.replaceChildren(svg);
  return svg;
}

function levels(svg, steps, width, y, unit) {
  const step = steps[1] - steps[0];
  for (const value of steps) {
    svg.append(
      draw("line", { class: "axis", x1: LEFT, x2: width, y1: y(value), y2: y(value) }),
      draw("text", { x: LEFT - 8, y: y(value) + 4, "text-anchor": "end" }, tickText(value, step)),
    );
  }
  svg.append(draw("text", { x: LEFT + 2, y: y(steps.at(-1)) - 7 }, unit));
}

// The target's error of each push, by physics alone and as the planner expected it.
function drawErrors(box, width, pushes, choose) {
  const height = 170, kinds = ["physics", "expected"];
  const known = pushes.flatMap((push, place) => (push.expectedError ?? push.physicsError) === null ? [] : [{ push, place }]);
  const highest = Math.max(...known.flatMap(({ push }) => kinds.map((kind) => 1000 * (push[`${kind}Error`] ?? 0))), 0.1);
  const steps = ticks(highest, 4), top = TOP + 10, y = (value) => height - BOTTOM - (value / steps.at(-1)) * (height - BOTTOM - top);
  const svg = canvas(box, width, height, `Errors of ${counted(known.length, "push", "pushes")}, up to ${highest.toFixed(1)} mm`);
  levels(svg, steps, width, y, "error of the target’s position [mm], by push");
  const room = (width - LEFT) / Math.max(known.length, 1), thick = Math.max(1, Math.min(16, 0.36 * room));
  known.forEach(({ push, place }, slot) => {
    const middle = LEFT + (slot + 0.5) * room;
    kinds.forEach((kind, side) => {
      const error = push[`${kind}Error`];
      if (error === null) return;
      const bar = draw("rect", {
        class: `bar ${kind}`, "data-push": place + 1, "data-error": error,
        x: middle + (side ? 1 : -1 - thick), width: thick, y: y(1000 * error), height: Math.max(y(0) - y(1000 * error), 1), rx: Math.min(2, thick / 3),
      }, draw("title", {}, `Push ${place + 1}, ${kind === "physics" ? push.physicsModel || "physics" : push.model || "planner"}: ${fineMillimetres(error)}`));
      bar.addEventListener("click", () => choose(place));
      svg.append(bar);
    });
    if (room > 14 || slot % Math.ceil(14 / room) === 0) {
      svg.append(draw("text", { x: middle, y: height - 5, "text-anchor": "middle" }, String(place + 1)));
    }
  });
}

// The target's way to the goal, over the recorded scenes: it shares its axis with the slider.
function drawDistance(box, width, episode) {
  const height = 74, { poses } = episode.frames, what = wantedName(episode);
  const values = poses.map((pose) => goalDistance(episode, pose));
  const highest = Math.max(...values, 1000 * episode.tolerance, 1), floor = height - 4;
  const x = (index) => (poses.length > 1 ? (index / (poses.length - 1)) * width : width / 2);
  const y = (value) => floor - (value / highest) * (floor - 18);
  const svg = canvas(box, width, height, `Distance from ${what} to goal, from ${values[0].toFixed(0)} to ${values.at(-1).toFixed(1)} mm`);
  const points = values.map((value, index) => `${x(index).toFixed(1)} ${y(value).toFixed(1)}`);
  const reached = floor - y(size(episode.tolerance));
  const cursor = draw("line", { class: "cursor", y1: 14, y2: floor });
  svg.append(
    draw("text", { x: 0, y: 9 }, `Distance from ${what} to goal`),
    draw("text", { x: width, y: 9, "text-anchor": "end" }, `${values[0].toFixed(0)} → ${values.at(-1).toFixed(1)} mm`),
    draw("rect", { class: "tolerance", x: 0, width, y: floor - reached, height: reached }),
    draw("path", { class: "area distance", d: `M0 ${floor}L${points.join("L")}L${width} ${floor}Z` }),
    draw("path", { class: "line distance", d: `M${points.join("L")}` }),
    cursor,
  );
  return (index) => {
    cursor.setAttribute("x1", x(index));
    cursor.setAttribute("x2", x(index));
  };
}

// How many pushes were predicted to within how much.
function drawDistribution(box, width, errors) {
  const height = 230, kinds = ["physics", "expected"].filter((kind) => errors[kind]);
  const highest = Math.max(...kinds.map((kind) => 1000 * errors[kind].sorted.at(-1)), 0.1);
  const steps = ticks(highest, 5), floor = height - BOTTOM - 16;
  const x = (value) => LEFT + (value / steps.at(-1)) * (width - LEFT - 8);
  const y = (share) => floor - share * (floor - TOP - 10);
  const svg = canvas(box, width, height, kinds.map((kind) => `${NAMES[kind]}: median ${fineMillimetres(errors[kind].median)}`).join(", "));
  levels(svg, [0, 25, 50, 75, 100], width, (percent) => y(percent / 100), "share of the pushes [%]");
  bottomAxis(svg, steps, x, height, width, "error of the target’s position [mm]");
  for (const kind of kinds) {
    const { sorted, shares, median } = errors[kind];
    const stairs = sorted.map((value, index) => `H${x(1000 * value).toFixed(1)}V${y(shares[index]).toFixed(1)}`);
    svg.append(
      draw("path", { class: `line ${kind}`, d: `M${x(0)} ${y(0)}${stairs.join("")}H${x(steps.at(-1))}` }),
      draw("circle", { class: kind, cx: x(1000 * median), cy: y(0.5), r: 4, "data-median": median },
        draw("title", {}, `median ${fineMillimetres(median)}`)),
    );
  }
}

// How long plans took.
function drawPlanning(box, width, planning) {
  const height = 230, floor = height - BOTTOM - 16, { counts, edges } = planning;
  const seconds = edges.at(-1) > 2, unit = seconds ? 1 : 1000;
  const steps = ticks(Math.max(...counts), 4).filter((value) => Number.isInteger(value));
  const across = ticks(unit * edges.at(-1), 6).filter((value) => value <= unit * edges.at(-1) * 1.001);
  const x = (time) => LEFT + (time / (unit * edges.at(-1))) * (width - LEFT - 8);
  const y = (count) => floor - (count / steps.at(-1)) * (floor - TOP - 32);
  const svg = canvas(box, width, height, `Planning times of ${counted(planning.plans, "plan")}: median ${milliseconds(planning.median)}`);
  levels(svg, steps, width, y, "number of plans");
  bottomAxis(svg, across, x, height, width, `planning time [${seconds ? "s" : "ms"}]`);
  counts.forEach((count, bin) => {
    if (!count) return;
    const left = x(unit * edges[bin]), right = x(unit * edges[bin + 1]);
    svg.append(draw("rect", {
      class: "plans", "data-count": count, x: left + 0.75, width: Math.max(right - left - 1.5, 1), y: y(count), height: y(0) - y(count), rx: 2,
    }, draw("title", {}, `${milliseconds(edges[bin])} to ${milliseconds(edges[bin + 1])}: ${counted(count, "plan")}`)));
  });
  const near = Math.abs(x(unit * planning.p95) - x(unit * planning.median)) < 180;
  [["median", planning.median, 0], ["95 %", planning.p95, near ? 15 : 0]].forEach(([name, time, lower]) => {
    const place = x(unit * time), side = place > width - 110 ? "end" : "start";
    svg.append(
      draw("line", { class: "mark", x1: place, x2: place, y1: TOP - 6 + lower, y2: floor }),
      draw("text", { class: "strong", x: place + (side === "end" ? -5 : 5), y: TOP + 4 + lower, "text-anchor": side }, `${name} ${milliseconds(time)}`),
    );
  });
}

function bottomAxis(svg, steps, x, height, width, unit) {
  for (const value of steps) {
    svg.append(draw("text", { x: x(value), y: height - BOTTOM, "text-anchor": "middle" }, tickText(value, steps[1] - steps[0])));
  }
  svg.append(draw("text", { x: width - 8, y: height - 3, "text-anchor": "end" }, unit));
}

export { BOTTOM, LEFT, TOP, bottomAxis, canvas, drawDistance, drawDistribution, drawErrors, drawPlanning, levels };
