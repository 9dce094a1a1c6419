// What a page has to do, asked of the page itself: an expression whose value is `{ problems: [...], frames_per_second }`.
(async () => {
  "use strict";
  const problems = [];
  const hold = (ok, what) => { if (!ok) problems.push(what); };
  const wait = (ms) => new Promise((r) => setTimeout(r, ms));
  const frame = () => new Promise((r) => requestAnimationFrame(() => requestAnimationFrame(r)));
  await frame();

  // Nothing is wider than the window, tables and drawings that scroll by themselves left out.
  const wide = document.documentElement.scrollWidth;
  hold(wide <= innerWidth, `the page is ${wide} px wide in a window of ${innerWidth} px`);
  if (innerWidth < 500) {
    for (const t of document.querySelectorAll(".cards")) {
      hold(t.scrollWidth <= t.parentElement.clientWidth + 1, `a table is ${t.scrollWidth} px wide: ${t.textContent.slice(0, 60)}`);
    }
  }

  // The first screen of a report: its answer, how far to trust it and what to do next, each at least with its first sentence.
  for (const part of document.querySelectorAll(".opening .part")) {
    const label = part.querySelector("h2").textContent, first = part.querySelector("p");
    const low = Math.round((first || part).getBoundingClientRect().bottom + scrollY);
    hold(first, `nothing stands under ${label}`);
    hold(low <= innerHeight, `${label} begins below the first screen: its first sentence ends at ${low} px of ${innerHeight}`);
  }
  // No text is cut off by its own box, and none of the page stands left of the window.
  for (const e of document.querySelectorAll("h1, h2, h3, p, li, td, th, caption, figcaption, summary, label, button")) {
    if (!e.getClientRects().length || e.closest(".wide, figure, .u-off")) continue;
    const hidden = getComputedStyle(e).overflowX !== "visible" && e.scrollWidth > e.clientWidth + 1;
    const box = e.getBoundingClientRect();
    hold(!hidden && box.left > -1 && box.right <= innerWidth + 1, `cut off: ${e.textContent.trim().slice(0, 40)}`);
  }

  // Contrast of text (WCAG 2.1, level AA: 4.5).
  const rgb = (text) => text.match(/[\d.]+/g).map(Number);
  const luminance = ([r, g, b]) => [r, g, b].map((c) => c / 255).map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  const behind = (e) => {
    for (; e; e = e.parentElement) {
      const c = rgb(getComputedStyle(e).backgroundColor);
      if (c.length < 4 || c[3] > 0) return c;
    }
    return [255, 255, 255];
  };
  for (const e of document.querySelectorAll("h1, h2, h3, p, li, td, th, caption, figcaption, summary, a, label, button, footer")) {
    if (!e.textContent.trim() || e.closest("[hidden], .u-off") || !e.getClientRects().length) continue;
    const [a, b] = [luminance(rgb(getComputedStyle(e).color)), luminance(behind(e))].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    hold(ratio >= 4.5, `contrast ${ratio.toFixed(2)} of <${e.tagName.toLowerCase()}> ${e.textContent.trim().slice(0, 40)}`);
  }

  // Colours of a canvas, thinned, as one text.
  const pixels = (canvas) => {
    const small = Object.assign(document.createElement("canvas"), { width: 96, height: 72 });
    const context = small.getContext("2d", { willReadFrequently: true });
    context.drawImage(canvas, 0, 0, 96, 72);
    return context.getImageData(0, 0, 96, 72).data;
  };
  const colours = (canvas) => {
    const p = pixels(canvas), seen = new Set();
    for (let i = 0; i < p.length; i += 4) seen.add(`${p[i]} ${p[i + 1]} ${p[i + 2]} ${p[i + 3]}`);
    return seen.size;
  };
  const picture = (canvas) => pixels(canvas).join();
  const input = (e, value) => {
    if (e.type === "checkbox") e.checked = value; else e.value = value;
    e.dispatchEvent(new Event("input", { bubbles: true }));
  };

  // Plots.
  for (const figure of document.querySelectorAll("figure.plot")) {
    const name = figure.querySelector("figcaption").textContent;
    const plots = figure.plots || [];
    hold(plots.length > 0, `no plots: ${name}`);
    hold(getComputedStyle(figure.querySelector(":scope > svg")).display === "none", `drawing and plots at once: ${name}`);
    for (const u of plots) {
      hold(colours(u.ctx.canvas) > 3, `a plot is blank: ${name}`);
      hold(u.width <= figure.clientWidth, `a plot is ${u.width} px wide in ${figure.clientWidth} px: ${name}`);
    }
    const u = plots[0];
    if (!u || u.series.length < 2) continue;
    const legend = u.root.querySelectorAll(".u-legend .u-series")[1].querySelector("th");
    for (const press of [() => legend.click(), () => legend.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter", bubbles: true, cancelable: true }))]) {
      const shown = u.series[1].show;
      press();
      hold(u.series[1].show === !shown, `the legend does not answer: ${name}`);
    }
    const before = [u.scales.x.min, u.scales.x.max];
    const middle = (before[0] + before[1]) / 2;
    u.setScale("x", { min: before[0], max: middle });
    await frame();
    hold(Math.abs(u.scales.x.max - middle) < 1e-6 * Math.abs(before[1] - before[0]), `a plot does not zoom: ${name}`);
    for (const other of plots) {
      if (u.linked && other.linked === u.linked) {
        hold(Math.abs(other.scales.x.max - middle) < 1e-6 * Math.abs(before[1]), `time axes are not linked: ${name}`);
      }
    }
    u.setScale("x", { min: before[0], max: before[1] });
    await frame();
    // The same by buttons and keys.
    const span = () => u.scales.x.max - u.scales.x.min;
    // What it shows of its own accord; plots that are linked may differ a little.
    const all = u.whole[1] - u.whole[0];
    const [more, less] = ["zoom in", "show the whole"].map((t) => figure.querySelector(`.zoom button[aria-label="${t}"]`));
    more.click();
    await frame();
    hold(span() < 0.6 * all, `a button does not zoom: ${name}`);
    less.click();
    await frame();
    hold(Math.abs(span() - all) < 1e-6 * all, `a button does not show the whole: ${name}`);
    const press = (key) => u.over.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
    press("+");
    await frame();
    hold(span() < 0.6 * all, `a key does not zoom: ${name}`);
    press("0");
    press("ArrowRight");
    await frame();
    hold(Math.abs(span() - all) < 1e-6 * all && u.cursor.left >= 0, `keys do not move the cursor: ${name}`);
    u.setCursor({ left: u.over.clientWidth / 2, top: u.over.clientHeight / 2 });
    await frame();
    const shown = [...u.root.querySelectorAll(".u-legend .u-value")].map((e) => e.textContent);
    hold(shown.some((t) => /\d/.test(t)), `no values under the cursor: ${name}`);
  }

  // Replays.
  let rate = null;
  for (const box of document.querySelectorAll(".replay")) {
    const v = box.viewer;
    hold(v && box.classList.contains("live"), `no 3-D view: ${box.querySelector(".failed").textContent}`);
    if (!v) continue;
    const control = (name) => box.querySelector(`[data-control="${name}"]`);
    for (const e of box.querySelectorAll("button, input, select, canvas")) {
      hold(e.closest("label") || e.getAttribute("aria-label") || e.textContent.trim(), `a control has no name: ${e.outerHTML.slice(0, 60)}`);
    }
    hold(colours(v.canvas) > 8, "the 3-D view is blank");
    const changes = async (what, act) => {
      const before = picture(v.canvas);
      await act();
      await frame();
      hold(picture(v.canvas) !== before, `the picture does not change: ${what}`);
    };
    const options = [...control("what").options].map((o) => o.value);
    if (options.includes("motion")) input(control("what"), "motion");
    await frame();
    if (options[0] !== "still") {
      await changes("play", async () => { control("play").click(); await wait(500); });
      hold(v.playing && v.time > 0, "it does not play");
      const [drawn, begun] = [v.drawn, performance.now()];
      await wait(1500);
      rate = ((v.drawn - drawn) * 1000) / (performance.now() - begun);
      control("play").click();
      hold(!v.playing, "it does not pause");
      await changes("time", () => input(control("time"), 0.6 * Number(control("time").max)));
      const t = v.time;
      v.canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight", cancelable: true }));
      hold(v.time > t, "the arrow keys do not step");
      for (const mode of options.filter((o) => /^\d+$/.test(o))) {
        input(control("what"), mode);
        await changes(`mode ${mode}`, () => v.seek(0.5 / v.data.scenes[0].modes[Number(mode)].frequency_hz));
      }
      await changes("deflections", () => input(control("deflection"), 3));
      input(control("what"), options[0]);
    }
    for (const view of ["front", "side", "top", "corner"]) await changes(view, () => box.querySelector(`[data-view=${view}]`).click());
    // Turning by the pointer.
    const at = (type, x) => v.canvas.dispatchEvent(new MouseEvent(type, { clientX: x, clientY: 150, button: 0, bubbles: true }));
    await changes("drag", async () => { at("mousedown", 100); window.dispatchEvent(new MouseEvent("mousemove", { clientX: 190, clientY: 160 })); window.dispatchEvent(new MouseEvent("mouseup", {})); await wait(300); });
    await changes("sensors", () => input(control("sensors"), false));
    await changes("com", () => input(control("com"), false));
    input(control("sensors"), true);
    input(control("com"), true);
    input(control("names"), true);
    await frame();
    hold([...box.querySelectorAll(".labels span")].some((s) => !s.hidden), "no names are shown");
    input(control("names"), false);
    if (v.robots.length > 1) {
      await changes("side by side", () => input(control("beside"), "side"));
      input(control("beside"), "over");
    }
    box.querySelector("[data-view=corner]").click();
    await frame();
  }
  return { problems, frames_per_second: rate };
})()
