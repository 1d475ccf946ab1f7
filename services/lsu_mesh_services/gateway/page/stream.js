// The connection to the gateway: opens again by itself, and says when it is lost.

const SILENT_MS = 4000; // health comes once a second
const RETRY_MS = 1000;

export class Stream {
  // `hear(kind, value, id)` gets each event; `tell(state)` gets "connecting", "live" or "lost".
  constructor(path, { hear, tell, opened }) {
    Object.assign(this, { path, hear, tell, opened });
    this.source = null;
    this.timer = 0;
    this.last = 0;
    document.addEventListener("visibilitychange", () => (document.hidden ? this.close() : this.open()));
    setInterval(() => this.check(), RETRY_MS);
    this.open();
  }

  open() {
    if (this.source || document.hidden) return;
    const source = (this.source = new EventSource(this.path));
    this.last = performance.now();
    source.onopen = () => this.opened();
    source.onerror = () => this.lose(source);
    for (const kind of ["estimate", "health", "event"]) {
      source.addEventListener(kind, (message) => {
        this.last = performance.now();
        this.tell("live");
        this.hear(kind, JSON.parse(message.data), message.lastEventId);
      });
    }
  }

  lose(source) {
    if (source !== this.source) return;
    this.close();
    this.tell("lost");
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.open(), RETRY_MS);
  }

  // A connection whose other end vanished says nothing: silence tells.
  check() {
    if (this.source && performance.now() - this.last > SILENT_MS) this.lose(this.source);
  }

  close() {
    this.source?.close();
    this.source = null;
  }
}
