// A sensor and a reader in JavaScript, over `lsu-mesh gateway --http 127.0.0.1:8080`: no package is needed.
// In a browser, or with Node 18 or newer:  node gateway.mjs http://127.0.0.1:8080 gauge main TOKEN
// Times of 64 bits are strings of digits, because a JavaScript number would lose their last digits.

export async function publish(base, sensor, token, y, time = "now") {
  const answer = await fetch(`${base}/measurements/${sensor}`, {
    method: "POST",
    headers: { Authorization: `Bearer ${token}`, "Content-Type": "application/json" },
    body: JSON.stringify({ y, time }), // y: a list, null where nothing was measured
  });
  if (!answer.ok) {
    const { error, remedy } = await answer.json();
    throw new Error(`${answer.status}: ${error}; ${remedy}`);
  }
}

// Every estimate of a filter or a fusion, as it comes, for ever: a lost connection is opened again.
export async function* estimates(base, name) {
  for (;;) {
    try {
      const answer = await fetch(`${base}/estimates/${name}`, { headers: { Accept: "text/event-stream" } });
      if (!answer.ok) throw new Error(`${answer.status}: ${(await answer.json()).error}`);
      let rest = "";
      for await (const bytes of answer.body.pipeThrough(new TextDecoderStream())) {
        const events = (rest + bytes).split("\n\n");
        rest = events.pop();
        for (const event of events) {
          const data = event.split("\n").find((line) => line.startsWith("data: "));
          if (data) yield JSON.parse(data.slice("data: ".length));
        }
      }
    } catch (error) {
      console.error(String(error.cause ?? error));
    }
    await new Promise((again) => setTimeout(again, 1000));
  }
}

// In a page the browser does the same: new EventSource("/estimates/main").addEventListener("estimate", …)

if (typeof process !== "undefined" && process.argv.length > 5) {
  const [base, sensor, filter, token] = process.argv.slice(2);
  setInterval(() => publish(base, sensor, token, [Math.sin(Date.now() / 1000)]).catch((e) => console.error(e.message)), 100);
  for await (const { step, lower, upper, sent_ns } of estimates(base, filter))
    console.log(step, lower, upper, BigInt(sent_ns) / 1_000_000n);
}
