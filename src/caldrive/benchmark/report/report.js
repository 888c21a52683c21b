"use strict";
// A number where the cell begins with one (also after a >), else text.
function value(cell) {
  const number = parseFloat(cell.textContent.replace(/^>\s*/, ""));
  return Number.isNaN(number) ? cell.textContent : number;
}
function compare(a, b) {
  if (typeof a === typeof b) return a < b ? -1 : a > b ? 1 : 0;
  return typeof a === "number" ? -1 : 1;
}
for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => head.querySelector("button").addEventListener("click", () => {
    const down = head.getAttribute("aria-sort") === "ascending";
    heads.forEach((other) => other.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const rows = [...table.tBodies[0].rows];
    rows.sort((a, b) => compare(value(a.cells[column]), value(b.cells[column])) * (down ? -1 : 1));
    table.tBodies[0].append(...rows);
  }));
}
const menus = [...document.querySelectorAll("select[data-filter]")];
function filter() {
  let shown = 0;
  for (const card of document.querySelectorAll(".card")) {
    const fits = menus.every((menu) =>
      !menu.value || card.dataset[menu.dataset.filter].split("|").includes(menu.value));
    card.hidden = !fits;
    shown += fits;
  }
  document.getElementById("shown").textContent = shown;
}
menus.forEach((menu) => menu.addEventListener("change", filter));
