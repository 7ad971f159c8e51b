"use strict";
const page = JSON.parse(document.getElementById("data").textContent);

// -- tables as files -------------------------------------------------------------------------

function save(name, text) {
  // Spreadsheets read other letters than ASCII only behind a mark.
  const mark = /[^\x00-\x7f]/.test(text) ? "\ufeff" : "";
  const address = URL.createObjectURL(new Blob([mark, text], { type: "text/csv;charset=utf-8" }));
  const link = document.createElement("a");
  link.href = address;
  link.download = name;
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(address), 60000);
}

for (const button of document.querySelectorAll("button[data-file]")) {
  const name = button.dataset.file;
  button.addEventListener("click", () => save(name, page.files[name]));
}
