// The page of the app: small pictures of dropped photos beside their numbers, and clocks that move between messages of the server.
(() => {
  const SIDE = 160; // longest side of a small picture [px]
  const PICTURE = /\.(jpe?g|png|heic)$/i;
  const read = new Map(); // files that were dropped, with a promise of the small picture of each
  let listed = [], coming = []; // [name, file] of each photo: uploaded, and on the way
  let last = Promise.resolve(), version = 0;
  const firstSeen = new WeakMap();

  async function shrink(file) {
    const image = new Image();
    image.src = URL.createObjectURL(file);
    try {
      await image.decode();
      const canvas = document.createElement("canvas"), scale = SIDE / Math.max(image.naturalWidth, image.naturalHeight);
      canvas.width = Math.ceil(scale * image.naturalWidth);
      canvas.height = Math.ceil(scale * image.naturalHeight);
      canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
      return canvas.toDataURL("image/jpeg", 0.8);
    } catch {
      return ""; // damaged, or in a format that this browser does not show
    } finally {
      URL.revokeObjectURL(image.src);
    }
  }

  function drop(files) {
    coming = [...files].filter((file) => PICTURE.test(file.name)).map((file) => [file.name, file]);
    version += 1;
    fill();
  }

  function list(files) {
    const left = new Set([...listed, ...coming].map(([, file]) => file));
    listed = (files ?? []).filter((one) => PICTURE.test(one.orig_name)).map(({ orig_name: name, size }) => {
      const file = [...left].find((one) => one?.name === name && (size == null || one.size === size));
      left.delete(file);
      return [name, file];
    });
    coming = [];
    left.forEach((file) => read.delete(file));
    version += 1;
    fill();
    return "";
  }

  function tile([name, file], waits) {
    const item = document.createElement("li"), label = document.createElement("span");
    item.classList.toggle("waits", waits);
    label.textContent = name;
    if (file) {
      if (!read.has(file)) read.set(file, (last = last.then(() => shrink(file)))); // one after another, so that large photos do not fill the memory
      const picture = document.createElement("img");
      picture.alt = "";
      read.get(file).then((source) => source ? (picture.src = source) : picture.remove());
      item.append(picture);
    }
    item.append(label);
    return item;
  }

  // Lists of photos that show something else than what was dropped, and clocks.
  function fill() {
    for (const one of document.querySelectorAll("ol.photos")) {
      if (Number(one.dataset.version ?? 0) === version) continue;
      const most = Number(one.dataset.most ?? listed.length), added = one.dataset.most ? coming : [];
      if (one.dataset.most || one.children.length === listed.length) one.replaceChildren(...[...listed, ...added].slice(0, most).map((photo, number) => tile(photo, number >= listed.length)));
      one.dataset.version = version;
    }
    for (const one of document.querySelectorAll("[data-seconds]")) {
      const now = performance.now();
      if (!firstSeen.has(one)) firstSeen.set(one, now - 1000 * one.dataset.seconds);
      const text = `${Math.floor((now - firstSeen.get(one)) / 1000)} s`;
      if (one.textContent !== text) one.textContent = text;
    }
  }

  document.addEventListener("change", ({ target }) => target.matches?.("#drop input[type=file]") && drop(target.files), true);
  document.addEventListener("drop", (event) => event.target.closest?.("#drop") && drop(event.dataTransfer.files), true);
  new MutationObserver(fill).observe(document, { childList: true, subtree: true });
  setInterval(fill, 1000);
  window.semgs = { list };
})();
