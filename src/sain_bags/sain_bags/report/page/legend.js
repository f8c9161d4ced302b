// What marks and colours mean: the names and the order of the project's pictures.

import { draw, make } from "./elements.js";

const circle = (kind) => draw("circle", { class: kind, cx: 10, cy: 7, r: 6 });
const square = (kind) => draw("rect", { class: kind, x: 4, y: 1, width: 12, height: 12 });
const path = (kind, d) => draw("path", { class: kind, d });

function mark(shape) {
  return draw("svg", { viewBox: "0 0 20 14", "aria-hidden": "true" }, shape);
}

// The legend of the top view; three kinds of marks can be switched off.
function topViewLegend(disks, onToggle) {
  const own = disks.filter((disk) => disk.colour !== "other").map((disk) => [disk.number, disk.colour]);
  const bodies = [...new Map(own).entries()].sort(([one], [other]) => one - other);
  const others = disks.some((disk) => disk.colour === "other");
  const entry = (shape, text) => make("span", {}, mark(shape), text);
  const toggle = (name, shape, text) => {
    const box = make("input", { type: "checkbox" });
    box.checked = true;
    box.addEventListener("change", () => onToggle(name, box.checked));
    return make("label", {}, box, mark(shape), text);
  };
  return [
    entry(square("top"), "table"), entry(square("reach"), "reachable area"),
    ...bodies.map(([number, colour]) => entry(circle(`disk c-${colour}`), `body ${number}`)),
    ...(others ? [entry(circle("disk c-other"), "other body")] : []),
    entry(circle("start c-other"), "start"), entry(circle("ring"), "goal and tolerance"),
    entry(path("tool", "M1 7H19M14 3L19 7L14 11"), "push"),
    toggle("physics", circle("ghost physics"), "predicted by physics"),
    toggle("expected", circle("ghost expected"), "predicted by the planner"),
    toggle("paths", path("path c-target", "M1 11C6 2 12 12 19 3"), "paths"),
  ];
}

// The series of a chart of errors, each with its colour and the names of its models.
function seriesLegend(errors) {
  return [["physics", "physics", errors.physicsModels], ["expected", "planner", errors.models]]
    .filter(([kind]) => errors[kind])
    .map(([kind, name, models]) => make("span", { class: "series" }, mark(square(kind)), models.length ? `${name} (${models.join(", ")})` : name));
}

export { seriesLegend, topViewLegend };
