// The camera in viser's client: it stays where the photos saw the scene, and returns to them. Defines window.semgs; pages and `semgs view` use it.
// Positions are in the viewer's units, in which the median depth of the photos is 10.
(() => {
  if (window.semgs) return; // after a reconnection
  const SIDEWAYS = 2, FORWARD = 6, BACKWARD = 4; // from a photo
  const TURN = 0.5; // from the direction of a photo [radians]
  const SPEED = 0.25; // of turning: 200 pixels are about 25 degrees
  const ROUNDING = 1e-3;
  const IN_THE_WAY = 2.5; // Photos that are closer to the camera are hidden, because they would block the view.
  const MARGIN = 1.5; // At most, a photo is this much narrower or lower than the window.
  const FLIGHT_SECONDS = 0.2, DRAG_SECONDS = 0.05; // How smooth a flight and a key are.
  const KEYS = /^(Key[WASDQE]|Arrow(Up|Down|Left|Right))$/;

  let viewer = null, views = [], near = true, photos = true, shown = new Map();
  const held = new Set();
  let byKeys = false; // whether keys moved the camera since the last frame

  const add = (...all) => [0, 1, 2].map((axis) => all.reduce((sum, one) => sum + one[axis], 0));
  const times = (vector, factor) => vector.map((side) => side * factor);
  const from = (a, b) => add(b, times(a, -1));
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const size = (vector) => Math.hypot(...vector);
  const unit = (vector) => times(vector, 1 / (size(vector) || 1));
  const limit = (value, least, most) => Math.min(Math.max(value, least), most);

  // Calls back as soon as viser's client is there, before it shows anything.
  function whenThere(ready) {
    if (window.__viserMutable) return ready(window.__viserMutable);
    let value;
    Object.defineProperty(window, "__viserMutable", {
      configurable: true,
      get: () => value,
      set: (given) => {
        value = given;
        ready(given);
      },
    });
  }

  // viser's quads of splats have positions with two coordinates, so three.js finds no radius for them and says so in the console. They get
  // the same radius, without the words: it keeps them from being culled and from being hit by clicks.
  function giveQuadsNoRadius(scene) {
    let known = null;
    scene.traverse((node) => (known ??= node.geometry?.attributes?.position ? node.geometry : null));
    let kind = known && Object.getPrototypeOf(known);
    while (kind && !Object.hasOwn(kind, "computeBoundingSphere")) kind = Object.getPrototypeOf(kind);
    if (!kind) return;
    const compute = kind.computeBoundingSphere;
    compute.call(known);
    const Sphere = known.boundingSphere.constructor;
    kind.computeBoundingSphere = function () {
      if (this.attributes.position?.itemSize !== 2) return compute.call(this);
      this.boundingSphere = new Sphere();
      this.boundingSphere.radius = NaN;
    };
  }

  const root = () => {
    const node = viewer.nodeRefFromName[""];
    node.updateWorldMatrix(true, false);
    return node.matrixWorld.elements;
  };
  const inThree = (m, [x, y, z]) => [0, 1, 2].map((row) => m[row] * x + m[4 + row] * y + m[8 + row] * z + m[12 + row]);

  // Position and direction of each photo, in the coordinates of three.js.
  function places() {
    const matrix = root();
    return views.map((view) => {
      const position = inThree(matrix, view.position);
      return { position, ahead: unit(from(position, inThree(matrix, view.lookAt))) };
    });
  }

  function pose() {
    const control = viewer.cameraControl, vector = () => viewer.camera.position.clone();
    return { position: control.getPosition(vector(), true).toArray(), target: control.getTarget(vector(), true).toArray() };
  }

  // Where a camera is beside, along and turned from a photo; `beyond` is above 1 outside of what is allowed.
  function relation({ position, ahead }, camera, direction) {
    const away = from(position, camera), forward = dot(away, ahead);
    const side = add(away, times(ahead, -forward)), turn = Math.acos(limit(dot(direction, ahead), -1, 1));
    const beyond = Math.max(size(side) / SIDEWAYS, forward / FORWARD, -forward / BACKWARD, turn / TURN);
    return { position, ahead, forward, side, beyond };
  }

  function nearest(at, direction) {
    const all = places().map((place, number) => ({ ...relation(place, at, direction), number }));
    return all.reduce((best, one) => (one.beyond < best.beyond ? one : best));
  }

  // Moves the camera back to the nearest place and direction that is allowed; along the limits it slides.
  function keepNear() {
    if (!near || !views.length) return;
    const { position, target } = pose();
    const best = nearest(position, unit(from(position, target)));
    if (best.beyond < 1 + ROUNDING) return;
    const kept = add(
      best.position,
      times(best.ahead, limit(best.forward, -BACKWARD, FORWARD)),
      times(best.side, Math.min(1, SIDEWAYS / size(best.side))),
    );
    let direction = unit(from(kept, target));
    const along = dot(direction, best.ahead);
    if (along < Math.cos(TURN)) {
      const across = unit(add(direction, times(best.ahead, -along)));
      direction = add(times(best.ahead, Math.cos(TURN)), times(across, Math.sin(TURN)));
    }
    const ahead = add(kept, times(direction, Math.max(1, size(from(kept, target)))));
    viewer.cameraControl.setLookAt(...kept, ...ahead, false);
  }

  // Fills the window with a photo, or almost.
  function fit(view) {
    const { camera, canvas } = viewer, box = canvas.getBoundingClientRect(), wide = box.width / box.height;
    const up = Math.tan(view.fov / 2), across = (up * view.aspect) / wide;
    const slope = wide < view.aspect ? Math.min(MARGIN * up, across) : Math.max(across, up / MARGIN);
    camera.fov = (360 / Math.PI) * Math.atan(slope);
    camera.updateProjectionMatrix();
    viewer.sendCamera?.();
    viewer.requestRender();
  }

  function fly(number) {
    const view = views[number], matrix = root(), control = viewer.cameraControl;
    const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    control.smoothTime = FLIGHT_SECONDS;
    control.setLookAt(...inThree(matrix, view.position), ...inThree(matrix, view.lookAt), !still);
    fit(view);
  }

  function goBack() {
    const { position, target } = pose();
    fly(nearest(position, unit(from(position, target))).number);
  }

  function setVisible(name, visible) {
    if (shown.get(name) === visible) return;
    shown.set(name, visible);
    viewer.messageQueue.push({ type: "SetSceneNodeVisibilityMessage", name, owner: "", visible });
    viewer.requestRender();
  }

  function hidePhotosInTheWay() {
    const at = viewer.camera.position.toArray();
    places().forEach(({ position }, number) => {
      if (views[number].node) setVisible(views[number].node, photos && size(from(position, at)) >= IN_THE_WAY);
    });
  }

  function stayNear(value) {
    near = value;
    const control = viewer.cameraControl;
    control.azimuthRotateSpeed = control.polarRotateSpeed = near ? SPEED : 1;
    if (near) goBack();
  }

  function showPhotos(value) {
    photos = value;
    hidePhotosInTheWay();
  }

  function follow() {
    const control = viewer.cameraControl;
    control.addEventListener("controlstart", () => (control.smoothTime = DRAG_SECONDS));
    control.addEventListener("control", keepNear);
    control.addEventListener("update", () => {
      if (byKeys) keepNear();
      byKeys = held.size > 0;
      hidePhotosInTheWay();
    });
    control.azimuthRotateSpeed = control.polarRotateSpeed = near ? SPEED : 1;
    fit(views[0]);
    hidePhotosInTheWay();
    window.addEventListener("resize", () => {
      const { position, target } = pose();
      fit(views[nearest(position, unit(from(position, target))).number]);
    });
  }

  // Keys also move the camera while a button or a check box has the focus.
  function listen() {
    for (const kind of ["keydown", "keyup"])
      window.addEventListener(kind, (event) => {
        if (!KEYS.test(event.code)) return;
        held[kind === "keydown" ? "add" : "delete"](event.code);
        byKeys = true;
        if (event.target.type === "checkbox" || event.target.type === "button")
          document.dispatchEvent(new KeyboardEvent(kind, { code: event.code }));
      });
    window.addEventListener("blur", () => held.clear());
    window.focus();
  }

  // Begins with the photos: position, lookAt, fov, aspect and, if there is one, the node that shows it. Calls back once the first is drawn.
  function start(given, drawn = () => {}) {
    ({ views } = given);
    near = given.near;
    (function wait() {
      const ready = viewer?.cameraControl && viewer.canvas && viewer.nodeRefFromName[""];
      if (!ready) return setTimeout(wait, 50);
      follow();
      requestAnimationFrame(() => requestAnimationFrame(drawn));
    })();
  }

  window.semgs = { start, fly, goBack, stayNear, showPhotos, setVisible, viewer: () => viewer };
  whenThere((found) => {
    viewer = found;
    giveQuadsNoRadius(viewer.scene);
  });
  listen();
})();
