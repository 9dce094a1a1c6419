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

  const draw = (box, figure, panel) => {
    const wide = () => Math.max(box.clientWidth, 200);
    const data = columns(panel);
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
        ...panel.series.map((s, i) => ({
          label: label(i), stroke: colour(s.colour), width: 1.5, dash: s.dashed || s.colour >= 8 ? [7, 4] : undefined, spanGaps: true,
          points: { show: false }, value: (u, v) => show(v),
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
    u.over.addEventListener("dblclick", () => u.setScale("x", { min: options.scales.x.min, max: options.scales.x.max }));
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
    }
  };
  build();
  dark.addEventListener("change", build);
})();
