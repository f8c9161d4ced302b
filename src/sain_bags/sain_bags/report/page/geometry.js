// Distances in an episode, in millimetres, and what it is about.

function apart(one, other) {
  return 1000 * Math.hypot(one[0] - other[0], one[1] - other[1]);
}

// Whether bodies are called by their shapes.
function named(episode) {
  return episode.disks.some((disk) => disk.name);
}

// What the goal is about.
function wantedName(episode) {
  return named(episode) ? "bodies" : "target";
}

// The largest distance of a body from its pose [mm].
function goalDistance(episode, poses) {
  return Math.max(...episode.poses.map(({ body, x, y }) => (poses[body] ? apart(poses[body], [x, y]) : 0)));
}

function wayLength(poses, number) {
  let sum = 0;
  for (let index = 1; index < poses.length; index += 1) sum += apart(poses[index - 1][number], poses[index][number]);
  return sum;
}

export { goalDistance, named, wantedName, wayLength };
