"use strict";
(() => {
  // Tables: a heading sorts the rows of each body; rows without a value come last.
  const valueOf = (row, column) => {
    const cell = row.cells[column];
    if (!cell) return null;
    if (cell.dataset.value !== undefined) return Number(cell.dataset.value);
    return cell.classList.contains("number") ? null : cell.textContent.trim();
  };
  const compare = (a, b) =>
    typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true });
  for (const table of document.querySelectorAll("table.sortable")) {
    const headings = [...table.tHead.rows[0].cells];
    headings.forEach((heading, column) => {
      heading.querySelector("button").addEventListener("click", () => {
        const direction = heading.getAttribute("aria-sort") === "ascending" ? -1 : 1;
        for (const other of headings) other.setAttribute("aria-sort", "none");
        heading.setAttribute("aria-sort", direction === 1 ? "ascending" : "descending");
        for (const body of table.tBodies) {
          const rows = [...body.rows].filter((row) => !row.classList.contains("separator"));
          rows.sort((left, right) => {
            const a = valueOf(left, column);
            const b = valueOf(right, column);
            if (a === null || b === null) return (a === null) - (b === null);
            return direction * compare(a, b);
          });
          body.append(...rows);
        }
      });
    });
  }

  // A link to the folds of a row opens their details.
  const reveal = () => {
    const target = location.hash.length > 1 && document.getElementById(location.hash.slice(1));
    if (!(target instanceof HTMLDetailsElement)) return;
    for (let open = target; open; open = open.parentElement.closest("details")) open.open = true;
    target.scrollIntoView();
  };
  addEventListener("hashchange", reveal);
  reveal();

  // A hint and a shadow at the edge mark content that is wider than its frame.
  for (const frame of document.querySelectorAll(".scroll")) {
    const hint = document.createElement("p");
    hint.className = "hint";
    hint.textContent = "Scrolls sideways \u2192";
    hint.setAttribute("aria-hidden", "true");
    hint.hidden = true;
    frame.before(hint);
    const measure = () => (hint.hidden = frame.scrollWidth <= frame.clientWidth + 1);
    new ResizeObserver(measure).observe(frame);
  }

  // Open all details for printing.
  const unfolded = [];
  addEventListener("beforeprint", () => {
    for (const folded of document.querySelectorAll("details:not([open])")) {
      folded.open = true;
      unfolded.push(folded);
    }
  });
  addEventListener("afterprint", () => {
    for (const folded of unfolded.splice(0)) folded.open = false;
  });

  // Matrices: pointing at a cell, or moving to it with the arrow keys, shows its content.
  const tip = document.createElement("div");
  tip.className = "tip";
  tip.hidden = true;
  tip.setAttribute("aria-hidden", "true");
  const spoken = document.createElement("p");
  spoken.className = "hidden";
  spoken.setAttribute("aria-live", "polite");
  document.body.append(tip, spoken);

  const describe = ({ names, counts, shares }, row, column) => {
    const cell = `true ${names[row]}, predicted ${names[column]}: `;
    if (shares) return `${cell}${(100 * shares[row][column]).toFixed(1)} %`;
    const total = counts[row].reduce((sum, count) => sum + count, 0);
    const count = counts[row][column];
    return `${cell}${count} of ${total} (${((100 * count) / Math.max(1, total)).toFixed(1)} %)`;
  };

  for (const matrix of document.querySelectorAll(".matrix")) {
    const svg = matrix.querySelector("svg");
    const data = JSON.parse(matrix.dataset.matrix);
    const size = data.names.length;
    const [left, top, cell] = ["left", "top", "cell"].map((name) => Number(matrix.dataset[name]));
    let at = null;
    // The tip shows the same text as the browser's tooltips.
    for (const title of svg.querySelectorAll(".heat title")) title.remove();
    // The matrix handles the arrow keys, also under a screen reader.
    matrix.setAttribute("role", "application");
    matrix.setAttribute("aria-roledescription", "confusion matrix");
    const cursor = document.createElementNS(svg.namespaceURI, "rect");
    cursor.setAttribute("class", "cursor");
    cursor.setAttribute("width", cell);
    cursor.setAttribute("height", cell);

    const hide = () => {
      tip.hidden = true;
      cursor.remove();
    };
    const show = (row, column) => {
      at = [row, column];
      cursor.setAttribute("x", left + cell * column);
      cursor.setAttribute("y", top + cell * row);
      if (!cursor.isConnected) svg.append(cursor);
      tip.textContent = describe(data, row, column);
      tip.hidden = false;
      const box = cursor.getBoundingClientRect();
      const room = document.documentElement.clientWidth - tip.offsetWidth - 4;
      const above = box.top - tip.offsetHeight - 6;
      tip.style.left = `${Math.max(4, Math.min(box.left, room))}px`;
      tip.style.top = `${above > 0 ? above : box.bottom + 6}px`;
    };
    const point = (event) => {
      const place = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      const column = Math.floor((place.x - left) / cell);
      const row = Math.floor((place.y - top) / cell);
      if (row < 0 || column < 0 || row >= size || column >= size) hide();
      else show(row, column);
    };
    const walk = (row, column) => {
      show(row, column);
      const box = cursor.getBoundingClientRect();
      const frame = matrix.getBoundingClientRect();
      if (box.left < frame.left) matrix.scrollLeft -= frame.left - box.left + 3 * cell;
      if (box.right > frame.right) matrix.scrollLeft += box.right - frame.right + 3 * cell;
      cursor.scrollIntoView({ block: "nearest", inline: "nearest" });
      show(row, column);
      spoken.textContent = tip.textContent;
    };

    svg.addEventListener("pointermove", point);
    svg.addEventListener("pointerdown", point);
    svg.addEventListener("pointerleave", (event) => {
      if (event.pointerType === "mouse") hide();
    });
    matrix.addEventListener("scroll", () => (tip.hidden = true));
    matrix.addEventListener("focus", () => {
      if (matrix.matches(":focus-visible") && size > 0) walk(...(at ?? [0, 0]));
    });
    matrix.addEventListener("blur", hide);
    matrix.addEventListener("keydown", (event) => {
      const [row, column] = at ?? [0, 0];
      const last = size - 1;
      const moves = {
        ArrowUp: [Math.max(0, row - 1), column],
        ArrowDown: [Math.min(last, row + 1), column],
        ArrowLeft: [row, Math.max(0, column - 1)],
        ArrowRight: [row, Math.min(last, column + 1)],
        Home: [row, 0],
        End: [row, last],
      };
      if (event.key === "Escape") hide();
      if (!moves[event.key] || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      walk(...moves[event.key]);
    });
  }
  addEventListener("scroll", () => (tip.hidden = true), { passive: true });
})();
