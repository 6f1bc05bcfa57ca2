"use strict";
// The page is whole without this script: it adds sorting to tables and puts pictures that stand side by side under a divider.
const svg = (name, attributes) => {
  const element = document.createElementNS("http" + "://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
};
// What is displayed, multiplied in linear light.
const light = (id) => {
  const slopes = ["R", "G", "B"].map((channel) => svg(`feFunc${channel}`, { type: "linear", slope: "1" }));
  const transfer = svg("feComponentTransfer", {});
  transfer.append(...slopes);
  const filter = svg("filter", { id, "color-interpolation-filters": "linearRGB", x: "0", y: "0", width: "1", height: "1" });
  filter.append(transfer);
  const root = svg("svg", { class: "light", "aria-hidden": "true", focusable: "false" });
  root.append(filter);
  return [root, (slope) => slopes.forEach((one) => one.setAttribute("slope", slope))];
};
const still = matchMedia("(prefers-reduced-motion: reduce)");
for (const box of document.querySelectorAll(".compare")) {
  const find = (name) => box.querySelector(name);
  const [left, right, mode, zoom, exposure, stops, swap] =
    [".of-left", ".of-right", ".mode", ".zoom", ".exposure", ".stops", ".swap"].map(find);
  const stage = find(".stage");
  const [under, over] = stage.querySelectorAll("img");
  const [leftName, rightName, range] = [find("b.left"), find("b.right"), find(".divider")];
  const show = (select, image, name) => {
    const option = select.selectedOptions[0];
    image.src = option.value;
    image.alt = option.dataset.alt;
    name.textContent = option.textContent;
  };
  const update = () => {
    show(right, under, rightName);
    show(left, over, leftName);
    range.setAttribute("aria-label", `Divider between ${leftName.textContent} on the left and ${rightName.textContent} on the right`);
  };
  const move = () => {
    stage.style.setProperty("--at", `${range.value}%`);
    range.setAttribute("aria-valuetext", `${range.value} % of the width shows ${leftName.textContent}`);
  };
  let clock = 0;
  const turn = () => over.classList.toggle("away");
  const subtract = () => {
    const files = [left, right].map((select) => `url("${select.value}")`);
    stage.style.backgroundImage = mode.value === "difference" ? files.join() : "";
  };
  const compare = () => {
    box.dataset.mode = mode.value;
    subtract();
    over.classList.remove("away");
    clearInterval(clock);
    swap.hidden = mode.value !== "flicker";
    // Once a second back and forth: three flashes a second would be too many for some people.
    if (mode.value === "flicker" && !still.matches) clock = setInterval(turn, 500);
  };
  const enlarge = () => {
    box.dataset.zoom = zoom.value;
    stage.style.setProperty("--zoom", zoom.value);
  };
  const [filter, set] = light(`${box.id}-light`);
  const expose = () => {
    stops.textContent = exposure.value;
    set(2 ** Number(exposure.value));
    stage.style.filter = exposure.value === "0" ? "" : `url(#${box.id}-light)`;
  };
  box.append(filter);
  left.addEventListener("change", () => { update(); move(); subtract(); });
  right.addEventListener("change", () => { update(); move(); subtract(); });
  range.addEventListener("input", move);
  mode.addEventListener("change", compare);
  zoom.addEventListener("change", enlarge);
  exposure.addEventListener("input", expose);
  swap.addEventListener("click", () => { clearInterval(clock); turn(); });
  update();
  move();
  compare();
  box.hidden = false;
  // As measured, where that fits.
  zoom.value = under.width <= box.clientWidth ? "1" : "fit";
  enlarge();
  expose();
  box.nextElementSibling.hidden = true;
}
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0];
  const headers = [...table.querySelectorAll("th[data-column]")];
  // Narrow windows lay the table out as lines: each cell says its column, and elements keep their roles.
  const names = headers.map((header) => header.textContent.trim());
  const groups = [...table.querySelectorAll(".groups th")].flatMap((group) => Array(group.colSpan).fill(group.textContent.trim()));
  const roles = [["thead, tbody", "rowgroup"], ["tr", "row"], ["td", "cell"], ["thead th", "columnheader"], ["tbody th", "rowheader"]];
  table.classList.add("cards");
  table.setAttribute("role", "table");
  for (const [which, role] of roles) for (const element of table.querySelectorAll(which)) element.setAttribute("role", role);
  for (const row of body.rows) for (const [index, cell] of [...row.cells].entries()) {
    // Errors of the picture have the names of those of the effect.
    const again = names.indexOf(names[index]) < index || groups[index] === "2014";
    if (index > 0) cell.dataset.label = (again ? `${groups[index]}: ` : "") + names[index];
  }
  const key = (row, column) => {
    const cell = row.cells[column];
    const number = cell.dataset.v;
    return number === undefined ? cell.textContent.trim() : number === "" ? null : Number(number);
  };
  for (const header of headers) {
    const column = Number(header.dataset.column);
    const button = document.createElement("button");
    button.type = "button";
    button.append(...header.childNodes);
    header.append(button);
    button.addEventListener("click", () => {
      const sign = header.getAttribute("aria-sort") === "ascending" ? -1 : 1;
      for (const other of headers) other.removeAttribute("aria-sort");
      header.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
      const rows = [...body.rows].sort((a, b) => {
        const x = key(a, column), y = key(b, column);
        // What was not measured comes last, whichever the direction.
        if (x === null || y === null) return (x === null) - (y === null);
        return sign * (typeof x === "number" && typeof y === "number" ? x - y : String(x).localeCompare(String(y)));
      });
      body.append(...rows);
    });
  }
}
