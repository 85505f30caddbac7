// The panel of a page: what is shown, its classes, and the way back to the photos.
(() => {
  const data = JSON.parse(document.getElementById("semgs").textContent);
  const { semgs } = window;
  const phone = window.matchMedia("(max-width: 700px)").matches;

  function make(tag, attributes = {}, ...children) {
    const node = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes))
      if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
      else node.setAttribute(name, value);
    node.append(...children);
    return node;
  }
  const button = (text, click, attributes = {}) => make("button", { type: "button", onclick: click, ...attributes }, text);
  function check(text, change, checked, extra = []) {
    const box = make("input", { type: "checkbox", onchange: () => change(box.checked) });
    box.checked = checked;
    return { box, label: make("label", {}, box, ...extra, make("span", { class: "name" }, text)) };
  }

  const modes = { colour: "Colour", classes: "Classes" };
  const shows = data.modes.map((mode) => button(modes[mode], () => {
    shows.forEach((one, index) => one.setAttribute("aria-pressed", data.modes[index] === mode));
    semgs.show({ mode });
  }, { "aria-pressed": mode === "colour" }));

  const near = check("Stay where the photos saw", (value) => semgs.stayNear(value), data.near);
  const back = button("Back to the photos", () => semgs.goBack());
  const flights = data.views.map((view, number) => button(`Photo ${number + 1}`, () => semgs.fly(number), { title: view.name }));

  const legend = data.classes.map(({ name, colour, share }) => {
    const swatch = make("span", { class: "swatch", style: `background: rgb(${colour.join(" ")})` });
    const entry = check(name, hide, true, [swatch]);
    entry.label.append(make("span", { class: "share" }, share));
    return entry;
  });
  function hide() {
    semgs.show({ hidden: legend.flatMap(({ box }, number) => (box.checked ? [] : [number])) });
  }
  const all = (value) => {
    legend.forEach(({ box }) => (box.checked = value));
    hide();
  };
  const least = make("output", {}, "all");
  const slider = make("input", { type: "range", min: 0, max: 9, step: 1, value: 0, "aria-label": "Hide what is less sure", oninput: () => {
    least.textContent = slider.value > 0 ? `at least ${10 * slider.value} %` : "all";
    semgs.show({ least: Number(slider.value) });
  } });

  const clicked = make("div", { "aria-live": "polite" });
  const number = (value) => value.toFixed(2);
  function describe(hit) {
    semgs.mark(hit ? [hit.raw] : []);
    if (!hit) return clicked.replaceChildren(make("p", {}, "Nothing: the photos do not show what is behind this."));
    const rows = data.classes.length ? [["Class", `${data.classes[hit.label].name}, ${Math.round(100 * hit.confidence)} %`]] : [];
    if (data.names?.[hit.thing]) rows.push(["Thing", data.names[hit.thing]]);
    rows.push(["Position", `${hit.position.map(number).join(", ")}${data.metric ? " m" : ""}`]);
    clicked.replaceChildren(make("dl", {}, ...rows.flatMap(([name, text]) => [make("dt", {}, name), make("dd", {}, text)])));
  }
  clicked.append(make("p", {}, "Click on something to see what it is."));

  const more = button("", () => open(!panel.classList.contains("open")));
  function open(value) {
    panel.classList.toggle("open", value);
    more.textContent = value ? "Less" : "More";
    more.setAttribute("aria-expanded", value);
  }
  const row = (...children) => make("div", { class: "row" }, ...children);
  const shown = [near.label, check("Show the photos", (value) => semgs.showPhotos(value), true).label];
  if (data.boxes) shown.push(check("Show boxes of things", (value) => semgs.show({ boxes: value }), true).label);
  const panel = make("aside", { id: "semgs-panel", "aria-label": "What is shown" },
    make("div", { class: "top" },
      make("div", { class: "title" }, make("h1", { title: data.title }, data.title), more),
      ...(shows.length > 1 ? [make("div", { class: "two", role: "group", "aria-label": "What the scene shows" }, ...shows)] : []),
      row(back)),
    make("div", { class: "rest" },
      row(...flights),
      make("div", {}, ...shown),
      ...(legend.length ? [
        make("div", {},
          make("div", { class: "row apart" }, make("h2", {}, "Classes"), row(button("all", () => all(true)), button("none", () => all(false)))),
          make("ul", {}, ...legend.map(({ label }) => make("li", {}, label)))),
        make("div", {}, make("div", { class: "row apart" }, make("h2", {}, "Confidence"), least), slider,
          make("p", {}, "Hides what the network is less sure of.")),
      ] : []),
      make("div", {}, make("h2", {}, "Clicked"), clicked)));
  open(!phone);
  const hint = make("div", { id: "semgs-hint" },
    make("span", { class: "mouse" }, "Drag to turn, right-drag to move, scroll to zoom; or use the arrow keys and W A S D. Click to see what is there."),
    make("span", { class: "touch" }, "One finger turns, two fingers move and zoom. Tap to see what is there."));

  document.body.append(panel, hint);
  semgs.load(data, () => {
    semgs.show({ boxes: data.boxes });
    semgs.listen(describe);
    document.body.dataset.ready = "true";
  });
})();
