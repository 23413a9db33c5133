// Before the first paint, so that a chosen theme does not flash.
try {
  const chosen = localStorage.getItem("subtense.theme");
  if (chosen === "light" || chosen === "dark") document.documentElement.dataset.theme = chosen;
} catch {
  // no storage: the system's theme
}
