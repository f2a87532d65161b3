"use strict";
const number = (text) => parseFloat(text.replace("−", "-").replace(/[%\s]/g, ""));
for (const button of document.querySelectorAll("thead button")) {
  button.addEventListener("click", () => {
    const head = button.parentElement, row = head.parentElement, body = head.closest("table").tBodies[0];
    const up = head.getAttribute("aria-sort") !== "ascending", k = head.cellIndex;
    for (const other of row.cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", up ? "ascending" : "descending");
    const compare = (a, b) => {
      const p = a.cells[k].textContent, q = b.cells[k].textContent, x = number(p), y = number(q);
      if (isNaN(x) !== isNaN(y)) return isNaN(x) ? 1 : -1;  // what has no figure comes last
      return (up ? 1 : -1) * (isNaN(x) ? p.localeCompare(q) : x - y);
    };
    body.append(...[...body.rows].sort(compare));
  });
}
for (const box of document.querySelectorAll("input[data-m]")) {
  const apply = () => document.body.classList.toggle("hide-" + box.dataset.m, !box.checked);
  box.addEventListener("change", apply);
  apply();
}
document.getElementById("theme").addEventListener("click", () => {
  const root = document.documentElement, system = matchMedia("(prefers-color-scheme: dark)").matches;
  const dark = root.dataset.theme ? root.dataset.theme === "dark" : system;
  root.dataset.theme = dark ? "light" : "dark";
});
