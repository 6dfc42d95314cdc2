"""
Add an effect of your own
=========================

The catalogue holds 13 effects. When something else makes real flights differ, the verdict is ``unknown``. An effect
is a class in a file: its words, its parameters with bounds, and the shift that it makes in measured quantities. This
tutorial adds one.
"""

# %%
# A gap without a name
# --------------------
# These flights meet a drag that no effect of the catalogue has: it grows with the Mach number, as the drag of
# compressibility does.

import descentflow as df

a320 = df.aircraft("A320")
model = df.fit(df.prepare(df.simulate(a320, 400, seed=0).rows), model="gaussian")
real = df.prepare(df.simulate(a320, 400, seed=1, plant={"compressibility": {"gain": 0.2}}).rows)

report = df.diagnose(real, model)
print(report)

# %%
# The effect
# ----------
# Parasitic drag that grows from an onset below the planned Mach number.
# :func:`~descentflow.effects.flight_state.log_rate` is the rate of the performance equations for each flight at
# its own speed; the shift is its response.

from descentflow.effects import EFFECTS
from descentflow.effects.effect import Effect, Parameter
from descentflow.effects.flight_state import log_rate

ONSET, PLANNED = float(a320.des_mach) - 0.06, float(a320.des_mach)


class Compressibility(Effect):
    """More parasitic drag the nearer a flight is to its planned Mach number."""

    name = "compressibility"
    label = "drag of compressibility"
    description = "drag that grows with the Mach number"
    directions = ("more drag at high Mach numbers", "less drag at high Mach numbers")
    parameters = (
        Parameter(
            "gain",
            -0.5,
            1.0,
            "1",
            0.05,
            label="relative change of the parasitic drag at the planned Mach number",
            shown_as="change",
            symbol="CD0 at the planned Mach number",
        ),
    )

    def shift(self, state, theta):
        """Rate by the energy equation."""
        beyond = ((state.mach() - ONSET) / (PLANNED - ONSET)).clamp(min=0.0)
        return {"rate": log_rate(state, parasitic=1 + theta[0] * beyond.square()) - state.own_log_rate}


# %%
# With it
# -------
# Nothing else has to change: it is fitted, judged and printed like the others. A simulator's own flights can be given
# it; a checkpoint cannot hold it, for it would not load where the class is not known.

report = df.diagnose(real, model, catalogue={**EFFECTS, "compressibility": Compressibility()})
print(report)

# %%
# From the command line, the class stands in a file of its own, which is run::
#
#     descentflow diagnose --real R --simulator S --out gap --catalogue own_effects.py
#
# To keep it, put the class into ``descentflow/effects/compressibility.py`` and a line into ``EFFECTS``.
