"""Access to memory by address in compiled code, for a callback that receives bare C pointers.

Functions for `numba`, to be called by compiled ones only; an address is a pointer-sized integer.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic
def load_pointer(typingctx: Any, address: Any = None) -> Any:
    """The pointer-sized number at an address."""

    def codegen(context, builder, signature, args):
        pointer = builder.inttoptr(args[0], cgutils.intp_t.as_pointer())
        return builder.load(pointer)

    return types.intp(types.intp), codegen


def _cast(kind: Any):
    @intrinsic
    def cast(typingctx: Any, address: Any = None) -> Any:
        def codegen(context, builder, signature, args):
            return builder.inttoptr(args[0], context.get_value_type(types.CPointer(kind)))

        return types.CPointer(kind)(types.intp), codegen

    return cast


numbers = _cast(types.float64)  # the double-precision numbers from an address on
integers = _cast(types.int32)  # the 32-bit integers from an address on


def scratch(size: int) -> Any:
    """A compiled function () -> stack space for `size` double-precision numbers, free again when its caller returns."""

    @intrinsic
    def space(typingctx: Any = None) -> Any:
        def codegen(context, builder, signature, args):
            return cgutils.alloca_once(builder, ir.DoubleType(), size=size)

        return types.CPointer(types.float64)(), codegen

    return space
