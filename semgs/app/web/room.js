// The page of a room: controls around the scene in 3D.
(() => {
  const room = JSON.parse(document.getElementById("room").textContent);
  const find = (selector) => document.querySelector(selector);
  const all = (selector) => [...document.querySelectorAll(selector)];
  const frame = find("#scene");
  const state = { mode: "colour", hidden: [], least: 0, boxes: false };
  let measuring = false, ends = [];
  const send = (message) => frame.contentWindow.postMessage({ semgs: "room", ...message }, "*");
  const change = () => send({ state });
  const unit = room.metric ? "m" : "units";
  const number = (value) => (room.metric ? value.toFixed(2) : String(Number(value.toFixed(room.decimals))));
  const lengths = (values, sign) => `${values.map(number).join(sign)} ${unit}`;

  all("[data-mode]").forEach((button) => button.addEventListener("click", () => {
    state.mode = button.dataset.mode;
    all("[data-mode]").forEach((one) => one.setAttribute("aria-pressed", one === button));
    change();
  }));
  const boxes = all("[data-class]");
  const readBoxes = () => {
    state.hidden = boxes.filter((one) => !one.checked).map((one) => Number(one.dataset.class));
    change();
  };
  boxes.forEach((box) => box.addEventListener("change", readBoxes));
  all("[data-all]").forEach((button) => button.addEventListener("click", () => {
    boxes.forEach((box) => (box.checked = button.dataset.all === "show"));
    readBoxes();
  }));
  const slider = find("#confidence");
  slider?.addEventListener("input", () => {
    state.least = Number(slider.value);
    find("#confidence-text").textContent = state.least ? `at least ${10 * state.least} %` : "all";
    change();
  });
  find("#boxes")?.addEventListener("click", (event) => {
    state.boxes = !state.boxes;
    event.currentTarget.setAttribute("aria-pressed", state.boxes);
    change();
  });
  find("#back").addEventListener("click", () => send({ back: true }));
  const near = find("#near");
  near.addEventListener("click", () => {
    const pressed = near.getAttribute("aria-pressed") !== "true";
    near.setAttribute("aria-pressed", pressed);
    send({ near: pressed });
  });
  all("[data-fly]").forEach((button) => button.addEventListener("click", () => {
    send({ fly: Number(button.dataset.fly) });
    find(".stage").scrollIntoView({ block: "nearest" });
  }));
  const measure = find("#measure");
  measure.addEventListener("click", () => {
    measuring = !measuring;
    measure.setAttribute("aria-pressed", measuring);
    ends = [];
    send({ marks: [] });
    info(measuring ? [["Distance", "Click the first point."]] : []);
  });
  find("#centre").addEventListener("click", () => send({ pick: "centre" }));

  function info(rows) {
    const list = find("#info");
    list.replaceChildren(...rows.flatMap(([name, text]) => {
      const dt = document.createElement("dt"), dd = document.createElement("dd");
      dt.textContent = name;
      dd.textContent = text;
      return [dt, dd];
    }));
    find("#info-empty").hidden = rows.length > 0;
  }

  const away = (a, b) => Math.hypot(...a.map((value, axis) => value - b[axis]));

  function clicked(hit) {
    if (!hit) return info([["Here", "Nothing: the photos do not show what is behind this."]]);
    if (measuring) {
      if (ends.length === 2) ends = [];
      ends.push(hit);
      send({ marks: ends.map((one) => one.raw) });
      if (ends.length === 1) return info([["Distance", "Click the second point."]]);
      return info([["Distance", lengths([away(ends[0].position, ends[1].position)], "")], ["From", name(ends[0])], ["To", name(ends[1])]]);
    }
    send({ marks: [hit.raw] });
    const rows = room.classes.length ? [["Class", name(hit)], ["Confidence", `${Math.round(100 * hit.confidence)} %`]] : [];
    const thing = room.things[hit.thing];
    if (thing) {
      rows[1] = ["Confidence", `${Math.round(100 * thing.confidence)} %`];
      rows.push(["Size", `${lengths(thing.size, " × ")} (length × width × height)`]);
      rows.push(["Centre", lengths(thing.centre, ", ")]);
    }
    rows.push(["Position", lengths(hit.position, ", ")]);
    rows.push(["Distance", `${lengths([away(hit.position, room.camera)], "")} from the first camera`]);
    info(rows);
  }
  const name = (hit) => room.classes[hit.label]?.name ?? "the scene";

  window.addEventListener("message", (event) => {
    if (event.source !== frame.contentWindow || event.data?.semgs !== "scene") return;
    const { event: what, hit, count, of } = event.data;
    if (what === "ready") {
      document.body.dataset.ready = "true";
      change();
    }
    if (what === "click") clicked(hit);
    if (what === "shown") find("#shown").textContent = `${Math.round((100 * count) / of)} % of the scene is shown.`;
  });
  all(".compare-range").forEach((range) => range.addEventListener("input", () =>
    range.previousElementSibling.style.setProperty("--cut", `${range.value}%`)));
  if (window.frameElement) {
    const fit = () => (window.frameElement.style.height = `${find("main").scrollHeight + 8}px`);
    new ResizeObserver(fit).observe(find("main"));
    window.addEventListener("load", fit);
  }
})();
