"""Gap between both sides: where it lies, how much it costs, and how much of it is left.

Reading order: ``_labellings`` and ``_where`` (cells of quantity and altitude against permuted aircraft),
:mod:`~descentflow.diagnosis.gap.practical_size` (against the rounding of reports),
:mod:`~descentflow.diagnosis.gap.costs` and ``_measured_gap`` (before and after the causes are in the simulator),
``_what_is_left`` (by level and flight), and ``_previous_round`` (an earlier diagnosis, checked).
"""
