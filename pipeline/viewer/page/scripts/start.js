// Starts every viewer of the page when it comes into sight.

async function start(root) {
  let viewer;
  try {
    const source = await sourceOf(root);
    viewer = new Viewer(root, source);
  } catch (error) {
    const text = "The scene cannot be drawn here (no WebGL?): ";
    root.querySelector(".adv-story").replaceChildren(element("p", "adv-lead", text + error.message));
    return;
  }
  root.dataset.started = "yes";
  await viewer.go(viewer.runs()[0]?.[0] ?? 0);
}

const watcher = new IntersectionObserver((entries) => {
  for (const { isIntersecting, target } of entries) {
    if (!isIntersecting) continue;
    watcher.unobserve(target);
    start(target);
  }
}, { rootMargin: "400px" });
for (const root of document.querySelectorAll(".adv-viewer")) watcher.observe(root);
