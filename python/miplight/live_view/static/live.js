// The page's side of a live view: shows pictures as they come, and says what hand and controls want.
// Nothing is loaded from anywhere; it is one module, as anywidget takes it.

const SEND_EVERY = 33; // ms between messages of a moving hand: more would only queue up in the kernel
const SILENCE = 8000; // ms after which a view without an answer says that it has no kernel
const NARROWEST = 360; // px that the controls have, below a picture that is narrower
const RATE_OVER = 1000; // ms over which pictures a second are counted

const element = (tag, attributes = {}, ...children) => {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
};

// What the hand did since the last message, in fractions of the picture's height and notches of the wheel.
const atRest = () => ({ orbit: [0, 0], pan: [0, 0], zoom: 0, light: [0, 0, 0] });

class Hand {
  constructor(canvas, post) {
    this.canvas = canvas;
    this.post = post;
    this.mode = "orbit";
    this.way = atRest();
    this.sentAt = 0;
    this.timer = 0;
    this.pointer = null;
    const on = (name, act) => canvas.addEventListener(name, act, { passive: false });
    on("pointerdown", (event) => this.take(event));
    on("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) on(name, (event) => this.release(event));
    on("wheel", (event) => this.wheel(event));
    on("contextmenu", (event) => event.preventDefault());
    on("keydown", (event) => this.key(event));
  }

  take(event) {
    if (this.pointer) return;
    event.preventDefault();
    this.canvas.focus({ preventScroll: true });
    this.canvas.setPointerCapture(event.pointerId);
    this.canvas.classList.add("held");
    let mode = this.mode;
    if (event.altKey) mode = "light";
    else if (event.shiftKey || event.button !== 0) mode = "pan";
    this.pointer = { id: event.pointerId, mode, x: event.clientX, y: event.clientY };
  }

  move(event) {
    const pointer = this.pointer;
    if (!pointer || pointer.id !== event.pointerId) return;
    const height = Math.max(this.canvas.clientHeight, 1);
    this.add(pointer.mode, (event.clientX - pointer.x) / height, (event.clientY - pointer.y) / height);
    pointer.x = event.clientX;
    pointer.y = event.clientY;
  }

  release(event) {
    if (!this.pointer || this.pointer.id !== event.pointerId) return;
    this.pointer = null;
    this.canvas.classList.remove("held");
    this.flush();
    this.post({ kind: "still" });
  }

  wheel(event) {
    event.preventDefault(); // the notebook stays where it is
    // a notch is 100 pixels, or 3 lines
    const notches = event.deltaMode === 0 ? event.deltaY / 100 : event.deltaY / 3;
    if (event.altKey || this.mode === "light") this.way.light[2] += notches;
    else this.way.zoom -= notches;
    this.schedule();
  }

  key(event) {
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const way = ways[event.key];
    if (!way && event.key !== "+" && event.key !== "-") return;
    event.preventDefault();
    event.stopPropagation(); // the notebook has its own ideas about arrows
    if (way) this.add(event.altKey ? "light" : event.shiftKey ? "pan" : this.mode, way[0] * 0.03, way[1] * 0.03);
    else {
      this.way.zoom += event.key === "+" ? 1 : -1;
      this.schedule();
    }
  }

  add(mode, right, down) {
    this.way[mode][0] += right;
    this.way[mode][1] += down;
    this.schedule();
  }

  schedule() {
    if (this.timer) return;
    const wait = Math.max(0, this.sentAt + SEND_EVERY - performance.now());
    this.timer = setTimeout(() => this.flush(), wait);
  }

  flush() {
    clearTimeout(this.timer);
    this.timer = 0;
    const way = this.way;
    if (!way.zoom && ![...way.orbit, ...way.pan, ...way.light].some(Boolean)) return;
    this.way = atRest();
    this.sentAt = performance.now();
    this.post({ kind: "move", ...way });
  }
}

class Controls {
  constructor(box, post) {
    this.box = box;
    this.post = post;
    this.parts = new Map();
  }

  build(specs) {
    this.parts.clear();
    this.box.replaceChildren(...specs.map((spec) => this.part(spec)));
  }

  part(spec) {
    const said = element("output");
    const title = element("span", {}, spec.label, spec.kind === "slider" ? said : "");
    let input;
    if (spec.kind === "slider") {
      input = element("input", { type: "range", min: 0, max: spec.stops.length - 1, step: 1 });
    } else {
      input = element("select");
      input.append(...spec.labels.map((label, index) => element("option", { value: index }, label)));
    }
    input.dataset.name = spec.name;
    input.addEventListener("input", () => {
      const index = Number(input.value);
      said.textContent = spec.labels[index];
      this.post({ kind: "set", name: spec.name, value: spec.stops[index] });
    });
    input.addEventListener("pointerdown", () => (this.held = input));
    for (const name of ["pointerup", "pointercancel"]) input.addEventListener(name, () => (this.held = null));
    this.parts.set(spec.name, { spec, input, said });
    return element("label", { title: spec.title }, title, input);
  }

  show(values) {
    for (const [name, { spec, input, said }] of this.parts) {
      // a slider under the hand is not pulled back by an answer that is late
      if (!(name in values) || (input === this.held && input.type === "range")) continue;
      const index = spec.stops.indexOf(values[name]);
      input.value = index;
      said.textContent = spec.labels[index] ?? String(values[name]);
    }
  }
}

// Draws pictures in the order of their numbers, and says which of them it has shown.
class Screen {
  constructor(canvas, root, post, status) {
    Object.assign(this, { canvas, root, post, status });
    this.context = canvas.getContext("2d", { alpha: false });
    this.number = 0;
    this.times = [];
    root.dataset.frames = "0";
  }

  async draw(bytes, mime) {
    const bitmap = await createImageBitmap(new Blob([bytes], { type: mime }));
    this.context.imageSmoothingQuality = "high";
    this.context.drawImage(bitmap, 0, 0, this.canvas.width, this.canvas.height);
    bitmap.close();
  }

  async show(about, bytes) {
    if (about.number > this.number) {
      this.number = about.number;
      await this.draw(bytes, about.mime);
      const now = performance.now();
      this.times = [...this.times.filter((time) => now - time < RATE_OVER), now];
      this.root.dataset.frames = String(Number(this.root.dataset.frames) + 1);
      this.root.dataset.stage = about.stage;
      this.status(about, this.times.length / (RATE_OVER / 1000));
    }
    if (about.sent > 0) this.post({ kind: "shown", sent: about.sent });
  }
}

const described = (about, rate) => {
  const parts = [
    `${about.ms.toFixed(about.ms < 100 ? 1 : 0)} ms`,
    `${about.fragments.toLocaleString("en")} fragments`,
    `${about.width} × ${about.height}, ${about.stage}`,
  ];
  if (about.stage === "moving") parts.push(`${rate.toFixed(0)} pictures/s`);
  if (about.note) parts.push(about.note);
  return parts.join(" · ");
};

const modes = (hand, post) => {
  const titles = {
    orbit: "Drag: turn around the target",
    pan: "Drag: move along the picture (also with Shift, or the right button)",
    light: "Drag: move the chosen light, the wheel moves it away (also with Alt)",
  };
  const buttons = Object.entries(titles).map(([mode, title]) => {
    const button = element("button", { type: "button", title, "aria-pressed": mode === hand.mode }, mode);
    button.addEventListener("click", () => {
      hand.mode = mode;
      for (const other of buttons) other.setAttribute("aria-pressed", other === button);
    });
    return button;
  });
  const act = (kind, text, title) => {
    const button = element("button", { type: "button", title }, text);
    button.addEventListener("click", () => post({ kind }));
    return button;
  };
  return element(
    "div",
    { class: "bar" },
    ...buttons,
    act("meter", "meter", "Find the exposure again"),
    act("reset", "reset", "Everything as at the start"),
  );
};

const legendOf = (pairs) =>
  pairs.map(([meaning, color]) => {
    const swatch = element("i");
    swatch.style.background = color;
    return element("span", {}, swatch, meaning);
  });

function render({ model, el }) {
  const page = Math.random().toString(36).slice(2);
  const [width, height] = model.get("size");
  const canvas = element("canvas", { width, height, tabindex: 0, "aria-label": "live view of a scene" });
  canvas.style.width = `${width}px`;
  const error = element("div", { class: "error", role: "alert", hidden: "" });
  const status = element("div", { class: "status" });
  const legend = element("div", { class: "legend" });
  const panel = element("div", { class: "controls" });
  const root = element("div", { class: "miplight-live" });
  root.style.width = `${Math.max(width, NARROWEST)}px`;

  let answered = false;
  const post = (message) => {
    try {
      model.send({ page, ...message });
    } catch {
      status.textContent = "no kernel: a still picture";
    }
  };
  const hand = new Hand(canvas, post);
  const controls = new Controls(panel, post);
  const screen = new Screen(canvas, root, post, (about, rate) => {
    error.hidden = true;
    status.textContent = described(about, rate);
    legend.replaceChildren(...legendOf(about.legend));
  });
  const fail = (text) => {
    error.textContent = text;
    error.hidden = false;
    root.dataset.errors = String(Number(root.dataset.errors ?? 0) + 1);
  };

  const receive = (message, buffers) => {
    answered = true;
    if (message.kind === "error") fail(message.text);
    else if (message.kind === "frame") {
      screen.show(message, buffers[0]).catch((problem) => fail(`the picture cannot be shown: ${problem}`));
    }
  };
  const rebuild = () => {
    controls.build(model.get("controls"));
    controls.show(model.get("values"));
  };
  const reset = () => controls.show(model.get("values"));
  model.on("msg:custom", receive);
  model.on("change:controls", rebuild);
  model.on("change:values", reset);

  root.append(canvas, modes(hand, post), error, status, legend, panel);
  el.append(root);
  rebuild();
  const still = model.get("still");
  if (still?.byteLength) screen.draw(still, "image/png").catch(() => {});
  post({ kind: "hello" });
  const silence = setTimeout(() => {
    if (!answered) status.textContent = "no answer from the kernel yet: it is busy, or there is none";
  }, SILENCE);

  return () => {
    clearTimeout(silence);
    clearTimeout(hand.timer);
    model.off("msg:custom", receive);
    model.off("change:controls", rebuild);
    model.off("change:values", reset);
    post({ kind: "gone" });
  };
}

export default { render };
