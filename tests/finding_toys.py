"""Findings of a diagnosis with every field filled, and of each verdict, made by hand."""

from dataclasses import replace

from descentflow.diagnosis.findings.cause_found import (
    Alternative,
    Cause,
    ClosedShare,
    Closure,
    OnBothSides,
    ParameterEstimate,
    ReportedSize,
)
from descentflow.diagnosis.findings.correction_found import Previous, RecipeNumber, RecipeStep
from descentflow.diagnosis.findings.costs_found import Cost, LevelMeans, Measured
from descentflow.diagnosis.findings.findings import (
    Curve,
    Details,
    DetectionLimit,
    Discrepancy,
    Findings,
    SingleEffect,
    Subset,
)
from descentflow.diagnosis.findings.gap_found import (
    BelowRounding,
    GapCell,
    LargestDifference,
    MeasuredEntry,
    Nuisance,
    Remaining,
    WouldSplit,
)
from descentflow.diagnosis.findings.inputs_found import (
    CoefficientsUsed,
    FlightWorthALook,
    InputUsed,
    LeftOutChannel,
    Provenance,
)
from descentflow.effects import EFFECTS

CLOSED = ClosedShare(0.84, 0.79, 0.88)
LABELS = {name: effect.text for name, effect in EFFECTS.items()}


def cause(effect: str, parameters: dict[str, ParameterEstimate], **more: object) -> Cause:
    """A cause with the words that the effect has for it."""
    first = next(iter(parameters.values())).estimate
    plain = Cause(
        effect=effect,
        group=[],
        probability=0.97,
        parameters=parameters,
        evidence_nats=210.0,
        closure=Closure(CLOSED),
        label=EFFECTS[effect].text,
        text=EFFECTS[effect].in_words(first),
        inclusion=0.99,
        on_both_sides=[OnBothSides(next(iter(parameters)), "K", first, 0.0)],
        takes_away={"time": 12.5, "ground_distance": 1.25, "rate": -55.0},
    )
    return replace(plain, **more)  # type: ignore[arg-type]


def brakes() -> Cause:
    """Brakes out in 62 % of the flights."""
    sizes = {
        "extra_cd0": ParameterEstimate(0.58, 0.54, 0.62, "1", "parasitic drag added"),
        "low_fl": ParameterEstimate(190.0, 187.0, 193.0, "FL", "lower end"),
        "high_fl": ParameterEstimate(265.0, 262.0, 268.0, "FL", "upper end"),
    }
    reported = [
        ReportedSize("extra_cd0", "CD0 x 1.58 (1.54 to 1.62)", "factor", Measured(1.58, 1.54, 1.62)),
        ReportedSize("low_fl", "lower end FL190 (FL187 to FL193)", "FL", Measured(190.0, 187.0, 193.0)),
        ReportedSize("high_fl", "upper end FL265 (FL262 to FL268)", "FL", Measured(265.0, 262.0, 268.0)),
    ]
    return cause("speed_brake", sizes, share_of_flights=ClosedShare(0.62, 0.58, 0.66), sizes=reported)


def warm() -> Cause:
    """Air that is 7.2 K warmer."""
    sizes = {"deviation_k": ParameterEstimate(7.2, 6.8, 7.6, "K", "deviation from the standard atmosphere")}
    reported = [ReportedSize("deviation_k", "ISA +7.2 K (+6.8 to +7.6)", "K", Measured(7.2, 6.8, 7.6))]
    lighter = [ReportedSize("relative_change", "mass x 0.93 (0.91 to 0.95)", "factor", Measured(0.93))]
    return cause(
        "temperature", sizes, group=["mass"], sizes=reported, alternatives=[Alternative("mass", 0.03, lighter)]
    )


def costs(after: bool = True) -> list[Cost]:
    """Of the whole range and of its thirds."""
    rest = Measured(1.5, -1.0, 4.0) if after else None
    slower = Measured(-8.0, -20.0, 5.0) if after else None
    made = []
    for low, high, part in ((150.0, 360.0, 1.0), (150.0, 220.0, 0.3), (220.0, 290.0, 0.4), (290.0, 360.0, 0.3)):
        longer, further = Measured(25 * part, 22 * part, 28 * part), Measured(2 * part, 1.8 * part, 2.2 * part)
        steeper, faster = Measured(-110.0, -120.0, -100.0), Measured(0.4, -0.3, 1.1)
        for name, label, unit, simulator, before, now, floor in (
            ("time", "time", "s", 520 * part, longer, rest, 3.0),
            ("time_at_speed", "time at equal speed", "s", 520 * part, longer, rest, 3.0),
            ("ground_distance", "distance over ground", "NM", 61 * part, further, rest, 0.4),
            ("rate", "rate of descent", "ft/min", 2450.0, steeper, slower, 15.0),
            ("cas", "calibrated airspeed", "kt", 281.0, faster, faster if after else None, 0.9),
        ):
            flights = simulator + before.estimate
            made.append(Cost(name, label, unit, low, high, simulator, flights, before, now, floor))
    return made


def details() -> Details:
    """Curves of two quantities, one of the whole flight; every effect alone."""
    levels: list[float | None] = [157.5 + 15 * k for k in range(14)]
    return Details(
        simulator="house_simulator.parquet",
        regime="anchored",
        typecode="A320",
        normal_from="simulator flights",
        seed=0,
        quantities=["rate", "tas", "level"],
        measured_over=[MeasuredEntry("rate", 150.0, 165.0, spread=0.07, distance=0.4, floor=0.05)],
        gap_error=0.02,
        transition_fl=318.0,
        mass_kg=60_000.0,
        n_permutations=1999,
        lacks=[Nuisance("noise_rate", 1.1, 0.05)],
        discrepancy=Discrepancy(300.0, 12.0, 0.04),
        singles=[
            SingleEffect("temperature", 210.0, {"deviation_k": 7.2}),
            SingleEffect("mass", 90.0, {}, "mass x 0.65 is the limit of what is possible"),
        ],
        curves={
            "rate": Curve(levels, [-0.05 + 0.001 * k for k in range(14)], [0.002] * 14, [0.004] * 14),
            "tas": Curve(levels, [0.016] * 14, [0.0] * 14, [0.001] * 14),
            "level": Curve([None], [3.0], [0.0], [2.0]),
        },
        labels=LABELS,
        profile=[LevelMeans(157.5 + 15 * k, 2000.0 + 50 * k, 280.0, 350.0 + 7 * k) for k in range(14)],
        subsets=[Subset(["temperature"], 0.9), Subset(["temperature", "mass"], 0.1)],
        detection_limits=[
            DetectionLimit("temperature", "deviation_k", 1.2, "K", "deviation from the standard atmosphere"),
            DetectionLimit("mass", "relative_change", None, "1", "relative change of the mass"),
        ],
    )


def findings() -> Findings:
    """Two causes, one of which leaves something: every optional field is filled."""
    where = GapCell("tas", 150.0, 195.0, "below", 0.02, 0.001, "relative", 0.02, 0.005, 0.4)
    left = LargestDifference("rate", 315.0, 330.0, difference=-0.02, in_negligible_shifts=2.0)
    known = {"version": "0.1.0", "settings": {"bottom_fl": "150"}, "files": ["october.csv"], "fingerprint": "6d14"}
    real = InputUsed("radar.parquet", "rows", 400, 80, "2026-10-01", "2026-10-31", ["A320"], **known)  # type: ignore[arg-type]
    simulator = InputUsed("house_simulator.parquet", "prepared descents", 350)
    used = CoefficientsUsed("A320", "open aircraft", ["A20N"], nearest=True)
    recipe = [
        RecipeStep("temperature", "ISA + 7.2 K [6.8, 7.6]", [RecipeNumber("deviation", "K", Measured(7.2, 6.8, 7.6))]),
        RecipeStep("speed_brake", "CD0 x 1.58 [1.54, 1.62] between FL190 and FL265 in 62 % of flights", [], 0.62),
    ]
    return Findings(
        verdict="partial",
        p_value=1 / 2000,
        floor=0.08,
        gap_before=0.67,
        where=[where],
        causes=[warm(), brakes()],
        gap_after=0.2,
        remaining=Remaining(0.12, 0.05, left),
        would_split=[WouldSplit(["temperature", "mass"], ["TAS"], "they look alike in the channels given")],
        dropped={"flights_given": 412, "flights_compared": 400},
        details=details(),
        costs=costs(),
        recipe=recipe,
        left_out_channels=[LeftOutChannel("geoaltitude", "simulator", ["temperature"])],
        flights_worth_a_look=[FlightWorthALook("DLH4AB-3", 41.0, "s", "time", 190.0, 235.0)],
        previous=Previous("gap/gap.json", ["temperature"], CLOSED, CLOSED, 0.6, 0.1),
        provenance=Provenance(real, simulator, {"descentflow": "0.1.0"}, {"seed": "0"}, ["own_effects.py"], used),
        corrected_file="corrected.parquet",
        below_rounding=[BelowRounding("cas", 150.0, 195.0, 0.11, 0.29)],
    )
