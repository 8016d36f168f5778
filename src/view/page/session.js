// ---- a session: what the operator is to do now, and how it goes ----

class Session {
  constructor() {
    this.told = null;
    document.querySelector("main").classList.add("led");
    byId("session").hidden = false;
    byId("time").hidden = true;
    document.querySelector(".hint").hidden = true;
  }

  show(told) {
    this.told = told;
    const { instruction, asked, remark, holds, recorded_s: recorded, trial, next, verdict } = told;
    put("do", instruction);
    put("asked", asked);
    put("remark", remark);
    const now = performance.now();
    this.until = holds ? now + 1000 * holds.left_s : null;
    this.lasts = holds ? 1000 * holds.lasts_s : null;
    this.since = recorded === null ? null : now - 1000 * recorded;
    const done = trial ? trial.good + trial.marked_good : 0;
    put("repetition", trial ? `${Math.min(done + 1, trial.wanted)} of ${trial.wanted}${done >= trial.wanted ? ", all done" : ""}` : "");
    byId("repetition").closest("div").hidden = !trial;
    const marked = trial && recorded !== null ? `; in this trial ${trial.marked_good} good, ${trial.marked_bad} bad` : "";
    put("place", trial ? `${trial.action}, ${trial.subjects}; action ${trial.number} of ${trial.total}; ${trial.good} kept${marked}` : "");
    put("verdict", verdict ? verdict.words : "nothing yet");
    byId("verdict").className = verdict ? (verdict.kept ? "kept" : "again") : "";
    const list = next.join("\n");
    if (this.list !== list) {
      this.list = list;
      byId("next").replaceChildren(...next.map(text => { const item = document.createElement("li"); item.textContent = text; return item; }));
    }
    this.run();
    const { dataset } = document.documentElement;
    dataset.instruction = instruction; dataset.asked = asked;
  }

  // The clocks run between what is told.
  run() {
    const now = performance.now(), place = byId("count");
    place.hidden = this.until === null && this.since === null;
    if (place.hidden) return;
    const left = this.until === null ? null : Math.max(0, this.until - now);
    byId("left").textContent = left === null ? `recorded for ${((now - this.since) / 1000).toFixed(1)} s` : `${(left / 1000).toFixed(1)} s`;
    const bar = byId("gone");
    bar.hidden = left === null;
    if (left !== null) bar.value = this.lasts > 0 ? 1 - left / this.lasts : 1;
  }
}
