// Appended to a page within a frame: looks at it as a reader would, and leaves what it found in #found.
"use strict";
const found = {wrong: [], tables: 0, plots: 0};
const wrong = (text) => found.wrong.push(text);
const name = (svg) => svg.getAttribute("aria-label");
const luminance = (colour) => {
  const parts = colour.match(/[\d.]+/g).slice(0, 3).map((v) => v / 255);
  const [r, g, b] = parts.map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const contrast = (a, b) => {
  const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
  return (high + 0.05) / (low + 0.05);
};
const figure = (text) => parseFloat(text.replace("−", "-").replace(/[%\s]/g, ""));

function plots() {
  for (const svg of document.querySelectorAll("figure > svg")) {
    const box = svg.getBoundingClientRect();
    found.plots += 1;
    if (box.width < 200 || box.height < 50) wrong(`${name(svg)}: ${box.width} by ${box.height}`);
    const texts = [...svg.querySelectorAll("text")].filter((one) => one.textContent);
    const boxes = texts.map((one) => one.getBoundingClientRect());
    boxes.forEach((own, k) => {
      if (own.left < box.left - 1 || own.right > box.right + 1 || own.top < box.top - 1 || own.bottom > box.bottom + 1)
        wrong(`${name(svg)}: ${texts[k].textContent} is cut off`);
      for (let j = 0; j < k; j++) {
        const other = boxes[j], across = Math.min(own.right, other.right) - Math.max(own.left, other.left);
        // Lines of text a little into each other are still read: ascenders and descenders seldom meet.
        const along = Math.min(own.bottom, other.bottom) - Math.max(own.top, other.top);
        if (across > 1 && along > 0.35 * own.height)
          wrong(`${name(svg)}: ${texts[j].textContent} and ${texts[k].textContent} overlap`);
      }
    });
  }
}

function tables() {
  for (const table of document.querySelectorAll("table")) {
    found.tables += 1;
    for (const button of table.querySelectorAll("thead button")) {
      const column = button.parentElement.cellIndex, order = [];
      for (const sense of ["ascending", "descending"]) {
        button.click();
        if (button.parentElement.getAttribute("aria-sort") !== sense) wrong(`${button.textContent}: not ${sense}`);
        order.push([...table.tBodies[0].rows].map((row) => figure(row.cells[column].textContent)).filter((v) => !isNaN(v)));
      }
      const [up, down] = order;
      if (up.some((v, k) => k && v < up[k - 1]) || down.some((v, k) => k && v > down[k - 1]))
        wrong(`column ${button.textContent} does not sort`);
    }
  }
}

function methods() {
  for (const box of document.querySelectorAll("input[data-m]")) {
    const lines = [...document.querySelectorAll(`svg .${box.dataset.m}`)];
    const shown = () => lines.filter((one) => getComputedStyle(one).display !== "none").length;
    if (!lines.length || shown() !== lines.length) wrong(`${box.dataset.m}: ${shown()} of ${lines.length} lines`);
    box.click();
    if (shown()) wrong(`${box.dataset.m}: does not hide`);
    box.click();
  }
}

function keyboard() {
  const wanted = "a[href], button, input, summary, .wide";
  for (const one of document.querySelectorAll(wanted)) if (one.tabIndex < 0) wrong(`${one.textContent}: no key reaches it`);
  for (const box of document.querySelectorAll("input")) if (!box.labels.length) wrong("a box without a label");
}

function colours() {
  const body = getComputedStyle(document.body), svg = document.querySelector("figure > svg text");
  const small = svg ? contrast(getComputedStyle(svg).fill, getComputedStyle(svg.closest("figure")).backgroundColor) : 21;
  found.ground = luminance(body.backgroundColor);
  const text = contrast(body.color, body.backgroundColor);
  if (text < 7 || small < 4.5) wrong(`contrast of ${text.toFixed(1)}, of small text ${small.toFixed(1)}`);
}

try {
  document.querySelectorAll("details").forEach((one) => { one.open = true; });
  plots();
  tables();
  methods();
  keyboard();
  colours();
  found.width = innerWidth;
  found.scrolls = document.documentElement.scrollWidth;
  found.loaded = performance.getEntriesByType("resource").map((one) => one.name);
} catch (error) {
  wrong(`${error}`);
}
const report = document.createElement("pre");
report.id = "found";
report.textContent = JSON.stringify(found);
top.document.body.replaceChildren(report);
