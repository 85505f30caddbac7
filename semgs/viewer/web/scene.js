// What a page shows of its scene, and what is under a pixel. Adds to window.semgs of camera.js.
// The tree has /MODE/CLASS/STEP: the Gaussians of a class whose confidence is in this tenth.
(() => {
  const NEAR = 0.05, SEEN = 0.5, DARK = 0.02, CUT = 4; // CUT: squared standard deviations / 2, where viser ends a splat
  const state = { mode: "colour", hidden: [], least: 0, boxes: false };
  let data = null, splats = null;

  const bytes = (text) => Uint8Array.from(atob(text), (one) => one.charCodeAt(0));
  const viewer = () => window.semgs.viewer();
  const nodes = (mode) => data.steps.flatMap((steps, label) => steps.map((step) => ({ label, step, name: `/${mode}/${label}/${step}` })));
  const isShown = (label, step) => !state.hidden.includes(label) && step >= state.least;

  // Shows what is asked for; says how many Gaussians that are.
  function show(change) {
    Object.assign(state, change);
    const { setVisible } = window.semgs;
    for (const mode of data.modes) setVisible(`/${mode}`, mode === state.mode);
    for (const mode of data.modes) for (const { label, step, name } of nodes(mode)) setVisible(name, isShown(label, step));
    if (viewer().nodeRefFromName["/things"]) setVisible("/things", state.boxes);
    let count = 0;
    for (let index = 0; index < splats.labels.length; index++) count += isShown(splats.labels[index], splats.steps[index]);
    return { count, of: splats.labels.length };
  }

  function half(bits) {
    const sign = bits & 0x8000 ? -1 : 1, exponent = (bits >> 10) & 31, fraction = bits & 1023;
    return sign * (exponent ? 2 ** (exponent - 15) * (1 + fraction / 1024) : 2 ** -14 * (fraction / 1024));
  }

  // The splats of a mode, from viser's own copies: 3 floats, a number of viser's, 6 halves of the covariance, 4 bytes of colour and opacity.
  function read(mode) {
    const tree = window.__viserSceneTree.getState();
    const parts = nodes(mode).map((node) => ({ ...node, words: tree[node.name].message.props.buffer }));
    const count = parts.reduce((sum, { words }) => sum + words.length / 8, 0);
    const all = {
      means: new Float32Array(3 * count), shapes: new Float32Array(6 * count), opacities: new Float32Array(count),
      labels: new Uint8Array(count), steps: new Uint8Array(count),
    };
    let index = 0;
    for (const { label, step, words } of parts) {
      const floats = new Float32Array(words.buffer, words.byteOffset, words.length);
      for (let at = 0; at < words.length; at += 8, index++) {
        all.means.set(floats.subarray(at, at + 3), 3 * index);
        for (let pair = 0; pair < 3; pair++) {
          all.shapes[6 * index + 2 * pair] = half(words[at + 4 + pair] & 0xffff);
          all.shapes[6 * index + 2 * pair + 1] = half(words[at + 4 + pair] >>> 16);
        }
        all.opacities[index] = (words[at + 7] >>> 24) / 255;
        all.labels[index] = label;
        all.steps[index] = step;
      }
    }
    return all;
  }

  // Column-major 4 x 4 matrices, as three.js has them.
  function product(a, b) {
    const out = new Float64Array(16);
    for (let column = 0; column < 4; column++)
      for (let row = 0; row < 4; row++)
        for (let k = 0; k < 4; k++) out[4 * column + row] += a[4 * k + row] * b[4 * column + k];
    return out;
  }

  function clipFromScene() {
    const { camera, nodeRefFromName } = viewer();
    camera.updateMatrixWorld();
    nodeRefFromName[""].updateWorldMatrix(true, false);
    return product(product(camera.projectionMatrix.elements, camera.matrixWorldInverse.elements), nodeRefFromName[""].matrixWorld.elements);
  }

  function project(matrix, x, y, z) {
    const at = (row) => matrix[row] * x + matrix[4 + row] * y + matrix[8 + row] * z + matrix[12 + row];
    const w = at(3), box = viewer().canvas.getBoundingClientRect();
    return { x: box.left + (0.5 + at(0) / w / 2) * box.width, y: box.top + (0.5 - at(1) / w / 2) * box.height, w };
  }

  // The opacity of a splat at a distance of (dx, dy) pixels from its centre, with the shape that it has in the picture.
  function alphaAt(index, at, dx, dy, matrix, box) {
    const s = splats.shapes.subarray(6 * index, 6 * index + 6);
    const full = [[s[0], s[1], s[2]], [s[1], s[3], s[4]], [s[2], s[4], s[5]]];
    // How the pixel moves with the position: the derivative of x / w and y / w.
    const slope = (row, scale, value) => [0, 1, 2].map((axis) => (scale * (matrix[4 * axis + row] - value * matrix[4 * axis + 3])) / at.w);
    const u = (2 * (at.x - box.left)) / box.width - 1, v = 1 - (2 * (at.y - box.top)) / box.height;
    const jx = slope(0, box.width / 2, u), jy = slope(1, -box.height / 2, v);
    const form = (a, b) => a.reduce((sum, one, i) => sum + one * b.reduce((inner, other, j) => inner + full[i][j] * other, 0), 0);
    const xx = form(jx, jx) + 0.3, xy = form(jx, jy), yy = form(jy, jy) + 0.3;
    const power = (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy) / 2;
    return power < CUT ? splats.opacities[index] * Math.exp(-power) : 0;
  }

  // What is under a pixel, by the rule of the renderer: where the opacity passes one half, and which class weighs most. Null if nothing is.
  function pick(px, py) {
    const matrix = clipFromScene(), box = viewer().canvas.getBoundingClientRect();
    const focal = (viewer().camera.projectionMatrix.elements[5] * box.height) / 2;
    const met = [];
    for (let index = 0; index < splats.labels.length; index++) {
      if (!isShown(splats.labels[index], splats.steps[index])) continue;
      const at = project(matrix, ...splats.means.subarray(3 * index, 3 * index + 3));
      if (at.w <= NEAR) continue;
      const dx = px - at.x, dy = py - at.y, s = splats.shapes;
      const widest = (focal / at.w) ** 2 * (s[6 * index] + s[6 * index + 3] + s[6 * index + 5]) + 0.3;
      if (dx * dx + dy * dy > 4 * CUT * widest) continue;
      const alpha = alphaAt(index, at, dx, dy, matrix, box);
      if (alpha > 0) met.push({ index, depth: at.w, alpha });
    }
    met.sort((a, b) => a.depth - b.depth);
    let light = 1, solid = null;
    const votes = new Map();
    for (const { index, depth, alpha } of met) {
      const weight = light * alpha, label = splats.labels[index], thing = splats.things?.[index] ?? 0;
      const vote = votes.get(label) ?? { weight: 0, confidence: 0, things: new Map() };
      vote.weight += weight;
      vote.confidence += (weight * splats.confidences[index]) / 255;
      vote.things.set(thing, (vote.things.get(thing) ?? 0) + weight);
      votes.set(label, vote);
      light -= weight;
      if (solid === null && light < SEEN) solid = depth;
      if (light < DARK) break;
    }
    if (solid === null) return null;
    const best = (map, weight) => [...map].sort((a, b) => weight(b[1]) - weight(a[1]))[0];
    const [label, vote] = best(votes, (one) => one.weight);
    const [thing] = best(vote.things, (one) => one);
    const raw = alongRay(px, py, solid, matrix);
    const position = raw.map((value, axis) => value / data.scale + data.origin[axis]);
    return { label, confidence: vote.confidence / vote.weight, thing, position, raw };
  }

  function alongRay(px, py, depth, matrix) {
    const box = viewer().canvas.getBoundingClientRect();
    const x = ((px - box.left) / box.width) * 2 - 1, y = 1 - ((py - box.top) / box.height) * 2;
    // Solve for the point whose clip coordinates are (x w, y w, -, w) with w = depth, by Cramer's rule on rows 0, 1 and 3.
    const row = (k) => [matrix[k], matrix[4 + k], matrix[8 + k], matrix[12 + k]];
    const rows = [row(0), row(1), row(3)], right = [x * depth - rows[0][3], y * depth - rows[1][3], depth - rows[2][3]];
    const det = (m) => m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    const whole = det(rows.map((one) => one.slice(0, 3)));
    return [0, 1, 2].map((k) => det(rows.map((one, i) => one.slice(0, 3).map((value, j) => (j === k ? right[i] : value)))) / whole);
  }

  // Marks of clicks, a text beside a single one, and a line between two of them, follow the camera.
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("class", "semgs-marks");
  svg.setAttribute("aria-hidden", "true");
  let marks = [], words = "", painted = "";
  function mark(points, text = "") {
    const still = marks.length === 0;
    marks = points;
    words = text.replace(/[&<>]/g, (one) => `&#${one.charCodeAt(0)};`);
    if (still) follow();
  }
  function follow() {
    if (!marks.length) {
      svg.innerHTML = painted = "";
      return;
    }
    requestAnimationFrame(follow);
    const matrix = clipFromScene();
    const spots = marks.map((point) => project(matrix, ...point)).filter((one) => one.w > 0);
    const dots = spots.map(({ x, y }) => `<circle cx="${x.toFixed(1)}" cy="${y.toFixed(1)}" r="6" fill="#ffd34d" stroke="#222" stroke-width="2"/>`);
    if (spots.length === 2) {
      const [a, b] = spots.map(({ x, y }) => [x.toFixed(1), y.toFixed(1)]);
      dots.unshift(`<line x1="${a[0]}" y1="${a[1]}" x2="${b[0]}" y2="${b[1]}" stroke="#ffd34d" stroke-width="3" stroke-dasharray="7 5"/>`);
    }
    if (spots.length === 1 && words) {
      const [{ x, y }] = spots, left = x > window.innerWidth / 2;
      dots.push(`<text x="${(x + (left ? -12 : 12)).toFixed(1)}" y="${(y + 5).toFixed(1)}" text-anchor="${left ? "end" : "start"}">${words}</text>`);
    }
    if (dots.join("") !== painted) svg.innerHTML = painted = dots.join("");
  }

  // Reports what is under each click, if it was no drag.
  function listen(clicked) {
    let down = null;
    window.addEventListener("pointerdown", (event) => {
      down = event.target instanceof HTMLCanvasElement && event.button === 0 ? [event.clientX, event.clientY] : null;
    }, true);
    window.addEventListener("pointerup", (event) => {
      if (down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < 4) clicked(pick(event.clientX, event.clientY));
      down = null;
    }, true);
  }

  function pickCentre() {
    const box = viewer().canvas.getBoundingClientRect();
    return pick(box.left + box.width / 2, box.top + box.height / 2);
  }

  // Calls back once all of the scene is there and the camera is at the first photo.
  function load(given, ready) {
    data = given;
    (function wait() {
      const there = viewer()?.canvas && data.modes.every((mode) => nodes(mode).every(({ name }) => viewer().nodeRefFromName[name]));
      if (!there) return setTimeout(wait, 100);
      splats = read(data.modes.at(-1));
      splats.confidences = bytes(data.confidences);
      if (data.things) splats.things = new Uint32Array(bytes(data.things).buffer);
      document.body.append(svg);
      window.semgs.start({ views: data.views, near: data.near }, ready);
    })();
  }

  Object.assign(window.semgs, { load, show, pickCentre, listen, mark });
})();
