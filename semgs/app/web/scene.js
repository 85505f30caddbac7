// Inside the page with the scene in 3D: does what the page around it asks for in messages, and reports clicks.
// Positions are in the viewer's units until they are reported.
(() => {
  const data = JSON.parse(document.getElementById("semgs").textContent);
  const bytes = (name) => Uint8Array.from(atob(data.arrays[name]), (one) => one.charCodeAt(0)).buffer;
  const means = new Float32Array(bytes("means"));
  const radii = new Float32Array(bytes("radii"));
  const opacities = new Uint8Array(bytes("opacities"));
  const confidences = new Uint8Array(bytes("confidences"));
  const labels = new Uint8Array(bytes("labels"));
  const things = new Uint16Array(bytes("things"));
  const count = labels.length;
  const groups = Object.keys(data.steps).length;
  const state = { mode: "colour", hidden: [], least: 0, boxes: false };
  let marks = [];

  const viewer = () => window.__viserMutable;
  const tell = (message) => window.parent.postMessage({ semgs: "scene", ...message }, "*");
  const stepOf = (index) => Math.min(9, Math.floor((10 * confidences[index]) / 255));
  const isShown = (index) => !state.hidden.includes(labels[index]) && stepOf(index) >= state.least;

  function setVisible(name, visible) {
    viewer().messageQueue.push({ type: "SetSceneNodeVisibilityMessage", name, owner: "", visible });
  }

  function apply() {
    for (const mode of data.modes) {
      setVisible(`/${mode}`, mode === state.mode);
      for (let group = 0; group < groups; group++) {
        setVisible(`/${mode}/${group}`, !state.hidden.includes(group));
        for (const step of data.steps[group]) setVisible(`/${mode}/${group}/${step}`, step >= state.least);
      }
    }
    if (viewer().nodeRefFromName["/things"]) setVisible("/things", state.boxes);
    viewer().requestRender();
    let shown = 0;
    for (let index = 0; index < count; index++) shown += isShown(index);
    tell({ event: "shown", count: shown, of: count });
  }

  // Column-major 4 x 4 matrices, as three.js has them.
  function product(a, b) {
    const out = new Float64Array(16);
    for (let column = 0; column < 4; column++)
      for (let row = 0; row < 4; row++)
        for (let k = 0; k < 4; k++) out[4 * column + row] += a[4 * k + row] * b[4 * column + k];
    return out;
  }

  function world() {
    const node = viewer().nodeRefFromName["/colour"];
    node.updateWorldMatrix(true, false);
    return node.matrixWorld.elements;
  }

  function clipFromScene() {
    const camera = viewer().camera;
    camera.updateMatrixWorld();
    return product(product(camera.projectionMatrix.elements, camera.matrixWorldInverse.elements), world());
  }

  function project(matrix, x, y, z) {
    const at = (row) => matrix[row] * x + matrix[4 + row] * y + matrix[8 + row] * z + matrix[12 + row];
    const w = at(3);
    const box = viewer().canvas.getBoundingClientRect();
    return { x: box.left + (0.5 + at(0) / w / 2) * box.width, y: box.top + (0.5 - at(1) / w / 2) * box.height, w };
  }

  // What is under a pixel, by the rule of the renderer: where the opacity passes one half, and which class weighs most.
  function pick(px, py) {
    const matrix = clipFromScene();
    const box = viewer().canvas.getBoundingClientRect();
    const focal = (viewer().camera.projectionMatrix.elements[5] * box.height) / 2;
    const near = [];
    for (let index = 0; index < count; index++) {
      if (!isShown(index)) continue;
      const at = project(matrix, means[3 * index], means[3 * index + 1], means[3 * index + 2]);
      if (at.w <= 0.05) continue;
      const radius = Math.max(1.5, (radii[index] * focal) / at.w);
      const away = Math.hypot(at.x - px, at.y - py) / radius;
      if (away < 2) near.push({ index, depth: at.w, alpha: (opacities[index] / 255) * Math.exp(-away * away) });
    }
    near.sort((a, b) => a.depth - b.depth);
    let light = 1, solid = null;
    const votes = new Map();
    for (const one of near) {
      const weight = light * one.alpha;
      const label = labels[one.index];
      const vote = votes.get(label) ?? { weight: 0, confidence: 0, things: new Map() };
      vote.weight += weight;
      vote.confidence += (weight * confidences[one.index]) / 255;
      vote.things.set(things[one.index], (vote.things.get(things[one.index]) ?? 0) + weight);
      votes.set(label, vote);
      light -= weight;
      if (solid === null && light < 0.5) solid = one;
      if (light < 0.02) break;
    }
    if (solid === null) return null;
    const best = (map, weight) => [...map].sort((a, b) => weight(b[1]) - weight(a[1]))[0];
    const [label, vote] = best(votes, (one) => one.weight);
    const [thing] = best(vote.things, (one) => one);
    // On the ray through the pixel, at the depth where it became solid.
    const position = alongRay(px, py, solid.depth, matrix);
    return { label, confidence: vote.confidence / vote.weight, thing, position };
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

  const inScene = (point) => point.map((value, axis) => value / data.scale + data.origin[axis]);

  function reportClick(px, py) {
    const hit = pick(px, py);
    tell({ event: "click", hit: hit && { ...hit, position: inScene(hit.position), raw: hit.position } });
  }

  function flyTo(number) {
    const view = data.views[number];
    const move = ([x, y, z]) => {
      const m = world();
      return [0, 1, 2].map((row) => m[row] * x + m[4 + row] * y + m[8 + row] * z + m[12 + row]);
    };
    const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    viewer().cameraControl.setLookAt(...move(view.position), ...move(view.lookAt), !still);
    viewer().requestRender();
  }

  // Marks of clicks and of the measured line follow the camera.
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("class", "marks");
  svg.setAttribute("aria-hidden", "true");
  let drawn = "";
  function follow() {
    if (!marks.length) {
      svg.innerHTML = drawn = "";
      return;
    }
    requestAnimationFrame(follow);
    const matrix = clipFromScene();
    const places = marks.map((point) => project(matrix, ...point)).filter((one) => one.w > 0);
    const dots = places.map(({ x, y }) => `<circle cx="${x.toFixed(1)}" cy="${y.toFixed(1)}" r="6" fill="#ffd34d" stroke="#222" stroke-width="2"/>`);
    if (places.length === 2) {
      const [a, b] = places.map(({ x, y }) => [x.toFixed(1), y.toFixed(1)]);
      dots.unshift(`<line x1="${a[0]}" y1="${a[1]}" x2="${b[0]}" y2="${b[1]}" stroke="#ffd34d" stroke-width="3" stroke-dasharray="7 5"/>`);
    }
    if (dots.join("") !== drawn) svg.innerHTML = drawn = dots.join("");
  }

  window.addEventListener("message", (event) => {
    const message = event.data;
    if (event.source !== window.parent || !message || message.semgs !== "room") return;
    if (message.fly !== undefined) flyTo(message.fly);
    if (message.marks) {
      const still = marks.length === 0;
      marks = message.marks;
      if (still) follow();
    }
    if (message.pick === "centre") {
      const box = viewer().canvas.getBoundingClientRect();
      reportClick(box.left + box.width / 2, box.top + box.height / 2);
    }
    if (message.state) {
      Object.assign(state, message.state);
      apply();
    }
  });

  let down = null;
  window.addEventListener("pointerdown", (event) => {
    down = event.target instanceof HTMLCanvasElement && event.button === 0 ? [event.clientX, event.clientY] : null;
  }, true);
  window.addEventListener("pointerup", (event) => {
    if (down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < 4) reportClick(event.clientX, event.clientY);
    down = null;
  }, true);

  (function wait() {
    const there = viewer() && viewer().camera && viewer().canvas && viewer().nodeRefFromName["/colour"];
    const complete = there && data.modes.every((mode) => Object.keys(data.steps).every((group) =>
      data.steps[group].every((step) => viewer().nodeRefFromName[`/${mode}/${group}/${step}`])));
    if (!complete) return setTimeout(wait, 100);
    document.body.append(svg);
    tell({ event: "ready" });
    apply();
  })();
})();
