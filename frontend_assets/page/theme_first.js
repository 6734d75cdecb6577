// Runs before the first paint, so that a remembered choice does not flash.
(function () {
  try {
    const saved = localStorage.getItem("keyhole-theme");
    if (saved === "light" || saved === "dark") document.documentElement.dataset.theme = saved;
  } catch {
    // Storage may be forbidden: the system's preference applies.
  }
})();
