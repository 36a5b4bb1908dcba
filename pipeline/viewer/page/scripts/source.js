// Where scenes come from: scripts of the page itself, or the server of `advpipe view`.

function sourceOf(root) {
  return root.dataset.source === "server" ? serverSource() : pageSource(root);
}

// Resolves to { frames: [title], options: [name of a bag], attacked: [first and last frames in a row, of each option],
// scene(number, number of an option) }.
async function pageSource(root) {
  const scripts = [...root.querySelectorAll("script.adv-scene")];
  return {
    frames: scripts.map((script) => script.dataset.title),
    options: [],
    attacked: [],
    scene: async (number) => decodeScene(JSON.parse(scripts[number].textContent)),
  };
}

const KEPT_SCENES = 12;

async function serverSource() {
  const about = await fetchJson("bag.json");
  const scenes = new Map(); // the latest ones, each a promise
  const scene = (number, option) => {
    const key = `scene/${option}/${number}.json`;
    const known = scenes.get(key) || fetchJson(key).then(decodeScene);
    scenes.delete(key);
    scenes.set(key, known);
    known.catch(() => scenes.delete(key));
    if (scenes.size > KEPT_SCENES) scenes.delete(scenes.keys().next().value);
    return known;
  };
  return { ...about, scene };
}

async function fetchJson(path) {
  const answer = await fetch(path);
  if (!answer.ok) throw new Error((await answer.text()).slice(0, 300));
  return answer.json();
}
