"use strict";
// Start of every page of abbe: labels in two languages, downloads, and a check that the file is complete.
const $ = id => document.getElementById(id), labels = JSON.parse($("labels").textContent);
let language = document.documentElement.lang;
const L = key => { if (!labels[key]) throw new Error("no label " + key); return labels[key][language]; };
function translate() {
  document.documentElement.lang = language;
  document.querySelectorAll("[data-label]").forEach(e => { e.textContent = L(e.dataset.label); });
  document.querySelectorAll("[data-aria]").forEach(e => { e.setAttribute("aria-label", L(e.dataset.aria)); });
}
function save(blob, name) {
  const a = document.createElement("a");
  a.href = URL.createObjectURL(blob); a.download = name; a.click();
  setTimeout(() => URL.revokeObjectURL(a.href), 1e4);
}
function isWhole() {
  if ($("end")) return true;
  $("busy").textContent = L("cut_off"); window.failed = "cut off";
  return false;
}
