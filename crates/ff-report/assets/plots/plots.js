// Figures of a report as plots: zoom, values under the cursor, curves on and off, linked time axes. Without this script, and on paper, the
// figures are drawings.
(() => {
  "use strict";
  // Okabe and Ito, as in the drawings; the seventh is dark, and light in the dark.
  const PALETTE = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "", "#805e28"];
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const variable = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const colour = (i) => PALETTE[i % 8] || variable("--ink");

  const numbers = (text) => {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    return Array.from(new Float32Array(bytes.buffer));
  };

  /** Aligned columns of a panel: one abscissa, curves in the order of the panel. */
  const columns = (panel) => {
    const clean = (ys) => (panel.log ? ys.map((y) => (y > 0 ? y : null)) : ys);
    const tables = panel.groups.map((g) => [numbers(g.x), ...g.ys.map((y) => clean(numbers(y)))]);
    for (const r of panel.ranges) tables.push([numbers(r.x), clean(numbers(r.high)), clean(numbers(r.low))]);
    const joined = tables.length > 1 ? uPlot.join(tables) : tables[0] || [[]];
    const order = panel.groups.flatMap((g) => g.series);
    // Ends of the shaded areas come last.
    return [joined[0], ...panel.series.map((_, i) => joined[1 + order.indexOf(i)]), ...joined.slice(1 + order.length)];
  };

  const show = (v) => (v === null || v === undefined ? "\u2014" : Math.abs(v) >= 1e5 || (v !== 0 && Math.abs(v) < 1e-3) ? v.toExponential(3) : v.toPrecision(5));
  const tick = (v) => {
    if (v === null) return "";
    if (v !== 0 && (Math.abs(v) >= 1e5 || Math.abs(v) < 1e-3)) return v.toExponential(0).replace("e+", "e");
    return `${Number(v.toPrecision(6))}`;
  };

  /** Plots over the same time zoom together: groups of one abscissa and one range, to a twentieth of it. */
  let groups = [];
  const group = (label, [min, max]) => {
    const near = (a, b) => Math.abs(a - b) <= 0.05 * (max - min);
    let found = groups.find((g) => g.label === label && near(g.min, min) && near(g.max, max));
    if (!found) groups.push((found = { label, min, max, plots: [], key: `${label} ${groups.length}` }));
    return found;
  };
  let zooming = false;
  const follow = (u, linked) => {
    if (!linked || zooming) return;
    zooming = true;
    const { min, max } = u.scales.x;
    for (const other of linked.plots) if (other !== u) other.setScale("x", { min, max });
    zooming = false;
  };

  const marks = (panel) => (u) => {
    const { ctx } = u;
    const { left, top, width, height } = u.bbox;
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, top, width, height);
    ctx.clip();
    ctx.fillStyle = "rgba(230, 159, 0, 0.12)";
    for (const [a, b] of panel.bands) {
      const x = u.valToPos(a, "x", true);
      ctx.fillRect(x, top, u.valToPos(b, "x", true) - x, height);
    }
    ctx.setLineDash([5, 3]);
    ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
    ctx.textAlign = "left";
    // Names stand beside their lines, each in the first row that has room.
    const rows = [-Infinity, -Infinity, -Infinity, -Infinity];
    for (const line of [...panel.lines].sort((a, b) => a.x - b.x)) {
      const x = u.valToPos(line.x, "x", true);
      ctx.strokeStyle = line.colour === null ? variable("--soft") : colour(line.colour);
      ctx.fillStyle = variable("--soft");
      ctx.beginPath();
      ctx.moveTo(x, top);
      ctx.lineTo(x, top + height);
      ctx.stroke();
      const wide = ctx.measureText(line.label).width;
      const row = rows.findIndex((end) => x > end);
      if (row >= 0 && line.label && x + wide + 4 < left + width) {
        ctx.fillText(line.label, x + 3 * devicePixelRatio, top + (12 + 13 * row) * devicePixelRatio);
        rows[row] = x + wide + 6;
      }
    }
    ctx.restore();
  };

  const reset = (u) => u.setScale("x", { min: u.whole[0], max: u.whole[1] });
  /** Shows `share` of what is shown now, about the cursor, or moved by `by` of it. */
  const zoom = (u, share, by = 0) => {
    const { min, max } = u.scales.x, span = max - min;
    const at = u.cursor.left >= 0 ? u.posToVal(u.cursor.left, "x") : (min + max) / 2;
    const width = Math.min(span * share, u.whole[1] - u.whole[0]);
    let low = (share === 1 ? min : at - ((at - min) / span) * width) + by * span;
    low = Math.min(Math.max(low, u.whole[0]), u.whole[1] - width);
    u.setScale("x", { min: low, max: low + width });
  };
  /** What a pointer does, by keys: values, zoom, the whole. */
  const keys = (u, name) => {
    u.over.tabIndex = 0;
    u.over.setAttribute("role", "img");
    u.over.setAttribute("aria-label", `Plot of ${name}. Left and right move the cursor, plus and minus zoom, 0 shows the whole.`);
    const step = (by) => {
      const from = u.cursor.left >= 0 ? u.cursor.left : u.over.clientWidth / 2;
      u.setCursor({ left: Math.min(Math.max(from + by * 0.02 * u.over.clientWidth, 0), u.over.clientWidth), top: u.over.clientHeight / 2 });
    };
    const acts = { ArrowLeft: () => step(-1), ArrowRight: () => step(1), "+": () => zoom(u, 0.5), "=": () => zoom(u, 0.5), "-": () => zoom(u, 2), 0: () => reset(u), Escape: () => reset(u) };
    u.over.addEventListener("keydown", (e) => {
      if (!acts[e.key] || e.ctrlKey || e.metaKey || e.altKey) return;
      e.preventDefault();
      acts[e.key]();
    });
  };
  /** Buttons that zoom the plots of a figure: for fingers and keys. */
  const bar = (figure) => {
    const box = Object.assign(document.createElement("div"), { className: "zoom" });
    const acts = [["\u2212", "show more", (u) => zoom(u, 2)], ["+", "zoom in", (u) => zoom(u, 0.5)], ["\u25c0", "move left", (u) => zoom(u, 1, -0.25)],
      ["\u25b6", "move right", (u) => zoom(u, 1, 0.25)], ["whole", "show the whole", reset]];
    for (const [text, title, act] of acts) {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: text, title });
      button.setAttribute("aria-label", title);
      button.addEventListener("click", () => {
        // One plot of each group: the others follow.
        const done = new Set();
        for (const u of figure.plots) {
          if (u.linked && done.has(u.linked)) continue;
          done.add(u.linked);
          act(u);
        }
      });
      box.append(button);
    }
    box.append(Object.assign(document.createElement("span"), { textContent: "Drag across a plot to zoom, double-click for the whole, click a name to hide its curve." }));
    return box;
  };

  const draw = (box, figure, panel) => {
    const wide = () => Math.max(box.clientWidth, 200);
    // Curves that are zero are drawn before the others, and stand in the legend where they belong.
    const order = [true, false].flatMap((zero) => panel.series.map((_, i) => i).filter((i) => panel.series[i].zero === zero));
    const given = columns(panel);
    const data = [given[0], ...order.map((i) => given[1 + i]), ...given.slice(1 + order.length)];
    const whole = panel.xRange || (data[0].length > 1 ? [data[0][0], data[0][data[0].length - 1]] : null);
    const linked = panel.x.startsWith("time") && whole ? group(panel.x, whole) : null;
    const label = (i) => {
      const name = panel.series[i].label || (figure.panels[0].series[i] || {}).label || panel.title || "value";
      return panel.series[i].zero ? `${name} (zero)` : name;
    };
    const axis = (text) => ({
      label: text, stroke: variable("--soft"), labelSize: 22, size: 56, labelFont: "12px system-ui, sans-serif", font: "11px system-ui, sans-serif",
      grid: { stroke: variable("--line"), width: 0.5 }, ticks: { stroke: variable("--line"), width: 0.5 },
    });
    const options = {
      width: wide(),
      height: panel.height + 70,
      legend: { live: true },
      cursor: { drag: { x: true, y: false }, sync: linked ? { key: linked.key } : {}, focus: { prox: 24 } },
      focus: { alpha: 0.35 },
      scales: {
        x: { time: false, ...(whole ? { min: whole[0], max: whole[1] } : {}) },
        y: panel.yRange
          ? { distr: panel.log ? 3 : 1, range: () => panel.yRange }
          : { distr: panel.log ? 3 : 1 },
      },
      axes: [{ ...axis(panel.x), size: 34 }, { ...axis(panel.y), values: (u, all) => all.map(panel.log ? (v) => (v !== null && Number.isInteger(Math.log10(v)) ? tick(v) : "") : tick) }],
      series: [
        { label: panel.x, value: (u, v) => show(v) },
        ...order.map((i) => ({
          label: label(i), stroke: colour(panel.series[i].colour), width: 1.5, dash: panel.series[i].dashed || panel.series[i].colour >= 8 ? [7, 4] : undefined,
          spanGaps: true, points: { show: false }, value: (u, v) => show(v),
        })),
        ...panel.ranges.flatMap(() => ["high", "low"].map((end) => ({ label: end, class: "end", stroke: "transparent", spanGaps: true, points: { show: false } }))),
      ],
      bands: panel.ranges.map((r, i) => {
        const high = 1 + panel.series.length + 2 * i;
        return { series: [high, high + 1], fill: `${colour(r.colour)}33` };
      }),
      hooks: { drawAxes: [marks(panel)], setScale: [(u, scale) => { if (scale === "x") follow(u, linked); }] },
    };
    if (panel.title) box.append(Object.assign(document.createElement("h3"), { textContent: panel.title }));
    const u = new uPlot(options, data, box);
    u.whole = whole || [u.scales.x.min, u.scales.x.max];
    u.over.addEventListener("dblclick", () => reset(u));
    keys(u, label(order[0] || 0));
    const entries = [...u.root.querySelectorAll(".u-legend .u-series")];
    entries.forEach((row, k) => { row.style.order = k === 0 || k > order.length ? k : 1 + order[k - 1]; });
    entries.slice(1, 1 + order.length).forEach((row, k) => {
      const name = row.querySelector("th");
      const told = () => name.setAttribute("aria-pressed", String(u.series[k + 1].show));
      name.tabIndex = 0;
      name.setAttribute("role", "button");
      name.addEventListener("click", () => setTimeout(told));
      name.addEventListener("keydown", (e) => {
        if (e.key !== "Enter" && e.key !== " ") return;
        e.preventDefault();
        name.click();
      });
      told();
    });
    if (linked) linked.plots.push(u);
    u.linked = linked;
    new ResizeObserver(() => {
      if (Math.abs(u.width - wide()) > 1) u.setSize({ width: wide(), height: options.height });
    }).observe(box);
    return u;
  };

  const figures = [...document.querySelectorAll("figure.plot")];
  const build = () => {
    groups = [];
    for (const figure of figures) {
      figure.querySelector(".plots")?.remove();
      const data = JSON.parse(figure.querySelector("script").textContent);
      const box = document.createElement("div");
      box.className = "plots";
      figure.prepend(box);
      figure.classList.add("live");
      figure.plots = data.panels.map((panel) => {
        const own = document.createElement("div");
        box.append(own);
        return draw(own, data, panel);
      });
      box.prepend(bar(figure));
    }
  };
  build();
  dark.addEventListener("change", build);
})();
