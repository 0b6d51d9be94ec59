"use strict";

/*
 * The numbers in this page.
 *
 * The element "meta" holds JSON; the elements "radii", "looks" and "frame-K" hold base64 of deflated arrays of unsigned
 * integers: of each array first the lowest bytes of all its numbers, then the next ones. An integer q of a quantity stands for
 * low + (high - low) f(q / largest); q > largest: not known. With the spacing "even" f(s) = s, with "square" s², and with
 * "signed" (1 + t |t|) / 2 of t = 2s − 1.
 */

const meta = JSON.parse(document.getElementById("meta").textContent);

/** Bytes of a packed element. */
async function unpack(id) {
  if (typeof DecompressionStream === "undefined") {
    throw new Error("This browser is too old to show the grains: it cannot decompress data (needs Chrome 80, Firefox 113 or Safari 16.4).");
  }
  const text = atob(document.getElementById(id).textContent);
  const packed = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Unsigned integers from their byte planes, which begin at an offset. */
function joinPlanes(bytes, offset, width, count) {
  if (width === 1) return bytes.subarray(offset, offset + count);
  const numbers = width === 2 ? new Uint16Array(count) : new Uint32Array(count);
  for (let plane = 0; plane < width; plane++) {
    const begin = offset + plane * count;
    for (let k = 0; k < count; k++) numbers[k] |= bytes[begin + k] << (8 * plane);
  }
  return numbers;
}

const SPACINGS = {
  even: (share) => share,
  square: (share) => share * share,
  signed: (share) => 0.5 + 0.5 * (2 * share - 1) * Math.abs(2 * share - 1),
};

/** Numbers of integers. */
function decode(name, integers) {
  const { low, high, largest, spacing } = meta.codes[name];
  const numbers = new Float64Array(integers.length), place = SPACINGS[spacing];
  for (let k = 0; k < numbers.length; k++) {
    const share = integers[k] / largest;
    numbers[k] = share > 1 ? NaN : low + (high - low) * place(share);
  }
  return numbers;
}

/** How far apart the numbers are that a quantity can have near a value. */
function resolution(name, value) {
  const { low, high, largest, spacing } = meta.codes[name], range = high - low, share = (value - low) / range;
  if (spacing === "even") return range / largest;
  const slope = 2 * Math.sqrt(Math.abs(spacing === "signed" ? 2 * share - 1 : share)); // of the spacing at the value
  return (range * (slope + 2 / largest)) / largest;
}

/** Contacts of a frame: first grains, second ends, forces, and ways to where they touch if not all grains are discs. */
function decodeContacts(arrays) {
  if (!arrays.contact_step) return { first: [], end: [], force: [], arm: null, known: arrays.contactsKnown };
  const first = Uint32Array.from(arrays.contact_step);
  for (let k = 1; k < first.length; k++) first[k] += first[k - 1];
  const arm = arrays.contact_arm_x ? [decode("arm", arrays.contact_arm_x), decode("arm", arrays.contact_arm_y)] : null;
  return { first, end: arrays.contact_end, force: decode("contact", arrays.contact_force), arm, known: true };
}

/** Arrays of a packed element, by name. */
async function unpackArrays(id, layout) {
  const bytes = await unpack(id), arrays = {};
  let offset = 0;
  for (const [name, width, count] of layout) {
    arrays[name] = joinPlanes(bytes, offset, width, count);
    offset += width * count;
  }
  return arrays;
}

const loaded = new Map(); // by number, the one used last at the end
const MOST_LOADED = Math.max(3, Math.floor(1.5e6 / meta.grains));

/** A frame with its numbers; those used last are kept, as many as may be in memory. */
function loadFrame(number) {
  const frame = loaded.get(number) || unpackFrame(number);
  loaded.delete(number);
  loaded.set(number, frame);
  if (loaded.size > MOST_LOADED) loaded.delete(loaded.keys().next().value);
  return frame;
}

async function unpackFrame(number) {
  const about = meta.frames[number];
  const arrays = { contactsKnown: about.contactCount !== null, ...(await unpackArrays(`frame-${number}`, about.arrays)) };
  const values = {};
  for (const field of meta.fields) {
    if (arrays[field.name]) values[field.name] = decode(field.name, arrays[field.name]);
  }
  const [x, y, angle, radii] = ["x", "y", "angle", "radius"].map((name) => (arrays[name] ? decode(name, arrays[name]) : null));
  return { number, about, x, y, angle, radii, values, contacts: decodeContacts(arrays) };
}

/** Radii of the grains at the start; frames have their own where sizes change. */
async function loadRadii() {
  const codes = joinPlanes(await unpack("radii"), 0, 4, meta.grains);
  return new Float32Array(codes.buffer);
}

/** Of each grain the rings around it, as x, y, x, y … in its radii; null for discs. */
async function loadLooks() {
  if (!meta.looks) return Array(meta.grains).fill(null);
  const { look, rings, points, x, y } = await unpackArrays("looks", meta.looks);
  const [right, up] = [decode("look", x), decode("look", y)];
  let ring = 0, point = 0;
  const looks = [null];
  for (const count of rings) {
    looks.push(
      Array.from({ length: count }, () => {
        const line = new Float32Array(2 * points[ring++]);
        for (let k = 0; k < line.length; k += 2) [line[k], line[k + 1]] = [right[point], up[point++]];
        return line;
      }),
    );
  }
  return Array.from(look, (number) => looks[number]);
}
