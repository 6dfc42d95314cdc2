"""Numbers as a reader wants them: few digits, a dash for what is not known."""


def number(value: float | None, digits: int = 3) -> str:
    """Digits that are worth reading; a dash for none.

    Args:
        value: An integer gets thousands separators and all its digits; ``None`` and NaN a dash.
        digits: Significant digits of numbers below 100.

    Example:
        >>> number(1234), number(0.12345), number(123.4), number(None)
        ('1,234', '0.123', '123', '-')
    """
    if value is None or value != value:
        return "-"
    if isinstance(value, int):
        return f"{value:,}"
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.{digits}g}"


def percent(share: float | None) -> str:
    """A share (1 is all) in percent, without decimals; a dash for none.

    Example:
        >>> percent(0.256), percent(None)
        ('26 %', '-')
    """
    return "-" if share is None else f"{100 * share:.0f} %"
