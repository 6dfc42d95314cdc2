"""Gap between both sides: where it lies, how much it costs, and how much of it is left.

Reading order: :mod:`~descentflow.diagnosis.gap.labellings` and :mod:`~descentflow.diagnosis.gap.where` (cells of
quantity and altitude against permuted aircraft), :mod:`~descentflow.diagnosis.gap.practical_size` (against the rounding
of reports), :mod:`~descentflow.diagnosis.gap.costs` and :mod:`~descentflow.diagnosis.gap.measured_gap` (before and
after the causes are in the simulator), :mod:`~descentflow.diagnosis.gap.what_is_left` (by level and flight), and
:mod:`~descentflow.diagnosis.gap.previous_round` (an earlier diagnosis, checked).
"""
