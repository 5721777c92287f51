"""Thesis 2.1.4, B.1: numba settings of the decision kernels.

`pumplib.kernels` lets the compiler fuse a product and a sum, and it may do so in one loop and not in another.
A decision must come out the same whether a record is evaluated as a whole or sample by sample, so the
kernels of this room are compiled without fused operations: their results do not depend on the loop around them.
"""

from collections.abc import Callable
from typing import Any

from pumplib.kernels import compiled

_FLAGS: dict[str, Any] = {"fastmath": False, "error_model": "numpy"}

strict_kernel: Callable[..., Any] = compiled(**_FLAGS, nogil=True)
"""Decorator of a compiled loop whose rounding does not depend on the compiler's choices."""

strict_inline: Callable[..., Any] = compiled(**_FLAGS, inline="always")
"""Decorator of a small function of scalars that disappears into its kernel, same rounding rule."""
