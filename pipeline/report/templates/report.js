for (const box of document.querySelectorAll(".slideshow")) {  // step through the frames of a drawing
  const {slides, photographs} = JSON.parse(box.querySelector("script").textContent);
  const slider = box.querySelector("input"), label = box.querySelector("output");
  const [back, on, play] = box.querySelectorAll("button");
  const overlay = box.querySelector(".overlay"), seen = box.querySelector(".photographs"), facts = box.querySelector(".facts tbody");
  let timer = 0;
  const show = (number) => {
    slider.value = Math.min(Math.max(number, 0), slides.length - 1);
    const slide = slides[slider.value];
    label.textContent = slide.label;
    overlay.innerHTML = slide.overlay;
    seen.replaceChildren(...slide.photographs.map(([caption, picture]) => {
      const image = new Image(), words = document.createElement("p");
      image.src = "data:image/jpeg;base64," + photographs[picture];
      image.alt = words.textContent = caption;
      const both = document.createElement("div");
      both.append(image, words);
      return both;
    }));
    facts.replaceChildren(...slide.facts.map((cells) => {
      const row = document.createElement("tr");
      row.append(...cells.map((text) => { const cell = document.createElement("td"); cell.textContent = text; return cell; }));
      return row;
    }));
  };
  const stop = () => { clearInterval(timer); timer = 0; play.textContent = "play"; };
  const go = (number) => { stop(); show(number); };
  slider.addEventListener("input", () => go(Number(slider.value)));
  back.addEventListener("click", () => go(Number(slider.value) - 1));
  on.addEventListener("click", () => go(Number(slider.value) + 1));
  play.addEventListener("click", () => {
    if (timer) { stop(); return; }
    play.textContent = "pause";
    if (Number(slider.value) === slides.length - 1) show(0);
    timer = setInterval(() => { if (Number(slider.value) < slides.length - 1) show(Number(slider.value) + 1); else stop(); }, 200);
  });
  show(0);
}
const large = document.getElementById("large");  // a click on a picture enlarges it, another one closes it
document.addEventListener("click", (event) => {
  if (large.open) { large.close(); return; }
  const picture = event.target.closest(".paper > img, .photographs img, .drawing > svg, .drawn > svg");
  if (!picture) return;
  const copy = picture.cloneNode(true);
  copy.classList.toggle("lines", picture.parentElement.classList.contains("lines"));
  large.replaceChildren(copy);
  large.showModal();
});
for (const table of document.querySelectorAll("table.sortable")) {  // a click on a column's head sorts by it
  table.tHead.addEventListener("click", (event) => {
    const head = event.target.closest("th"), column = head.cellIndex, body = table.tBodies[0];
    const up = head.getAttribute("aria-sort") !== "ascending", text = (row) => row.cells[column].textContent.trim();
    const compare = (a, b) => {
      const one = parseFloat(text(a).replace(/\u2009/g, "")), other = parseFloat(text(b).replace(/\u2009/g, ""));
      if (!isNaN(one) && !isNaN(other)) return one - other;
      return isNaN(one) !== isNaN(other) ? (isNaN(one) ? 1 : -1) : text(a).localeCompare(text(b));
    };
    body.append(...[...body.rows].sort((a, b) => up ? compare(a, b) : compare(b, a)));
    for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", up ? "ascending" : "descending");
  });
}
