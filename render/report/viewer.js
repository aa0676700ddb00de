language = (location.hash.includes("language") && /language%22%3A%22(en|zh)/.exec(location.hash) || [])[1] || language;
addEventListener("DOMContentLoaded", () => {      // the script precedes the data, so that it can report a truncated file
translate();
if (!isWhole()) return;
(async () => {
const t0 = performance.now(), timings = window.timings = {};
const index = JSON.parse($("index").textContent), dark = matchMedia("(prefers-color-scheme: dark)").matches && !matchMedia("print").matches;
const C = dark ? { ink: "#e4e6ea", faint: "#a4a9b2", rule: "#3a3e45", paper: "#17191d", plate: "#17191ddd", a: "#79aef0", b: "#f09a5e", high: "#ff9db0", low: "#a9b8ff", ground: [.09, .098, .114] }
  : { ink: "#212429", faint: "#5b6068", rule: "#e6e7ea", paper: "#ffffff", plate: "#ffffffdd", a: "#00458c", b: "#b8430a", high: "#8c0012", low: "#0a1254", ground: [1, 1, 1] };


// ---- data: inflated at once, numbers unpacked when first needed -----------------------------------
const nV = index.vertices, nT = index.triangles, unpackedArrays = new Map();
const lap = name => { timings[name] = Math.round(performance.now() - t0); };
const textOf = name => { const node = $("a:" + name), text = node.textContent; node.remove(); return text; };
lap("script");
const bytes = new Map(await Promise.all(Object.keys(index.arrays).map(async name => [name, await inflated(textOf(name))]))); lap("inflated");
function load(name) {                             // -> integers, one component after the other
  if (!unpackedArrays.has(name)) {
    const d = index.arrays[name], r = d.reference;
    unpackedArrays.set(name, unpackNumbers(bytes.get(name), d, r && (r.startsWith("midst:") ? midstOf(r.slice(6), d) : load(r))));
    bytes.delete(name);
  }
  return unpackedArrays.get(name);
}
let midsts = null;
function midstOf(name, d) {                       // middle of the time of each line of a column, in steps of d
  const line = load("block_line"), begin = load("block_time"), n = line.length, step = Math.round(d.step[0] / index.arrays.block_time.step[0]);
  if (!midsts) { midsts = new Map(); for (let k = 0; k < n; k++) if (!midsts.has(line[k])) midsts.set(line[k], Math.floor((begin[k] + begin[Math.min(k + 1, n - 1)] + step) / (2 * step))); }
  return load(name).map(l => midsts.get(l) || 0);
}
const NONE = 1e9;                                 // stands for "no value" on the graphics card
function values(name) {                           // -> numbers with their unit
  const d = index.arrays[name], x = load(name), y = new Float32Array(x.length);
  for (let c = 0; c < d.components; c++) for (let i = c * d.n, e = i + d.n; i < e; i++) y[i] = x[i] === MISSING ? NONE : d.offset[c] + x[i] * d.step[c];
  return y;
}
const interleaved = (x, n, m) => { const y = new x.constructor(n * m); for (let c = 0; c < m; c++) for (let i = 0; i < n; i++) y[i * m + c] = x[c * n + i]; return y; };

// ---- small matrices, column major -----------------------------------------------------------------
const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]], dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const norm = a => { const l = Math.hypot(...a) || 1; return a.map(v => v / l); }, mix = (a, b, t) => a.map((v, i) => v + (b[i] - v) * t);
const eye = () => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
function mul(a, b) { const o = new Array(16); for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) { let s = 0; for (let k = 0; k < 4; k++) s += a[k * 4 + r] * b[c * 4 + k]; o[c * 4 + r] = s; } return o; }
const at = (m, p) => [0, 1, 2, 3].map(r => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r]);
const move = v => { const m = eye(); m[12] = v[0]; m[13] = v[1]; m[14] = v[2]; return m; };
function turn(u, a, p) {                          // about the line through p
  const c = Math.cos(a), s = Math.sin(a), k = 1 - c, [x, y, z] = u;
  const m = [c + x * x * k, z * s + x * y * k, -y * s + x * z * k, 0, -z * s + x * y * k, c + y * y * k, x * s + y * z * k, 0, y * s + x * z * k, -x * s + y * z * k, c + z * z * k, 0, 0, 0, 0, 1];
  return mul(move(p), mul(m, move(p.map(v => -v))));
}
function inverse(m) {                             // of a rigid one
  const t = [m[12], m[13], m[14]], r = [m[0], m[4], m[8], 0, m[1], m[5], m[9], 0, m[2], m[6], m[10], 0, 0, 0, 0, 1];
  for (let i = 0; i < 3; i++) r[12 + i] = -(r[i] * t[0] + r[4 + i] * t[1] + r[8 + i] * t[2]);
  return r;
}

// ---- mesh -----------------------------------------------------------------------------------------
const tri = interleaved(load("triangle"), nT, 3), P = interleaved(values("position"), nV, 3); lap("positions");
const normal = new Float32Array(nV * 3);
for (let k = 0; k < nT * 3; k += 3) {
  const a = tri[k] * 3, b = tri[k + 1] * 3, c = tri[k + 2] * 3;
  const ux = P[b] - P[a], uy = P[b + 1] - P[a + 1], uz = P[b + 2] - P[a + 2], vx = P[c] - P[a], vy = P[c + 1] - P[a + 1], vz = P[c + 2] - P[a + 2];
  const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
  for (const v of [a, b, c]) { normal[v] += x; normal[v + 1] += y; normal[v + 2] += z; }
}
const n8 = new Int8Array(nV * 4);
for (let i = 0; i < nV; i++) { const l = Math.hypot(normal[3 * i], normal[3 * i + 1], normal[3 * i + 2]) || 1; for (let c = 0; c < 3; c++) n8[4 * i + c] = Math.round(127 * normal[3 * i + c] / l); }
const low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9];
for (let i = 0; i < nV; i++) for (let c = 0; c < 3; c++) { const v = P[3 * i + c]; if (v < low[c]) low[c] = v; if (v > high[c]) high[c] = v; }
const centre = mix(low, high, .5), size = Math.hypot(...sub(high, low)); lap("normals");
const cases = index.cases;
const layers = index.arrays.form0 ? ["residual", "form", "texture"] : ["residual"];
cases.forEach((c, i) => Object.defineProperties(c, { line: { get: () => load("line" + i) }, time: { get: () => c.times ||= values("cut_time" + i) } }));   // unpacked when first needed
function layerOf(i) {                             // micrometres, unpacked when first shown
  const c = cases[i]; c.layers ||= {};
  return c.layers[S.layer] ||= S.layer === "texture" ? difference2(values("residual" + i), values("form" + i)) : values(S.layer + i);
}
const difference2 = (a, b) => a.map((v, k) => v < NONE && b[k] < NONE ? v - b[k] : NONE);
const regionOf = index.regions.length ? load("region") : null, isIn = v => !S.region || regionOf[v] === S.region;
function residual(i) {                            // the case with what is shown of it: `all` of the layer, `r` within the region
  const c = cases[i], key = S.layer + S.region + S.reveal;
  if (c.key !== key) {
    c.key = key; c.all = layerOf(i); c.r = S.region ? c.all.map((v, k) => regionOf[k] === S.region ? v : NONE) : c.all; c.bins = null;
    if (c.vao) { c.vao.own.forEach(b => gl.deleteBuffer(b)); gl.deleteVertexArray(c.vao); c.vao = null; }
    let mi = -1, ma = -1;
    for (let k = 0; k < nV; k++) if (c.r[k] < NONE) { if (mi < 0 || c.r[k] < c.r[mi]) mi = k; if (ma < 0 || c.r[k] > c.r[ma]) ma = k; }
    c.min = Math.max(0, mi); c.max = Math.max(0, ma);
  }
  return c;
}
function figuresOf(c) {                           // as text, for the displayed map
  if (!S.region) return c.stats && c.stats[S.layer] + " µm";
  const f = S.layer === "residual" && index.regions[S.region - 1].figures[c.name]; if (!f || f.pv === null) return "";
  return `PV ${+f.pv.toPrecision(4)}  RMS ${+f.rms.toPrecision(4)} µm` + (f.in === null ? "" : `  ${f.in.toFixed(2)} % ${L("in_tolerance")}`);
}

// ---- graphics card --------------------------------------------------------------------------------
const glc = $("gl"), ink = $("ink"), pen = ink.getContext("2d");
const gl = glc.getContext("webgl2", { antialias: true, alpha: false, preserveDrawingBuffer: true });
if (!gl) { $("fallback").hidden = false; $("fallback").textContent = L("no_webgl"); $("busy").hidden = true; document.body.classList.add("still"); window.failed = "no WebGL 2"; return; }
function program(vs, fs) {
  const p = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vs], [gl.FRAGMENT_SHADER, fs]]) {
    const s = gl.createShader(kind); gl.shaderSource(s, "#version 300 es\nprecision highp float;precision highp int;" + text); gl.compileShader(s);
    if (!gl.getShaderParameter(s, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(s));
    gl.attachShader(p, s);
  }
  gl.linkProgram(p);
  if (!gl.getProgramParameter(p, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(p));
  const u = {}; for (let i = 0, n = gl.getProgramParameter(p, gl.ACTIVE_UNIFORMS); i < n; i++) { const name = gl.getActiveUniform(p, i).name; u[name] = gl.getUniformLocation(p, name); }
  return { p, u };
}
const surfaceVs = `layout(location=0)in vec3 p;layout(location=1)in vec3 n;layout(location=2)in float r;layout(location=3)in float ct;
uniform mat4 M,V;uniform float mag;out vec3 vn,vp;out float vr,vbad,vt;flat out uint vid;
void main(){bool bad=r>1e8;float d=bad?0.:r;vec4 q=M*vec4(p+n*d*mag*1e-3,1.);gl_Position=V*q;vn=mat3(M)*n;vp=p;vr=d;vbad=bad?1.:0.;vt=ct;vid=uint(gl_VertexID);}`;
const surface = program(surfaceVs, `in vec3 vn,vp;in float vr,vbad,vt;uniform sampler2D lut;uniform float lo,hi,bands,tnow;uniform vec3 eye;uniform vec4 plane;out vec4 o;
void main(){vec3 n=normalize(vn);float l=.62+.38*abs(dot(n,eye));vec3 c;
if(vbad>0.)c=vec3(.5);else if(vt>tnow)c=vec3(.86,.87,.89);else{float t=(vr-lo)/(hi-lo);
if(t>1.)c=vec3(.30,0.,.07);else if(t<0.)c=vec3(.04,.07,.33);else{if(bands>0.)t=(floor(min(t,.9999)*bands)+.5)/bands;c=texture(lut,vec2(t,.5)).rgb;}}
if(plane.w<1e8){float s=dot(plane.xyz,vp)-plane.w;if(abs(s)<1.2*fwidth(s))c=vec3(.1);}
if(dot(n,eye)<-.05)c=mix(c,vec3(.6),.6);
o=vec4(c*l,1.);}`);
const picker = program(surfaceVs, `in vec3 vn,vp;in float vr,vbad,vt;flat in uint vid;layout(location=0)out uvec4 o;layout(location=1)out uvec4 w;
void main(){o=uvec4(vid+1u,floatBitsToUint(vr),vbad>0.?1u:0u,0u);w=uvec4(floatBitsToUint(vp),0u);}`);
const plain = program(`layout(location=0)in vec3 p;layout(location=1)in vec3 n;uniform mat4 M,V;out vec3 vn;void main(){gl_Position=V*(M*vec4(p,1.));vn=mat3(M)*n;}`,
  `in vec3 vn;uniform vec4 colour;uniform vec3 eye;out vec4 o;void main(){float l=.6+.4*abs(dot(normalize(vn),eye));o=vec4(colour.rgb*l,colour.a);}`);
const strand = program(`layout(location=0)in vec3 p;layout(location=1)in float t;uniform mat4 M,V;out float vt;void main(){gl_Position=V*(M*vec4(p,1.));vt=t;}`,
  `in float vt;uniform float tnow,trail;uniform vec3 colour;out vec4 o;void main(){float age=(tnow-vt)/trail;if(age>1.||age<-.15)discard;float k=age<0.?.25:1.-.8*age;o=vec4(colour,k);}`);
const buffer = (data, target = gl.ARRAY_BUFFER) => { const b = gl.createBuffer(); gl.bindBuffer(target, b); gl.bufferData(target, data, gl.STATIC_DRAW); return b; };
function attribute(i, b, n, type = gl.FLOAT, stride = 0, normalised = false) { gl.bindBuffer(gl.ARRAY_BUFFER, b); gl.enableVertexAttribArray(i); gl.vertexAttribPointer(i, n, type, normalised, stride, 0); }
gl.bindVertexArray(null);
const positions = buffer(P), normals = buffer(n8); gl.bindVertexArray(null); const triangles = buffer(tri, gl.ELEMENT_ARRAY_BUFFER);
function surfaceOf(values, time) {
  const vao = gl.createVertexArray(); gl.bindVertexArray(vao);
  vao.own = [values, time].filter(Boolean).map(x => buffer(x));
  attribute(0, positions, 3); attribute(1, normals, 3, gl.BYTE, 4, true); vao.own.forEach((b, k) => attribute(2 + k, b, 1));
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, triangles); gl.bindVertexArray(null); return vao;
}
function diverging(n) {                           // Moreland 2009, cool to warm, in his Msh space
  const a = [80, 1.08, -1.1], b = [80, 1.08, .5], middle = 88, out = [];
  const lab = m => [m[0] * Math.cos(m[1]), m[0] * Math.sin(m[1]) * Math.cos(m[2]), m[0] * Math.sin(m[1]) * Math.sin(m[2])];
  const hue = m => { const s = m[1] * Math.sqrt(middle ** 2 - m[0] ** 2) / (m[0] * Math.sin(m[1])); return m[2] > -Math.PI / 3 ? m[2] + s : m[2] - s; };
  for (let i = 0; i < n; i++) {
    const t = i / (n - 1), low = t < .5, [p, q, u] = low ? [a, [middle, 0, hue(a)], 2 * t] : [[middle, 0, hue(b)], b, 2 * t - 1], [l, s, v] = lab(mix(p, q, u));
    const fy = (l + 16) / 116, [x, y, z] = [fy + s / 500, fy, fy - v / 200].map((f, k) => (f > .206893 ? f ** 3 : (f - 16 / 116) / 7.787) * [.95047, 1, 1.08883][k]);
    for (const c of [3.2406 * x - 1.5372 * y - .4986 * z, -.9689 * x + 1.8758 * y + .0415 * z, .0557 * x - .204 * y + 1.057 * z]) out.push(Math.round(255 * Math.min(1, Math.max(0, c > .0031308 ? 1.055 * c ** (1 / 2.4) - .055 : 12.92 * c))));
  }
  return out;
}
const colours = diverging(256), lut = gl.createTexture();
gl.bindTexture(gl.TEXTURE_2D, lut); gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB8, colours.length / 3, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, new Uint8Array(colours));
for (const k of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, k, gl.LINEAR);
for (const k of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, k, gl.CLAMP_TO_EDGE);
const colourAt = v => { const t = (v - S.lo) / (S.hi - S.lo), m = colours.length / 3; if (t > 1) return "#4d0012"; if (t < 0) return "#0a1254";
  const u = S.bands > 0 ? (Math.floor(Math.min(t, .9999) * S.bands) + .5) / S.bands : t, k = 3 * Math.round(u * (m - 1)); return `rgb(${colours[k]},${colours[k + 1]},${colours[k + 2]})`; };

// ---- displayed state ------------------------------------------------------------------------------
const S = { language, tab: "map", layer: "residual", region: 0, errors: 0, signal: "", a: Math.min(1, cases.length - 1), b: cases.length - 1, mode: "side", lo: -10, hi: 10, bands: 0, mag: 0, az: -117, el: 39, zoom: 1, target: [0, 0, 0], persp: 0, swipe: .5, time: 0, reveal: 0, line: null };
S.target = centre.slice();
const home = { az: S.az, el: S.el };
try { Object.assign(S, JSON.parse(decodeURIComponent(location.hash.slice(1)))); } catch { }
if (!layers.includes(S.layer)) S.layer = layers[0];
const zero = [...Array(16)].map((_, i) => i % 5 ? 0 : 1);
let probe = null, section = null, dragging = null, difference = null, dirty = true;
const shown = () => S.mode === "difference" ? [difference] : S.mode === "single" || S.tab === "machine" ? [cases[S.a]] : [cases[S.a], cases[S.b]];
async function prepare() {
  const a = residual(S.a), b = residual(S.b);
  for (const c of [a, b]) c.vao ||= surfaceOf(c.r, S.reveal && c.time);
  if (S.mode === "difference" && !(difference && difference.of === a && difference.less === b && difference.key === a.key)) {
    const r = new Float32Array(nV); let mi = 0, ma = 0;
    for (let i = 0; i < nV; i++) { r[i] = a.r[i] < NONE && b.r[i] < NONE ? a.r[i] - b.r[i] : NONE; if (r[i] < NONE) { if (r[i] < r[mi]) mi = i; if (r[i] > r[ma]) ma = i; } }
    difference = { of: a, less: b, key: a.key, all: r, name: a.name + " − " + b.name, r, get line() { return a.line; }, get time() { return a.time; }, min: mi, max: ma }; difference.vao = surfaceOf(r, S.reveal && a.time);
  }
  histogram(); cut(); draw();
}
function fit() {                                  // as fitted_range_um does: 99.5 % of all displayed values, rounded
  const all = []; for (const c of shown()) for (let i = 0; i < nV; i += 1 + (nV >> 17)) if (c.r[i] < NONE) all.push(Math.abs(c.r[i]));
  const x = Float32Array.from(all).sort()[Math.floor(.995 * (all.length - 1))] || 1e-6, p = 10 ** Math.floor(Math.log10(x));
  const k = [1, 1.5, 2, 3, 4, 5, 6, 8, 10].find(k => k * p >= x * .999999) || 10; S.hi = k * p; S.lo = -S.hi;
}

// ---- camera and drawing ---------------------------------------------------------------------------
function fitView() {                              // the part fills its pane from this direction
  const p = panes()[0], cam = camera(p.w, H); let x0 = 1e9, x1 = -1e9, y0 = 1e9, y1 = -1e9;
  for (let i = 0; i < nV; i += 1 + (nV >> 14)) { const v = vertex(i), x = dot(cam.right, v), y = dot(cam.up, v); x0 = Math.min(x0, x); x1 = Math.max(x1, x); y0 = Math.min(y0, y); y1 = Math.max(y1, y); }
  S.zoom *= .9 * Math.min((p.w - 100) / ((x1 - x0) / cam.perPixel + 1), H / ((y1 - y0) / cam.perPixel + 1));
  const mx = (x0 + x1) / 2 - dot(cam.right, S.target), my = (y0 + y1) / 2 - dot(cam.up, S.target); for (let c = 0; c < 3; c++) S.target[c] += cam.right[c] * mx + cam.up[c] * my;
}
const rad = Math.PI / 180, eyeDirection = () => [Math.cos(S.el * rad) * Math.cos(S.az * rad), Math.cos(S.el * rad) * Math.sin(S.az * rad), Math.sin(S.el * rad)];
function camera(w, h) {
  const d = eyeDirection(), right = [-Math.sin(S.az * rad), Math.cos(S.az * rad), 0], up = cross(d, right);
  const machine = S.tab === "machine", target = machine ? S.machineTarget || machineCentre : S.target, extent = machine ? machineSize : size;
  const half = extent * .55 / (machine ? S.machineZoom || 1 : S.zoom), k = Math.min(w / h, 1), hw = half * (w / h) / k, hh = half / k, far = Math.max(extent, size) * 6;
  const view = [right[0], up[0], d[0], 0, right[1], up[1], d[1], 0, right[2], up[2], d[2], 0, -dot(right, target), -dot(up, target), -dot(d, target), 1];
  let proj;
  if (S.persp) { const dist = half * 3.2, n = dist * .02, f = dist + far; view[14] -= dist; proj = [dist / hw, 0, 0, 0, 0, dist / hh, 0, 0, 0, 0, -(f + n) / (f - n), -1, 0, 0, -2 * f * n / (f - n), 0]; }
  else proj = [1 / hw, 0, 0, 0, 0, 1 / hh, 0, 0, 0, 0, -1 / far, 0, 0, 0, 0, 1];
  return { V: mul(proj, view), d, right, up, perPixel: 2 * hh / h };
}
let W = 1, H = 1, ratio = 1;
function resize() {
  ratio = Math.min(devicePixelRatio || 1, 2); W = ink.clientWidth; H = ink.clientHeight;
  for (const c of [glc, ink]) { c.width = Math.round(W * ratio); c.height = Math.round(H * ratio); }
  for (const c of [$("hist"), $("prof"), $("course")]) { c.width = Math.round(c.clientWidth * ratio); c.height = Math.round(c.clientHeight * ratio); }
  histogram(); profile(); curves(); draw();
}
function panes() {                                // in CSS pixels: the area of each map, and its visible part
  const s = shown();
  if (s.length === 1) return [{ c: s[0], x: 0, w: W, cx: 0, cw: W }];
  if (S.mode === "swipe") return [{ c: s[0], x: 0, w: W, cx: 0, cw: W * S.swipe }, { c: s[1], x: 0, w: W, cx: W * S.swipe, cw: W * (1 - S.swipe) }];
  return [{ c: s[0], x: 0, w: W / 2, cx: 0, cw: W / 2 }, { c: s[1], x: W / 2, w: W / 2, cx: W / 2, cw: W / 2 }];
}
function setSurface(prog, cam, M) {
  gl.useProgram(prog.p); const u = prog.u;
  gl.uniformMatrix4fv(u.M, false, M); gl.uniformMatrix4fv(u.V, false, cam.V); gl.uniform1f(u.mag, S.mag > 0 ? 10 ** S.mag : 0);
  if (u.lut) { gl.uniform1i(u.lut, 0); gl.uniform1f(u.lo, S.lo); gl.uniform1f(u.hi, S.hi); gl.uniform1f(u.bands, S.bands); gl.uniform3fv(u.eye, cam.d);
    gl.uniform1f(u.tnow, S.reveal || S.tab === "machine" && S.reveal ? S.time : 1e30);
    gl.uniform4fv(u.plane, section && S.tab === "map" ? [...section.n, section.c] : [0, 0, 0, 1e9]); }
}
function paint(p, cam, M) {
  gl.viewport(p.x * ratio, 0, p.w * ratio, H * ratio); gl.scissor(p.cx * ratio, 0, p.cw * ratio, H * ratio);
  setSurface(surface, cam, M); gl.bindVertexArray(p.c.vao); gl.drawElements(gl.TRIANGLES, nT * 3, gl.UNSIGNED_INT, 0);
}
let frames = 0;
function draw() { if (!dirty) { dirty = true; } requestAnimationFrame(render); }
let asked = 0;
function render(stamp) {
  if (!dirty || stamp === asked || !shown().every(c => c && c.vao)) return; asked = stamp; dirty = false; frames++;
  const begun = performance.now();
  gl.bindFramebuffer(gl.FRAMEBUFFER, null); gl.disable(gl.SCISSOR_TEST); gl.clearColor(...C.ground, 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.enable(gl.DEPTH_TEST); gl.enable(gl.SCISSOR_TEST); gl.enable(gl.BLEND); gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA); gl.bindTexture(gl.TEXTURE_2D, lut);
  pen.setTransform(ratio, 0, 0, ratio, 0, 0); pen.clearRect(0, 0, W, H); pen.font = "12px system-ui, DejaVu Sans"; pen.textBaseline = "middle";
  const ps = panes();
  for (const p of ps) {
    const cam = p.cam = camera(p.w, H);
    if (S.tab === "machine") machineScene(p, cam); else paint(p, cam, zero);
  }
  for (const p of ps) overlay(p, ps.length);
  if (S.tab === "map" && ps.length > 1) { pen.fillStyle = C.faint; pen.fillRect(ps[1].cx - .5, 0, 1, H); if (S.mode === "swipe") { pen.beginPath(); pen.arc(ps[1].cx, H / 2, 9, 0, 7); pen.fillStyle = C.paper; pen.fill(); pen.strokeStyle = C.ink; pen.stroke(); pen.fillStyle = C.ink; pen.textAlign = "center"; pen.fillText("↔", ps[1].cx, H / 2); } }
  legend(); timings.frame = +(performance.now() - begun).toFixed(1);
  location.hash !== hash() && clearTimeout(hashLater), hashLater = setTimeout(() => { $("permalink").href = hash(); }, 200);
}
let hashLater = 0; const hash = () => "#" + encodeURIComponent(JSON.stringify(S));
const project = (p, cam, q) => { const c = at(cam.V, q); return [p.x + (c[0] / c[3] + 1) / 2 * p.w, (1 - c[1] / c[3]) / 2 * H, c[2] / c[3]]; };
const vertex = i => [P[3 * i], P[3 * i + 1], P[3 * i + 2]], digits = v => Math.abs(v) >= 9.995 ? 1 : Math.abs(v) >= .9995 ? 2 : Math.abs(v) >= .0995 ? 3 : 4;
const um = v => v >= NONE ? L("uncut") : (v > 0 ? "+" : v < 0 ? "−" : "") + (Math.abs(v) < .0005 && v ? Math.abs(v * 1000).toPrecision(2) + " nm" : Math.abs(v).toFixed(digits(v)) + " µm");
function flag(p, q, text, colour) {
  const [x, y] = project(p, p.cam, q); if (x < p.cx || x > p.cx + p.cw) return;
  pen.beginPath(); pen.arc(x, y, 3, 0, 7); pen.fillStyle = C.paper; pen.fill(); pen.lineWidth = 1.5; pen.strokeStyle = colour; pen.stroke();
  if (!text) return; const w = pen.measureText(text).width; let tx = x + 9; if (tx + w > p.cx + p.cw - (p.cx + p.cw > W - 1 ? 72 : 4)) tx = x - 13 - w;
  pen.fillStyle = C.plate; pen.fillRect(tx - 3, y - 18, w + 6, 16); pen.fillStyle = colour; pen.textAlign = "left"; pen.fillText(text, tx, y - 10);
}
function overlay(p, many) {
  pen.save(); pen.beginPath(); pen.rect(p.cx, 0, p.cw, H); pen.clip();
  const second = p.cx > 0; pen.textAlign = "left"; const s = figuresOf(p.c);
  if (S.tab === "machine") { pen.fillStyle = C.plate; pen.fillRect(p.cx + 6, 5, 14 + Math.max(1.15 * pen.measureText(p.c.name).width, pen.measureText(s || "").width), 38); }
  pen.fillStyle = second ? C.b : C.a; pen.font = "600 13px system-ui, DejaVu Sans"; pen.fillText(p.c.name, p.cx + 12, 16); pen.font = "12px system-ui, DejaVu Sans";
  pen.fillStyle = C.faint; if (s) pen.fillText(s, p.cx + 12, 33);
  if (S.tab === "map") {
    flag(p, vertex(p.c.max), L("max").split(" ")[0] + " " + um(p.c.r[p.c.max]), C.high); flag(p, vertex(p.c.min), L("min").split(" ")[0] + " " + um(p.c.r[p.c.min]), C.low);
    if (probe) flag(p, probe.p, um(p.c.all[probe.v]), C.ink);
    if (section && section.mark) flag(p, section.mark, "", C.ink);
  }
  if (p.cx === 0) {                               // directions and, in parallel projection, a scale bar
    const o = [p.x + 34, H - 34]; [["X", [1, 0, 0], "#b3261e"], ["Y", [0, 1, 0], "#1e7d32"], ["Z", [0, 0, 1], "#1f4fbf"]].forEach(([n, v, c]) => { const e = [o[0] + 24 * dot(v, p.cam.right), o[1] - 24 * dot(v, p.cam.up)]; pen.strokeStyle = pen.fillStyle = c; pen.lineWidth = 2; pen.beginPath(); pen.moveTo(...o); pen.lineTo(...e); pen.stroke(); pen.textAlign = "center"; pen.fillText(n, o[0] + 1.35 * (e[0] - o[0]), o[1] + 1.35 * (e[1] - o[1])); });
    if (!S.persp) { const want = 90 * p.cam.perPixel, d = 10 ** Math.floor(Math.log10(want)), mm = [1, 2, 5, 10].map(k => k * d).filter(v => v <= want).pop(), px = mm / p.cam.perPixel; pen.strokeStyle = pen.fillStyle = C.ink; pen.lineWidth = 1.5; pen.beginPath(); pen.moveTo(p.x + 78, H - 14); pen.lineTo(p.x + 78 + px, H - 14); pen.stroke(); pen.textAlign = "left"; pen.fillText(mm + " mm", p.x + 84 + px, H - 14); }
  }
  pen.restore();
}
function legend() {
  const x = W - 26, y0 = 60, h = Math.min(260, H - 140), n = S.bands || 64;
  if (S.tab === "machine") { pen.fillStyle = C.plate; pen.fillRect(x - 44, y0 - 32, 66, h + 48); }  
  for (let i = 0; i < n; i++) { pen.fillStyle = colourAt(S.lo + (S.hi - S.lo) * (i + .5) / n); pen.fillRect(x, y0 + h * (1 - (i + 1) / n), 14, h / n + .6); }
  pen.fillStyle = "#4d0012"; pen.fillRect(x, y0 - 8, 14, 6); pen.fillStyle = "#0a1254"; pen.fillRect(x, y0 + h + 2, 14, 6);
  pen.fillStyle = C.ink; pen.textAlign = "right"; const m = S.bands && S.bands <= 10 ? S.bands : 4; for (let i = 0; i <= m; i++) { const v = S.lo + (S.hi - S.lo) * i / m; pen.fillText(+v.toPrecision(3) + "", x - 4, y0 + h * (1 - i / m)); }
  pen.fillText("µm", x + 14, y0 - 18);
}

// ---- picking: the card writes vertex, value and place of one pixel --------------------------------
const fbo = gl.createFramebuffer(); gl.bindFramebuffer(gl.FRAMEBUFFER, fbo);
for (const i of [0, 1]) { const t = gl.createTexture(); gl.bindTexture(gl.TEXTURE_2D, t); gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32UI, 1, 1); gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, t, 0); }
const depth = gl.createRenderbuffer(); gl.bindRenderbuffer(gl.RENDERBUFFER, depth); gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, 1, 1); gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
gl.drawBuffers([gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1]); gl.bindFramebuffer(gl.FRAMEBUFFER, null);
let around = null;                                // triangles at each vertex, computed when first needed
function neighbours() {
  const first = new Uint32Array(nV + 1); for (const v of tri) first[v + 1]++; for (let i = 0; i < nV; i++) first[i + 1] += first[i];
  const at = first.slice(), list = new Uint32Array(nT * 3); for (let k = 0; k < nT * 3; k++) list[at[tri[k]]++] = k / 3 | 0; return { first, list };
}
function pick(x, y) {
  const p = panes().find(p => x >= p.cx && x < p.cx + p.cw); if (!p) return null; p.cam = camera(p.w, H);
  const begun = performance.now();
  gl.bindFramebuffer(gl.FRAMEBUFFER, fbo); gl.disable(gl.SCISSOR_TEST); gl.disable(gl.BLEND); gl.enable(gl.DEPTH_TEST); gl.viewport(0, 0, 1, 1);
  gl.clearBufferuiv(gl.COLOR, 0, [0, 0, 0, 0]); gl.clearBufferuiv(gl.COLOR, 1, [0, 0, 0, 0]); gl.clearBufferfi(gl.DEPTH_STENCIL, 0, 1, 0);
  // a window of one pixel about the cursor
  const nx = 2 * (x - p.x) / p.w - 1, ny = 1 - 2 * y / H, sx = p.w, sy = H, Z = [sx, 0, 0, 0, 0, sy, 0, 0, 0, 0, 1, 0, -nx * sx, -ny * sy, 0, 1];
  const cam = { ...p.cam, V: mul(Z, p.cam.V) };
  setSurface(picker, cam, S.tab === "machine" ? partPose() : zero); gl.bindVertexArray(p.c.vao); gl.drawElements(gl.TRIANGLES, nT * 3, gl.UNSIGNED_INT, 0);
  const o = new Uint32Array(4), w = new Uint32Array(4); gl.readBuffer(gl.COLOR_ATTACHMENT0); gl.readPixels(0, 0, 1, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, o); gl.readBuffer(gl.COLOR_ATTACHMENT1); gl.readPixels(0, 0, 1, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, w);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null); timings.pick = +(performance.now() - begun).toFixed(1);
  if (!o[0]) return null;
  const q = [...new Float32Array(w.buffer, 0, 3)]; around ||= neighbours();
  let v = o[0] - 1, best = Infinity; for (let k = around.first[o[0] - 1]; k < around.first[o[0]]; k++) for (let c = 0; c < 3; c++) { const j = tri[3 * around.list[k] + c], e = Math.hypot(...sub(vertex(j), q)); if (e < best) best = e, v = j; }
  return { p: q, v };
}
function tell() {
  if (!probe) { $("probe").textContent = "—"; return; }
  const v = probe.v, f = (x, n = 3) => x.toFixed(n).padStart(9); let text = `X ${f(P[3 * v])} mm\nY ${f(P[3 * v + 1])}\nZ ${f(P[3 * v + 2])}` + (regionOf && regionOf[v] ? `\n${L("region")} ${index.regions[regionOf[v] - 1].name}` : "");
  for (const c of new Set([cases[S.a], cases[S.b], ...(S.mode === "difference" ? [difference] : [])])) text += `\n\n${c.name}\n  ${um(c.all[v])}` + (c.all[v] < NONE ? `   ${L("line")} ${c.line[v]}, ${c.time[v].toFixed(1)} s` : "");
  $("probe").textContent = text;
}

// ---- section: the mesh cut by a plane -------------------------------------------------------------
function cut() {
  if (!S.line) { section = null; profile(); return; }
  const [p, q] = S.line, d = norm(sub(q, p)), up = S.lineUp || [0, 0, 1], n = norm(cross(d, up)), c = dot(n, p), maps = shown(), begun = performance.now();
  const s = new Float32Array(nV); for (let i = 0; i < nV; i++) s[i] = n[0] * P[3 * i] + n[1] * P[3 * i + 1] + n[2] * P[3 * i + 2] - c;
  const out = [];
  for (let k = 0; k < nT * 3; k += 3) for (let e = 0; e < 3; e++) {
    const i = tri[k + e], j = tri[k + (e + 1) % 3]; if (i > j || (s[i] < 0) === (s[j] < 0)) continue;   // every edge once on a closed patch
    const t = s[i] / (s[i] - s[j]), x = [0, 1, 2].map(a => P[3 * i + a] + t * (P[3 * j + a] - P[3 * i + a]));
    out.push({ u: dot(d, sub(x, p)), x, r: maps.map(m => m.r[i] < NONE && m.r[j] < NONE ? m.r[i] + t * (m.r[j] - m.r[i]) : NaN) });
  }
  out.sort((a, b) => a.u - b.u); section = { n, c, points: out, names: maps.map(m => m.name), mark: null }; timings.section = +(performance.now() - begun).toFixed(1); profile();
}
const css = 'system-ui, "DejaVu Sans"';
function axes(c, x0, x1, y0, y1, xl, yl, title) {  // a simple plot; returns the transformations to pixels
  const g = c.getContext("2d"), w = c.width / ratio, h = c.height / ratio, L = 52, R = w - 12, T = 24, B = h - 34; g.setTransform(ratio, 0, 0, ratio, 0, 0); g.clearRect(0, 0, w, h); g.font = "11px " + css;
  const X = v => L + (v - x0) / (x1 - x0) * (R - L), Y = v => B - (v - y0) / (y1 - y0) * (B - T);
  const ticks = (a, b, n) => { const raw = (b - a) / n, p = 10 ** Math.floor(Math.log10(raw)), st = [1, 2, 2.5, 5, 10].map(k => k * p).find(k => k >= raw), o = []; for (let v = Math.ceil(a / st) * st; v <= b + 1e-9 * st; v += st) o.push(+v.toPrecision(10)); return o; };
  g.strokeStyle = C.rule; g.fillStyle = C.faint; g.lineWidth = 1; g.textAlign = "center"; g.textBaseline = "top"; for (const v of ticks(x0, x1, w / 90)) { g.beginPath(); g.moveTo(X(v), T); g.lineTo(X(v), B); g.stroke(); g.fillText(v, X(v), B + 4); }
  g.textAlign = "right"; g.textBaseline = "middle"; for (const v of ticks(y0, y1, 4)) { g.beginPath(); g.moveTo(L, Y(v)); g.lineTo(R, Y(v)); g.stroke(); g.fillText(v, L - 5, Y(v)); }
  g.textAlign = "right"; g.fillText(xl, R, h - 8); g.textAlign = "left"; g.fillStyle = C.ink; g.font = "600 12px " + css; g.fillText(title, L, 11); g.font = "11px " + css; g.fillStyle = C.faint; g.textAlign = "right"; g.fillText(yl, R, 11);
  return { g, X, Y, L, R, T, B, inverse: px => x0 + (px - L) / (R - L) * (x1 - x0) };
}
const inks = [C.a, C.b];
let profAxes = null;
function profile() {
  const c = $("prof"); if (!c.width) return;
  if (!section || section.points.length < 2) { const a = axes(c, 0, 1, -1, 1, "", "", L("section_hint")); profAxes = null; return; }
  const pts = section.points; let y0 = Infinity, y1 = -Infinity; for (const q of pts) for (const v of q.r) if (v === v) { y0 = Math.min(y0, v); y1 = Math.max(y1, v); } const m = (y1 - y0) * .06 || 1e-6;
  profAxes = axes(c, pts[0].u, pts[pts.length - 1].u, y0 - m, y1 + m, L("along"), "µm", L("section") + ", " + pts.length + " " + L("points")); const { g, X, Y } = profAxes;
  section.names.forEach((n, k) => { g.strokeStyle = inks[k]; g.lineWidth = 1.1; g.beginPath(); let on = false; for (const q of pts) { const v = q.r[k]; if (v !== v) { on = false; continue; } on ? g.lineTo(X(q.u), Y(v)) : g.moveTo(X(q.u), Y(v)); on = true; } g.stroke(); });
  if (section.mark) { g.strokeStyle = C.ink; g.beginPath(); g.moveTo(X(section.at), profAxes.T); g.lineTo(X(section.at), profAxes.B); g.stroke(); g.textAlign = "left"; g.fillStyle = C.ink; g.fillText(section.at.toFixed(2) + " mm: " + section.values.map(um).join("   "), profAxes.L + 6, profAxes.T + 8); }
}
$("prof").addEventListener("pointermove", e => { if (!profAxes) return; const u = profAxes.inverse(e.offsetX), pts = section.points; let a = 0, b = pts.length - 1; while (b - a > 1) { const m = (a + b) >> 1; pts[m].u < u ? a = m : b = m; } const q = pts[b]; section.mark = q.x; section.at = q.u; section.values = q.r.map(v => v === v ? v : NONE); profile(); draw(); });
let histAxes = null;
function histogram() {
  const c = $("hist"); if (!c.width) return; const maps = shown().filter(Boolean); if (!maps.length || !maps[0].r) return;
  const span = Math.max(...maps.map(m => Math.max(Math.abs(m.r[m.min]), Math.abs(m.r[m.max]))), Math.abs(S.lo), Math.abs(S.hi)) * 1.04, n = 160, counts = maps.map(m => { if (m.bins && m.bins.span === span) return m.bins; const b = new Float64Array(n); let all = 0; for (let i = 0; i < nV; i++) if (m.r[i] < NONE) { b[Math.min(n - 1, Math.floor((m.r[i] + span) / (2 * span) * n))]++; all++; } for (let i = 0; i < n; i++) b[i] *= 100 / all; b.span = span; return m.bins = b; });
  const top = Math.max(...counts.map(b => b.reduce((x, y) => Math.max(x, y)))) * 1.08; histAxes = axes(c, -span, span, 0, Math.sqrt(top), "µm", L("histogram_y"), L("histogram")); const { g, X, Y, T, B } = histAxes;
  counts.forEach((b, k) => { g.globalAlpha = k ? 1 : .85; g.beginPath(); for (let i = 0; i < n; i++) { const x0 = X(-span + 2 * span * i / n), x1 = X(-span + 2 * span * (i + 1) / n), y = Y(Math.sqrt(b[i])); if (!k) { g.fillStyle = colourAt(-span + 2 * span * (i + .5) / n); g.fillRect(x0, y, x1 - x0 + .4, B - y); } i ? g.lineTo(x0, y) : g.moveTo(x0, B); g.lineTo(x1, y); } g.strokeStyle = inks[k]; g.lineWidth = 1.2; g.stroke(); }); g.globalAlpha = 1;
  g.fillStyle = C.ink; for (const v of [S.lo, S.hi]) { g.fillRect(X(v) - .75, T, 1.5, B - T); g.beginPath(); g.arc(X(v), T, 4, 0, 7); g.fill(); }
}
let limit = null;
$("hist").addEventListener("pointerdown", e => { if (!histAxes) return; const { X } = histAxes; limit = Math.abs(e.offsetX - X(S.lo)) < Math.abs(e.offsetX - X(S.hi)) ? "lo" : "hi"; e.target.setPointerCapture(e.pointerId); });
$("hist").addEventListener("pointermove", e => { if (!limit) return; const v = histAxes.inverse(e.offsetX); if (limit === "lo" ? v < S.hi : v > S.lo) { S[limit] = +v.toPrecision(3); controls(); histogram(); draw(); } });
$("hist").addEventListener("pointerup", () => limit = null);

// ---- machine: rigid bodies on a chain along the samples -------------------------------------------
const machine = index.machine; let partInBed = null, path = null, machineCentre = [0, 0, 0], machineSize = 600, bodies = [];
if (machine) {
  const k = machine.joints.length, d = index.arrays.q, q = values("q"), n = d.n;
  const t = values("t"), line = load("block_line"), start = values("block_time");
  path = { n, q, t, line, start, end: t[n - 1] };
  const xyz = new Float32Array(3 * n);
  for (let i = 0; i < n; i++) { const T = tipInPart(j => q[j * n + i], machine.tools[toolAt(t[i])]); for (let c = 0; c < 3; c++) xyz[3 * i + c] = T[c]; }
  path.xyz = xyz; path.strandOf = points => { const v = gl.createVertexArray(); gl.bindVertexArray(v); attribute(0, buffer(points), 3); attribute(1, buffer(t), 1); gl.bindVertexArray(null); return v; };
  path.vao = path.strandOf(xyz);
  const from = [1e9, 1e9, 1e9], to = [-1e9, -1e9, -1e9], T = posesNow();
  const reach = (M, x) => { const v = at(M, x); for (let c = 0; c < 3; c++) { from[c] = Math.min(from[c], v[c]); to[c] = Math.max(to[c], v[c]); } };
  for (let i = 0; i < machine.bodies.length; i++) { const b = { ...machine.bodies[i], ...solid(i) }; bodies.push(b); for (let k = 0; k < b.x.length; k += 3) if (b.tool <= 0) reach(T[b.on], b.x.subarray(k, k + 3)); }
  for (let k = 0; k < 8; k++) reach(T.w, [0, 1, 2].map(c => (k >> c & 1 ? high : low)[c]));
  reach(T.t, [0, 0, 0]); machineCentre = mix(from, to, .5); machineSize = Math.hypot(...sub(to, from)); lap("machine");
} else { document.querySelectorAll("[data-tab=machine],.motion").forEach(e => e.hidden = true); if (S.tab === "machine") S.tab = "map"; }
function solid(i) {                         // with the normals of its facets
  const x = values("body" + i), t = load("facet" + i), n = x.length / 3, m = t.length / 3, v = new Float32Array(18 * m);
  const corner = k => [x[k], x[n + k], x[2 * n + k]];
  for (let f = 0; f < m; f++) { const [a, b, c] = [0, 1, 2].map(k => corner(t[k * m + f])), u = norm(cross(sub(b, a), sub(c, a))); [a, b, c].forEach((p, k) => v.set([...p, ...u], 18 * f + 6 * k)); }
  const vao = gl.createVertexArray(); gl.bindVertexArray(vao); gl.bindBuffer(gl.ARRAY_BUFFER, buffer(v)); for (const k of [0, 1]) { gl.enableVertexAttribArray(k); gl.vertexAttribPointer(k, 3, gl.FLOAT, false, 24, 12 * k); } gl.bindVertexArray(null);
  return { vao, count: 3 * m, x: interleaved(x, n, 3) };
}
function exponential(j, q) { return j.rotary ? turn(j.direction, q * rad, j.point) : move(j.direction.map(v => v * q)); }
function tipInPart(q, tool) {                     // spindles at rest; point by point, because a matrix per joint would take ten times as long
  let p = tool.T_bt_home.slice(12, 15);
  for (let i = machine.joints.length - 1; i >= 0; i--) {
    const j = machine.joints[i], u = j.direction; if (j.spindle) continue;
    if (!j.rotary) { p = p.map((v, c) => v + u[c] * q(i)); continue; }
    const v = sub(p, j.point), a = q(i) * rad, s = Math.sin(a), k = Math.cos(a), w = cross(u, v), along = dot(u, v) * (1 - k);
    p = v.map((x, c) => j.point[c] + x * k + w[c] * s + u[c] * along);
  }
  return at(partInBed ||= inverse(machine.T_bw_home), p).slice(0, 3);
}
function posesNow() {                             // pose of every carriage in the bed
  const { i, f } = sampleAt(S.time), n = path.n, q = j => path.q[j * n + i] + f * (path.q[j * n + Math.min(i + 1, n - 1)] - path.q[j * n + i]), T = {}; let m = eye();
  machine.joints.forEach((j, k) => { if (!j.workpiece) T[j.name] = m = mul(m, exponential(j, q(k))); }); T.tool = toolAt(S.time); T.t = mul(m, machine.tools[T.tool].T_bt_home); m = eye();
  for (let k = machine.joints.length - 1; k >= 0; k--) { const j = machine.joints[k]; if (j.workpiece) T[j.name] = m = mul(m, exponential(j, -q(k))); } T.w = mul(m, machine.T_bw_home); T.f = mul(m, machine.T_bf_home); T.b = eye(); T.q = machine.joints.map((_, k) => q(k)); T.i = i; return T;
}
const lastBefore = (x, t) => { let a = 0, b = x.length; while (b - a > 1) { const m = (a + b) >> 1; x[m] <= t ? a = m : b = m; } return a; };
function between(x, t) { let a = 0, b = x.length - 1; while (b - a > 1) { const m = (a + b) >> 1; x[m] <= t ? a = m : b = m; } return { i: a, f: Math.min(1, Math.max(0, (t - x[a]) / (x[b] - x[a] || 1))) }; }
function sampleAt(t) { return between(path.t, t); }
function toolAt(t) { let k = machine.tools.length - 1; while (k > 0 && machine.tools[k].from > t) k--; return k; }
function trackOf(c) { if (!c.track) return null; return c.course ||= { t: values("t:" + c.track), tip: values(c.track + "_tip"), turned: values(c.track + "_direction") }; }
function offAt(c, t) {                            // deviation of the tool in the part: of its tip, mm, and of its direction
  const k = trackOf(c); if (!k) return null; const { i, f } = between(k.t, t), n = k.t.length, j = Math.min(i + 1, n - 1);
  return [k.tip, k.turned].map(x => [0, 1, 2].map(a => x[a * n + i] + f * (x[a * n + j] - x[a * n + i])));
}
function turned(M, v) { return at(M, v).slice(0, 3).map((x, k) => x - M[12 + k]); }
const hasErrors = c => S.errors > 0 && c.track;
function truePose(T) {                            // pose of the tool with magnified errors
  const [tip, way] = offAt(cases[S.a], S.time).map(v => turned(T.w, v).map(x => x * S.errors)), u = [8, 9, 10].map(k => T.t[k]), axis = cross(u, way), angle = Math.min(1.5, Math.hypot(...axis));
  return mul(move(tip), angle > 0 ? mul(turn(norm(axis), angle, [12, 13, 14].map(k => T.t[k])), T.t) : T.t);
}
let trueStrand = null;
function trueWay() {                              // position of the tip in the part with magnified errors
  const c = cases[S.a]; if (trueStrand && trueStrand.of === c && trueStrand.errors === S.errors) return trueStrand.vao;
  const xyz = path.xyz.slice(); for (let i = 0; i < path.n; i++) { const [tip] = offAt(c, path.t[i]); for (let a = 0; a < 3; a++) xyz[3 * i + a] += S.errors * tip[a]; }
  trueStrand = { of: c, errors: S.errors, vao: path.strandOf(xyz) }; return trueStrand.vao;
}
const partPose = () => posesNow().w;
function machineScene(p, cam) {
  const T = posesNow(); paint(p, cam, T.w);
  gl.useProgram(strand.p); gl.uniformMatrix4fv(strand.u.M, false, T.w); gl.uniformMatrix4fv(strand.u.V, false, cam.V); gl.uniform1f(strand.u.tnow, S.time); gl.uniform1f(strand.u.trail, Math.max(2, path.end * .02));
  gl.uniform3fv(strand.u.colour, dark ? [.5, .7, 1] : [.2, .35, .65]); gl.bindVertexArray(path.vao); gl.drawArrays(gl.LINE_STRIP, 0, path.n);
  const errs = hasErrors(cases[S.a]), ghost = [.85, .35, .1]; if (errs) { gl.uniform3fv(strand.u.colour, ghost); gl.bindVertexArray(trueWay()); gl.drawArrays(gl.LINE_STRIP, 0, path.n); }
  gl.useProgram(plain.p); gl.uniformMatrix4fv(plain.u.V, false, cam.V); gl.uniform3fv(plain.u.eye, cam.d);
  const body = (b, M, colour, opacity) => { gl.uniformMatrix4fv(plain.u.M, false, M); gl.uniform4f(plain.u.colour, ...colour, opacity); gl.bindVertexArray(b.vao); gl.drawArrays(gl.TRIANGLES, 0, b.count); };
  const here = bodies.filter(b => b.tool < 0 || b.tool === T.tool), pose = errs && truePose(T);
  for (const clear of [false, true]) { gl.depthMask(!clear); for (const b of here) if (b.opacity < 1 === clear) body(b, T[b.on], b.colour, b.opacity); if (clear && errs) for (const b of here) if (b.on === "t") body(b, pose, ghost, .6); } gl.depthMask(true);
}
function motionText() {
  if (!path) return; const T = posesNow(), c = cases[S.a], off = offAt(c, S.time), q = machine.joints.map((j, k) => j.spindle ? "" : `${j.name} ${T.q[k].toFixed(3).replace(/^-(0\.0+)$/, "$1").padStart(9)} ${j.rotary ? "°" : "mm"}`); $("state").textContent = `${S.time.toFixed(2)} ${L("of")} ${path.end.toFixed(0)} s   ${L("line")} ${path.line[lastBefore(path.start, S.time)]}\n` + (machine.tools.length > 1 ? machine.tools[T.tool].name + "\n" : "") + q.filter(Boolean).join("\n") + (off ? `\n${L("tool_off")} µm\n` + off[0].map((v, k) => "XYZ"[k] + " " + (1000 * v).toFixed(3).padStart(9)).join("\n") : ""); $("time").value = S.time; curves();
}
function courseOf(c, name) {                      // -> times and values of a signal
  if (name === "tip_deviation_um") { const k = trackOf(c); return k && (k.size ||= { t: k.t, v: k.t.map((_, i) => 1000 * Math.hypot(k.tip[i], k.tip[k.t.length + i], k.tip[2 * k.t.length + i])) }); }
  const s = (c.signals || []).find(s => s.name === name); return s && (s.course ||= { t: values("t:" + s.key), v: values(s.key) });
}
let curveAxes = null;
function curves() {
  const c = $("course"); if (!path || S.tab !== "machine" || !c.width) return; curveAxes = null;
  const all = [...new Set([cases[S.a], cases[S.b]])].map(x => [x, courseOf(x, S.signal)]).filter(x => x[1]);
  if (!all.length) { axes(c, 0, path.end, 0, 1, "s", "", L("no_signal")); return; }
  let y0 = Infinity, y1 = -Infinity; for (const [, k] of all) for (const v of k.v) { y0 = Math.min(y0, v); y1 = Math.max(y1, v); } const m = (y1 - y0) * .06 || 1e-6;
  curveAxes = axes(c, 0, path.end, y0 - m, y1 + m, "s", "", S.signal); const { g, X, Y, T, B, R } = curveAxes; let right = R;
  g.save(); g.beginPath(); g.rect(curveAxes.L, T, R - curveAxes.L, B - T); g.clip();
  for (const [x, k] of all) { g.strokeStyle = x === cases[S.a] ? C.a : C.b; g.lineWidth = 1.1; g.beginPath(); k.t.forEach((t, i) => i ? g.lineTo(X(t), Y(k.v[i])) : g.moveTo(X(t), Y(k.v[i]))); g.stroke(); } g.restore();
  g.strokeStyle = C.ink; g.beginPath(); g.moveTo(X(S.time), T); g.lineTo(X(S.time), B); g.stroke(); g.textAlign = "right"; g.textBaseline = "middle";
  for (const [x, k] of all.reverse()) { const { i, f } = between(k.t, S.time), j = Math.min(i + 1, k.t.length - 1), text = `${x.name}: ${(k.v[i] + f * (k.v[j] - k.v[i])).toPrecision(5)}`; g.fillStyle = x === cases[S.a] ? C.a : C.b; g.fillText(text, right, 11); right -= g.measureText(text).width + 16; }
}
let playing = 0;
function tick(now) { if (!playing) return; S.time += (now - playing) / 1000 * +$("speed").value; playing = now; if (S.time >= path.end) S.time = 0; motionText(); draw(); requestAnimationFrame(tick); }

// ---- controls -------------------------------------------------------------------------------------
if (!index.tolerance_um && !index.regions.some(r => r.tolerance_um)) $("tol").hidden = true;
cases.forEach((c, i) => { for (const id of ["a", "b"]) $(id).add(new Option(c.name, i)); });
document.querySelectorAll("#figures tbody tr").forEach(r => { const i = cases.findIndex(c => c.name === r.dataset.case); r.onclick = e => { if (i < 0) return; S[e.shiftKey ? "a" : "b"] = i; controls(); prepare(); }; });
$("language").addEventListener("click", () => { language = S.language = language === "en" ? "zh" : "en"; translate(); controls(); tell(); motionText(); histogram(); profile(); draw(); });
function controls() {
  for (const o of $("errors").options) o.textContent = o.value === "0" ? L("off") : "× " + o.value; for (const o of $("layer").options) o.textContent = L(o.value); $("region").options[0].textContent = L("whole_part"); for (const k of ["a", "b", "lo", "hi", "bands", "mag", "layer", "region", "errors", "signal"]) $(k).value = S[k]; $("persp").checked = S.persp; $("reveal").checked = S.reveal; $("bandsOut").textContent = S.bands || L("smooth"); $("magOut").textContent = S.mag > 0 ? "× " + (10 ** S.mag).toPrecision(2) : L("off");
  document.querySelectorAll("[data-mode]").forEach(b => b.classList.toggle("on", b.dataset.mode === S.mode)); document.querySelectorAll("[data-tab]").forEach(b => b.setAttribute("aria-selected", String(b.dataset.tab === S.tab))); document.querySelectorAll("#figures tbody tr").forEach(r => { r.className = r.dataset.case === cases[S.a].name ? "a" : r.dataset.case === cases[S.b].name ? "b" : ""; });
  document.body.classList.toggle("text", S.tab === "text"); document.body.classList.toggle("machine", S.tab === "machine");
}
const on = (id, event, f) => $(id).addEventListener(event, e => { f(e.target, e); controls(); });
for (const k of layers) $("layer").add(new Option("", k));
$("region").add(new Option("", 0)); index.regions.forEach((r, i) => $("region").add(new Option(r.name, i + 1))); $("region").parentElement.hidden = !index.regions.length;
on("layer", "change", e => { S.layer = e.value; refitted(); }); on("region", "change", e => { S.region = +e.value; refitted(); });
function refitted() { for (const i of [S.a, S.b]) residual(i); difference = null; if (S.mode !== "difference") fit(); controls(); prepare(); }
for (const id of ["a", "b"]) on(id, "change", e => { S[id] = +e.value; motionText(); prepare(); });
for (const id of ["lo", "hi"]) on(id, "change", e => { const v = +e.value; if (Number.isFinite(v) && (id === "lo" ? v < S.hi : v > S.lo)) S[id] = v; histogram(); draw(); });
on("bands", "input", e => { S.bands = +e.value; histogram(); draw(); }); on("mag", "input", e => { S.mag = +e.value; draw(); }); on("persp", "change", e => { S.persp = +e.checked; draw(); });
on("fit", "click", () => { fit(); histogram(); draw(); }); on("tol", "click", () => { const t = S.region && index.regions[S.region - 1].tolerance_um || index.tolerance_um; if (!t) return; S.lo = t[0]; S.hi = t[1]; S.bands = 4; histogram(); draw(); });
document.querySelectorAll("[data-mode]").forEach(b => b.addEventListener("click", () => { S.mode = b.dataset.mode; controls(); prepare(); }));
document.querySelectorAll("[data-tab]").forEach(b => b.addEventListener("click", () => { S.tab = b.dataset.tab; controls(); motionText(); resize(); prepare(); }));
const signalNames = [...new Set(cases.flatMap(c => [...(c.track ? ["tip_deviation_um"] : []), ...(c.signals || []).map(s => s.name)]))];
for (const n of signalNames) $("signal").add(new Option(n, n)); if (!signalNames.includes(S.signal)) S.signal = signalNames[0] || ""; $("signal").parentElement.hidden = !signalNames.length; $("errors").parentElement.hidden = !cases.some(c => c.track);
for (const k of [0, 1, 10, 100, 1000, 10000]) $("errors").add(new Option("", k));
on("signal", "change", e => { S.signal = e.value; curves(); draw(); }); on("errors", "change", e => { S.errors = +e.value; draw(); });
for (const kind of ["pointerdown", "pointermove"]) $("course").addEventListener(kind, e => { if (!curveAxes || !e.buttons) return; S.time = Math.min(path.end, Math.max(0, curveAxes.inverse(e.offsetX))); motionText(); draw(); });
if (path) { $("time").max = path.end; on("time", "input", e => { S.time = +e.value; motionText(); draw(); }); on("go", "click", () => { const n = +$("goLine").value; let k = path.line.indexOf(n); if (k < 0) { let best = Infinity; path.line.forEach((l, i) => { if (Math.abs(l - n) < best) { best = Math.abs(l - n); k = i; } }); } S.time = path.start[k]; $("goLine").value = path.line[k]; motionText(); draw(); });
  ink.addEventListener("dblclick", e => { const h = pick(e.offsetX, e.offsetY), c = cases[S.a]; if (!h || !(c.time[h.v] < NONE)) return; S.time = c.time[h.v]; S.tab = "machine"; controls(); motionText(); resize(); prepare(); });
  on("play", "click", e => { playing = playing ? 0 : performance.now(); e.textContent = playing ? "⏸" : "▶"; if (playing) requestAnimationFrame(tick); }); }
if (path) on("toTool", "click", () => { const T = posesNow(); S.machineTarget = [12, 13, 14].map(k => T.t[k]); S.machineZoom = machineSize / (2.5 * size); draw(); });
on("reveal", "change", e => { S.reveal = +e.checked; prepare(); });
on("png", "click", () => { dirty = true; asked = -1; render(performance.now()); const c = document.createElement("canvas"); c.width = glc.width; c.height = glc.height; const g = c.getContext("2d"); g.drawImage(glc, 0, 0); g.drawImage(ink, 0, 0); c.toBlob(b => save(b, "map.png")); });
on("csv", "click", () => { if (section) save(new Blob(["along_mm,x_mm,y_mm,z_mm," + section.names.map(n => n + "_um").join(",") + "\n" + section.points.map(q => [q.u, ...q.x, ...q.r].map(v => +v.toPrecision(7)).join(",")).join("\n") + "\n"], { type: "text/csv" }), "profile.csv"); });
let pointers = new Map(), last = null;
ink.addEventListener("pointerdown", e => {
  ink.setPointerCapture(e.pointerId); ink.focus(); pointers.set(e.pointerId, [e.offsetX, e.offsetY]);
  if (S.mode === "swipe" && S.tab === "map" && Math.abs(e.offsetX - W * S.swipe) < 12) dragging = "swipe";
  else if (e.shiftKey && e.button === 0 && S.tab === "map") { const h = pick(e.offsetX, e.offsetY); dragging = h ? { from: h.p, v: h.v } : null; }
  else dragging = e.button === 2 || e.button === 1 ? "pan" : "turn"; last = [e.offsetX, e.offsetY];
});
ink.addEventListener("pointermove", e => {
  const x = e.offsetX, y = e.offsetY;
  if (!dragging) { if (waiting) return; waiting = true; requestAnimationFrame(() => { waiting = false; probe = pick(x, y); tell(); draw(); }); return; }
  const dx = x - last[0], dy = y - last[1]; last = [x, y];
  if (pointers.size === 2) { const before = [...pointers.values()]; pointers.set(e.pointerId, [x, y]); const after = [...pointers.values()], l = v => Math.hypot(v[0][0] - v[1][0], v[0][1] - v[1][1]); S.zoom *= l(after) / (l(before) || 1); pan(dx / 2, dy / 2); draw(); return; }
  pointers.set(e.pointerId, [x, y]);
  if (dragging === "swipe") S.swipe = Math.min(.98, Math.max(.02, x / W));
  else if (dragging === "pan") pan(dx, dy);
  else if (dragging === "turn") { S.az -= dx * .4; S.el = Math.min(90, Math.max(-90, S.el + dy * .4)); }
  else { const h = pick(x, y); if (h && Math.hypot(...sub(h.p, dragging.from)) > 1e-3 * size) { S.line = [dragging.from, h.p]; const k = 3 * dragging.v, m = 3 * h.v; S.lineUp = norm([0, 1, 2].map(a => normal[k + a] / 1 + normal[m + a])); cut(); } }
  draw();
});
let waiting = false;
function pan(dx, dy) { const p = panes()[0], cam = camera(p.w, H), t = S.tab === "machine" ? S.machineTarget ||= machineCentre.slice() : S.target; for (let c = 0; c < 3; c++) t[c] += (-dx * cam.right[c] + dy * cam.up[c]) * cam.perPixel; }
for (const k of ["pointerup", "pointercancel"]) ink.addEventListener(k, e => { pointers.delete(e.pointerId); dragging = null; });
ink.addEventListener("pointerleave", () => { if (!dragging) { probe = null; tell(); draw(); } });
ink.addEventListener("contextmenu", e => e.preventDefault());
ink.addEventListener("wheel", e => { e.preventDefault(); const z = S.tab === "machine" ? "machineZoom" : "zoom"; S[z] = Math.min(400, Math.max(.1, (S[z] || 1) * Math.exp(-e.deltaY * .0015))); draw(); }, { passive: false });
ink.addEventListener("keydown", e => { const step = { ArrowLeft: [8, 0], ArrowRight: [-8, 0], ArrowUp: [0, 8], ArrowDown: [0, -8] }[e.key], z = { "+": 1.25, "-": .8 }[e.key]; if (step) { e.preventDefault(); S.az += step[0]; S.el = Math.min(90, Math.max(-90, S.el + step[1])); draw(); } if (z) { const k = S.tab === "machine" ? "machineZoom" : "zoom"; S[k] = Math.min(400, Math.max(.1, (S[k] || 1) * z)); draw(); } const v = { 0: [home.az, home.el], 1: [-90, 90], 2: [-90, 0], 3: [0, 0] }[e.key]; if (v) { [S.az, S.el] = v; S.machineZoom = 1; S.machineTarget = null; S.target = centre.slice(); fitView(); draw(); } });
glc.addEventListener("webglcontextlost", e => { e.preventDefault(); $("fallback").hidden = false; $("fallback").textContent = L("lost"); });
new ResizeObserver(resize).observe(ink);
residual(S.a); residual(S.b); lap("residuals");
if (!location.hash) fit(); controls(); motionText(); resize(); if (!location.hash) fitView(); await prepare(); $("busy").hidden = true;
requestAnimationFrame(() => { gl.finish(); lap("ready"); window.ready = true; });
addEventListener("hashchange", () => { try { Object.assign(S, JSON.parse(decodeURIComponent(location.hash.slice(1)))); } catch { return; } language = S.language; translate(); controls(); motionText(); prepare(); });
const tipAt = t => { const { i, f } = sampleAt(t), n = path.n, k = Math.min(i + 1, n - 1); return tipInPart(j => path.q[j * n + i] + f * (path.q[j * n + k] - path.q[j * n + i]), machine.tools[toolAt(t)]); };
window.abbe = { tipAt, offAt, courseOf, index, P, S, prepare, draw, controls, pick, project, cut, cases, get section() { return section; }, get frames() { return frames; }, panes, motionText, fit, fitView };
})().catch(e => { document.getElementById("busy").textContent = L("cannot") + e.message; window.failed = e.stack; console.error(e); });
});
