/* Numbers for people, and the bar that says which color stands for which value. */

const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";

/** A number for people, with some digits. */
function format(value, digits = 4) {
  if (value === null || Number.isNaN(value)) return "–";
  const [mantissa, exponent] = value.toPrecision(digits).split("e");
  const size = Math.abs(value);
  if (exponent === undefined && (size >= 1e-3 || size === 0)) return tidy(mantissa);
  const [m, e] = value.toExponential(digits - 1).split("e");
  const power = Math.abs(Number(e)).toString().replace(/\d/g, (digit) => SUPERSCRIPTS[digit]);
  return `${tidy(m)}·10${Number(e) < 0 ? "⁻" : ""}${power}`;
}

/** Without zeros at the end, and with a real minus sign. */
function tidy(text) {
  const short = text.includes(".") ? text.replace(/\.?0+$/, "") : text;
  return short.replace("-", "−");
}

/** A value of a grain with those of its digits that are known: not finer than the page stores it. */
function formatKnown(name, value, most) {
  const step = resolution(name, value);
  if (!(step > 0)) return format(value, most);
  if (Math.abs(value) < step) return "0";
  const digits = Math.floor(Math.log10(Math.abs(value)) + 1e-9) + 1 - Math.ceil(Math.log10(step) - 1e-9);
  return format(value, Math.max(1, Math.min(digits, most)));
}

/** 1, 2 or 5 times a power of ten: the largest such number that is not above a positive one. */
function roundDown(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * ([5, 2].find((times) => times * power <= value * (1 + 1e-9)) || 1);
}

/** Round values within a range, with their texts: powers of ten, or four to ten evenly spaced ones. */
function chooseTicks([low, high], isLogarithmic) {
  const isAbout = 1e-6; // ends of the range are rounded
  if (isLogarithmic) {
    const first = Math.ceil(Math.log10(low) - isAbout), last = Math.floor(Math.log10(high) + isAbout);
    return Array.from({ length: last - first + 1 }, (_, k) => 10 ** (first + k)).map((value) => [value, format(value, 1)]);
  }
  const step = roundDown((high - low) / 4), first = Math.ceil(low / step - isAbout), last = Math.floor(high / step + isAbout);
  const power = (value) => Math.floor(Math.log10(value) + isAbout);
  const largest = power(Math.max(Math.abs(first), Math.abs(last), 1) * step);
  const digits = largest - (largest < 5 ? Math.min(power(step), 0) : power(step)) + 1;
  return Array.from({ length: last - first + 1 }, (_, k) => (first + k) * step).map((value) => [value, format(value, digits)]);
}

/** What is to be said about values that have no color of their own, if there are any. */
function tellBeyond({ name, scale }, [low, high], show) {
  const { low: least, high: most } = meta.codes[name], number = (value) => format(show(value), 3);
  if (scale === "logarithmic") return ["grains without color: none"];
  if (scale === "centered") return most > high ? [`values up to ±${number(most)} share the colors of the ends`] : [];
  return [
    ...(least < low ? [`values down to ${number(least)} share the first color`] : []),
    ...(most > high ? [`values up to ${number(most)} share the last color`] : []),
  ];
}

/** Show what colors mean.
 *  @param {number[]} range smallest and largest value with a color of their own
 *  @param {boolean} isOneFrame whether that is the range of one frame
 *  @param {boolean} isKnown whether the frame has these values */
function showBar(field, colors, range, isOneFrame, isKnown) {
  const { label, unit, scale, reference } = field, isRise = reference !== null, isLogarithmic = scale === "logarithmic";
  const show = (value) => (isRise ? (value - reference) * 1e3 : value);
  const name = isRise ? `${label} above ${reference} K [mK]` : `${label} [${unit}]`;
  const about = isKnown ? (isOneFrame && !isLogarithmic ? [] : tellBeyond(field, range, show)) : ["not recorded in this frame"];
  $("bar-label").textContent = [name, ...about].join("; ");
  $("bar-colors").style.background = `linear-gradient(to right, ${colors.filter((_, k) => k % 15 === 0).join(",")})`;
  const [low, high] = range.map(show);
  const share = (value) => (isLogarithmic ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low));
  const ticks = chooseTicks([low, high], isLogarithmic);
  $("bar-ticks").replaceChildren(...ticks.map(([value, text]) => makeTick(text, share(value))));
}

function makeTick(text, share) {
  const tick = document.createElement("span");
  tick.textContent = text;
  tick.style.left = `${100 * share}%`;
  tick.style.transform = `translateX(${share < 0.03 ? 0 : share > 0.97 ? -100 : -50}%)`;
  return tick;
}
