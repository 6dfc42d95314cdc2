"""Place at which the exported flights of the tests are flown."""

WHERE = {
    "end": (52.3, 4.76),
    "track": 184.0,
    "to_go_nm": 40.0,
    "wind": "150:270/20,350:280/60",
    "end_time": "2026-11-22T10:00:00Z",
}
