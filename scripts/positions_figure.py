"""Draw samples laid over the ground in three winds: python scripts/positions_figure.py best.ckpt FIGURE.png."""

import sys

import numpy as np
from matplotlib.figure import Figure

import descentflow as df
from descentflow.core.units import KT_MPS, NM_M
from descentflow.reporting.figure_file import write_figure
from descentflow.reporting.figure_style import model_style, tidy

ROUTE = [(53.6, 2.6), (53.0, 3.6), (52.62, 4.75), (52.3, 4.76)]
WINDS = {
    "still air": None,
    "westerly: 20 kt at FL150, 70 kt at FL350": "150:270/20,350:270/70",
    "easterly: 20 kt at FL150, 70 kt at FL350": "150:90/20,350:90/70",
}


def figure(checkpoint: str) -> Figure:
    drawn = df.sample(checkpoint, 300, seed=0, entry_fl=350)
    picture = Figure(figsize=(10.5, 3.9), layout="constrained")
    vertical, speed, ground = picture.subplots(1, 3)
    levels = drawn.trajectories.levels_fl.numpy()
    below = levels <= 350
    for k, (name, wind) in enumerate(WINDS.items()):
        placed = drawn.placed(route=ROUTE, wind=wind, to_go_nm=30.0).positions
        style = model_style(k)
        to_go = placed.to_go_m[:, below] / NM_M
        low, middle, high = np.quantile(to_go, [0.05, 0.5, 0.95], axis=0)
        vertical.fill_betweenx(levels[below], low, high, color=style["color"], alpha=0.15, linewidth=0)
        vertical.plot(middle, levels[below], **style)
        speed.plot(np.median(placed.groundspeed_mps[:, below], 0) / KT_MPS, levels[below], label=name, **style)
        top = np.flatnonzero(levels == 350)[0]
        places = placed.longitude[:, top], placed.latitude[:, top]
        ground.plot(*places, ".", color=style["color"], markersize=2, alpha=0.3, zorder=2)
        ground.plot(*np.median(places, 1), "osD"[k], color=style["color"], markeredgecolor="black", zorder=3 + k)
    latitude, longitude = np.array(ROUTE).T
    ground.plot(longitude, latitude, "-", color="black", linewidth=0.8, zorder=1)
    ground.plot(longitude[-1], latitude[-1], "k^", markersize=7)
    ground.annotate("end point", (longitude[-1], latitude[-1]), xytext=(-8, -3), textcoords="offset points", ha="right")
    ground.set(xlabel="longitude, degrees", ylabel="latitude, degrees", title="tops of descent on the route")
    ground.set_aspect(1 / np.cos(np.radians(53)))
    vertical.set(xlabel="distance to go, NM", ylabel="flight level", title="profile (median, 5 to 95 %)")
    vertical.invert_xaxis()
    speed.set(xlabel="groundspeed, kt", ylabel="flight level", title="median groundspeed")
    tidy([vertical, speed, ground])
    picture.legend(loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return picture


if __name__ == "__main__":
    write_figure(figure(sys.argv[1]), sys.argv[2], 90)
