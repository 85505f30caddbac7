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

  // What the controls are called and how they are ordered comes from panel_texts.py, as in `semgs view`.
  const { words } = data;
  const titled = (help, node) => {
    node.title = help;
    return node;
  };
  const row = (...children) => make("div", { class: "row" }, ...children);
  const heading = (name, ...children) => make("div", { class: "row apart" }, make("h2", {}, name), ...children);

  function show({ name }) {
    const shows = data.modes.map((mode) => button(data.modeNames[mode], () => {
      shows.forEach((one, index) => one.setAttribute("aria-pressed", data.modes[index] === mode));
      semgs.show({ mode });
    }, { "aria-pressed": mode === "colour" }));
    return make("div", { class: "two", role: "group", "aria-label": name }, ...shows);
  }

  const legend = data.classes.map(({ name, colour, share }) => {
    const swatch = make("span", { class: "swatch", style: `background: rgb(${colour.join(" ")})` });
    const entry = check(name, hide, true, [swatch]);
    entry.label.append(make("span", { class: "share" }, share));
    return entry;
  });
  function hide() {
    semgs.show({ hidden: legend.flatMap(({ box }, number) => (box.checked ? [] : [number])) });
  }
  function classes({ name }) {
    const all = (value) => {
      legend.forEach(({ box }) => (box.checked = value));
      hide();
    };
    const buttons = row(button(words.show_all, () => all(true)), button(words.hide_all, () => all(false)));
    return make("div", {}, heading(name, buttons), make("ul", {}, ...legend.map(({ label }) => make("li", {}, label))));
  }

  function confidence({ name, help }) {
    const least = make("output", {}, "0 %");
    const slider = make("input", { type: "range", min: 0, max: 90, step: 10, value: 0, "aria-label": name, oninput: () => {
      least.textContent = `${slider.value} %`;
      semgs.show({ least: slider.value / 10 });
    } });
    return make("div", {}, heading(name, least), slider, make("p", {}, help));
  }

  const clicked = make("div", { "aria-live": "polite" }, make("p", {}, words.click));
  const number = (value) => (data.metric ? value.toFixed(2) : String(Number(value.toFixed(data.decimals))));
  function describe(hit) {
    const kind = hit && data.classes.length ? `${data.classes[hit.label].name}, ${Math.round(100 * hit.confidence)} %` : null;
    semgs.mark(hit ? [hit.raw] : [], kind ?? words.here);
    if (!hit) return clicked.replaceChildren(make("p", {}, words.nothing));
    const rows = kind ? [[words.class, kind]] : [];
    if (data.names[hit.thing]) rows.push([words.thing, data.names[hit.thing]]);
    rows.push([words.position, `${hit.position.map(number).join(", ")}${data.metric ? " m" : ""}`]);
    clicked.replaceChildren(make("dl", {}, ...rows.flatMap(([name, text]) => [make("dt", {}, name), make("dd", {}, text)])));
  }

  const build = {
    show,
    back: ({ name }) => row(button(name, () => semgs.goBack())),
    photo: ({ name }) => row(...data.views.map((view, number) => titled(view.name, button(`${name} ${number + 1}`, () => semgs.fly(number))))),
    near: ({ name }) => check(name, (value) => semgs.stayNear(value), data.near).label,
    photos: ({ name }) => check(name, (value) => semgs.showPhotos(value), true).label,
    boxes: ({ name }) => check(name, (value) => semgs.show({ boxes: value }), true).label,
    classes,
    confidence,
    clicked: ({ name }) => make("div", {}, heading(name), clicked),
  };
  const always = ["show", "back"]; // also while the rest is folded
  const nodes = data.controls.map((control) => ({ key: control.key, node: titled(control.help, build[control.key](control)) }));
  const part = (top) => nodes.filter(({ key }) => always.includes(key) === top).map(({ node }) => node);

  const more = button("", () => open(!panel.classList.contains("open")));
  function open(value) {
    panel.classList.toggle("open", value);
    more.textContent = value ? "Less" : "More";
    more.setAttribute("aria-expanded", value);
  }
  const panel = make("aside", { id: "semgs-panel", "aria-label": "What is shown" },
    make("div", { class: "top" },
      make("div", { class: "title" }, make("h1", { title: data.title }, data.title), more), ...part(true)),
    make("div", { class: "rest" }, ...part(false)));
  open(!phone);
  const hint = make("div", { id: "semgs-hint" },
    make("span", { class: "mouse" }, words.mouse), make("span", { class: "touch" }, words.touch));

  document.body.append(panel, hint);
  semgs.load(data, () => {
    semgs.show({ boxes: data.boxes });
    semgs.listen(describe);
    document.body.dataset.ready = "true";
  });
})();
