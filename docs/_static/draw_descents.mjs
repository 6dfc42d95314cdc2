// The demonstration in how-to/export_onnx: descents drawn in the browser by onnxruntime-web.
// Everything is loaded from the folder `browser` of this site, which the build of the documentation makes.

const NAMESPACE = "http://www.w3.org/2000/svg";
const WIDTH = 720, HEIGHT = 380, LEFT = 56, RIGHT = 16, TOP = 14, BOTTOM = 44;

function element(parent, name, attributes, text) {
  const made = document.createElementNS(NAMESPACE, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  parent.append(made);
  return made;
}

/** Tick values between two ends: whole multiples of 1, 2 or 5 times a power of ten, about six of them. */
function ticks(low, high) {
  const rough = (high - low) / 6, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough);
  const first = Math.ceil(low / step), count = Math.floor(high / step) - first + 1;
  return Array.from({ length: count }, (_, i) => (first + i) * step);
}

/** Flight level over minutes since entry, a line for each descent. */
function plot(figure, samples, levels) {
  figure.replaceChildren();
  const longest = Math.max(...samples.map((s) => s.time_s.at(-1))) / 60;
  const [bottom, top] = [levels[0], levels.at(-1)];
  const x = (minutes) => LEFT + ((WIDTH - LEFT - RIGHT) * minutes) / longest;
  const y = (level) => HEIGHT - BOTTOM - ((HEIGHT - TOP - BOTTOM) * (level - bottom)) / (top - bottom);
  for (const value of ticks(0, longest)) {
    element(figure, "line", { x1: x(value), x2: x(value), y1: TOP, y2: HEIGHT - BOTTOM, class: "grid" });
    element(figure, "text", { x: x(value), y: HEIGHT - BOTTOM + 18, "text-anchor": "middle" }, value);
  }
  for (const value of ticks(bottom, top)) {
    element(figure, "line", { x1: LEFT, x2: WIDTH - RIGHT, y1: y(value), y2: y(value), class: "grid" });
    element(figure, "text", { x: LEFT - 8, y: y(value) + 4, "text-anchor": "end" }, `FL${value}`);
  }
  element(figure, "text", { x: (LEFT + WIDTH) / 2, y: HEIGHT - 6, "text-anchor": "middle" }, "minutes since entry");
  for (const sample of samples) {
    const points = sample.time_s.map((t, k) => `${x(t / 60).toFixed(1)},${y(sample.level_fl[k]).toFixed(1)}`);
    element(figure, "polyline", { points: points.join(" "), class: "descent" });
  }
}

const median = (values) => values.toSorted((a, b) => a - b)[Math.floor(values.length / 2)];

async function load(base) {
  const get = async (name) => {
    const found = await fetch(new URL(name, base));
    if (!found.ok) throw new Error(`${name} is not part of this copy of the site: it was built without npm`);
    return found;
  };
  const wasm = await (await get("ort-wasm-simd-threaded.wasm")).arrayBuffer();
  const ort = await import(new URL("ort.wasm.bundle.min.mjs", base));
  const { Descents } = await import(new URL("a320.mjs", base));
  ort.env.wasm.numThreads = 1;  // threads would need headers that plain file servers do not send
  ort.env.wasm.wasmBinary = wasm;
  const about = await (await get("a320.json")).json();
  const model = await (await get("a320.onnx")).arrayBuffer();
  const session = await ort.InferenceSession.create(new Uint8Array(model));
  return new Descents(ort, session, about, Date.now());
}

function start(root) {
  const part = (name) => root.querySelector(`[data-part="${name}"]`);
  const base = new URL("../browser/", import.meta.url);
  let descents = null;
  part("draw").addEventListener("click", async () => {
    part("draw").disabled = true;
    try {
      part("said").textContent = "loading onnxruntime-web and the model ...";
      descents ??= await load(base);
      const n = Number(part("number").value);
      const entry_fl = part("entry").value === "" ? null : Number(part("entry").value);
      const before = performance.now();
      const { samples, drawn } = await descents.draw(n, { entry_fl });
      const took = performance.now() - before;
      plot(part("figure"), samples, descents.about.levels_fl);
      const minutes = median(samples.map((s) => s.time_s.at(-1))) / 60;
      const miles = median(samples.map((s) => s.distance_nm.at(-1)));
      part("said").textContent =
        `${samples.length} descents of ${drawn} draws in ${took.toFixed(0)} ms, in this browser; median to ` +
        `FL${descents.about.levels_fl[0]}: ${minutes.toFixed(1)} min, ${miles.toFixed(0)} NM`;
      root.dataset.drawn = samples.length;
    } catch (error) {
      part("said").textContent = `nothing could be drawn: ${error.message}`;
      root.dataset.failed = error.message;
    }
    part("draw").disabled = false;
  });
}

start(document.getElementById("draw-descents"));
