// The list of peers, what is wrong, and the events.

const WORDS = { OK: "OK", WARN: "warning", ERROR: "error", STALE: "gone" };
const OF_MESH = { OK: "all well", WARN: "warnings", ERROR: "errors", STALE: "peers are missing" };
const MARKS = { OK: "●", WARN: "▲", ERROR: "✖", STALE: "✖" };
const MAX_EVENTS = 50;

export function showLevel(element, level) {
  element.dataset.level = level;
  element.textContent = level in OF_MESH ? `${MARKS[level]} ${OF_MESH[level]}` : "not known";
}

// The state of a peer in a word: one that never came has not gone.
function word(peer) {
  return peer.level === "STALE" && peer.age_s === null ? "absent" : WORDS[peer.level];
}

export function showPeers(body, peers) {
  keep(body, peers, (peer) => peer.name, newRow, (row, peer) => {
    row.dataset.level = peer.level;
    row.querySelector("small").textContent = peer.role + (peer.host ? ` on ${peer.host}` : "");
    const badge = row.querySelector(".badge");
    badge.dataset.level = peer.level;
    badge.textContent = `${MARKS[peer.level]} ${word(peer)}`;
    row.querySelector(".number").textContent = peer.step ? peer.step.toLocaleString("en") : "–";
    row.querySelector("time").textContent = clock(peer.since_ns);
    row.title = peer.reasons.join("\n");
  });
}

function newRow(peer) {
  const row = document.createElement("tr");
  row.dataset.peer = peer.name;
  row.innerHTML =
    '<th scope="row"><span></span><small></small></th><td><span class="badge"></span></td>' +
    '<td class="number"></td><td><time></time></td>';
  row.querySelector("th span").textContent = peer.name;
  return row;
}

// One line for each thing that is wrong; a line that stays is not touched, so that it is read out once.
export function showProblems(list, health, isLost) {
  const found = [];
  if (isLost) {
    found.push({ id: "gateway", level: "ERROR", text: "The gateway does not answer. Trying again; what is drawn is old." });
  } else if (health) {
    if (!health.links) {
      const where = health.trying.join(", ") || "nobody";
      found.push({ id: "links", level: "ERROR", text: `The gateway is connected to nobody, trying ${where}.` });
    }
    for (const peer of health.peers.filter((one) => one.level !== "OK")) found.push(problem(peer));
    if (health.refused) {
      const text = `The gateway refused ${health.refused} messages, the last: ${health.last_refusal}`;
      found.push({ id: "refused", level: "WARN", text });
    }
    if (!found.length) found.push({ id: "fine", level: "OK", text: "Nothing is wrong." });
  }
  keep(list, found, (one) => one.id, () => document.createElement("li"), (line, one) => {
    line.dataset.level = one.level;
    if (line.textContent !== one.text) line.textContent = one.text;
  });
}

function problem(peer) {
  const why = peer.reasons.map((one) => one.replace(/ (in|for) [\d.]+ s$/, "")).join("; ");
  const what = why || "no reason given";
  const who = peer.role === peer.name ? peer.name : `${peer.role} ${peer.name}`;
  return { id: `peer ${peer.name}`, level: peer.level, text: `${who} (${word(peer)}): ${what}` };
}

export function showEvent(list, event, id) {
  if ([...list.children].some((line) => line.dataset.id === id)) return;
  const line = document.createElement("li");
  line.dataset.id = id;
  line.dataset.level = event.level;
  const time = document.createElement("time");
  time.textContent = clock(event.sent_ns);
  line.append(time, `${event.name}: ${event.text}`);
  list.prepend(line);
  while (list.children.length > MAX_EVENTS) list.lastChild.remove();
}

function clock(ns) {
  return new Date(Number(BigInt(ns) / 1000000n)).toLocaleTimeString("en-GB");
}

// Children of `parent`, one per value, in this order; those that stay are changed in place.
export function keep(parent, values, key, make, change) {
  const known = new Map([...parent.children].map((child) => [child.dataset.key, child]));
  values.forEach((value, i) => {
    const name = key(value);
    let child = known.get(name);
    known.delete(name);
    if (!child) {
      child = make(value);
      child.dataset.key = name;
    }
    change(child, value);
    if (parent.children[i] !== child) parent.insertBefore(child, parent.children[i] ?? null);
  });
  for (const child of known.values()) child.remove();
}
