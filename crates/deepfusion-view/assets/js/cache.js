// A least-recently-used cache with a limit in bytes.

export class Cache {
  constructor(mostBytes, dropped = () => {}) {
    this.most = mostBytes;
    this.bytes = 0;
    this.entries = new Map();
    this.dropped = dropped;
  }

  get(key) {
    const entry = this.entries.get(key);
    if (!entry) return undefined;
    // A map keeps its entries in insertion order, so the last used one is moved to the end.
    this.entries.delete(key);
    this.entries.set(key, entry);
    return entry.value;
  }

  has(key) { return this.entries.has(key); }

  set(key, value, bytes) {
    this.delete(key);
    this.entries.set(key, { value, bytes });
    this.bytes += bytes;
    for (const [oldest] of this.entries) {
      if (this.bytes <= this.most || oldest === key) break;
      this.delete(oldest);
    }
  }

  delete(key) {
    const entry = this.entries.get(key);
    if (!entry) return;
    this.entries.delete(key);
    this.bytes -= entry.bytes;
    this.dropped(entry.value);
  }
}
