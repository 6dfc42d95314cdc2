"""Options of the command and the defaults of the library say the same."""

from dataclasses import fields

from descentflow.commands.prepare import THRESHOLDS
from descentflow.surveillance.prepare import Cleaning


def test_every_threshold_is_an_option_with_its_default() -> None:
    rules = {field.name: field.default for field in fields(Cleaning) if field.name != "bottom_fl"}
    assert {name.replace("-", "_"): default for name, (default, _) in THRESHOLDS.items()} == rules
