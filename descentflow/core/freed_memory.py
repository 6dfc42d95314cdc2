"""Memory that was freed, and that the C library still holds."""

import ctypes


def give_back() -> bool:
    """Give freed memory back to the system, and say whether there was any that the C library held.

    The GNU C library keeps what large arrays leave between smaller ones that are still in use: of a diagnosis of 2,000
    flights half a gigabyte. Other libraries are left alone.

    Example:
        >>> isinstance(give_back(), bool)
        True
    """
    trim = getattr(_C_LIBRARY, "malloc_trim", None)
    return trim is not None and bool(trim(0))


def _c_library() -> ctypes.CDLL | None:
    try:
        return ctypes.CDLL(None)
    except (OSError, TypeError):  # Windows has no library of the process's own
        return None


_C_LIBRARY = _c_library()
