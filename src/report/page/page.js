"use strict";
// The page is whole without this script: it adds sorting to tables and puts pictures that stand side by side under a divider.
for (const box of document.querySelectorAll(".compare")) {
  const [left, right] = box.querySelectorAll("select");
  const stage = box.querySelector(".stage");
  const [under, over] = stage.querySelectorAll("img");
  const [leftName, rightName] = stage.querySelectorAll("b");
  const range = stage.querySelector("input");
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
  left.addEventListener("change", () => { update(); move(); });
  right.addEventListener("change", () => { update(); move(); });
  range.addEventListener("input", move);
  update();
  move();
  box.hidden = false;
  box.nextElementSibling.hidden = true;
}
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0];
  const headers = [...table.querySelectorAll("th[data-column]")];
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
