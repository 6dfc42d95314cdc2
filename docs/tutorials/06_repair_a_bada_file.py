"""
Repair a BADA 3 file from a radar
=================================

A simulator flies a BADA 3 file whose descents are too slow, and the analyst has a month of radar. The flights
give drag and idle thrust about the file's reference mass, and a file that agrees with them.
"""

# %%
# A file that is off
# ------------------
# A licence holder has OPF and APF files. Here an open type stands for one, with a fifth too little drag without lift
# and twice the idle thrust.

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import descentflow as df
from descentflow.aircraft_types.bada3.apf_file import write_apf
from descentflow.aircraft_types.bada3.opf_file import read_opf, write_opf

kept = TemporaryDirectory()
bada, mended = Path(kept.name, "bada"), Path(kept.name, "mended")
bada.mkdir()
mended.mkdir()

true = df.aircraft("A320")
wrong = replace(true, cd0_cr=0.8 * true.cd0_cr, ct_des_low=2 * true.ct_des_low, ct_des_high=2 * true.ct_des_high)
write_opf(wrong, bada / "A320__.OPF")
write_apf(wrong, bada / "A320__.APF")

# %%
# What the diagnosis finds
# ------------------------
# The radar's flights differ from the nominal descent at their own speeds. One flight in three has brakes out.

brakes = {"speed_brake": {"factor": 1.5, "share": 0.33, "low_fl": 210.0, "high_fl": 260.0}}
radar = df.prepare(df.simulate(true, 150, seed=1, plant=brakes))

print(df.diagnose(radar, df.aircraft("A320", bada_dir=bada)))

# %%
# The repair
# ----------
# The same from a shell: ``descentflow repair radar.parquet --aircraft A320 --bada-dir bada --out mended/A320.toml``.
# Brakes of single flights are set apart as the diagnosis sets them apart, and are not averaged into the drag.

found = df.repair(radar, aircraft="A320", bada_dir=bada, out=mended / "A320.toml")
print(found)

# %%
# Mass, thrust and drag scale together without a trace: the numbers hold at the reference mass. CD2 and idle thrust
# share one another's error where speeds differ little, and their intervals are wide. The page ``A320.html``
# has the errors by level, before and after, on aircraft that were not used.

for level in found.held_out.levels[::3]:
    print(f"FL{level.level_fl:.0f}: rate off by {level.rate.before:+.0f} ft/min, now {level.rate.after:+.0f}")

# %%
# The file
# --------
# The OPF is the holder's own, with the repaired numbers alone changed; its folder is a ``bada_dir``.

before, after = (read_opf(folder / "A320__.OPF").numbers for folder in (bada, mended))
print({name: (before[name], after[name]) for name in after if after[name] != before[name]})

# %%
# Other flights judge it
# ----------------------

others = df.prepare(df.simulate(true, 150, seed=2))
print(df.diagnose(others, df.aircraft("A320", bada_dir=mended)))
