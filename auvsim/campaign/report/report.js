// Choice of variants, one filter at a time, sorting and values under the pointer. Everything shown is in the page already; this hides and orders it.
"use strict";
(() => {
  const PAGE = 100; // rows of the list shown at first, and added by "more"
  const all = (selector, from = document) => Array.from(from.querySelectorAll(selector));
  const one = (selector) => document.querySelector(selector);
  const body = one("#trials tbody");
  const rows = all("tr", body);
  const boxes = all("#variants input");
  const total = rows.length;
  let filter = null; // the element that filters: its data-filter holds what a row's data must equal
  let shown = PAGE;

  const hiddenVariants = () => new Set(boxes.filter((box) => !box.checked).map((box) => box.value));

  function fits(row, hidden, wanted) {
    return !hidden.has(row.dataset.v) && wanted.every(([key, value]) => row.dataset[key] === value);
  }

  function list() {
    const hidden = hiddenVariants();
    const wanted = filter ? Object.entries(JSON.parse(filter.dataset.filter)) : [];
    const kept = rows.filter((row) => fits(row, hidden, wanted));
    body.replaceChildren(...kept.slice(0, shown));
    const what = filter ? `: ${filter.dataset.label}` : "";
    one("#count").textContent = one("#said").textContent = `${kept.length} of ${total} trials${what}`;
    one("#more").classList.toggle("hidden", kept.length <= shown);
    one("#more").textContent = `Show ${Math.min(PAGE, kept.length - shown)} more of ${kept.length}`;
    one("#status").classList.toggle("hidden", !filter && hidden.size === 0);
  }

  function choose(element) {
    filter = filter === element ? null : element;
    for (const other of all("[data-filter]")) {
      const chosen = other === filter;
      other.setAttribute("aria-pressed", chosen);
      (other.closest("tr[data-chooses]") || other).classList.toggle("chosen", chosen);
    }
    shown = PAGE;
    list();
  }

  function showVariants() {
    const hidden = hiddenVariants();
    for (const element of all("[data-variant]")) {
      element.classList.toggle("hidden", hidden.has(element.dataset.variant));
    }
    list();
  }

  function sort(heading) {
    const column = Array.from(heading.parentNode.children).indexOf(heading);
    const up = heading.getAttribute("aria-sort") !== "ascending";
    all("[aria-sort]", heading.parentNode).forEach((other) => other.removeAttribute("aria-sort"));
    heading.setAttribute("aria-sort", up ? "ascending" : "descending");
    const keys = new Map(rows.map((row) => [row, key(row.children[column])]));
    rows.sort((a, b) => compare(keys.get(a), keys.get(b), up ? 1 : -1));
    list();
  }

  function key(cell) {
    const value = "value" in cell.dataset ? cell.dataset.value : cell.textContent;
    return value === "" ? null : Number.isNaN(Number(value)) ? value : Number(value);
  }

  function compare(a, b, sign) {
    if (a === null || b === null) return (a === null) - (b === null); // what is missing stands last, whichever way
    return sign * (typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b)));
  }

  // Cells of a map: one stop of the tabulator for each map, arrows within it.
  function arrows(event) {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    const cells = step ? all(".cell", event.target.closest("svg")) : [];
    const next = cells[(cells.indexOf(event.target) + step + cells.length) % cells.length];
    if (!next) return;
    event.preventDefault();
    event.target.tabIndex = -1;
    next.tabIndex = 0;
    next.focus();
  }

  const tip = one("#tip");
  function showTip(event) {
    const element = event.target.closest("[data-tip]");
    tip.classList.toggle("hidden", !element);
    if (element) placeTip(element.dataset.tip, event.clientX || element.getBoundingClientRect().right, event.clientY || element.getBoundingClientRect().top);
  }

  function placeTip(text, x, y) {
    tip.classList.remove("hidden");
    tip.textContent = text;
    const box = tip.getBoundingClientRect();
    tip.style.left = `${Math.max(4, Math.min(x + 14, innerWidth - box.width - 8))}px`;
    tip.style.top = `${y + 18 + box.height > innerHeight ? y - box.height - 10 : y + 18}px`;
  }

  // A line through the curves: the share of each at the distance under the pointer.
  function readCurves(event) {
    const svg = event.currentTarget;
    const box = svg.getBoundingClientRect();
    const { x0, x1, low, high, y0, y1 } = Object.fromEntries(Object.entries(svg.dataset).map(([k, v]) => [k, Number(v)]));
    const x = ((event.clientX - box.left) * svg.viewBox.baseVal.width) / box.width;
    const cross = svg.querySelector(".cross");
    const inside = x >= x0 && x <= x1;
    cross.classList.toggle("hidden", !inside);
    if (!inside) return tip.classList.add("hidden");
    cross.setAttribute("x1", x);
    cross.setAttribute("x2", x);
    const lines = [`within ${(low * (high / low) ** ((x - x0) / (x1 - x0))).toPrecision(2)} m`];
    for (const curve of all(".curve:not(.hidden)", svg)) {
      const left = Array.from(curve.points).filter((point) => point.x <= x);
      const share = left.length ? (left[left.length - 1].y - y0) / (y1 - y0) : 0;
      lines.push(`${curve.dataset.name}: ${(100 * share).toFixed(0)} %`);
    }
    placeTip(lines.join("\n"), event.clientX, event.clientY);
  }

  for (const title of all("svg title")) {
    title.parentNode.dataset.tip = title.textContent;
    title.parentNode.setAttribute("aria-label", title.textContent.replaceAll("\n", ", "));
    title.remove();
  }
  for (const element of all("[data-filter]")) {
    element.addEventListener("click", () => choose(element));
    if (element.tagName === "BUTTON") continue;
    element.setAttribute("role", "button");
    element.setAttribute("aria-pressed", false);
    element.addEventListener("keydown", (event) => {
      if (event.key === "Enter" || event.key === " ") {
        event.preventDefault();
        choose(element);
      } else arrows(event);
    });
  }
  for (const svg of all("svg.map")) {
    all(".cell", svg).forEach((cell, index) => (cell.tabIndex = index ? -1 : 0));
  }
  for (const svg of all("svg.curves")) {
    svg.addEventListener("pointermove", readCurves);
    svg.addEventListener("pointerleave", () => (tip.classList.add("hidden"), svg.querySelector(".cross").classList.add("hidden")));
  }
  for (const heading of all("#trials thead th")) {
    heading.querySelector("button").addEventListener("click", () => sort(heading));
  }
  for (const control of all("#maps select")) {
    const set = () => (one("#maps").dataset[control.name] = control.value);
    control.addEventListener("change", set);
    set();
  }
  boxes.forEach((box) => box.addEventListener("change", showVariants));
  document.addEventListener("pointermove", (event) => event.target.closest(".curves") || showTip(event));
  document.addEventListener("focusin", showTip);
  document.addEventListener("keydown", (event) => event.key === "Escape" && filter && choose(filter));
  one("#more").addEventListener("click", () => ((shown += PAGE), list()));
  one("#clear").addEventListener("click", () => {
    boxes.forEach((box) => (box.checked = true));
    filter ? choose(filter) : null;
    showVariants();
  });
  showVariants();
  document.documentElement.className = "ready";
})();
