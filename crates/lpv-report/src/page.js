"use strict";
// Values, zoom and legend of the figures of a page, which without it stay as they are drawn.
(() => {
  const MOST_ZOOM = 200;
  const page = [];

  const set = (node, attributes) => {
    for (const key in attributes) node.setAttribute(key, attributes[key]);
  };
  const make = (parent, name, attributes = {}, text = "") => {
    const node = document.createElementNS(parent.namespaceURI, name);
    set(node, attributes);
    node.textContent = text;
    return parent.appendChild(node);
  };

  // An axis in its own coordinates: values, or their logarithms to base 10.
  const axis = (scale, label) => {
    const [kind, ...home] = scale.split(" ");
    return { log: kind === "log", label, home: home.map(Number), range: home.map(Number) };
  };
  const span = ([low, high]) => high - low;
  const fraction = (range, at) => (at - range[0]) / span(range);
  const zoomed = ({ home, range }) => home[0] !== range[0] || home[1] !== range[1];

  // No more digits than the drawing has.
  const written = ({ log, home }, at) => {
    if (log) return String(Number((10 ** at).toPrecision(3)));
    const last = Math.floor(Math.log10(span(home) / 2000));
    const digits = at === 0 ? 0 : Math.floor(Math.log10(Math.abs(at))) - last + 1;
    return digits < 1 ? "0" : String(Number(at.toPrecision(Math.min(digits, 12))));
  };

  const power = (exponent) => "10" + [...String(exponent)].map((c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻").join("");

  // Ticks as [coordinate, label], and a power of ten that the labels share.
  const linear = ([low, high], most) => {
    const multiples = (step) => [Math.ceil(low / step - 1e-6), Math.floor(high / step + 1e-6)];
    let exponent = Math.floor(Math.log10((high - low) / (most + 1)));
    let mantissa = 1;
    while (span(multiples(mantissa * 10 ** exponent)) >= most) {
      exponent += mantissa === 5 ? 1 : 0;
      mantissa = { 1: 2, 2: 5, 5: 1 }[mantissa];
    }
    const step = mantissa * 10 ** exponent;
    const [first, last] = multiples(step);
    const largest = Math.max(Math.abs(first), Math.abs(last)) * step;
    const plain = largest === 0 || (largest >= 1e-2 && largest < 1e4);
    const factor = plain ? 0 : 3 * Math.floor(Math.floor(Math.log10(2 * largest)) / 3);
    const label = (at) => (at / 10 ** factor).toFixed(Math.max(0, factor - exponent)).replace("-", "−");
    const ticks = [];
    for (let k = first; k <= last; k++) ticks.push([k * step, label(k * step)]);
    return { ticks, factor };
  };
  const logarithmic = ([low, high], most) => {
    const [first, last] = [Math.ceil(low - 1e-9), Math.floor(high + 1e-9)];
    const ticks = [];
    const stride = Math.ceil((last - first + 1) / most);
    for (let k = first; k <= last; k++) if (k % stride === 0) ticks.push([k, power(k)]);
    if (last > first) return { ticks, factor: 0 };
    const within = [];
    for (let k = Math.floor(low); k <= high; k++) {
      for (const m of [1, 2, 5]) within.push([k + Math.log10(m), k < -3 || k > 3 ? `${m}·${power(k)}` : written({ log: true }, k + Math.log10(m))]);
    }
    const seen = within.filter(([at]) => at >= low && at <= high);
    if (seen.length > 1) return { ticks: seen, factor: 0 };
    const even = linear([10 ** low, 10 ** high], most);
    return { ...even, ticks: even.ticks.map(([at, label]) => [Math.log10(at), label]) };
  };

  // Lines are read between their points, symbols at theirs.
  const series = (node) => {
    let runs;
    return {
      node,
      kind: node.dataset.t,
      keys: (node.dataset.k ?? "").split(" ").filter(Boolean),
      shapes: [...node.querySelectorAll("path")].map((path) => [path, path.getAttribute("d")]),
      get runs() {
        return (runs ??= this.shapes.flatMap(([, d]) => {
          const found = [];
          let at = [0, 0];
          for (const [, step, x, y] of d.matchAll(/([Ml])(-?[\d.]+) ?(-?[\d.]+)/g)) {
            if (step === "l" && this.kind !== "line") continue;
            at = step === "M" ? [+x, +y] : [at[0] + +x, at[1] + +y];
            if (step === "M") found.push([]);
            found.at(-1).push(at);
          }
          return found;
        }));
      },
    };
  };

  class Panel {
    constructor(figure, group) {
      Object.assign(this, { figure, group, at: null });
      const { size, x, y, xl, yl, n } = group.dataset;
      [this.width, this.height] = size.split(" ").map(Number);
      this.axes = [axis(x, xl), axis(y, yl)];
      this.numbers = n;
      this.link = `${this.axes[0].log} ${xl}`;
      this.series = [...group.querySelectorAll("[data-t]")].map(series);
      this.notes = [...group.querySelectorAll("[data-at]")];
      this.ticks = make(group, "g", { class: "live" });
      group.prepend(make(group, "g", { class: "live" }));
      this.cross = make(group, "g", { class: "cross", "pointer-events": "none" });
      this.lines = make(this.cross, "path", { fill: "none" });
      this.spot = make(this.cross, "circle", { r: 4, fill: "none" });
      this.frame = make(group, "rect", { class: "frame off" });
      this.hit = make(group, "rect", {
        class: "hit", width: this.width, height: this.height, fill: "transparent", tabindex: 0, role: "application",
        "aria-label": `${yl} over ${xl}. Arrow keys read values, plus and minus zoom, Shift and arrows move, 0 resets.`,
      });
      this.listen();
      this.hide();
    }

    // Place in the panel, px, of a place in the drawing as it came.
    now([x, y]) {
      const [h, v] = this.axes;
      const across = h.home[0] + (x / this.width) * span(h.home);
      const up = v.home[1] - (y / this.height) * span(v.home);
      return [this.width * fraction(h.range, across), this.height * (1 - fraction(v.range, up)), across, up];
    }

    inside([x, y]) {
      return x >= -0.5 && x <= this.width + 0.5 && y >= -0.5 && y <= this.height + 0.5;
    }

    draw() {
      const away = this.axes.some(zoomed);
      this.group.classList.toggle("zoomed", away);
      const [left, top] = this.now([0, 0]);
      const [right, bottom] = this.now([this.width, this.height]);
      const [a, d] = [(right - left) / this.width, (bottom - top) / this.height];
      for (const { node, kind, shapes } of this.series) {
        if (kind !== "sign") {
          set(node, { transform: `matrix(${a} 0 0 ${d} ${left} ${top})` });
          continue;
        }
        // Symbols keep their shape and move.
        for (const [path, d] of shapes) {
          path.setAttribute("d", d.replace(/M(-?[\d.]+) ?(-?[\d.]+)/g, (_, x, y) => "M" + this.now([+x, +y]).slice(0, 2).join(" ")));
        }
      }
      for (const note of this.notes) {
        const home = note.dataset.at.split(" ").map(Number);
        const [x, y] = this.now(home).map((to, i) => (Number.isNaN(home[i]) ? NaN : to));
        note.classList.toggle("off", !this.inside([x || 0, y || 0]));
        set(note, { transform: `translate(${x - home[0] || 0} ${y - home[1] || 0})` });
      }
      const [grid] = this.group.children;
      grid.replaceChildren();
      this.ticks.replaceChildren();
      if (away) this.axes.forEach((own, i) => this.scale(own, i, grid));
      const { at } = this;
      this.hide();
      if (at && this.inside(this.now(at.point))) this.read(at.own, at.point);
    }

    scale(own, vertical, grid) {
      const { width, height } = this;
      const most = Math.max(2, Math.floor(vertical ? height / 34 : width / 62));
      const { ticks, factor } = (own.log ? logarithmic : linear)(own.range, most);
      const text = (x, y, anchor, label) =>
        make(this.ticks, "text", { class: "tx", fill: "#1f1f1f", x, y, "text-anchor": anchor, "font-size": 10 }, label);
      for (const [at, label] of ticks) {
        const u = fraction(own.range, at);
        const [x, y] = vertical ? [0, height * (1 - u)] : [width * u, 0];
        make(grid, "path", { class: "gr", stroke: "#d9d9d9", "stroke-width": 0.6, d: `M${x} ${y}${vertical ? "H" + width : "V" + height}` });
        if (!this.numbers.includes(vertical ? "y" : "x")) continue;
        if (vertical) text(-5, y + 3.6, "end", label);
        else text(x, height + 14.5, "middle", label);
      }
      if (factor && this.numbers.includes(vertical ? "y" : "x")) {
        if (vertical) text(0, -4.5, "start", "×" + power(factor));
        else text(width, height + 30.5, "end", "×" + power(factor));
      }
    }

    // Sets a range within the one of the drawing, on all panels with this x axis.
    view(i, [low, high]) {
      const { home } = this.axes[i];
      const size = Math.min(Math.max(high - low, span(home) / MOST_ZOOM), span(home));
      const from = Math.min(Math.max(low, home[0]), home[1] - size);
      const reset = size > span(home) * 0.999;
      for (const panel of i ? [this] : page.filter((other) => other.link === this.link)) {
        const own = panel.axes[i];
        own.range = reset ? [...own.home] : [from, from + size];
        panel.draw();
      }
    }

    reset() {
      this.axes.forEach(({ home }, i) => this.view(i, home));
    }

    zoom(by, [u, v] = [0.5, 0.5]) {
      [u, v].forEach((centre, i) => {
        const { range } = this.axes[i];
        const fixed = range[0] + centre * span(range);
        this.view(i, [fixed - centre * span(range) * by, fixed + (1 - centre) * span(range) * by]);
      });
    }

    pan(i, by) {
      const { range } = this.axes[i];
      this.view(i, range.map((end) => end + by * span(range)));
    }

    get shown() {
      return this.series.filter(({ node, kind }) => /line|dots|sign/.test(kind) && !node.classList.contains("off"));
    }

    nearest([x, y]) {
      let best = [Infinity];
      const offer = (own, point, away) => {
        if (away < best[0] && this.inside(this.now(point))) best = [away, own, point];
      };
      const home = (u, i) => { const { home, range } = this.axes[i]; return fraction(home, range[0] + u * span(range)); };
      const across = this.width * home(x / this.width, 0);
      for (const own of this.shown) {
        for (const run of own.runs) {
          run.forEach((point, k) => {
            const [px, py] = this.now(point);
            if (own.kind !== "line" || run.length === 1) offer(own, point, Math.hypot(px - x, py - y));
            const next = run[k + 1];
            const t = next && (across - point[0]) / (next[0] - point[0]);
            if (own.kind !== "line" || !(t >= 0 && t <= 1)) return;
            const between = [across, point[1] + t * (next[1] - point[1])];
            offer(own, between, Math.abs(this.now(between)[1] - y));
          });
        }
      }
      if (best[1]) this.read(best[1], best[2]);
    }

    // To the next point of the series that is read, or of the next series at this place.
    step(along, across) {
      const shown = this.shown;
      if (!shown.length) return;
      const k = Math.max(0, shown.indexOf(this.at?.own));
      const own = shown[(k + across + shown.length) % shown.length];
      const points = own.runs.flat().filter((point) => this.inside(this.now(point))).sort((a, b) => a[0] - b[0]);
      if (!points.length) return;
      const x = this.at?.point[0] ?? -1;
      let i = points.findIndex((point) => point[0] >= x);
      if (i < 0) i = points.length - 1;
      if (this.at && !across) {
        const here = points.indexOf(this.at.point);
        i = here < 0 ? i : here + along;
      }
      this.read(own, points[Math.min(Math.max(i, 0), points.length - 1)]);
    }

    read(own, point) {
      const [x, y, across, up] = this.now(point);
      const name = own.keys.map((key) => this.figure.names[key]).filter(Boolean).join(", ");
      const [h, v] = this.axes;
      page.forEach((panel) => panel.hide());
      this.at = { own, point };
      this.cross.classList.remove("off");
      set(this.lines, { d: `M${x} 0V${this.height}M0 ${y}H${this.width}` });
      set(this.spot, { cx: x, cy: y });
      this.figure.tell(this, [x, y], [name, `${h.label}: ${written(h, across)}`, `${v.label}: ${written(v, up)}`]);
    }

    hide() {
      if (this.at) this.figure.tip.hidden = true;
      this.at = null;
      this.cross.classList.add("off");
    }

    listen() {
      const { hit, frame } = this;
      const place = (event) => {
        const box = hit.getBoundingClientRect();
        const within = (v, from, size) => Math.min(Math.max((v - from) / size, 0), 1);
        return [this.width * within(event.clientX, box.left, box.width), this.height * within(event.clientY, box.top, box.height)];
      };
      let from = null;
      const box = (to) => [0, 1].map((i) => [Math.min(from[i], to[i]), Math.max(from[i], to[i])]);
      hit.addEventListener("pointerdown", (event) => {
        this.figure.active = this;
        if (event.pointerType === "touch") return this.nearest(place(event));
        if (event.button) return;
        from = place(event);
        hit.setPointerCapture(event.pointerId);
      });
      hit.addEventListener("pointermove", (event) => {
        const to = place(event);
        if (!from) return this.nearest(to);
        const [[x, right], [y, bottom]] = box(to);
        frame.classList.remove("off");
        set(frame, { x, y, width: right - x, height: bottom - y });
      });
      hit.addEventListener("pointerup", (event) => {
        if (!from) return;
        const sides = box(place(event));
        const { width, height } = this;
        from = null;
        frame.classList.add("off");
        const at = (i, px) => { const { range } = this.axes[i]; return range[0] + span(range) * (i ? 1 - px / height : px / width); };
        if (span(sides[0]) > 5) this.view(0, sides[0].map((px) => at(0, px)));
        if (span(sides[1]) > 5) this.view(1, sides[1].map((px) => at(1, px)).reverse());
      });
      hit.addEventListener("pointercancel", () => { from = null; this.hide(); });
      hit.addEventListener("pointerleave", (event) => { if (!from && event.pointerType !== "touch") this.hide(); });
      hit.addEventListener("dblclick", () => this.reset());
      hit.addEventListener("wheel", (event) => {
        if (!event.ctrlKey) return;
        event.preventDefault();
        const [x, y] = place(event);
        this.zoom(1.0015 ** event.deltaY, [x / this.width, 1 - y / this.height]);
      }, { passive: false });
      hit.addEventListener("focus", () => { this.figure.active = this; });
      hit.addEventListener("blur", () => this.hide());
      hit.addEventListener("keydown", (event) => {
        const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] }[event.key];
        if (event.ctrlKey || event.altKey || event.metaKey) return;
        if (arrow && event.shiftKey) arrow.forEach((way, i) => way && this.pan(i, 0.2 * way));
        else if (arrow) this.step(...arrow);
        else if (event.key === "+" || event.key === "=") this.zoom(0.5);
        else if (event.key === "-") this.zoom(2);
        else if (event.key === "0" || event.key === "Escape") this.reset();
        else return;
        event.preventDefault();
      });
    }
  }

  class Figure {
    constructor(box) {
      const svg = box.querySelector("svg");
      Object.assign(this, { box, svg, names: {}, off: new Set() });
      svg.setAttribute("role", "group");
      this.tip = make(box, "div", { class: "tip", role: "status", hidden: "" });
      const tools = make(box, "div", { class: "tools" });
      const button = (text, label, act) => make(tools, "button", { type: "button", "aria-label": label }, text).addEventListener("click", act);
      button("+", "zoom in", () => this.active.zoom(0.5));
      button("−", "zoom out", () => this.active.zoom(2));
      button("0", "reset", () => this.panels.forEach((panel) => panel.reset()));
      make(tools, "span", {}, "Drag to zoom, arrow keys for values, legend to hide");
      this.panels = [...svg.querySelectorAll("[data-size]")].map((group) => new Panel(this, group));
      [this.active] = this.panels;
      page.push(...this.panels);
      this.entries = [...svg.querySelectorAll(".entry")];
      this.entries.forEach((entry) => this.legend(entry));
    }

    legend(entry) {
      const [x, y, width, height] = entry.dataset.box.split(" ");
      this.names[entry.dataset.k] = entry.textContent;
      make(entry, "rect", { x, y, width, height, fill: "transparent" });
      set(entry, { role: "button", tabindex: 0, "aria-pressed": true });
      entry.addEventListener("click", () => this.toggle(entry.dataset.k));
      entry.addEventListener("keydown", (event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        this.toggle(entry.dataset.k);
      });
    }

    toggle(key) {
      if (!this.off.delete(key)) this.off.add(key);
      for (const entry of this.entries) entry.setAttribute("aria-pressed", !this.off.has(entry.dataset.k));
      for (const panel of this.panels) {
        panel.hide();
        for (const { node, keys } of panel.series) node.classList.toggle("off", keys.some((own) => this.off.has(own)));
      }
    }

    // The lines beside a place in a panel, kept within the figure.
    tell(panel, [x, y], lines) {
      const { tip, box } = this;
      tip.hidden = false;
      tip.replaceChildren();
      lines.filter(Boolean).forEach((line) => make(tip, "div", {}, line));
      const [hit, around] = [panel.hit.getBoundingClientRect(), box.getBoundingClientRect()];
      const left = hit.left - around.left + (x / panel.width) * hit.width;
      const top = hit.top - around.top + (y / panel.height) * hit.height;
      const room = around.width - tip.offsetWidth - 4;
      tip.style.left = `${Math.max(0, Math.min(left + 12 > room ? left - tip.offsetWidth - 12 : left + 12, room))}px`;
      tip.style.top = `${Math.max(0, top - tip.offsetHeight - 10)}px`;
    }
  }

  document.querySelectorAll(".drawing").forEach((box) => new Figure(box));
})();
