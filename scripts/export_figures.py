"""Draw what other programs make of exported samples: python scripts/export_figures.py NAME best.ckpt FIGURE.png."""

import importlib
import json
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import descentflow as df
from descentflow.exports.export import export
from descentflow.reporting.figure_file import write_figure
from descentflow.reporting.figure_style import MODELS, tidy

WHERE = {
    "route": [(53.6, 2.6), (53.0, 3.6), (52.62, 4.75), (52.3, 4.76)],
    "to_go_nm": 30.0,
    "wind": "150:270/20,350:280/60",
    "end_time": "2026-11-22T10:00:00Z",
}


def cf(checkpoint: str, folder: Path) -> Figure:
    """The CF file as xarray reads it."""
    import xarray

    export(checkpoint, "cf", folder / "s.nc", n=12, **WHERE)
    data = xarray.open_dataset(folder / "s.nc")
    figure = Figure(figsize=(8.5, 3.6), layout="constrained")
    axes = figure.subplots()
    for k in range(data.sizes["trajectory"]):
        descent = data.isel(trajectory=k)
        dots = axes.scatter(descent.time, descent.altitude, c=descent.TAS, s=4, vmin=330, vmax=470, cmap="cividis")
    figure.colorbar(dots, ax=axes, label="true airspeed, kt")
    axes.set(xlabel="time, UTC", ylabel="pressure altitude, ft", title="12 trajectories of a CF file, read by xarray")
    tidy([axes])
    return figure


def traffic(checkpoint: str, folder: Path) -> Figure:
    """Flights in traffic, resampled and with its phases."""
    from traffic.core import Traffic

    export(checkpoint, "traffic", folder / "t.parquet", n=12, **WHERE)
    flights = Traffic.from_file(folder / "t.parquet").resample("5s").phases().eval(max_workers=1)
    figure = Figure(figsize=(10, 3.8), layout="constrained")
    ground, vertical = figure.subplots(1, 2, width_ratios=[1, 1.6])
    colours = {"DESCENT": MODELS[0][0], "NA": "#8c8c8c", "CRUISE": MODELS[1][0], "LEVEL": MODELS[2][0]}
    for flight in flights:
        ground.plot(flight.data.longitude, flight.data.latitude, color=MODELS[1][0], linewidth=0.8)
        for name, part in flight.data.groupby("phase"):
            vertical.scatter(part.timestamp, part.altitude, s=3, color=colours.get(name, "black"), label=name)
    ground.plot(4.76, 52.3, "k^")
    ground.set_aspect(1 / np.cos(np.radians(53)))
    ground.set(xlabel="longitude, degrees", ylabel="latitude, degrees", title="12 flights in traffic")
    vertical.set(xlabel="time, UTC", ylabel="altitude, ft", title="resampled at 5 s, phases by traffic")
    named = dict(zip(*vertical.get_legend_handles_labels()[::-1], strict=True))
    vertical.legend(named.values(), named.keys(), frameon=False, markerscale=4)
    tidy([ground, vertical])
    return figure


def bluesky(checkpoint: str, folder: Path) -> Figure:
    """A scenario and the plugin as BlueSky flies them, next to the samples."""
    flyer = Path(__file__).resolve().parents[1] / "tests" / "fly_in_bluesky.py"
    own = df.sample(checkpoint, 40, seed=0).to_polars()
    figure = Figure(figsize=(10, 3.8), layout="constrained")
    vertical, errors = figure.subplots(1, 2, width_ratios=[1.6, 1])
    for k, name in enumerate(("flights.scn", "flights.py")):
        export(checkpoint, "bluesky", folder / name, n=40, every_s=0.0, **{**WHERE, "end_time": None})
        plan = {"files": [str(folder / name)], "step_s": 0.5, "commands": [], "until_s": 7200}
        if name.endswith(".py"):
            plan |= {"files": [str(folder / name), str(folder / "flights.json")], "until_s": 1200}
            for i, sample in enumerate(own.partition_by("sample_id", maintain_order=True)):
                made = f"CRE DF{i:05d} A320 {i * 0.5 - 40} 0 90 {sample['altitude_ft'][0] + 1000} {sample['CAS'][0]}"
                plan["commands"] += [(0, made), (1, f"DFSAMPLE DF{i:05d} {i}"), (1, f"ALT DF{i:05d} 13000")]
        (folder / "plan.json").write_text(json.dumps(plan))
        words = [sys.executable, "-W", "ignore", flyer, folder / "plan.json", folder / "flown.json"]
        subprocess.run(words, check=True)
        flown = json.loads((folder / "flown.json").read_text())["flights"]
        states = {callsign: np.array(rows) for callsign, rows in flown.items()}
        off = []
        for number in range(40):
            state, sampled = states[f"DF{number:05d}"], own.filter(sample_id=number)
            grid = np.arange(15_500.0, sampled["altitude_ft"][0] - 500, 500.0)
            flown_s = np.interp(-grid, -state[:, 1], state[:, 0])
            time_s = np.interp(-grid, -sampled["altitude_ft"].to_numpy(), sampled["time_s"].to_numpy())
            flown_s -= flown_s[-1] - time_s[-1]
            off.append((flown_s - time_s)[0])
            if k == 0 and number < 8:
                vertical.plot(sampled["time_s"] / 60, sampled["altitude_ft"], color="black", linewidth=0.8)
                vertical.plot(flown_s / 60, grid, "o", color=MODELS[0][0], markersize=2)
        label = f"{'scenario' if k == 0 else 'plugin'}: {np.mean(off):+.2f} s, spread {np.std(off):.2f} s"
        errors.plot(sorted(off), (np.arange(40) + 0.5) / 40, MODELS[k][1], color=MODELS[k][0], label=label)
    vertical.set(xlabel="minutes since the entry level", ylabel="altitude, ft", title="8 samples, as BlueSky flew them")
    errors.set(xlabel="time flown minus sampled, s", ylabel="share of 40 flights", title="top of descent to FL155")
    errors.legend(frameon=False, fontsize=8, loc="upper left")
    tidy([vertical, errors])
    return figure


def bluebird(checkpoint: str, folder: Path) -> Figure:
    """Times of 600 flights of bluebird-dt by the exported predictor, and by its own class."""
    from bluebird_dt.core import Aircraft
    from bluebird_dt.predictor.linear_predictor import LinearPredictor

    export(checkpoint, "bluebird", folder / "sampled_a320.py", n=2000)
    sys.path.insert(0, str(folder))
    sampled = importlib.import_module("sampled_a320").SampledDescents

    def seconds(predictor: Any, seed: int) -> float:
        flight = Aircraft(
            lat=51.0, lon=0.0, fl=340.0, heading=90.0, flight_plan=None, callsign=f"A{seed}", selected_fl=140,
            aircraft_type="A320", random_seed=seed,
        )  # fmt: skip
        flight.on_route, flight.selected_instructions.heading = False, 90.0
        points, _ = predictor._predict(flight, 1500.0)
        return float(np.interp(-150.0, [-point.fl for point in points], [point.time for point in points]))

    flown = df.sample(checkpoint, 2000).trajectories
    top, low = (flown.levels_fl.tolist().index(level) for level in (340.0, 150.0))
    own = (flown.time_s[:, low] - flown.time_s[:, top])[flown.entry >= top].numpy()
    times = {"the samples": own}
    made = ("predictor", sampled(3.0, 1.0, None)), ("bluebird's class MEDIUM", LinearPredictor(3.0, 1.0, None))
    for name, predictor in made:
        times[name] = np.array([seconds(predictor, seed) for seed in range(600)])
    figure = Figure(figsize=(8.0, 3.8), layout="constrained")
    axes = figure.subplots()
    for (name, values), style in zip(times.items(), [("black", "-"), *MODELS[:2]], strict=True):
        label = f"{name}: {values.mean():.0f} s, spread {values.std():.0f} s"
        shares = (np.arange(len(values)) + 0.5) / len(values)
        axes.plot(np.sort(values), shares, color=style[0], linestyle=style[1], label=label)
    axes.set(xlabel="seconds from FL340 to FL150", ylabel="share of flights", title="600 A320 in bluebird-dt 0.4")
    axes.legend(frameon=False, fontsize=8)
    tidy([axes])
    return figure


FIGURES: dict[str, Callable[[str, Path], Figure]] = {
    "bluebird": bluebird,
    "bluesky": bluesky,
    "cf": cf,
    "traffic": traffic,
}


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    with TemporaryDirectory() as scratch:
        write_figure(FIGURES[sys.argv[1]](sys.argv[2], Path(scratch)), sys.argv[3], 90)
