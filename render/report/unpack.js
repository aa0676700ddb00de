// Unpacks the data that sim/report/page_data.cpp packs: base64 of a range code of numbers, each as its
// difference from what those before it predict.
function bytesOf(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const s = atob(text), b = new Uint8Array(s.length);
  for (let i = 0; i < s.length; i++) b[i] = s.charCodeAt(i);
  return b;
}
const numberModel = 24 * 32 + 32 + 32 * 4;        // chances: lengths by context, signs, leading bits
function rangeDecoder(bytes, chances) {
  const fast = new Uint16Array(chances).fill(32768), slow = new Uint16Array(chances).fill(32768);
  const state = new Uint32Array([0xffffffff, bytes[0] << 24 | bytes[1] << 16 | bytes[2] << 8 | bytes[3]]), end = bytes.length;   // range and code: a closure's own variables would be boxed
  let at = 4;
  function bit(m) {
    const f = fast[m], s = slow[m], zero = (state[0] >>> 15) * ((f + s) >>> 2);
    let range = zero, code = state[1], one = 0;
    if (code < zero) { fast[m] = f + ((65535 - f) >> 4); slow[m] = s + ((65535 - s) >> 7); }
    else { code -= zero; range = state[0] - zero; one = 1; fast[m] = f - (f >> 4); slow[m] = s - (s >> 7); }
    while (range < 16777216) { range *= 256; code = code * 256 + (at < end ? bytes[at] : 0); at++; }
    state[0] = range; state[1] = code;
    return one;
  }
  function bits(x, count) {                       // behind x, each as likely 0 as 1
    let range = state[0], code = state[1];
    for (let k = 0; k < count; k++) {
      range = range >>> 1; x *= 2; if (code >= range) { code -= range; x++; }
      while (range < 16777216) { range *= 256; code = code * 256 + (at < end ? bytes[at] : 0); at++; }
    }
    state[0] = range; state[1] = code;
    return x;
  }
  function tree(m, count) { let node = 1; for (let k = 0; k < count; k++) node = 2 * node + bit(m + node); return node - (1 << count); }
  const decoder = { bit, tree, length: 0, number(m, context) {
    const length = decoder.length = tree(m + 32 * Math.min(context, 23), 5);
    if (length === 0) return 0;
    const negative = bit(m + 768 + length), led = Math.min(2, length - 1), rest = length - 1 - led;
    const x = bits(1 << led | tree(m + 800 + 4 * length, led), rest);
    return negative ? -x : x;
  } };
  return decoder;
}
// -> the corners of the triangles, and of every vertex those known before it: a, b of an edge, c opposite
function unpackMesh(bytes, nV, nT) {
  const OPS = 8 * 8 * 5 * 8, START = OPS, NUMBER = OPS + 1, d = rangeDecoder(bytes, OPS + 1 + numberModel);
  const tri = new Uint32Array(3 * nT), known = new Int32Array(3 * nV), many = new Uint8Array(nV), from = new Int32Array(nV).fill(-1);
  const most = 3 * nT + 3, vertex = new Int32Array(most), opposite = new Int32Array(most), next = new Int32Array(most), previous = new Int32Array(most);
  const open = new Uint8Array(most), waits = new Uint8Array(most), waiting = [];
  let met = 0, edges = 0, done = 0, last = 0;
  const meet = (a, b, c) => { known[3 * met] = a; known[3 * met + 1] = b; known[3 * met + 2] = c; return met++; };
  const apart = () => { const k = Math.max(0, met - 1); return meet(k, k, k); };
  const other = () => met - 1 - d.number(NUMBER, 0);
  const count = v => { if (many[v] < 7) many[v]++; };
  const add = (v, o) => { vertex[edges] = v; opposite[edges] = o; open[edges] = waits[edges] = 1; waiting.push(edges); return from[v] = edges++; };
  const link = (a, b) => { next[a] = b; previous[b] = a; };
  const wait = i => { if (!waits[i]) { waits[i] = 1; waiting.push(i); } };
  const triangle = (a, b, c) => { tri[3 * done] = a; tri[3 * done + 1] = b; tri[3 * done + 2] = c; done++; count(a); count(b); count(c); };
  function close(gone, kept, to, o) {
    open[gone] = 0; opposite[kept] = o; link(kept, to);
    if (next[to] === kept) open[kept] = open[to] = 0; else wait(kept);
  }
  function conquer(i) {
    waits[i] = 0;
    if (!open[i]) return;
    const n = next[i], p = previous[i], s = vertex[i], e = vertex[n], after = next[n], what = last = d.tree(((many[s] * 8 + many[e]) * 5 + last) * 8, 3);
    if (what === 0) return;
    const w = what === 1 ? meet(s, e, opposite[i]) : what === 2 ? vertex[p] : what === 3 ? vertex[after] : other();
    triangle(e, s, w);
    if (what === 2) return close(i, p, n, s);
    if (what === 3) return close(n, i, after, e);
    const there = from[w];
    opposite[i] = e; wait(i);
    const parts = there >= 0 && open[there], before = parts ? previous[there] : i, k = add(w, s);
    if (parts) link(i, there);
    link(before, k); link(k, n);
  }
  while (done < nT) {
    const [a, b, c] = [0, 1, 2].map(() => d.bit(START) ? other() : apart());
    triangle(a, b, c);
    const x = add(a, c), y = add(b, a), z = add(c, b); link(x, y); link(y, z); link(z, x);
    for (let k = 0; k < waiting.length; k++) conquer(waiting[k]);
    waiting.length = 0;
  }
  while (met < nV) apart();
  return { tri, known };
}
const MISSING = -2147483648;
// -> for every column its numbers, and in `shown` the same with MISSING where there is none
function unpackNumbers(bytes, about, known, reference) {
  const n = about.n, many = numberModel + 4, d = rangeDecoder(bytes, many * about.components), limit = 1 << 29;
  const numbers = new Int32Array(n * about.components), shown = about.missing ? new Int32Array(numbers.length) : numbers, length = new Uint8Array(n);
  for (let column = 0; column < about.components; column++) {
    const x = numbers.subarray(column * n, (column + 1) * n), seen = shown.subarray(column * n, (column + 1) * n), m = column * many, by = about.by[column], r = reference;
    for (let k = 0; k < n; k++) {
      let a = 0, b = 0, c = 0, context = 0, number = r ? r[k] : 0;
      if (k > 0) {
        if (known) { a = known[3 * k]; b = known[3 * k + 1]; c = known[3 * k + 2]; } else { a = b = k - 1; c = k > 1 ? k - 2 : 0; }
        context = (length[a] + length[b] + length[k - 1] + 1) / 3 | 0;
        if (by === 0) { number += x[a] + x[b] - x[c]; if (r) number -= r[a] + r[b] - r[c]; }
        else if (by === 1) { number += Math.floor((x[a] + x[b]) / 2); if (r) number -= Math.floor((r[a] + r[b]) / 2); }
        number = Math.max(-limit, Math.min(limit, number));
      }
      if (about.missing) {
        const i = k > 0 ? (seen[a] === MISSING) + 2 * (seen[b] === MISSING) : 0;
        if (d.bit(m + numberModel + i)) { length[k] = 0; x[k] = number; seen[k] = MISSING; continue; }
      }
      x[k] = number + d.number(m, context);
      seen[k] = x[k]; length[k] = d.length;
    }
  }
  return { numbers, shown };
}
