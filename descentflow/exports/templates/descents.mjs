// Draws descents by a sampler that `descentflow export --to onnx` wrote, through onnxruntime-web or onnxruntime-node.
//
//   import * as ort from "onnxruntime-node";                       // or "onnxruntime-web"
//   import { Descents } from "./a320.mjs";
//   const about = JSON.parse(fs.readFileSync("a320.json"));        // in a browser: await (await fetch("a320.json")).json()
//   const descents = new Descents(ort, await ort.InferenceSession.create("a320.onnx"), about, 0);
//   const { samples, drawn } = await descents.draw(100, { entry_fl: 330 });
//   samples[0].time_s, samples[0].level_fl, samples[0].CAS, ...    // from the entry level down

const PROFILES = ["time_s", "CAS", "Mach", "TAS", "vertical_rate", "drag_n", "thrust_n", "fuel_flow_kg_s", "fuel_kg", "co2_kg", "distance_nm"];

/** Random numbers that a seed repeats: sfc32, its state filled by splitmix32. */
export class Random {
  constructor(seed = 0) {
    let state = seed >>> 0;
    const next = () => {
      state = (state + 0x9e3779b9) >>> 0;
      let z = state;
      z = Math.imul(z ^ (z >>> 16), 0x21f0aaad);
      z = Math.imul(z ^ (z >>> 15), 0x735a2d97);
      return (z ^ (z >>> 15)) >>> 0;
    };
    [this.a, this.b, this.c, this.d] = [next(), next(), next(), 1];
    for (let i = 0; i < 12; i++) this.bits();
  }

  bits() {
    const sum = (this.a + this.b + this.d) >>> 0;
    this.d = (this.d + 1) >>> 0;
    this.a = this.b ^ (this.b >>> 9);
    this.b = (this.c + (this.c << 3)) >>> 0;
    this.c = (((this.c << 21) | (this.c >>> 11)) + sum) >>> 0;
    return sum;
  }

  /** Uniform in [0, 1), to 53 bits. */
  uniform() {
    return ((this.bits() >>> 5) * 67108864 + (this.bits() >>> 6)) / 9007199254740992;
  }

  /** Standard normal, by Box and Muller. */
  normal() {
    return Math.sqrt(-2 * Math.log(1 - this.uniform())) * Math.cos(2 * Math.PI * this.uniform());
  }
}

export class Descents {
  /** `ort`: the library; `session`: of NAME.onnx; `about`: NAME.json, parsed; `seed`: the same seed, the same descents. */
  constructor(ort, session, about, seed = 0) {
    Object.assign(this, { ort, session, about, random: new Random(seed) });
    this.widths = Object.fromEntries(
      Object.entries(about.inputs.sampler).map(([name, input]) => [name, input.shape[1] ?? 1]),
    );
  }

  /** A level where descents start, drawn as the training flights entered. */
  entry() {
    const { levels_fl, entry_share } = this.about;
    let left = this.random.uniform();
    const k = entry_share.findIndex((share) => (left -= share) < 0);
    return levels_fl[k < 0 ? entry_share.findLastIndex((share) => share > 0) : k];
  }

  /**
   * n plausible descents. `entry_fl`: where all of them start, as the training flights did if absent; `context`: the
   * encoded numbers of a conditional model (see `about.context`). What the model does not accept is drawn again with the
   * same entry level, so that levels stay as frequent as among flights.
   */
  async draw(n, { entry_fl = null, context = null, budget = Math.max(100 * n, 10000) } = {}) {
    let waiting = Array.from({ length: n }, (_, i) => this.request(i, entry_fl, context));
    const samples = new Array(n);
    let drawn = 0;
    while (waiting.length && drawn < budget) {
      const found = await this.run(waiting);
      drawn += waiting.length;
      waiting = waiting.filter((request, row) => {
        if (found.accepted.data[row]) samples[request.place] = this.sample(found, row);
        return !found.accepted.data[row];
      });
      waiting = waiting.map((request) => this.request(request.place, request.entry_fl, context));
    }
    if (waiting.length) throw new Error(`${n - waiting.length} of ${n} descents accepted after ${drawn} draws`);
    return { samples, drawn };
  }

  request(place, entry_fl, context) {
    return { place, entry_fl: entry_fl ?? this.entry(), uniform: this.random.uniform(), context };
  }

  /** One call of the model: its outputs as they are, a row for each request. */
  async run(requests) {
    const rows = (width, value) =>
      requests.flatMap((request) => Array.from({ length: width }, (_, k) => value(request, k)));
    const values = {
      noise: () => this.random.normal(),
      neighbour: () => this.random.uniform(),
      entry_fl: (request) => request.entry_fl,
      uniform: (request) => request.uniform,
      context: (request, k) => request.context[k],
    };
    const Numbers = this.about.precision === "float64" ? Float64Array : Float32Array;
    const feeds = {};
    for (const [name, { shape }] of Object.entries(this.about.inputs.sampler)) {
      const data = Numbers.from(rows(this.widths[name], values[name]));
      feeds[name] = new this.ort.Tensor(this.about.precision, data, [requests.length, ...shape.slice(1)]);
    }
    return this.session.run(feeds);
  }

  /** One descent as arrays from the entry level down, in the units of `about.outputs`. */
  sample(found, row) {
    const levels = found.level_fl.data;
    const begin = row * levels.length;
    const one = { level_fl: [] };
    for (const name of PROFILES) one[name] = [];
    for (let k = levels.length - 1; k >= 0; k--) {
      if (Number.isNaN(found.time_s.data[begin + k])) continue;
      one.level_fl.push(levels[k]);
      for (const name of PROFILES) one[name].push(found[name].data[begin + k]);
    }
    return one;
  }
}
