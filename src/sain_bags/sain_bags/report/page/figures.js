// Figures as people read them; what is not known is a dash.

const UNKNOWN = "–";

function fixed(value, digits, unit) {
  if (value === null || value === undefined) return UNKNOWN;
  const text = value.toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits, signDisplay: "negative" });
  return `${text.replace("-", "−")}\u202f${unit}`;
}

function millimetres(metres) {
  return metres === null ? UNKNOWN : fixed(1000 * metres, Math.abs(metres) < 0.01 ? 1 : 0, "mm");
}

function fineMillimetres(metres) {
  return metres === null ? UNKNOWN : fixed(1000 * metres, 1, "mm");
}

function milliseconds(seconds) {
  if (seconds === null) return UNKNOWN;
  return seconds >= 10 ? fixed(seconds, 1, "s") : fixed(1000 * seconds, seconds < 0.01 ? 1 : 0, "ms");
}

function degrees(radians) {
  return radians === null ? UNKNOWN : `${fixed((radians * 180) / Math.PI, 0, "").trim()}°`;
}

function length(seconds) {
  if (seconds < 120) return fixed(seconds, seconds < 10 ? 2 : 1, "s");
  const minutes = Math.round(seconds / 60);
  return minutes < 120 ? `${minutes}\u202fmin` : `${Math.floor(minutes / 60)}\u202fh ${minutes % 60}\u202fmin`;
}

function bytes(count) {
  const units = ["B", "kB", "MB", "GB", "TB"];
  const power = Math.min(Math.floor(Math.log10(Math.max(count, 1)) / 3), units.length - 1);
  return fixed(count / 1000 ** power, power > 1 ? 1 : 0, units[power]);
}

function counted(count, one, many = `${one}s`) {
  return `${count.toLocaleString("en")} ${count === 1 ? one : many}`;
}

// Round steps from 0 that reach at least to the highest, no more than so many.
function ticks(highest, most = 5) {
  const raw = Math.max(highest, 1e-9) / most;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((size) => size >= raw * 0.999);
  const count = Math.ceil(highest / step - 1e-6) || 1;
  return Array.from({ length: count + 1 }, (_, index) => index * step);
}

function tickText(value, step) {
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return value.toFixed(digits);
}

export { UNKNOWN, bytes, counted, degrees, fineMillimetres, fixed, length, milliseconds, millimetres, tickText, ticks };
