"""Effects shared with the training flights: nothing differs from the simulator's own flights, and physics objects.

Inferred drag takes in whatever explains the rates of the training flights. What it cannot take in: airspeeds that
disagree with the standard atmosphere, wind between airspeed and groundspeed, IAS against Mach number, a reported rate
against altitude over time, and sharp edges in altitude. Mass, thrust, drag, speeds and held paths leave no such trace,
and are not looked for.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from descentflow.aircraft_types.aircraft import Aircraft
from descentflow.core.units import FL_M
from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood
from descentflow.diagnosis.inference.permutation import null_test
from descentflow.diagnosis.inference.search import fit_effects
from descentflow.diagnosis.inference.selection import Chosen, Outside
from descentflow.diagnosis.inference.single_effects import Candidate
from descentflow.diagnosis.inference.two_sides import Compared, compare
from descentflow.diagnosis.inference.whitening import whiten
from descentflow.effects import Effect
from descentflow.measurements.quantities import Quantities
from descentflow.physics.transition import transition_altitude_m

MAX_EFFECTS = 3
"""Effects named together at most. Set by hand."""
MIN_GAIN = 20.0
"""Held-out gain below which no effect is named, nats. Set by hand: physics alone is coarser than other flights."""
MIN_GAIN_Z = 4.0
"""Standard errors that this gain must reach. Set by hand."""
MIN_FURTHER_SHARE = 0.05
"""Share of what is explained so far which a further effect must gain. Set by hand."""
DEGREE = 3
"""Of the polynomial in altitude that the rate may have for any reason."""


@dataclass(frozen=True)
class SharedEffects:
    """What was found against physics alone.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.effects import EFFECTS
        >>> from descentflow.measurements.quantities import CHANNELS, quantities_of
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> frame = read_descents("descents.parquet").frame
        >>> warm = frame.with_columns(TAS=frame["TAS"] * 1.02)  # two per cent of the airspeed are some ten kelvin
        >>> flights = quantities_of(warm, 150, 340, CHANNELS)
        >>> catalogue = {"temperature": EFFECTS["temperature"]}
        >>> found = shared_effects(flights, aircraft("A320"), catalogue, 0, lambda stage: None)
        >>> found.chosen.fit.effects
        ('temperature',)
    """

    likelihood: EffectsLikelihood
    chosen: Chosen
    p_value: float


def shared_effects(
    real: Quantities, aircraft: Aircraft, catalogue: Mapping[str, Effect], seed: int, progress: Callable[[str], None]
) -> SharedEffects | None:
    """Look for causes that show against physics alone.

    Args:
        real: Real flights.
        aircraft: Coefficients of the simulator.
        catalogue: Effects that may be named.
        seed: Of folds and permutations.
        progress: Called with what is being done.

    Returns:
        The causes, None if there is none.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.effects import EFFECTS
        >>> from descentflow.measurements.quantities import CHANNELS, quantities_of
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> flights = quantities_of(read_descents("descents.parquet").frame, 150, 340, CHANNELS)
        >>> warm = {"temperature": EFFECTS["temperature"]}
        >>> shared_effects(flights, aircraft("A320"), warm, 0, lambda stage: None) is None  # in standard air
        True
    """
    sizes = {name: effect.inherited_from for name, effect in catalogue.items()}
    able = {name: catalogue[name] for name, size in sizes.items() if size is not None}
    if not able:
        return None
    compared = compare(None, real, aircraft)
    weights = whiten(compared.y, compared.real, compared.airframe, compared.nugget(), compared.of_flight())
    likelihood = EffectsLikelihood(compared, weights, able, seed, nuisance=_smooth_rates(compared))
    null = fit_effects(likelihood, ())
    singles: dict[str, Candidate] = {}
    for name in able:
        progress(f"looking for {name} in the simulator's own flights")
        fit = fit_effects(likelihood, (name,))
        singles[name] = Candidate(fit, *likelihood.gain(fit.log_score, null.log_score))
    chosen = null
    path: list[tuple[str, tuple[float, float]]] = []
    candidates = singles
    while len(path) < MAX_EFFECTS:
        so_far = likelihood.gain(chosen.log_score, null.log_score)[0]
        best = _best(likelihood, candidates, sizes, so_far)
        if best is None:
            break
        path.append((best.fit.effects[-1], (best.gain, best.error)))
        chosen = best.fit
        candidates = {}
        for name in able:
            if name not in chosen.effects:
                fit = fit_effects(likelihood, (*chosen.effects, name), chosen.theta)
                candidates[name] = Candidate(fit, *likelihood.gain(fit.log_score, chosen.log_score))
    if not path:
        return None
    explained = likelihood.gain(chosen.log_score, null.log_score)[0]
    gains = dict(path)
    empty: dict[str, tuple[str, ...]] = dict.fromkeys(gains, ())
    found = Chosen(null, Outside(explained, 0.0, 0.0, False), singles, chosen, empty, dict.fromkeys(gains, 1.0), gains)
    transition_fl = float(transition_altitude_m(aircraft)) / FL_M
    test = null_test(likelihood, discrepancy_columns(compared), transition_fl, seed)
    return SharedEffects(likelihood, found, test.p_value)


def _best(
    likelihood: EffectsLikelihood, candidates: Mapping[str, Candidate], sizes: Mapping[str, float | None], so_far: float
) -> Candidate | None:
    least = max(MIN_GAIN, MIN_FURTHER_SHARE * so_far)
    for candidate in sorted(candidates.values(), key=lambda c: -c.gain):
        name = candidate.fit.effects[-1]
        theta, size = candidate.fit.theta[name], sizes[name]
        large = size is not None and float(theta[0].abs()) >= size
        counts = candidate.gain >= least and candidate.gain >= MIN_GAIN_Z * candidate.error
        if large and counts and likelihood.catalogue[name].plausible(likelihood.compared.state, theta):
            return candidate
    return None


def _smooth_rates(compared: Compared) -> Tensor:
    """Columns (n, p, q): a polynomial in altitude for the rate, which any inferred drag may follow."""
    at = compared.columns("rate")
    altitude = compared.state.altitude_m
    place = 2 * (altitude - altitude.mean()) / (altitude[-1] - altitude[0]).clamp(min=1.0)
    columns = torch.zeros(*compared.y.shape, DEGREE + 1, dtype=torch.float64)
    for i in at.tolist():
        for power in range(DEGREE + 1):
            columns[:, i, power] = 0.05 * place[compared.entries[i].band] ** power
    return columns
