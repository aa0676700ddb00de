// ---- texts and numbers: a text is a string, { label }, or a list of these -------------------------
const word = w => w === null || w === undefined ? "" : typeof w === "string" ? w
  : Array.isArray(w) ? w.map(word).join("") : L(w.label);
const english = w => { const now = language; language = "en"; const text = word(w); language = now; return text; };
const escaped = s => String(s).replace(/[&<>"]/g, c => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", "\"": "&quot;" })[c]);
function shown(v, digits = 4) {
  if (v === null || v === undefined || !Number.isFinite(v)) return "–";
  if (Number.isInteger(v) && Math.abs(v) < 1e7) return String(v).replace("-", "−");
  const a = Math.abs(v);
  const text = a < 1e-4 || a >= 1e7 ? v.toExponential(digits - 2) : String(Number(v.toPrecision(digits)));
  return text.replace("-", "−");
}
const isBanded = c => c !== null && typeof c === "object" && "value" in c;
const valueOf = c => isBanded(c) ? c.value : typeof c === "number" ? c : null;
const withUnit = (text, unit) => unit && text !== "–" ? text + " " + unit : text;
const bandText = c => isBanded(c) && c.low !== null && c.high !== null ? ` [${shown(c.low, 3)}, ${shown(c.high, 3)}]` : "";
const cellText = c => isBanded(c) || typeof c === "number" || c === null ? shown(valueOf(c)) + bandText(c) : word(c);

// ---- CSV, with every digit ------------------------------------------------------------------------
const field = v => v === null || v === undefined ? "" : /[",\r\n]/.test(v) ? "\"" + String(v).replace(/"/g, "\"\"") + "\"" : String(v);
const csv = rows => rows.map(r => r.map(field).join(",")).join("\r\n") + "\r\n";
const heads = (name, banded) => banded ? [name, name + " low", name + " high"] : [name];
const fields = (c, banded) => banded ? isBanded(c) ? [c.value, c.low, c.high] : [valueOf(c), null, null]
  : [isBanded(c) || typeof c === "number" ? valueOf(c) : english(c)];
const titled = (w, unit) => english(w) + (unit ? " / " + unit : "");
const tables = {
  table(b) {
    const banded = b.columns.map((_, k) => b.rows.some(r => isBanded(r[k])));
    return [b.columns.flatMap((c, k) => heads(titled(c.head, c.unit), banded[k])),
      ...b.rows.map(r => r.flatMap((c, k) => fields(c, banded[k])))];
  },
  bars(b) {
    const banded = b.series.map((_, k) => b.rows.some(r => isBanded(r.values[k])));
    return [["name", ...b.series.flatMap((s, k) => heads(titled(s.name, b.unit), banded[k]))],
      ...b.rows.map(r => [english(r.name), ...r.values.flatMap((c, k) => fields(c, banded[k]))])];
  },
  panels(b) {
    return [["panel", "series", "x", "y", "low", "high"], ...b.panels.flatMap(p => p.series.flatMap(s =>
      s.x.map((x, k) => [english(p.title), english(s.name), p.names ? p.names[x] : x, s.y[k], s.low ? s.low[k] : null, s.high ? s.high[k] : null])))];
  },
  histogram(b) { return [["series", titled(b.x, b.unit)], ...b.series.flatMap(s => s.values.map(v => [english(s.name), v]))]; },
  polar(b) {
    return [["panel", "series", "angle / deg", "deviation / " + b.unit],
      ...b.panels.flatMap(p => p.series.flatMap(s => s.angle.map((a, k) => [english(p.title), english(s.name), a, s.deviation[k]])))];
  },
};

// ---- drawing --------------------------------------------------------------------------------------
const ruler = document.createElement("canvas").getContext("2d");
ruler.font = "12px system-ui, \"DejaVu Sans\", \"Noto Sans CJK SC\", sans-serif";
const widthOf = text => ruler.measureText(text).width;
function short(text, most) {                      // the middle is removed first, because names differ at their ends
  if (widthOf(text) <= most) return text;
  for (let k = text.length - 1; k > 2; k--) {
    const s = text.slice(0, Math.ceil(k / 2)) + "…" + text.slice(text.length - Math.floor(k / 2));
    if (widthOf(s) <= most) return s;
  }
  return "…";
}
function ticks(low, high, room) {                 // round numbers, as many as fit
  const span = high - low, rough = span / Math.max(1, room), power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map(m => m * power).find(s => s >= rough), all = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * span; k++) all.push(k * step);
  return all;
}
const tickText = (v, all) => {
  const step = all.length > 1 ? Math.abs(all[1] - all[0]) : Math.abs(v) || 1, digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return (digits > 6 || Math.abs(v) >= 1e7 ? v.toExponential(1) : v.toFixed(digits)).replace(/^-(0(\.0+)?)$/, "$1").replace("-", "−");
};
function padded(values, zero) {
  let low = zero ? 0 : Infinity, high = zero ? 0 : -Infinity;
  for (const v of values) if (v !== null && Number.isFinite(v)) { if (v < low) low = v; if (v > high) high = v; }
  if (low > high) return [0, 1];
  if (low === high) { const d = Math.abs(low) * .1 || 1; return [low - (zero && low === 0 ? 0 : d), high + d]; }
  const d = .04 * (high - low);
  return [zero && low === 0 ? 0 : low - d, zero && high === 0 ? 0 : high + d];
}
const text = (x, y, s, anchor = "start", more = "") => `<text x="${x.toFixed(1)}" y="${y.toFixed(1)}" text-anchor="${anchor}" ${more}>${escaped(s)}</text>`;
const line = (x, y, u, v, of) => `<line x1="${x.toFixed(1)}" y1="${y.toFixed(1)}" x2="${u.toFixed(1)}" y2="${v.toFixed(1)}" class="${of}"/>`;
function path(points, X, Y) {                      // broken where a value is missing
  let d = "", pen = "M";
  for (const [x, y] of points) {
    if (x === null || y === null || !Number.isFinite(y)) { pen = "M"; continue; }
    d += `${pen}${X(x).toFixed(1)} ${Y(y).toFixed(1)}`; pen = "L";
  }
  return d;
}
const colour = k => k % 6;

// Rows of bars or dots with their intervals, in the order of the data: largest first.
function drawBars(b, W, state) {
  const all = state.order === "name" ? [...b.rows].sort((p, q) => word(p.name).localeCompare(word(q.name))) : b.rows;
  const rows = state.all ? all : all.slice(0, b.most || 25), n = b.series.length, H = n > 1 && b.mark !== "dot" ? 24 : 19;
  const left = Math.min(W * .34, Math.max(40, ...rows.map(r => widthOf(word(r.name)) + 16)));
  const right = Math.min(W * .24, Math.max(16, ...rows.map(r => r.note ? widthOf(word(r.note)) + 14 : 0))), top = 26;
  const ends = rows.flatMap(r => r.values.flatMap(c => isBanded(c) ? [c.value, c.low, c.high] : [valueOf(c)]));
  if (b.limit !== undefined) ends.push(b.limit);
  if (b.running) ends.push(100);
  const [low, high] = padded(ends, true), X = v => left + (v - low) / (high - low) * (W - left - right);
  const bottom = top + rows.length * H, marks = [], steps = ticks(low, high, (W - left - right) / 90);
  let s = steps.map(v => line(X(v), top - 4, X(v), bottom, "grid") + text(X(v), top - 9, tickText(v, steps), "middle", "class=\"faint\"")).join("");
  let sum = 0; const run = [];
  rows.forEach((r, k) => {
    const y = top + k * H, tip = [word(r.name)];
    s += text(left - 6, y + H / 2 + 4, short(word(r.name), left - 10), "end");
    r.values.forEach((c, j) => {
      const v = valueOf(c), h = b.mark === "dot" ? H : (H - 5) / n, from = y + 2.5 + (b.mark === "dot" ? 0 : j * h), f = `f${colour(b.series[j].colour ?? j)}`;
      if (v === null) return;
      const middle = b.mark === "dot" ? y + H / 2 + (n > 1 ? (j - (n - 1) / 2) * 6 : 0) : from + h / 2;
      if (b.mark === "dot") s += `<circle cx="${X(v).toFixed(1)}" cy="${middle.toFixed(1)}" r="3.5" class="${f}"/>`;
      else s += `<rect x="${Math.min(X(0), X(v)).toFixed(1)}" y="${from.toFixed(1)}" width="${Math.max(.5, Math.abs(X(v) - X(0))).toFixed(1)}" height="${(h - (n > 1 ? 1 : 0)).toFixed(1)}" class="${f}"/>`;
      if (isBanded(c) && c.low !== null && c.high !== null) s += line(X(c.low), middle, X(c.high), middle, b.mark === "dot" ? `s${colour(b.series[j].colour ?? j)}` : "whisker");
      tip.push(`${word(b.series[j].name)}: ${withUnit(shown(v), b.unit)}${bandText(c)}`);
    });
    sum += valueOf(r.values[0]) || 0; run.push([sum, y + H / 2]);
    if (r.note) { s += text(W - right + 8, y + H / 2 + 4, short(word(r.note), right - 10), "start", "class=\"faint\""); tip.push(word(r.note)); }
    if (b.running) tip.push(`${L("running_sum")}: ${shown(sum)} %`);
    marks.push({ x: left, y, w: W - left, h: H, tip: tip.join("\n") });
  });
  if (b.running && state.order !== "name") s += `<path d="${path(run, X, y => y)}" class="s1"/>` + run.map(([v, y]) => `<circle cx="${X(v).toFixed(1)}" cy="${y}" r="2" class="f1"/>`).join("");
  s += line(X(0), top - 4, X(0), bottom, "axis");
  if (b.limit !== undefined) s += line(X(b.limit), top - 4, X(b.limit), bottom, "limit");
  s += text((left + W - right) / 2, bottom + 17, word(b.x) + (b.unit ? " / " + b.unit : ""), "middle");
  return { H: bottom + 26, s, marks };
}

// Axes of one panel: its scales and its frame.
function frame(x0, y0, w, h, xs, ys, p) {
  const X = v => x0 + (v - xs[0]) / (xs[1] - xs[0]) * w, Y = v => y0 + h - (v - ys[0]) / (ys[1] - ys[0]) * h;
  const tx = p.names ? p.names.map((_, k) => k) : ticks(...xs, w / 62), ty = ticks(...ys, h / 34);
  let s = ty.map(v => line(x0, Y(v), x0 + w, Y(v), "grid") + text(x0 - 5, Y(v) + 4, tickText(v, ty), "end", "class=\"faint\"")).join("");
  let last = -Infinity;
  for (const v of tx) {
    const t = p.names ? p.names[v] : tickText(v, tx);
    s += line(X(v), y0 + h, X(v), y0 + h + 4, "axis");
    if (X(v) - widthOf(t) / 2 > last + 4) { s += text(X(v), y0 + h + 16, t, "middle", "class=\"faint\""); last = X(v) + widthOf(t) / 2; }
  }
  return { X, Y, s: s + `<rect x="${x0}" y="${y0}" width="${w}" height="${h}" class="axis"/>` };
}
function drawSeries(q, k, X, Y, p, marks) {
  const c = colour(q.colour ?? k), points = q.x.map((x, i) => [x, q.y[i]]);
  let s = "";
  if (q.low) {
    const band = q.x.map((x, i) => [x, q.low[i], q.high[i]]).filter(r => r[1] !== null && r[2] !== null);
    if (band.length > 1) s += `<path d="${path(band.map(r => [r[0], r[1]]), X, Y)}${path(band.reverse().map(r => [r[0], r[2]]), X, Y).replace("M", "L")}Z" class="f${c}" opacity=".22"/>`;
  }
  if (q.mark !== "points") s += `<path d="${path(points, X, Y)}" class="s${c}" stroke-width="1.6"/>`;
  if (q.mark !== "line") s += points.filter(r => r[1] !== null).map(([x, y]) => `<circle cx="${X(x).toFixed(1)}" cy="${Y(y).toFixed(1)}" r="${q.mark === "points" ? 1.6 : 2.4}" class="f${c}" ${q.mark === "points" ? "opacity=\".55\"" : ""}/>`).join("");
  points.forEach(([x, y], i) => {
    if (y === null) return;
    const band = q.low && q.low[i] !== null ? ` [${shown(q.low[i], 3)}, ${shown(q.high[i], 3)}]` : "";
    marks.push({ cx: X(x), cy: Y(y), tip: `${word(p.title)}\n${word(q.name)}\n${word(p.x)}: ${p.names ? p.names[x] : shown(x)}\n${word(p.y)}: ${shown(y)}${band}` });
  });
  return s;
}
function drawPanels(b, W, state) {
  const panels = state.all ? b.panels : b.panels.slice(0, b.most || 24), columns = Math.max(1, Math.min(panels.length, Math.floor(W / 330), b.columns || 9));
  const w = W / columns, h = columns === 1 ? 300 : 220, marks = [];
  const common = b.common_y ? padded(panels.flatMap(p => p.series.flatMap(q => [...q.y, ...(q.low || []), ...(q.high || [])]))) : null;
  let s = "";
  panels.forEach((p, k) => {
    const x0 = (k % columns) * w + 62, y0 = Math.floor(k / columns) * (h + 12) + 26, iw = w - 80, ih = h - 66;
    const xs = p.names ? [-.3, p.names.length - .7] : padded(p.series.flatMap(q => q.x));
    const f = frame(x0, y0, iw, ih, xs, common || padded(p.series.flatMap(q => [...q.y, ...(q.low || []), ...(q.high || [])])), p);
    const note = (p.note || []).map(word).join("   ");
    s += f.s + text(x0, y0 - 8, short(word(p.title) + (note ? "   " + note : ""), iw + 10), "start", "font-weight=\"600\"");
    s += p.series.map((q, j) => drawSeries(q, j, f.X, f.Y, p, marks)).join("");
    s += text(x0 + iw / 2, y0 + ih + 33, short(word(p.x), iw), "middle") + `<text transform="translate(${x0 - 50},${y0 + ih / 2}) rotate(-90)" text-anchor="middle">${escaped(short(word(p.y), ih))}</text>`;
  });
  return { H: Math.ceil(panels.length / columns) * (h + 12) + 6, s, marks };
}

// Fractions of the values in bins of equal width, the same for every series.
function drawHistogram(of, W, state) {
  const b = of.one_at_a_time ? { ...of, series: [of.series[state.series || 0]] } : of;
  const all = b.series.flatMap(q => q.values), h = 320, x0 = 62, y0 = 24, iw = W - 84, ih = h - 70, marks = [];
  const xs = padded([...all, ...(b.limit === undefined ? [] : [b.limit])]), sorted = [...b.series[0].values].sort((p, q) => p - q);
  const quarter = sorted[Math.floor(.75 * (sorted.length - 1))] - sorted[Math.floor(.25 * (sorted.length - 1))];
  const wanted = quarter > 0 ? (xs[1] - xs[0]) / (2 * quarter / Math.cbrt(sorted.length)) : 10, n = Math.min(80, Math.max(8, Math.round(wanted)));
  const step = (xs[1] - xs[0]) / n, shares = b.series.map(q => {
    const count = new Array(n).fill(0);
    for (const v of q.values) count[Math.min(n - 1, Math.max(0, Math.floor((v - xs[0]) / step)))]++;
    return count.map(c => 100 * c / q.values.length);
  });
  const p = { title: "", x: b.x, y: "" }, f = frame(x0, y0, iw, ih, xs, padded(shares.flat(), true), p);
  let s = f.s;
  shares.forEach((share, j) => {
    const c = colour(b.series[j].colour ?? j);
    let d = `M${f.X(xs[0]).toFixed(1)} ${f.Y(0).toFixed(1)}`, sum = 0;
    share.forEach((v, k) => {
      const a = f.X(xs[0] + k * step), e = f.X(xs[0] + (k + 1) * step); sum += v;
      d += `L${a.toFixed(1)} ${f.Y(v).toFixed(1)}L${e.toFixed(1)} ${f.Y(v).toFixed(1)}`;
      if (v > 0) marks.push({ cx: (a + e) / 2, cy: f.Y(v), tip: `${word(b.series[j].name)}\n${shown(xs[0] + k * step, 3)} … ${withUnit(shown(xs[0] + (k + 1) * step, 3), b.unit)}: ${shown(v, 3)} %\n${L("up_to_here")}: ${shown(sum, 4)} %` });
    });
    d += `L${f.X(xs[1]).toFixed(1)} ${f.Y(0).toFixed(1)}Z`;
    s += `<path d="${d}" class="f${c}" opacity="${shares.length > 1 ? .18 : .35}"/><path d="${d}" class="s${c}" stroke-width="1.4"/>`;
  });
  b.series.forEach((q, j) => (q.marks || []).forEach((m, k) => {
    if (m.value === null) return;
    const x = f.X(m.value), y = y0 + 12 + 14 * k + 30 * j, t = `${word(m.name)} ${shown(m.value)}`, end = x + widthOf(t) + 8 > x0 + iw;
    s += line(x, y0, x, y0 + ih, `s${colour(q.colour ?? j)}`) + text(end ? x - 4 : x + 4, y, t, end ? "end" : "start");
  }));
  if (b.limit !== undefined) {
    const x = f.X(b.limit), t = `${L("limit")} ${shown(b.limit)}`;
    s += line(x, y0, x, y0 + ih, "limit") + text(Math.min(x0 + iw - widthOf(t) / 2, Math.max(x0 + widthOf(t) / 2, x)), y0 - 7, t, "middle", "class=\"limit\"");
  }
  s += text(x0 + iw / 2, y0 + ih + 34, word(b.x) + (b.unit ? " / " + b.unit : ""), "middle") + `<text transform="translate(${x0 - 44},${y0 + ih / 2}) rotate(-90)" text-anchor="middle">${escaped(word(b.y))}</text>`;
  return { H: h, s, marks };
}

// Deviations from a circle, magnified.
function drawPolar(b, W) {
  const columns = Math.max(1, Math.min(b.panels.length, Math.floor(W / 420))), w = W / columns, marks = [], h = 400;
  let s = "";
  b.panels.forEach((p, k) => {
    const cx = (k % columns) * w + w / 2, cy = Math.floor(k / columns) * h + h / 2 + 14, all = p.series.flatMap(q => q.deviation);
    const largest = Math.max(1e-9, ...all.map(v => Math.abs(v || 0))), steps = ticks(-largest, largest, 5), radius = Math.min(w / 2 - 40, h / 2 - 46);
    const R = v => radius * (.6 + .4 * v / (Math.max(largest, ...steps.map(Math.abs)) || 1));
    const at = (a, v) => [cx + R(v) * Math.cos(a * Math.PI / 180), cy - R(v) * Math.sin(a * Math.PI / 180)];
    for (const v of steps) s += `<circle cx="${cx}" cy="${cy}" r="${R(v).toFixed(1)}" class="${v === 0 ? "base" : "grid"}"/>`;
    s += line(cx - radius, cy, cx + radius, cy, "grid") + line(cx, cy - radius, cx, cy + radius, "grid") + text(cx + radius + 6, cy + 4, "+" + p.axes[0]) + text(cx - 6, cy - radius - 4, "+" + p.axes[1], "end");
    s += text(cx, cy - h / 2 + 6, short([word(p.title), ...(p.note || []).map(word), "/ " + b.unit].join("   "), w - 20), "middle", "font-weight=\"600\"");
    p.series.forEach((q, j) => {
      s += `<path d="${q.angle.map((a, i) => (i ? "L" : "M") + at(a, q.deviation[i]).map(v => v.toFixed(1)).join(" ")).join("")}" class="s${colour(j)}" stroke-width="1.4"/>`;
      q.angle.forEach((a, i) => { const [x, y] = at(a, q.deviation[i]); marks.push({ cx: x, cy: y, tip: `${word(p.title)}\n${word(q.name)}\n${shown(a)}°: ${shown(q.deviation[i])} ${b.unit}` }); });
    });
    for (const v of steps) s += text(cx + 4, cy - R(v) - 2, tickText(v, steps), "start", "class=\"faint halo\"");
  });
  return { H: Math.ceil(b.panels.length / columns) * h, s, marks };
}
const drawings = { bars: drawBars, panels: drawPanels, histogram: drawHistogram, polar: drawPolar };

// ---- blocks ---------------------------------------------------------------------------------------
function button(label, act) {
  const e = document.createElement("button");
  e.dataset.label = label; e.textContent = L(label); e.addEventListener("click", act);
  return e;
}
function point(e, of, m, view, x, y) {            // shows the tooltip of a mark
  of.querySelector(".at")?.remove();
  const tip = $("tip");
  if (!m) { tip.hidden = true; return; }
  const ring = document.createElementNS("http://www.w3.org/2000/svg", m.w ? "rect" : "circle");
  for (const [k, v] of Object.entries(m.w ? { x: m.x, y: m.y, width: m.w - 1, height: m.h } : { cx: m.cx, cy: m.cy, r: 5 })) ring.setAttribute(k, v);
  ring.setAttribute("class", "at"); of.append(ring);
  tip.textContent = m.tip; tip.hidden = false;
  const box = tip.getBoundingClientRect();
  tip.style.left = Math.max(4, Math.min(innerWidth - box.width - 6, x + 14)) + "px";
  tip.style.top = (y + 16 + box.height > innerHeight ? Math.max(4, y - box.height - 10) : y + 16) + "px";
}
function live(svg, drawn) {                       // pointer and arrow keys over the marks of a drawing
  let at = -1;
  const place = m => [m.w ? m.x + Math.min(m.w / 2, 200) : m.cx, m.w ? m.y + m.h / 2 : m.cy];
  svg.addEventListener("pointermove", e => {
    const box = svg.getBoundingClientRect(), k = drawn.W / box.width, x = (e.clientX - box.left) * k, y = (e.clientY - box.top) * k;
    let best = -1, least = 40;
    drawn.marks.forEach((m, i) => {
      const d = m.w ? (y >= m.y && y < m.y + m.h ? 0 : 99) : Math.hypot(m.cx - x, m.cy - y);
      if (d < least) { least = d; best = i; }
    });
    at = best; point(e, svg, drawn.marks[best], drawn, e.clientX, e.clientY);
  });
  for (const leave of ["pointerleave", "blur"]) svg.addEventListener(leave, e => { at = -1; point(e, svg, null); });
  svg.addEventListener("keydown", e => {
    const step = { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 }[e.key];
    if (e.key === "Escape") { at = -1; point(e, svg, null); }
    if (!step || !drawn.marks.length) return;
    e.preventDefault();
    at = (at + step + drawn.marks.length) % drawn.marks.length;
    const m = drawn.marks[at], [x, y] = place(m), box = svg.getBoundingClientRect(), k = box.width / drawn.W;
    point(e, svg, m, drawn, box.left + x * k, box.top + y * k);
  });
}
function draw(b, state) {
  const W = Math.max(320, Math.min(1400, state.body.clientWidth || 1000)), drawn = { W, ...drawings[b.type](b, W, state) };
  state.body.innerHTML = `<svg tabindex="0" role="img" viewBox="0 0 ${W} ${Math.ceil(drawn.H)}" width="${W}" height="${Math.ceil(drawn.H)}" aria-label="${escaped(word(b.title))}">${drawn.s}</svg>`;
  live(state.body.firstChild, drawn);
}
function drawTable(b, state) {
  let rows = [...b.rows];
  if (state.by !== undefined) {
    const key = r => { const v = valueOf(r[state.by]); return v === null ? cellText(r[state.by]) : v; };
    rows.sort((p, q) => { const a = key(p), c = key(q); return (typeof a === "number" && typeof c === "number" ? a - c : typeof a === "number" ? -1 : typeof c === "number" ? 1 : String(a).localeCompare(String(c))) * (state.down && typeof a === typeof c ? -1 : 1); });
  }
  if (!state.all) rows = rows.slice(0, b.most || 40);
  const isWord = k => b.rows.every(r => valueOf(r[k]) === null);
  const head = b.columns.map((c, k) => `<th class="${isWord(k) ? "word" : ""}"${state.by === k ? ` aria-sort="${state.down ? "descending" : "ascending"}"` : ""}><button data-column="${k}">${escaped(word(c.head) + (c.unit ? " / " + c.unit : ""))}</button></th>`).join("");
  const cell = (c, k) => {
    const v = valueOf(c);
    return `<td class="${isWord(k) ? "word" : ""}"${v === null ? "" : ` data-value="${v}" title="${v}"`}>${v === null ? escaped(cellText(c)) : escaped(shown(v)) + (bandText(c) ? ` <small>${escaped(bandText(c))}</small>` : "")}</td>`;
  };
  state.body.innerHTML = `<div class="wide"><table><thead><tr>${head}</tr></thead><tbody>${rows.map(r => "<tr>" + r.map(cell).join("") + "</tr>").join("")}</tbody></table></div>`;
  state.body.querySelectorAll("th button").forEach(e => e.addEventListener("click", () => {
    const k = +e.dataset.column; state.down = state.by === k ? !state.down : !isWord(k); state.by = k; drawTable(b, state); state.body.querySelector(`[data-column="${k}"]`).focus();
  }));
}
function drawPicture(b, state) {
  const one = b.pictures[state.picture || 0];
  state.body.innerHTML = `<img alt="${escaped(word(b.title) + ": " + one.name)}" src="${one.src}">`;
}
function show(b, state) { b.type === "table" ? drawTable(b, state) : b.type === "pictures" ? drawPicture(b, state) : draw(b, state); }

const lengthOf = b => b.type === "table" || b.type === "bars" ? b.rows.length : b.type === "panels" ? b.panels.length : 0;
const mostOf = b => b.most || { table: 40, bars: 25, panels: 24 }[b.type];
function tools(b, state) {
  const bar = state.bar;
  bar.replaceChildren();
  const names = b.one_at_a_time ? [] : b.series || (b.panels || []).flatMap(p => p.series.map((q, k) => ({ ...q, colour: q.colour ?? k }))), seen = new Set();
  names.forEach((q, k) => {
    const name = word(q.name); if (!name || seen.has(name) || names.length < 2 && b.type !== "panels" && !b.running) return; seen.add(name);
    bar.insertAdjacentHTML("beforeend", `<span class="legend"><i class="f${colour(q.colour ?? k)}"></i>${escaped(name)}</span>`);
  });
  if (b.running) bar.insertAdjacentHTML("beforeend", `<span class="legend"><i class="f1"></i>${escaped(L("running_sum"))}</span>`);
  if (b.type === "bars" && b.rows.length > 1) {
    const e = document.createElement("select");
    e.setAttribute("aria-label", L("order")); e.add(new Option(L("order_size"), "")); e.add(new Option(L("order_name"), "name")); e.value = state.order || "";
    e.addEventListener("change", () => { state.order = e.value; show(b, state); });
    bar.append(e);
  }
  if (lengthOf(b) > mostOf(b)) {
    const e = button(state.all ? "show_less" : "show_all", () => { state.all = !state.all; tools(b, state); show(b, state); });
    if (!state.all) e.append(` (${lengthOf(b)})`);
    delete e.dataset.label; bar.append(e);
  }
  if (b.one_at_a_time && b.series.length > 1) {
    const e = document.createElement("select");
    e.setAttribute("aria-label", L("shown_group")); b.series.forEach((q, k) => e.add(new Option(word(q.name), k))); e.value = state.series || 0;
    e.addEventListener("change", () => { state.series = +e.value; show(b, state); });
    bar.append(e);
  }
  if (b.type === "pictures") {
    const e = document.createElement("select");
    e.setAttribute("aria-label", L("picture")); b.pictures.forEach((p, k) => e.add(new Option(p.name, k))); e.value = state.picture || 0;
    e.addEventListener("change", () => { state.picture = +e.value; show(b, state); });
    bar.append(e);
  } else bar.append(button("csv_all", () => save(new Blob([csv(tables[b.type](b))], { type: "text/csv" }), b.id + ".csv")));
}
function build(b) {
  const section = document.createElement("section");
  section.className = "block" + (b.type === "table" || b.type === "pictures" ? " long" : ""); section.id = "b-" + b.id;
  section.innerHTML = "<h2></h2><p class=\"note\"></p><div class=\"bar\"></div><div class=\"body\"></div>";
  const [title, note, bar, body] = section.children, state = { section, title, note, bar, body, by: b.by, down: b.by !== undefined };
  $("blocks").append(section);
  return state;
}
function caption(b, state) {
  state.title.textContent = word(b.title);
  state.note.textContent = word(b.note); state.note.hidden = !b.note;
}

addEventListener("DOMContentLoaded", () => {      // the script precedes the data, so that it can report a truncated file
  translate();
  if (!isWhole()) return;
  try {
    const index = JSON.parse($("index").textContent), blocks = index.blocks, states = blocks.map(build);
    const groups = [...new Set(blocks.map(b => b.group).filter(Boolean))];
    groups.forEach(g => $("group").add(new Option(g, g)));
    $("groups").hidden = groups.length < 2;
    const isShown = b => !b.group || b.group === ($("group").value || groups[0]);
    const all = () => {
      $("contents").replaceChildren(...blocks.filter(isShown).map(b => { const a = document.createElement("a"); a.href = "#b-" + b.id; a.textContent = word(b.short || b.title); return a; }));
      blocks.forEach((b, k) => { states[k].section.hidden = !isShown(b); caption(b, states[k]); tools(b, states[k]); show(b, states[k]); });
    };
    $("group").addEventListener("change", all);
    $("language").addEventListener("click", () => { language = language === "en" ? "zh" : "en"; translate(); all(); });
    all();
    let width = $("blocks").clientWidth, waiting = false;
    new ResizeObserver(() => {
      if (waiting || $("blocks").clientWidth === width) return;
      waiting = true;
      requestAnimationFrame(() => { waiting = false; width = $("blocks").clientWidth; blocks.forEach((b, k) => { if (drawings[b.type]) show(b, states[k]); }); });
    }).observe($("blocks"));
    $("busy").hidden = true;
    window.abbe = { index, csvOf: id => csv(tables[blocks.find(b => b.id === id).type](blocks.find(b => b.id === id))) };
    window.ready = true;
  } catch (e) { $("busy").textContent = L("cannot") + e.message; window.failed = e.stack; console.error(e); }
});
