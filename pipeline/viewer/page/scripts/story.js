// The story of one box in words: what it is, and every fact on the clean and on the attacked cloud.

const OUTCOMES = {
  found: "found", displaced: "displaced", lost: "lost", missed: "missed", ignored: "not evaluated",
  changed: "by the attack", hit: "finds an object", false: "false positive",
  true: "true position", claimed: "claimed by the attack", believed: "believed position", withheld: "not sent",
};

function storyOf(box) {
  const table = element("table", "adv-facts", "");
  const both = box.facts.some((fact) => fact.length > 2);
  if (both) table.append(lineOf("th", ["", "clean", "attacked"]));
  for (const [name, ...values] of box.facts) {
    const line = lineOf("td", [name, ...values]);
    if (both && values.length === 1) line.lastChild.colSpan = 2;
    table.append(line);
  }
  const title = element("h4", "adv-title", box.title);
  if (OUTCOMES[box.outcome]) title.append(" ", element("span", `adv-chip adv-${box.outcome}`, OUTCOMES[box.outcome]));
  return box.lead ? [title, element("p", "adv-lead", box.lead), table] : [title, table];
}

function lineOf(tag, cells) {
  const line = document.createElement("tr");
  line.append(...cells.map((cell, i) => element(i ? tag : "th", i ? "" : "adv-fact", cell)));
  return line;
}
