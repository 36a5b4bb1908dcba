// The colours stand in viewer.css alone, once for light and once for dark pages.

function colourOf(root, name) {
  return new THREE.Color(getComputedStyle(root).getPropertyValue(`--adv-${name}`).trim());
}

function onThemeChange(then) {
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", then);
}
