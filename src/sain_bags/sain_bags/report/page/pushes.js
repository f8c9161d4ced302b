// The pushes of an episode in words and figures.

function title(episode) {
  const several = new Set(data.episodes.map((one) => one.namespace)).size > 1;
  return [several ? episode.namespace || "/" : "", `Episode ${episode.number}`, episode.name].filter(Boolean).join(" · ");
}

function shownText(episode) {
  const { time, recorded, thinned, unusable, fromPushes, cut } = episode.frames;
  const parts = [];
  if (fromPushes) parts.push("Scenes were not recorded: shown are those before and after each push.");
  else if (thinned > 1) parts.push(`Of ${counted(recorded, "recorded scene")} ${time.length.toLocaleString("en")} are shown: all where the disks came to rest, and every ${thinned}th in motion.`);
  if (unusable) parts.push(`${counted(unusable, "scene")} made no sense and are left out.`);
  if (cut) parts.push(`Only the first ${episode.pushes.length} pushes are shown.`);
  return parts.join(" ");
}

function verdictText(episode) {
  const last = episode.verdicts.at(-1);
  if (!last) return "";
  return `The planner’s last word: ${last.status}${last.message ? `, ${last.message}` : ""}.`;
}

function outcomeText(push) {
  if (push.outcome === "executed") return push.fallback ? "planned with the prior: the model had failed" : "";
  return [push.outcome === "refused" ? `refused, ${push.reason}` : "", push.message].filter(Boolean).join(": ");
}

function pushFacts(push, number, episode) {
  const facts = [
    ["Tool at", degrees(push.location)], ["Direction", degrees(push.angle)], ["Travel", millimetres(push.length)],
    ["Target moved", millimetres(push.moved)],
    ["Target to goal", episode.goal ? `${millimetres(push.distance[0])} → ${millimetres(push.distance[1])}` : null],
    [`Expected by ${push.model || "the planner"}`, push.expectedError === null ? null : `off by ${fineMillimetres(push.expectedError)}`],
    [`Expected by ${push.physicsModel || "physics"}`, push.physicsError === null ? null : `off by ${fineMillimetres(push.physicsError)}`],
    ["Planned in", push.planning === null ? null : milliseconds(push.planning)],
    ["Sent by", push.source || null],
  ].filter(([, value]) => value !== null);
  const text = outcomeText(push);
  return [
    make("h3", {}, `Push ${number + 1} of ${episode.pushes.length}`),
    ...(text ? [make("p", { class: "alarm" }, text)] : []),
    make("dl", {}, ...facts.flatMap(([key, value]) => [make("dt", {}, key), make("dd", {}, value)])),
  ];
}

function pushRows(episode, jump) {
  const remarks = episode.pushes.some((push) => outcomeText(push));
  const heads = ["Push", "Tool at", "Direction", "Travel", "Target moved", "To goal", "Planner off by", "Physics off by", "Planned in", ...(remarks ? ["Remark"] : [])];
  const head = make("tr", {}, ...heads.map((name) => make("th", { scope: "col", class: name === "Remark" ? "left" : null }, name)));
  const rows = episode.pushes.map((push, number) => {
    const button = make("button", { type: "button", "aria-label": `Go to push ${number + 1}` }, String(number + 1));
    button.addEventListener("click", () => jump(number));
    const cells = [degrees(push.location), degrees(push.angle), millimetres(push.length), millimetres(push.moved), millimetres(push.distance[1]),
      fineMillimetres(push.expectedError), fineMillimetres(push.physicsError), milliseconds(push.planning)];
    const remark = remarks ? [make("td", { class: "wide left alarm" }, outcomeText(push))] : [];
    return make("tr", { class: push.outcome }, make("td", {}, button), ...cells.map((text) => make("td", {}, text)), ...remark);
  });
  return [make("thead", {}, head), make("tbody", {}, ...rows)];
}
