// The pushes of an episode in words and figures.

import { make } from "./elements.js";
import { counted, degrees, fineMillimetres, milliseconds, millimetres } from "./figures.js";
import { named } from "./geometry.js";

function shownText(episode) {
  const { time, recorded, thinned, unusable, fromPushes, cut } = episode.frames;
  const parts = [];
  if (fromPushes) parts.push("The recording has no scenes of this episode. The page shows the scenes before and after each push.");
  else if (thinned > 1) parts.push(`${time.length.toLocaleString("en")} of ${counted(recorded, "recorded scene")} are shown: every scene at rest, and every ${thinned}th scene in motion.`);
  if (unusable) parts.push(`${counted(unusable, "scene")} with invalid values ${unusable === 1 ? "is" : "are"} left out.`);
  if (cut) parts.push(`Only the first ${episode.pushes.length} pushes are shown.`);
  return parts.join(" ");
}

function verdictText(episode) {
  const last = episode.verdicts.at(-1);
  const none = episode.pushes.length ? "" : "No push was sent in this episode. ";
  if (!last) return none;
  return `${none}Last decision of the planner: ${last.status}${last.message ? `, ${last.message}` : ""}.`;
}

function outcomeText(push) {
  if (push.outcome === "executed") return push.fallback ? "planned with the physics prior: the model had failed" : "";
  return [push.outcome === "refused" ? `refused, ${push.reason}` : "", push.message].filter(Boolean).join(": ");
}

// What a body is called: by the paper's words, or by its place and shape.
function bodyName(episode, number) {
  const body = episode.disks[number];
  return body?.name ? `${number} (${body.name})` : ["mid disk", "target"][number] ?? `disk ${number}`;
}

function pushFacts(push, number, episode) {
  const aimed = named(episode) ? bodyName(episode, episode.aimed) : "Target";
  const facts = [
    ["Body", named(episode) ? bodyName(episode, push.body) : null],
    ["Tool at", degrees(push.location)], ["Direction", degrees(push.angle)], ["Travel", millimetres(push.length)],
    ["Speed", push.speed === null ? null : `${(100 * push.speed).toFixed(1)} cm/s`],
    [`${aimed} moved`, millimetres(push.moved)],
    [`${aimed} to goal`, episode.poses.length ? `${millimetres(push.distance[0])} → ${millimetres(push.distance[1])}` : null],
    [`Error of ${push.physicsModel || "physics"}`, push.physicsError === null ? null : fineMillimetres(push.physicsError)],
    [`Error of ${push.model || "the planner"}`, push.expectedError === null ? null : fineMillimetres(push.expectedError)],
    ["Planning time", push.planning === null ? null : milliseconds(push.planning)],
    ["Sent by", push.source || null],
  ].filter(([, value]) => value !== null);
  const text = outcomeText(push);
  return [
    make("h3", {}, `Push ${number + 1} of ${episode.pushes.length}`),
    ...(text ? [make("p", { class: "alarm" }, text)] : []),
    make("dl", {}, ...facts.flatMap(([key, value]) => [make("dt", {}, key), make("dd", {}, value)])),
  ];
}

const COLUMNS = [
  ["Tool at", (push) => degrees(push.location)], ["Direction", (push) => degrees(push.angle)],
  ["Travel", (push) => millimetres(push.length)], ["Target moved", (push) => millimetres(push.moved)],
  ["Target to goal", (push) => millimetres(push.distance[1])],
  ["Physics error", (push) => fineMillimetres(push.physicsError)], ["Planner error", (push) => fineMillimetres(push.expectedError)],
  ["Planning time", (push) => milliseconds(push.planning)],
];

function pushRows(episode, jump) {
  if (!episode.pushes.length) return [];
  const remarks = episode.pushes.some((push) => outcomeText(push));
  const renamed = COLUMNS.map(([name, text]) => [name.replace("Target", bodyName(episode, episode.aimed)), text]);
  const columns = named(episode) ? [["Body", (push) => bodyName(episode, push.body)], ...renamed] : COLUMNS;
  const heads = ["Push", ...columns.map(([name]) => name), ...(remarks ? ["Remark"] : [])];
  const head = make("tr", {}, ...heads.map((name) => make("th", { scope: "col", class: name === "Remark" ? "left" : null }, name)));
  const rows = episode.pushes.map((push, number) => {
    const button = make("button", { type: "button", "aria-label": `Go to push ${number + 1}` }, String(number + 1));
    button.addEventListener("click", () => jump(number));
    const remark = remarks ? [make("td", { class: "wide left alarm" }, outcomeText(push))] : [];
    const cells = columns.map(([name, text]) => make("td", { "data-head": name }, text(push)));
    return make("tr", { class: push.outcome }, make("td", {}, button), ...cells, ...remark);
  });
  return [make("thead", {}, head), make("tbody", {}, ...rows)];
}

export { pushFacts, pushRows, shownText, verdictText };
